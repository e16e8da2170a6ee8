//! Instructions of every stage, in the order in which the pipeline calls them.

use core::cell::Cell;
use core::fmt::Write;
use core::hint::black_box;

use echoloop_dsp::detect::Threshold;
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::loops::{Portable, Scalar};
use echoloop_dsp::near::Near;
use echoloop_dsp::noise::Noise;
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::ramp::Ramp;
use echoloop_dsp::refine::{Refiner, Waveform};
use echoloop_dsp::statistics::Statistics;
use echoloop_dsp::{
    DetectorConfig, Echo, Echoes, MAX_SAMPLES, MAX_TAPS, Pipeline, SampleLoops, Scratch,
};
use echoloop_image::measure::{Text, instructions};
use echoloop_kernels::{FASTEST, OWN_INSTRUCTIONS};

use crate::waveforms::{CASES, Case};

/// Number of runs that are counted together.
const RUNS: u32 = 8;

pub(crate) fn count(text: &mut Text) -> Result<(), &'static str> {
    for case in &CASES {
        count_with("portable", Portable, case, text)?;
        count_with("scalar", Scalar, case, text)?;
        if let Some(name) = OWN_INSTRUCTIONS {
            count_with(name, FASTEST, case, text)?;
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
    let waveform = case.waveform(config.template.half());
    let codes = waveform.get(..case.samples).ok_or("waveform too long")?;
    count_shots(name, config, case, codes, text)?;
    let spent = Cell::new(0u32);
    let mut line = |stage, instructions| {
        spent.set(spent.get().wrapping_add(instructions));
        writeln!(text, "cost\t{name}\t{}\t{stage}\t{instructions}", case.name)
            .map_err(|_| "no text")
    };
    let (mut padded, mut y) = ([0; MAX_SAMPLES + MAX_TAPS + PADDING], [0; MAX_SAMPLES]);
    let y = y.get_mut(..codes.len()).ok_or("waveform too long")?;
    let (statistics, threshold, peaks) =
        over_samples(loops, config, codes, &mut padded, y, &mut line)?;
    let made = Made { config, codes, padded: &padded, y, statistics, threshold, peaks };
    let mut scratch = Scratch::new();
    let pipeline_count = per_run(|| {
        drop(black_box(pipeline.process(loops, black_box(codes), black_box(&mut scratch))))
    });
    let report = match (made.peaks.is_empty(), config.ramp.as_ref()) {
        (true, _) => 0,
        (false, None) => per_run(|| drop(black_box(made.report()))),
        // A near gain changes the samples during the report, so it cannot be repeated: the count is
        // the pipeline's less that of the other stages.
        (false, Some(_)) => pipeline_count.saturating_sub(spent.get()),
    };
    line("report", report)?;
    line("pipeline", pipeline_count)?;
    let echoes = pipeline.process(loops, codes, &mut scratch);
    let same = (echoes == made.report() || config.ramp.is_some())
        && scratch.statistics() == &made.statistics
        && scratch.filtered(codes.len()) == made.y;
    if same { Ok(()) } else { Err("the stages are not the pipeline") }
}

/// Counts adding a shot and reading the sum of several. Both come before the pipeline and are the
/// same in every kernel.
fn count_shots(
    name: &str,
    config: &DetectorConfig,
    case: &Case,
    codes: &[u16],
    text: &mut Text,
) -> Result<(), &'static str> {
    let mut scratch = Scratch::new();
    let mut sums = [0; MAX_SAMPLES];
    let sums = sums.get_mut(..codes.len()).ok_or("waveform too long")?;
    let add = per_run(|| scratch.shots().add(black_box(1), black_box(codes)));
    let read = per_run(|| scratch.shots().read(black_box(config.sum_shift), black_box(sums)));
    for (stage, instructions) in [("shot", add), ("sum", read)] {
        writeln!(text, "cost\t{name}\t{}\t{stage}\t{instructions}", case.name)
            .map_err(|_| "no text")?;
    }
    Ok(())
}

/// Runs and counts the stages over every sample; `padded` and `y` keep their results. Inlined, as
/// in the pipeline.
#[inline(always)]
fn over_samples(
    loops: impl SampleLoops,
    config: &DetectorConfig,
    codes: &[u16],
    padded: &mut Padded,
    y: &mut [i16],
    line: &mut impl FnMut(&'static str, u32) -> Result<(), &'static str>,
) -> Result<(Statistics, Threshold, Peaks), &'static str> {
    let (shift, template) = (config.code_shift, &config.template);
    let mut statistics = Statistics::default();
    let near = config.ramp.as_ref().map_or(0, Ramp::samples);
    let full = codes.get(near..).ok_or("the gain rises to the end")?;
    let count = per_run(|| statistics = loops.statistics(black_box(full), shift, &statistics));
    line("statistics", count)?;

    let (clip, ambient) = (config.clip_code, statistics.ambient_q15());
    let window = template.half()..template.half() + codes.len();
    let x = padded.get_mut(window).ok_or("template too long")?;
    line(
        "baseline",
        per_run(|| {
            loops.remove_baseline(black_box(codes), clip, shift, ambient, black_box(x));
            if let Some(ramp) = config.ramp.as_ref() {
                let rising = Near { ramp, config, ambient };
                loops.remove_near_baseline(&rising, codes, 0..near, black_box(x));
            }
        }),
    )?;

    let taps = template.taps_in_pairs();
    line("filter", per_run(|| loops.correlate(black_box(taps), black_box(padded), black_box(y))))?;

    let threshold = Threshold::new(config, &statistics);
    let mut peaks = Peaks::new();
    line("peaks", per_run(|| loops.peaks(black_box(y), threshold.level, black_box(&mut peaks))))?;
    Ok((statistics, threshold, peaks))
}

/// Samples, with zeros around them.
type Padded = [i16; MAX_SAMPLES + MAX_TAPS + PADDING];

/// Results of those stages for a waveform.
struct Made<'a> {
    config: &'a DetectorConfig,
    codes: &'a [u16],
    padded: &'a Padded,
    y: &'a [i16],
    statistics: Statistics,
    threshold: Threshold,
    peaks: Peaks,
}

impl Made<'_> {
    /// Turns candidates into echoes, as the pipeline does.
    #[inline(always)]
    fn report(&self) -> Echoes {
        let Self { config, codes, padded, y, statistics, threshold, .. } = self;
        let template = &config.template;
        let exact = |n| filter::exact(template.taps(), *padded, codes.len(), n);
        let x = padded.get(template.half()..template.half() + codes.len()).unwrap_or_default();
        let waveform = Waveform { codes, x, y };
        let noise = Noise::new(statistics, config.shot_noise);
        let refiner = Refiner {
            config,
            waveform,
            threshold,
            noise: &noise,
            dithered: None,
            near: None,
            level: None,
        };
        let mut echoes = Echoes::new();
        for peak in refiner.chosen(&self.peaks) {
            let refined = refiner.refine(exact, peak);
            echoes.extend(Echo::from_peak(config, &refined, threshold, peak.index.into()));
        }
        echoes
    }
}

/// Instructions of a run after the first, without the loop around it. The first run finds the
/// statistics without a guess and costs more.
#[inline(always)]
fn per_run(mut run: impl FnMut()) -> u32 {
    run();
    let all = instructions(|| (0..RUNS).for_each(|_| run()));
    let none = instructions(|| (0..RUNS).for_each(|_| black_box(())));
    (all.saturating_sub(none) + RUNS / 2) / RUNS
}
