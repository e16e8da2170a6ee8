//! The integer code equals the bit-true model: every stage alone, then the pipeline.

use std::collections::HashMap;
use std::sync::LazyLock;

use echoloop_dsp::SampleLoops;
use echoloop_dsp::accumulate::Accumulator;
use echoloop_dsp::choice::{EchoChoice, TimingMethod};
use echoloop_dsp::detect::{self, Threshold};
use echoloop_dsp::echo::Echo;
use echoloop_dsp::edges::{EdgeFit, MAX_AMPLITUDE, Run};
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::loops::{Portable, Scalar};
use echoloop_dsp::near::Near;
use echoloop_dsp::noise::Noise;
use echoloop_dsp::peak::{self, Candidate, Candidates, Peaks};
use echoloop_dsp::pulse::{self, Pulse};
use echoloop_dsp::refine::{Refined, Refiner, Waveform};
use echoloop_dsp::statistics::Statistics;
use echoloop_dsp::{
    DetectorConfig, Echoes, Flags, Hardware, MAX_CODES, Pipeline, Scratch, Settings, baseline,
};
use echoloop_tests::bit_true::{self, BitTrue};
use echoloop_tests::vectors::{self, Case, ClippedRun, Kind};
use rand::{Rng, RngExt};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Waveforms per stage.
const SEEDS: u64 = 10_000;

/// The case of a seed, the DSP's constants and the model.
type SetUp = (Case, DetectorConfig, BitTrue);

/// Set-ups of the first [`SEEDS`] seeds, drawn once for all tests.
static SET_UPS: LazyLock<Vec<SetUp>> =
    LazyLock::new(|| (0..SEEDS).into_par_iter().map(draw).collect());

fn set_up(seed: u64) -> &'static SetUp {
    &SET_UPS[seed as usize]
}

fn draw(seed: u64) -> SetUp {
    let case = vectors::case(seed);
    let config = DetectorConfig::new(&case.settings, &case.hardware)
        .expect("vectors draw accepted settings");
    let model = BitTrue::new(&case.settings, &case.hardware, &config);
    (case, config, model)
}

fn reals(y: &[i16]) -> Vec<f64> {
    y.iter().map(|&v| f64::from(v)).collect()
}

fn model_peaks(peaks: &[peak::Peak]) -> Vec<bit_true::Peak> {
    peaks.iter().map(|&p| p.into()).collect()
}

fn models(echoes: &Echoes) -> Vec<bit_true::Echo> {
    echoes.iter().map(|&e| e.into()).collect()
}

#[test]
fn constants_equal_their_models() {
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let ours: [f64; 11] = [
            config.clip_code.into(),
            config.floor.into(),
            config.min_separation.into(),
            config.sample_period_fs.into(),
            config.range_step as f64,
            config.template.noise_gain.into(),
            config.shots.into(),
            f64::from(1 << config.sum_shift),
            f64::from(1 << config.code_shift),
            config.samples as f64,
            (config.codes() - config.samples) as f64,
        ];
        let theirs = [
            model.clip_code,
            model.floor,
            model.min_separation,
            model.period_fs,
            model.range_step,
            model.noise_gain,
            model.shots,
            model.sum_divisor,
            model.code,
            case.settings.bins.into(),
            model.pre_trigger as f64,
        ];
        assert_eq!(ours, theirs, "seed {seed}: {:?}", case.settings);
    }
}

#[test]
fn summed_shots_equal_their_model_and_begin_anew() {
    let mut accumulator = Accumulator::new();
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let shots = vectors::shots(case, &mut vectors::rng(seed));
        let mut codes = vec![1; shots[0].len() + 3];
        for (shot, codes) in (0..).zip(&shots) {
            accumulator.add(shot, codes);
        }
        let room = codes.len() - 3;
        accumulator.read(config.sum_shift, &mut codes[..room]);
        assert_eq!(codes[..room], model.accumulate(&shots), "seed {seed}: {:?}", case.settings);
        assert_eq!(codes[room..], [1; 3], "seed {seed}");
    }
}

#[test]
fn codes_beyond_the_capacity_are_not_summed() {
    let mut accumulator = Accumulator::default();
    for shot in 0..16 {
        accumulator.add(shot, &[0x3fff; MAX_CODES + 1]);
    }
    let mut codes = [7; MAX_CODES + 1];
    accumulator.read(4, &mut codes);
    assert_eq!((codes[0], codes[MAX_CODES - 1], codes[MAX_CODES]), (0x3fff, 0x3fff, 7));
    accumulator.read(0, &mut codes);
    assert_eq!(codes[0], u16::MAX, "a sum that 16 bits do not hold saturates");
}

#[test]
fn every_number_of_bins_has_the_model_s_sample_period() {
    for bins in 200..=2400 {
        let period_fs = sample_period_fs(bins as u32, &Hardware::REFERENCE);
        assert_eq!(
            f64::from(period_fs),
            bit_true::period_fs(bins, &Hardware::REFERENCE),
            "{bins} bins"
        );
    }
}

#[test]
fn statistics_equal_their_model_whatever_the_guess() {
    let mut last = Statistics::default();
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let shift = config.code_shift;
        let codes = case.split().1;
        let mut rng = vectors::rng(seed);
        let random =
            Statistics { median: rng.random(), deviation: rng.random(), ..Statistics::default() };
        let expected = model.statistics(codes);
        for guess in [Statistics::default(), last, random] {
            last = Portable.statistics(codes, shift, &guess);
            assert_eq!(bit_true::Statistics::from(last), expected, "seed {seed} from {guess:?}");
            let in_one_pass = Scalar.statistics(codes, shift, &guess);
            assert_eq!(in_one_pass, last, "seed {seed} from {guess:?}");
        }
    }
}

#[test]
fn the_ambient_of_every_estimator_equals_its_model() {
    let mut estimators = [0; 3];
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let (before, codes) = case.split();
        let statistics = Portable.statistics(codes, config.code_shift, &Statistics::default());
        let mut rng = vectors::rng(seed);
        let fewer = &before[..rng.random_range(0..=before.len())];
        for before in [before, fewer, &[]] {
            let ours = statistics.with_ambient(
                case.settings.choices().unwrap().ambient,
                before,
                config.code_shift,
                config.black,
            );
            assert_eq!(
                bit_true::Statistics::from(ours),
                model.with_ambient(statistics.into(), before),
                "seed {seed}"
            );
        }
        estimators[case.settings.ambient as usize] += 1;
    }
    assert!(estimators.iter().all(|&n| n > SEEDS / 4), "{estimators:?}");
}

#[test]
fn the_baseline_equals_its_model() {
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let ambient = match seed % 3 {
            0 => vectors::rng(seed).random_range(-40_000..=40_000), // saturates
            _ => {
                Portable.statistics(&case.codes, config.code_shift, &Statistics::default()).ambient
            }
        };
        let saturated = Statistics { ambient, ..Statistics::default() }.ambient_q15();
        let mut x = vec![0; case.codes.len()];
        baseline::remove(&case.codes, config.clip_code, config.code_shift, saturated, &mut x);
        if let Some(ramp) = config.ramp.as_ref() {
            let near = Near { ramp, config, ambient: saturated };
            near.remove_baseline(&case.codes, 0..ramp.samples(), &mut x);
        }
        assert_eq!(reals(&x), model.baseline(&case.codes, ambient.into()), "seed {seed}");
    }
}

#[test]
fn the_filter_equals_its_model_over_the_whole_scale_of_samples() {
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let amplitude = [3, 100, 0x7fff][seed as usize % 3];
        let length = rng.random_range(0..=case.codes.len().min(500));
        let mut x: Vec<i16> =
            (0..length).map(|_| rng.random_range(-amplitude..=amplitude)).collect();
        if seed % 8 == 0 {
            x.fill([i16::MIN, i16::MAX][rng.random_range(0..2)]);
        }
        let template = &config.template;
        let mut padded = vec![0; template.half()];
        padded.extend(&x);
        padded.resize(padded.len() + template.half() + PADDING, 0);
        let mut y = vec![0; length.next_multiple_of(16)];
        filter::correlate(template.taps_in_pairs(), &padded, &mut y);
        assert_eq!(reals(&y[..length]), model.filter(&reals(&x)), "seed {seed}");
    }
}

#[test]
fn statistics_and_filter_inside_the_pipeline_equal_their_models_in_both_builds() {
    let mut scratch = Scratch::new();
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let mut case = case.clone();
        case.codes.truncate(config.codes() - config.samples + echoloop_dsp::MAX_SAMPLES);
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        let (before, codes) = case.split();
        let statistics = model.with_ambient(model.statistics(model.of_full_gain(codes)), before);
        let y = model.filter(&model.baseline(codes, statistics.ambient));
        for process in [echoloop_kernels::process, echoloop_kernels::process_baseline] {
            process(&pipeline, &case.codes, &mut scratch);
            assert_eq!(
                bit_true::Statistics::from(*scratch.statistics()),
                statistics,
                "seed {seed}"
            );
            assert_eq!(reals(scratch.filtered(codes.len())), y, "seed {seed}");
        }
    }
}

#[test]
fn thresholds_equal_their_model() {
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let measured = Portable.statistics(&case.codes, config.code_shift, &Statistics::default());
        let any = Statistics { sigma: rng.random::<u32>() >> rng.random_range(4..32), ..measured };
        for statistics in [measured, any, Statistics::default()] {
            let ours = Threshold::new(config, &statistics);
            assert_eq!(
                bit_true::Threshold::from(ours),
                model.threshold(&statistics.into()),
                "seed {seed}"
            );
        }
    }
}

#[test]
fn peaks_equal_their_model() {
    let mut found = Peaks::new();
    for seed in 0..SEEDS {
        let (y, threshold) = vectors::output(seed);
        Portable.peaks(&y, threshold, &mut found);
        assert_eq!(
            model_peaks(&found),
            bit_true::peaks(&reals(&y), threshold.into()),
            "seed {seed}"
        );
    }
}

#[test]
fn separation_and_choice_equal_their_models() {
    let mut found = Peaks::new();
    for seed in 0..SEEDS {
        let (y, threshold) = vectors::output(seed);
        let mut rng = vectors::rng(seed);
        let min_separation = rng.random_range(1..60);
        Portable.peaks(&y, threshold, &mut found);
        // Few strengths, so that many are equal.
        let most = [3, 100, u32::MAX][rng.random_range(0..3)];
        let strengths: HashMap<usize, u32> =
            found.iter().map(|p| (p.index.into(), rng.random_range(0..=most))).collect();
        let strength = |peak: &bit_true::Peak| f64::from(strengths[&peak.index]);
        let mut candidates: Candidates = found
            .iter()
            .map(|&peak| Candidate { peak, strength: strengths[&peak.index.into()] })
            .collect();
        detect::separate(&mut candidates, min_separation);
        let expected = bit_true::separate(&model_peaks(&found), min_separation.into(), strength);
        let kept: Vec<_> = candidates.iter().map(|c| c.peak).collect();
        assert_eq!(model_peaks(&kept), expected, "seed {seed}");
        for (count, choice) in
            (1..=4).flat_map(|count| EchoChoice::ALL.iter().map(move |&choice| (count, choice)))
        {
            let chosen = detect::choose(candidates.clone(), count, choice);
            assert_eq!(
                model_peaks(&chosen),
                bit_true::choose(&expected, count, choice, strength),
                "seed {seed}, {count} of {choice:?}"
            );
        }
    }
}

#[test]
fn the_noise_of_a_sample_equals_its_model() {
    for seed in 0..SEEDS {
        let mut rng = vectors::rng(seed);
        let noise = any_noise(&mut rng);
        let model = bit_true::Noise::from(noise);
        for _ in 0..20 {
            let three_sigma = noise.hidden();
            let value = match rng.random_range(0..4) {
                0 => three_sigma + rng.random_range(-2..=2),
                1 => rng.random_range(-70_000..=70_000),
                2 => i64::from(rng.random::<i16>()) >> rng.random_range(0..16),
                _ => rng.random_range(0..=MAX_AMPLITUDE),
            };
            let share = rng.random_range(0..=40_000);
            assert_eq!(
                f64::from(noise.of(value)),
                model.of(value as f64),
                "seed {seed}: {noise:?} {value}"
            );
            assert_eq!(noise.hidden() as f64, model.hidden(), "seed {seed}: {noise:?}");
            assert_eq!(
                noise.hides(value),
                !model.shows(value as f64),
                "seed {seed}: {noise:?} {value}"
            );
            let shared = f64::from(noise.with(value, share));
            assert_eq!(
                shared,
                model.with(value as f64, share.into()),
                "seed {seed}: {noise:?} {value} {share}"
            );
        }
    }
}

#[test]
fn noise_whose_nine_variances_no_integer_holds_hides_everything() {
    let noise = Noise { sigma: 1_431_655_766, shot: 0 }; // 9 σ² is 2⁶⁴ + 2³⁴ + 4
    assert!(noise.hides(0xffff) && !bit_true::Noise::from(noise).shows(65_535.0));
}

/// Draws noise from none to more than any waveform has.
fn any_noise(rng: &mut impl Rng) -> Noise {
    let mut any = || match rng.random_range(0..6) {
        0 => 0,
        1 => u32::MAX,
        _ => rng.random::<u32>() >> rng.random_range(0..32),
    };
    Noise { sigma: any(), shot: any() }
}

#[test]
fn the_table_of_the_pulse_equals_its_model() {
    assert_eq!(pulse::SIN_SQUARED.map(f64::from), *bit_true::pulse::TABLE);
}

#[test]
fn the_pulse_and_its_slope_equal_their_models() {
    for seed in 0..SEEDS {
        let mut rng = vectors::rng(seed);
        let period_fs = rng.random_range(1..=4_000_000u32) >> rng.random_range(0..20);
        let width_ps = rng.random_range(0..=20_000) >> rng.random_range(0..12);
        let pulse = Pulse::new(width_ps, period_fs.max(1));
        let model = bit_true::Pulse::new(width_ps.into(), period_fs.max(1).into());
        assert_eq!(pulse.width() as f64, model.width, "seed {seed}");
        let length = 2 * pulse.width();
        let ends =
            [-1, 0, 1, length / 2 - 1, length / 2, length / 2 + 1, length - 1, length, length + 1];
        let inside: [i64; 40] = std::array::from_fn(|_| rng.random_range(0..=length));
        for u in ends.into_iter().chain(inside) {
            assert_eq!(pulse.at(u) as f64, model.at(u as f64), "seed {seed}: {pulse:?} at {u}");
            assert_eq!(
                pulse.slope(u) as f64,
                model.slope(u as f64),
                "seed {seed}: {pulse:?} at {u}"
            );
        }
    }
}

#[test]
fn the_edges_of_clipped_runs_equal_their_models() {
    let mut kinds = [0; 5];
    for seed in 0..3 * SEEDS {
        let run = vectors::clipped_run(seed);
        let ClippedRun { level, first, last, .. } = run;
        let noise = Noise { sigma: run.sigma, shot: run.shot };
        let pulse = Pulse::new(run.width_ps, run.period_fs);
        let ours = EdgeFit { pulse: &pulse, noise: &noise, level }
            .fit(&run.x, Run { first, last })
            .map(bit_true::edges::Edges::from);
        let x = reals(&run.x);
        let model = bit_true::edges::Clipped {
            pulse: &bit_true::Pulse::new(run.width_ps.into(), run.period_fs.into()),
            x: &x,
            level: level as f64,
            first,
            last,
            noise: noise.into(),
        };
        assert_eq!(ours, model.fit(), "seed {seed}: {run:?}");
        let shows =
            |n: Option<usize>| n.and_then(|n| run.x.get(n)).map(|&v| !noise.hides(v.into()));
        kinds[match (shows(first.checked_sub(1)), shows(Some(last + 1))) {
            (Some(true), Some(true)) => 0,
            (Some(true), Some(false)) => 1,
            (Some(false), Some(true)) => 2,
            (Some(false), Some(false)) => 3,
            _ => 4,
        }] += 1;
    }
    assert!(kinds.iter().all(|&n| n > SEEDS / 20), "{kinds:?} do not hold enough of each kind");
}

#[test]
fn refined_peaks_equal_their_models() {
    let mut found = Peaks::new();
    for seed in 0..SEEDS {
        let (_, config, model) = set_up(seed);
        let (y, level) = vectors::output(seed);
        let mut rng = vectors::rng(seed);
        let codes = codes_near(config.clip_code, &y, &mut rng);
        // f rounds to y. Ripple gives the plateaus of y slopes, or makes f as flat as possible
        // between even and odd values.
        let steepest = rng.random_range(0..4) > 0;
        let mut ripple = |v: i16| {
            if steepest { rng.random_range(-128..128) } else { 127 - 255 * i64::from(v & 1) }
        };
        let f: Vec<i64> = y.iter().map(|&v| (i64::from(v) << 8) + ripple(v)).collect();
        let at = |f: &[i64], n: i64| {
            usize::try_from(n).ok().and_then(|n| f.get(n)).copied().unwrap_or(0)
        };
        let x: Vec<i16> = match rng.random_range(0..3) {
            0 => y.clone(),
            1 => y.iter().map(|_| rng.random_range(-3..200)).collect(),
            _ => y.iter().map(|_| rng.random()).collect(),
        };
        let noise = Noise {
            sigma: rng.random::<u32>() >> rng.random_range(12..32),
            shot: config.shot_noise,
        };
        Portable.peaks(&y, level, &mut found);
        // Sometimes a threshold above the peak, which detection never gives.
        let level =
            if rng.random_range(0..16) == 0 { rng.random_range(level..=i16::MAX) } else { level };
        let threshold = Threshold {
            sigma: rng.random(),
            level,
            ambient: rng.random::<i16>() >> rng.random_range(0..16),
        };
        let reals_f: Vec<f64> = f.iter().map(|&v| v as f64).collect();
        let model_wave = bit_true::Waveform {
            codes: &codes,
            x: &reals(&x),
            y: &reals(&y),
            f: &reals_f,
            shots: None,
            level: None,
        };
        let near =
            config.ramp.as_ref().map(|ramp| Near { ramp, config, ambient: threshold.ambient });
        for &peak in found.iter().take(8) {
            let waveform = Waveform { codes: &codes, x: &x, y: &y };
            let refiner = Refiner {
                config,
                waveform,
                threshold: &threshold,
                noise: &noise,
                dithered: None,
                near,
                level: near.map(|_| usize::from(peak.index)),
            };
            let ours = refiner.refine(|n| at(&f, n), peak);
            let expected = model.refine(&model_wave, peak.into(), &threshold.into(), &noise.into());
            assert_eq!(bit_true::Refined::from(ours), expected, "seed {seed}, {peak:?}");
            let ours = refiner.candidates(&[&[peak], &found[..]].concat());
            let strength = |candidate: &Candidate| f64::from(candidate.strength);
            let all: Vec<_> = found.iter().map(|&other| other.into()).collect();
            let peak_and_all = (peak.into(), &all[..]);
            let expected =
                model.strength(&model_wave, peak_and_all, &threshold.into(), &noise.into());
            assert_eq!(ours.first().map(strength), Some(expected), "seed {seed}, {peak:?}");
        }
    }
}

/// Draws codes at the saturation level: one in fifty, or runs, or where `y` is high; the others are
/// one below.
fn codes_near(clip: u16, y: &[i16], rng: &mut impl Rng) -> Vec<u16> {
    let kind = rng.random_range(0..3);
    let high = rng.random::<i16>().max(1);
    let mut clipped = false;
    let mut code = |&v: &i16| {
        clipped = match kind {
            0 => rng.random_range(0..50) == 0,
            1 => clipped ^ (rng.random_range(0..6) == 0),
            _ => v >= high,
        };
        clip - u16::from(!clipped)
    };
    y.iter().map(&mut code).collect()
}

#[test]
fn echoes_equal_their_models() {
    for seed in 0..SEEDS {
        let (case, config, model) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let level = rng.random_range(1..=0x7fff) >> rng.random_range(0..15);
        for _ in 0..10 {
            let sigma = rng.random::<u32>() >> rng.random_range(4..32);
            let threshold = Threshold { sigma, level: level.max(1), ambient: rng.random() };
            let height = match rng.random_range(0..3) {
                0 => 5 * i32::from(threshold.level) / 4 + rng.random_range(-1..=1),
                1 => rng.random_range(-100..100),
                _ => rng.random_range(0..45_000),
            };
            let refined = Refined {
                time: rng.random_range(-0x20000..=(i64::from(case.settings.bins) << 16))
                    >> rng.random_range(0..16),
                height,
                width: rng.random_range(0..=i64::from(case.settings.bins) << 16)
                    >> rng.random_range(0..16),
                amplitude: rng.random_range(-MAX_AMPLITUDE / 8..=2 * MAX_AMPLITUDE)
                    >> rng.random_range(0..26),
                sigma: rng.random::<u32>() >> rng.random_range(0..32),
                flags: Flags(rng.random_range(0..32)),
            };
            let index = (refined.time.max(0) >> 16) as usize;
            let ours =
                Echo::from_peak(config, &refined, &threshold, index).map(bit_true::Echo::from);
            assert_eq!(
                ours,
                model.echo(&refined.into(), &threshold.into(), index),
                "seed {seed}: {refined:?} {threshold:?}"
            );
        }
    }
}

#[test]
fn the_pipeline_equals_its_model_in_every_build() {
    let mut scratch = Scratch::new();
    for seed in 0..2 * SEEDS {
        let drawn;
        let (case, _, model) = if seed < SEEDS {
            set_up(seed)
        } else {
            drawn = draw(seed);
            &drawn
        };
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        let expected = model.process(&case.codes);
        let fastest = echoloop_kernels::process(&pipeline, &case.codes, &mut scratch);
        assert_eq!(models(&fastest), expected, "seed {seed}, {:?}", case.kind);
        let compiled = echoloop_kernels::process_compiled(&pipeline, &case.codes, &mut scratch);
        let plain = echoloop_kernels::process_baseline(&pipeline, &case.codes, &mut scratch);
        let scalar = pipeline.process(Scalar, &case.codes, &mut scratch);
        assert_eq!(
            [compiled, plain, scalar],
            [(); 3].map(|()| fastest.clone()),
            "seed {seed}, {:?}",
            case.kind
        );
    }
}

#[test]
fn the_pipeline_equals_its_model_on_dithered_shots() {
    let mut scratch = Scratch::new();
    let mut differ = 0;
    for seed in 0..SEEDS {
        let (case, ..) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let timing = [TimingMethod::WalkCorrected, TimingMethod::ConstantFraction];
        let settings = Settings {
            dither: rng.random_range(0..16).min(1),
            shots: 1 << rng.random_range(0..5),
            timing: timing[seed as usize % 2].code(),
            ..case.settings
        };
        let pipeline = Pipeline::new(&settings, &case.hardware).unwrap();
        let config = pipeline.config();
        let model = BitTrue::new(&settings, &case.hardware, config);
        // Shots of one clipped waveform, each with its own scale.
        let kind = [Kind::ClippedEcho, Kind::ClipEdge, Kind::ManyEchoes][rng.random_range(0..3)];
        let wave = vectors::waveform(&settings, &case.hardware, kind, &mut rng);
        let top = case.hardware.full_scale_code();
        let mut shot = || -> Vec<u16> {
            let scale = rng.random_range(0.8..1.5);
            let code = |&code: &u16| (f64::from(code) * scale) as u16;
            wave.iter().map(|c| code(c).min(top)).collect()
        };
        let shots: Vec<Vec<u16>> = (0..settings.shots).map(|_| shot()).collect();
        (0..).zip(&shots).for_each(|(shot, codes)| scratch.shots().add(shot, codes));
        let mut codes = vec![0; wave.len()];
        scratch.shots().read(config.sum_shift, &mut codes);
        let ours = models(&echoloop_kernels::process(&pipeline, &codes, &mut scratch));
        assert_eq!(ours, model.process_shots(&shots), "seed {seed}, {kind:?}, {settings:?}");
        // The single shots have been used up: without them the model has only their sum.
        let again = models(&echoloop_kernels::process(&pipeline, &codes, &mut scratch));
        assert_eq!(again, model.process(&codes), "seed {seed}");
        differ += u64::from(again != ours);
    }
    assert!(differ > SEEDS / 20, "only {differ} waveforms were timed by their shots");
}

#[test]
fn used_memory_changes_nothing() {
    let mut reused = Scratch::new();
    for seed in 0..SEEDS {
        // Other seeds, in another order of kinds.
        let case = vectors::case(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        let again = echoloop_kernels::process(&pipeline, &case.codes, &mut reused);
        let mut fresh = Scratch::new();
        assert_eq!(
            again,
            echoloop_kernels::process(&pipeline, &case.codes, &mut fresh),
            "seed {seed}"
        );
        let length = case.split().1.len();
        assert_eq!(reused.filtered(length), fresh.filtered(length), "seed {seed}");
        assert_eq!(reused.statistics(), fresh.statistics(), "seed {seed}");
    }
}
