//! Instructions of every stage, one after the other, as the pipeline calls them.

use core::fmt::Write;
use core::hint::black_box;

use echoloop_dsp::detect::{self, Threshold};
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::loops::{Portable, Scalar};
use echoloop_dsp::noise::Noise;
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::refine::{Refiner, Waveform};
use echoloop_dsp::statistics::Statistics;
use echoloop_dsp::{Echo, Echoes, MAX_SAMPLES, MAX_TAPS, Pipeline, SampleLoops, Scratch};
use echoloop_image::measure::{Text, instructions};
use echoloop_kernels::{FASTEST, HAS_DUAL_MULTIPLY};

use crate::waveforms::{CASES, Case};

/// Runs that are counted together.
const RUNS: u32 = 8;

pub(crate) fn count(text: &mut Text) -> Result<(), &'static str> {
    for case in &CASES {
        count_with("portable", Portable, case, text)?;
        count_with("scalar", Scalar, case, text)?;
        if HAS_DUAL_MULTIPLY {
            count_with("dual_multiply", FASTEST, case, text)?;
        }
    }
    Ok(())
}

/// Not inlined: each kernel's code is compiled for it alone, as in the sensor's image.
#[inline(never)]
fn count_with(
    name: &str,
    loops: impl SampleLoops,
    case: &Case,
    text: &mut Text,
) -> Result<(), &'static str> {
    let settings = case.settings();
    let pipeline = Pipeline::new(&settings, &case.hardware()).map_err(|_| "settings refused")?;
    let config = pipeline.config();
    let template = config.template();
    let shift = case.hardware().code_shift();
    let waveform = case.waveform(template.half());
    let codes = waveform.get(..case.samples).ok_or("waveform too long")?;
    let mut line = |stage, instructions| {
        writeln!(text, "cost\t{name}\t{}\t{stage}\t{instructions}", case.name)
            .map_err(|_| "no text")
    };

    let mut statistics = Statistics::default();
    line(
        "statistics",
        per_run(|| statistics = loops.statistics(black_box(codes), shift, &statistics)),
    )?;

    let mut padded = [0; MAX_SAMPLES + MAX_TAPS + PADDING];
    let ambient = statistics.ambient_q15();
    let x = padded
        .get_mut(template.half()..template.half() + codes.len())
        .ok_or("template too long")?;
    line(
        "baseline",
        per_run(|| {
            loops.remove_baseline(
                black_box(codes),
                config.clip_code(),
                shift,
                ambient,
                black_box(x),
            )
        }),
    )?;

    let mut y = [0; MAX_SAMPLES];
    let y = y.get_mut(..codes.len()).ok_or("waveform too long")?;
    let taps = template.taps_in_pairs();
    line("filter", per_run(|| loops.correlate(black_box(taps), black_box(&padded), black_box(y))))?;

    let threshold = Threshold::new(config, &statistics);
    let mut peaks = Peaks::new();
    line("peaks", per_run(|| loops.peaks(black_box(y), threshold.level, black_box(&mut peaks))))?;

    let report = || {
        let mut peaks = peaks.clone();
        detect::separate(&mut peaks, config.min_separation());
        let chosen = detect::choose(peaks, settings.echoes as usize, config.echo_choice());
        let exact = |n| filter::exact(template.taps(), &padded, codes.len(), n);
        let x = padded.get(template.half()..template.half() + codes.len()).unwrap_or_default();
        let waveform = Waveform { codes, x, y };
        let noise = Noise::new(&statistics, config.shot_noise());
        let refiner = Refiner { config, waveform: &waveform, threshold: &threshold, noise: &noise };
        let mut echoes = Echoes::new();
        for peak in chosen {
            let refined = refiner.refine(exact, peak);
            echoes.extend(Echo::from_peak(config, &refined, &threshold));
        }
        echoes
    };
    line("report", if peaks.is_empty() { 0 } else { per_run(|| drop(black_box(report()))) })?;

    let mut scratch = Scratch::new();
    line(
        "pipeline",
        per_run(|| {
            drop(black_box(pipeline.process(loops, black_box(codes), black_box(&mut scratch))))
        }),
    )?;
    let echoes = pipeline.process(loops, codes, &mut scratch);
    let same = echoes == report()
        && scratch.statistics() == &statistics
        && scratch.filtered(codes.len()) == y;
    if same { Ok(()) } else { Err("the stages are not the pipeline") }
}

/// Instructions of a run after the first, without the loop around it. (The first finds where the
/// statistics lie.)
#[inline(always)]
fn per_run(mut run: impl FnMut()) -> u32 {
    run();
    let all = instructions(|| (0..RUNS).for_each(|_| run()));
    let none = instructions(|| (0..RUNS).for_each(|_| black_box(())));
    (all.saturating_sub(none) + RUNS / 2) / RUNS
}
