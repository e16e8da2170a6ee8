//! The integer code equals the twin that rounds where its tables say: every stage by itself, then the pipeline.

use echoloop_dsp::config::sample_period_fs;
use echoloop_dsp::detect::{self, Peaks, Threshold};
use echoloop_dsp::echo::Echo;
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::kernel::{Portable, Scalar};
use echoloop_dsp::refine::{self, Refined};
use echoloop_dsp::statistics::Statistics;
use echoloop_dsp::template::Template;
use echoloop_dsp::{Config, Echoes, Flags, Hardware, Pipeline, Scratch, baseline};
use echoloop_sim::vector;
use echoloop_tests::quantised::{self, Twin};
use echoloop_tests::vectors::{self, Case};
use rand::RngExt;

/// Waveforms per stage.
const SEEDS: u64 = 10_000;

/// A case, the DSP's constants and the twin's.
fn set_up(seed: u64) -> (Case, Config, Twin) {
    let case = vectors::case(seed);
    let config = Config::new(&case.settings, &case.hardware).expect("vectors draw accepted settings");
    let twin = Twin::new(&case.settings, &case.hardware);
    (case, config, twin)
}

fn reals(y: &[i16]) -> Vec<f64> {
    y.iter().map(|&v| f64::from(v)).collect()
}

fn twin_peaks(peaks: &[detect::Peak]) -> Vec<quantised::Peak> {
    peaks.iter().map(|&p| p.into()).collect()
}

fn twins(echoes: &Echoes) -> Vec<quantised::Echo> {
    echoes.iter().map(|&e| e.into()).collect()
}

#[test]
fn constants_equal_their_twins() {
    for seed in 0..SEEDS {
        let (case, config, twin) = set_up(seed);
        assert_eq!(f64::from(config.clip_code()), twin.clip_code, "seed {seed}: {:?}", case.settings);
        assert_eq!(f64::from(config.floor()), twin.floor, "seed {seed}: {:?}", case.settings);
        assert_eq!(f64::from(config.min_separation()), twin.min_separation, "seed {seed}: {:?}", case.settings);
        assert_eq!(f64::from(config.sample_period_fs()), twin.period_fs, "seed {seed}: {:?}", case.settings);
        assert_eq!(config.range_step() as f64, twin.range_step, "seed {seed}: {:?}", case.settings);
        assert_eq!(f64::from(config.template().noise_gain()), twin.noise_gain, "seed {seed}: {:?}", case.settings);
    }
}

#[test]
fn every_number_of_bins_has_the_twin_s_sample_period() {
    for bins in 200..=2400 {
        let period_fs = sample_period_fs(bins as u32, &Hardware::REFERENCE);
        assert_eq!(f64::from(period_fs), quantised::period_fs(bins, &Hardware::REFERENCE), "{bins} bins");
    }
}

#[test]
fn statistics_equal_their_twin_whatever_the_guess() {
    let mut last = Statistics::default();
    for seed in 0..SEEDS {
        let (case, _, twin) = set_up(seed);
        let shift = case.hardware.code_shift();
        let mut rng = vectors::rng(seed);
        let random = Statistics { median: rng.random(), deviation: rng.random(), ..Statistics::default() };
        let expected = twin.statistics(&case.codes);
        for guess in [Statistics::default(), last, random] {
            last = Statistics::of(Portable, &case.codes, shift, &guess);
            assert_eq!(quantised::Statistics::from(last), expected, "seed {seed} from {guess:?}");
            let in_one_pass = Statistics::of(Scalar, &case.codes, shift, &guess);
            assert_eq!(in_one_pass, last, "seed {seed} from {guess:?}");
        }
    }
}

#[test]
fn the_baseline_equals_its_twin() {
    for seed in 0..SEEDS {
        let (case, config, twin) = set_up(seed);
        let ambient = match seed % 3 {
            0 => vectors::rng(seed).random_range(-40_000..=40_000), // saturates
            _ => Statistics::of(Portable, &case.codes, case.hardware.code_shift(), &Statistics::default()).ambient,
        };
        let saturated = Statistics { ambient, ..Statistics::default() }.ambient_q15();
        let mut x = vec![0; case.codes.len()];
        baseline::remove(&case.codes, config.clip_code(), case.hardware.code_shift(), saturated, &mut x);
        assert_eq!(reals(&x), twin.baseline(&case.codes, ambient.into()), "seed {seed}");
    }
}

#[test]
fn the_filter_equals_its_twin_over_the_whole_scale_of_samples() {
    for seed in 0..SEEDS {
        let (case, config, twin) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let amplitude = [3, 100, 0x7fff][seed as usize % 3];
        let length = rng.random_range(0..=case.codes.len().min(500));
        let mut x: Vec<i16> = (0..length).map(|_| rng.random_range(-amplitude..=amplitude)).collect();
        if seed % 8 == 0 {
            x.fill([i16::MIN, i16::MAX][rng.random_range(0..2)]);
        }
        let template = config.template();
        let mut padded = vec![0; template.half()];
        padded.extend(&x);
        padded.resize(padded.len() + template.half() + PADDING, 0);
        let mut y = vec![0; length.next_multiple_of(16)];
        filter::correlate(template.taps_in_pairs(), &padded, &mut y);
        assert_eq!(reals(&y[..length]), twin.filter(&reals(&x)), "seed {seed}");
    }
}

#[test]
fn statistics_and_filter_inside_the_pipeline_equal_their_twins_in_both_builds() {
    let mut scratch = Scratch::new();
    for seed in 0..SEEDS {
        let (mut case, _, twin) = set_up(seed);
        case.codes.truncate(echoloop_dsp::MAX_SAMPLES);
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        let statistics = twin.statistics(&case.codes);
        let y = twin.filter(&twin.baseline(&case.codes, statistics.ambient));
        for process in [vector::process, vector::process_baseline] {
            process(&pipeline, &case.codes, &mut scratch);
            assert_eq!(quantised::Statistics::from(*scratch.statistics()), statistics, "seed {seed}");
            assert_eq!(reals(scratch.filtered(case.codes.len())), y, "seed {seed}");
        }
    }
}

#[test]
fn thresholds_equal_their_twin() {
    for seed in 0..SEEDS {
        let (case, config, twin) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let measured = Statistics::of(Portable, &case.codes, case.hardware.code_shift(), &Statistics::default());
        let any = Statistics { sigma: rng.random::<u32>() >> rng.random_range(4..32), ..measured };
        for statistics in [measured, any, Statistics::default()] {
            let ours = Threshold::of(&config, &statistics);
            assert_eq!(quantised::Threshold::from(ours), twin.threshold(&statistics.into()), "seed {seed}");
        }
    }
}

#[test]
fn peaks_equal_their_twin() {
    let mut found = Peaks::new();
    for seed in 0..SEEDS {
        let (y, threshold) = vectors::output(seed);
        detect::peaks(Portable, &y, threshold, &mut found);
        assert_eq!(twin_peaks(&found), quantised::peaks(&reals(&y), threshold.into()), "seed {seed}");
    }
}

#[test]
fn separation_and_choice_equal_their_twins() {
    let mut found = Peaks::new();
    for seed in 0..SEEDS {
        let (y, threshold) = vectors::output(seed);
        let mut rng = vectors::rng(seed);
        let min_separation = rng.random_range(1..60);
        detect::peaks(Portable, &y, threshold, &mut found);
        let before = twin_peaks(&found);
        detect::separate(&mut found, min_separation);
        let expected = quantised::separate(&before, min_separation.into());
        assert_eq!(twin_peaks(&found), expected, "seed {seed}");
        for (count, choice) in (1..=4).flat_map(|count| [(count, 0), (count, 1), (count, 2)]) {
            let chosen = detect::choose(found.clone(), count, choice);
            assert_eq!(
                twin_peaks(&chosen),
                quantised::choose(&expected, count, choice),
                "seed {seed}, {count} of {choice}"
            );
        }
    }
}

#[test]
fn refined_peaks_equal_their_twins() {
    let mut found = Peaks::new();
    for seed in 0..SEEDS {
        let (_, config, twin) = set_up(seed);
        let (y, threshold) = vectors::output(seed);
        let mut rng = vectors::rng(seed);
        // one code in fifty at the saturation level, the others one below: clipped or not by one sample
        let clip = config.clip_code();
        let codes: Vec<u16> = y.iter().map(|_| clip - u16::from(rng.random_range(0..50) > 0)).collect();
        // f rounds to y: plateaus of y have slopes and ripples
        let f: Vec<i64> = y.iter().map(|&v| (i64::from(v) << 8) + rng.random_range(-128..128)).collect();
        let at = |f: &[i64], n: i64| usize::try_from(n).ok().and_then(|n| f.get(n)).copied().unwrap_or(0);
        detect::peaks(Portable, &y, threshold, &mut found);
        for &peak in found.iter().take(8) {
            let ours = refine::refine(&config, &codes, &y, |n| at(&f, n), peak, threshold);
            let reals_f: Vec<f64> = f.iter().map(|&v| v as f64).collect();
            let expected = twin.refine(&codes, &reals(&y), &reals_f, peak.into(), threshold.into());
            assert_eq!(quantised::Refined::from(ours), expected, "seed {seed}, {peak:?}");
        }
    }
}

#[test]
fn echoes_equal_their_twins() {
    for seed in 0..SEEDS {
        let (case, config, twin) = set_up(seed);
        let mut rng = vectors::rng(seed);
        let level = rng.random_range(1..=0x7fff) >> rng.random_range(0..15);
        for _ in 0..10 {
            let threshold = Threshold { sigma: rng.random::<u32>() >> rng.random_range(4..32), level: level.max(1) };
            let height = match rng.random_range(0..3) {
                0 => 5 * i32::from(threshold.level) / 4 + rng.random_range(-1..=1),
                1 => rng.random_range(-100..100),
                _ => rng.random_range(0..45_000),
            };
            let refined = Refined {
                time: rng.random_range(-0x20000..=(i64::from(case.settings.bins) << 16)) >> rng.random_range(0..16),
                height,
                width: rng.random_range(0..=i64::from(case.settings.bins) << 16) >> rng.random_range(0..16),
                flags: Flags(rng.random_range(0..32)),
            };
            let ours = Echo::of(&config, &refined, &threshold).map(quantised::Echo::from);
            assert_eq!(ours, twin.echo(&refined.into(), &threshold.into()), "seed {seed}: {refined:?} {threshold:?}");
        }
    }
}

#[test]
fn the_pipeline_equals_its_twin_in_both_builds() {
    let mut scratch = Scratch::new();
    for seed in 0..2 * SEEDS {
        let (case, _, twin) = set_up(seed);
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        let expected = twin.process(&case.codes);
        let fastest = vector::process(&pipeline, &case.codes, &mut scratch);
        assert_eq!(twins(&fastest), expected, "seed {seed}, {:?}", case.kind);
        let plain = vector::process_baseline(&pipeline, &case.codes, &mut scratch);
        assert_eq!(plain, fastest, "seed {seed}, {:?}", case.kind);
    }
}

#[test]
fn memory_of_other_waveforms_and_settings_changes_nothing() {
    let mut reused = Scratch::new();
    for seed in 0..SEEDS {
        let (case, ..) = set_up(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)); // other seeds, other order of kinds
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        let again = vector::process(&pipeline, &case.codes, &mut reused);
        let mut fresh = Scratch::new();
        assert_eq!(again, vector::process(&pipeline, &case.codes, &mut fresh), "seed {seed}");
        let length = case.codes.len();
        assert_eq!(reused.filtered(length), fresh.filtered(length), "seed {seed}");
        assert_eq!(reused.statistics(), fresh.statistics(), "seed {seed}");
    }
}

/// The taps of one pulse, from the first to the centre.
struct Golden {
    width_ps: u32,
    period_fs: u32,
    peak_gain: u16,
    noise_gain: u16,
    taps: &'static [i16],
}

#[rustfmt::skip]
const GOLDEN: [Golden; 7] = [
    Golden { width_ps: 5_000, period_fs: 1_999_704, peak_gain: 24573, noise_gain: 17950, taps: &[1248, 8578, 13113] },
    Golden { width_ps: 5_000, period_fs: 992_353, peak_gain: 24583, noise_gain: 12644, taps: &[0, 655, 2294, 4284, 5895, 6504] },
    Golden { width_ps: 5_000, period_fs: 999_852, peak_gain: 24577, noise_gain: 12689, taps: &[0, 623, 2267, 4286, 5929, 6552] },
    Golden { width_ps: 2_000, period_fs: 330_784, peak_gain: 24583, noise_gain: 11543, taps: &[0, 388, 1393, 2742, 4084, 5064, 5420] },
    Golden { width_ps: 10_000, period_fs: 3_969_413, peak_gain: 24556, noise_gain: 17871, taps: &[1311, 8567, 13007] },
    Golden { width_ps: 7_321, period_fs: 793_089, peak_gain: 24577, noise_gain: 9339, taps: &[5, 152, 486, 969, 1545, 2142, 2702, 3155, 3448, 3549] },
    Golden { width_ps: 20_000, period_fs: 661_569, peak_gain: 24563, noise_gain: 5157, taps: &[0, 4, 14, 30, 51, 77, 109, 145, 186, 230, 278, 329, 382, 437, 492, 548, 604, 659, 713, 766, 816, 863, 907, 947, 982, 1012, 1037, 1057, 1072, 1080, 1083] },
];

#[test]
fn template_taps_are_the_committed_ones_on_every_machine() {
    for golden in &GOLDEN {
        let template = Template::sin_squared(golden.width_ps, golden.period_fs);
        let mirrored: Vec<i16> = golden.taps.iter().chain(golden.taps.iter().rev().skip(1)).copied().collect();
        assert_eq!(template.taps(), mirrored, "{} ps", golden.width_ps);
        assert_eq!((template.peak_gain(), template.noise_gain()), (golden.peak_gain, golden.noise_gain));
    }
}

#[test]
fn template_taps_lie_within_one_lsb_and_a_tolerance_of_the_true_pulse() {
    const OF_THE_LARGEST_TAP: f64 = 1.5e-3; // micromath's cosine
    for seed in 0..SEEDS {
        let (case, config, _) = set_up(seed);
        let template = config.template();
        let width = f64::from(case.settings.pulse_width_ps) * 1e3 / f64::from(config.sample_period_fs());
        let half = width.ceil() as i32 - 1;
        let shape: Vec<f64> = (-half..=half).map(|k| vectors::pulse(k.into(), width)).collect();
        let sum: f64 = shape.iter().sum();
        let energy: f64 = shape.iter().map(|p| p * p).sum();
        assert_eq!(template.taps().len(), shape.len(), "seed {seed}: {:?}", case.settings);
        for (&tap, p) in template.taps().iter().zip(&shape) {
            let below = 32_767.0 * p / sum - f64::from(tap); // rounded down
            let slack = OF_THE_LARGEST_TAP * 32_767.0 / sum;
            assert!((-slack..=1.0 + slack).contains(&below), "seed {seed}: {tap} is {below} below");
        }
        for (ours, ideal) in [(template.peak_gain(), energy / sum), (template.noise_gain(), energy.sqrt() / sum)] {
            assert!((f64::from(ours) / 32_768.0 / ideal - 1.0).abs() < 2e-3, "seed {seed}: {ours} for {ideal}");
        }
    }
}
