//! Constants computed in `f32` when settings are committed: the same on every machine, and near
//! their formulas in `f64`. The model of `bit_exact.rs` takes them from the DSP.

use echoloop_dsp::choice::DenoiseFilter;
use echoloop_dsp::template::Template;
use echoloop_dsp::{DetectorConfig, Hardware, Settings};
use echoloop_tests::float_reference::Filtered;
use echoloop_tests::vectors::{self, pulse};

/// Number of settings and hardware per test.
const SEEDS: u64 = 10_000;

fn draw(seed: u64) -> (Settings, Hardware, DetectorConfig) {
    let mut rng = vectors::rng(seed);
    let hardware = vectors::hardware(&mut rng);
    let settings = vectors::settings(&mut rng, &hardware);
    let config = DetectorConfig::new(&settings, &hardware).expect("vectors draw accepted settings");
    (settings, hardware, config)
}

/// Pulse width in samples, W f_s.
fn samples_per_width(settings: &Settings, config: &DetectorConfig) -> f64 {
    f64::from(settings.pulse_width_ps) * 1e3 / f64::from(config.sample_period_fs)
}

/// Committed taps of one pulse, from the first to the centre.
struct Golden {
    width_ps: u32,
    period_fs: u32,
    peak_gain: u16,
    noise_gain: u16,
    taps: &'static [i16],
}

/// Shorthand for [`Golden`]: pulse width, sample period, gains, taps.
const fn golden(
    width_ps: u32,
    period_fs: u32,
    peak_gain: u16,
    noise_gain: u16,
    taps: &'static [i16],
) -> Golden {
    Golden { width_ps, period_fs, peak_gain, noise_gain, taps }
}

const GOLDEN: [Golden; 7] = [
    golden(5_000, 1_999_704, 24573, 17950, &[1248, 8578, 13113]),
    golden(5_000, 992_353, 24583, 12644, &[0, 655, 2294, 4284, 5895, 6504]),
    golden(5_000, 999_852, 24577, 12689, &[0, 623, 2267, 4286, 5929, 6552]),
    golden(2_000, 330_784, 24583, 11543, &[0, 388, 1393, 2742, 4084, 5064, 5420]),
    golden(10_000, 3_969_413, 24556, 17871, &[1311, 8567, 13007]),
    golden(7_321, 793_089, 24577, 9339, &[5, 152, 486, 969, 1545, 2142, 2702, 3155, 3448, 3549]),
    golden(
        20_000,
        661_569,
        24563,
        5157,
        &[
            0, 4, 14, 30, 51, 77, 109, 145, 186, 230, 278, 329, 382, 437, 492, 548, 604, 659, 713,
            766, 816, 863, 907, 947, 982, 1012, 1037, 1057, 1072, 1080, 1083,
        ],
    ),
];

#[test]
fn template_taps_are_the_committed_ones_on_every_machine() {
    for golden in &GOLDEN {
        let template = Template::sin_squared(golden.width_ps, golden.period_fs);
        let mirrored: Vec<i16> =
            golden.taps.iter().chain(golden.taps.iter().rev().skip(1)).copied().collect();
        assert_eq!(template.taps(), mirrored, "{} ps", golden.width_ps);
        assert_eq!(
            (template.peak_gain, template.noise_gain),
            (golden.peak_gain, golden.noise_gain)
        );
    }
}

#[test]
fn template_taps_lie_within_one_lsb_and_a_tolerance_of_the_true_shape() {
    const OF_THE_LARGEST_TAP: f64 = 1.5e-3; // micromath's cosine
    for seed in 0..SEEDS {
        let (settings, _, config) = draw(seed);
        let template = &config.template;
        let width = samples_per_width(&settings, &config);
        let filter = settings.choices().unwrap().denoise;
        let half = if filter == DenoiseFilter::None { 0 } else { width.ceil() as i32 - 1 };
        let shape = |k: i32| match filter {
            DenoiseFilter::None => 1.0,
            DenoiseFilter::Gaussian => f64::powf(2.0, -16.0 * (f64::from(k) / width).powi(2)),
            DenoiseFilter::Matched => pulse(k.into(), width),
        };
        let shapes: Vec<f64> = (-half..=half).map(shape).collect();
        let sum: f64 = shapes.iter().sum();
        assert_eq!(template.taps().len(), shapes.len(), "seed {seed}: {settings:?}");
        let slack = if filter == DenoiseFilter::Matched {
            OF_THE_LARGEST_TAP * 32_767.0 / sum
        } else {
            0.02
        };
        for (&tap, p) in template.taps().iter().zip(&shapes) {
            let below = 32_767.0 * p / sum - f64::from(tap); // rounded down
            assert!((-slack..=1.0 + slack).contains(&below), "seed {seed}: {tap} is {below} below");
        }
        let height: f64 =
            (-half..=half).zip(&shapes).map(|(k, s)| s / sum * pulse(k.into(), width)).sum();
        let energy: f64 = shapes.iter().map(|s| s * s).sum();
        for (ours, ideal) in
            [(template.peak_gain, height), (template.noise_gain, energy.sqrt() / sum)]
        {
            assert!(
                (f64::from(ours) / 32_768.0 / ideal - 1.0).abs() < 2e-3,
                "seed {seed}: {ours} for {ideal}"
            );
        }
    }
}

#[test]
fn the_timing_stage_s_constants_are_those_of_real_numbers() {
    for seed in 0..SEEDS / 4 {
        let (settings, _, config) = draw(seed);
        let timing = &config.timing;
        let width = samples_per_width(&settings, &config);
        let taps = config.template.taps().iter().map(|&h| f64::from(h) / 32_768.0).collect();
        let filtered = Filtered::new(taps, width, settings.upsampling);
        let method = settings.choices().unwrap().timing;
        let (gain, share) = filtered.gain_and_share(method);
        for (name, error, bound) in [
            ("gain", f64::from(timing.gain) / 65_536.0 / gain - 1.0, 2e-3),
            ("share", f64::from(timing.shot_share) / 32_768.0 - share, 1e-4),
            ("bias", f64::from(timing.bias) / 32_768.0 - filtered.bias(), 1e-4),
            ("offset", timing.offset as f64 / 65_536.0 - filtered.offset(method), 1e-4),
        ] {
            assert!(error.abs() < bound, "seed {seed}: {name} is {error} off, {settings:?}");
        }
    }
}

#[test]
fn shot_noise_and_the_scale_of_reflectivity_are_those_of_real_numbers() {
    const OF_F32: f64 = 3e-6;
    for seed in 0..SEEDS {
        let (settings, hardware, config) = draw(seed);
        let gain = f64::powf(10.0, f64::from(settings.gain_cdb) / 2_000.0);
        let power_w = f64::from(settings.power_uw) / 1e6;
        let kappa = f64::from(hardware.shot_noise_ppm) * 1e-6 * gain / f64::from(settings.shots)
            * f64::powi(2.0, 32);
        // A R² / (U P G): Q1.15 and mm², to Q6.10 and 64 bits more
        let unit = f64::from(hardware.unit_echo_milli.max(1)) / 1e3;
        let per_lsb = f64::powi(2.0, 10 + 64 - 15) * 1e-6 / (unit * power_w * gain);
        for (ours, real, most) in [
            (f64::from(config.shot_noise), kappa, f64::from(u32::MAX)),
            (config.reflectivity_scale as f64, per_lsb, u64::MAX as f64),
        ] {
            let real = real.min(most);
            assert!(
                (ours - real).abs() <= 0.5 + OF_F32 * real,
                "seed {seed}: {ours} for {real}, {settings:?}"
            );
        }
    }
}
