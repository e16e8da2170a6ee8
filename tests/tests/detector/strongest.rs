//! Strongest of two clipped echoes: the sensor keeps the one that would be higher without clipping.
//!
//! Each case has two shapes of known heights, one 1.2 to 100 times as high as the other, both above
//! the clip level, in the reference receiver's noise. The lower one is 1.05 to 4 times as high as
//! the level; beyond, a hard pulse's edges fall between samples, so no sample shows a ratio near 1.
//! `cargo test -p echoloop-tests --test detector strongest:: -- --nocapture` prints the errors by
//! ratio.

use std::f64::consts::PI;
use std::fmt;

use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::{Hardware, Pipeline, Scratch, Settings};
use echoloop_frontend::{Analog, Exposure, Receiver, ShotBuffers, Trigger, noise_key, synthesise};
use echoloop_tests::bit_true::BitTrue;
use echoloop_tests::vectors;
use rand::{Rng, RngExt};

/// c/2, m per ns.
const M_PER_NS: f64 = 0.149_896_229;

/// Shape of an echo.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// Surface square to the beam.
    Hard,
    /// Sloped surface under a Gaussian beam, 0.5 to 3 pulse widths long.
    Sloped,
    /// Sloped surface under a uniform beam, 0.5 to 3 pulse widths long.
    SlopedEven,
    /// Fog in front of the sensor, of this visibility, m.
    Air(f64),
}

/// A sensor's clock and pulse.
#[derive(Clone, Copy)]
struct Clock {
    settings: Settings,
    period_ns: f64,
    width_ns: f64,
}

impl Clock {
    fn new(bins: i32, pulse_width_ps: i32) -> Self {
        let power_uw = Hardware::REFERENCE.strongest_power_uw(pulse_width_ps).min(75_000_000);
        let settings = Settings { bins, pulse_width_ps, power_uw, ..Settings::default() };
        Self {
            settings,
            period_ns: f64::from(sample_period_fs(bins as u32, &Hardware::REFERENCE)) / 1e6,
            width_ns: f64::from(pulse_width_ps) / 1e3,
        }
    }

    /// Pulse at a time after its beginning.
    fn pulse(&self, ns: f64) -> f64 {
        let inside = ns > 0.0 && ns < 2.0 * self.width_ns;
        if inside { (PI * ns / (2.0 * self.width_ns)).sin().powi(2) } else { 0.0 }
    }

    /// An echo of height 1 whose middle is `middle_ns` after sample 0; that of air, which is given,
    /// always begins at the sensor.
    fn echo(&self, shape: Shape, air: &[f64], middle_ns: f64, rng: &mut impl Rng) -> Vec<f64> {
        let length_ns = self.width_ns * log_uniform(rng, 0.5, 3.0);
        let parts: Vec<(f64, f64)> = match shape {
            Shape::Hard => vec![(0.0, 1.0)],
            Shape::Sloped => (-40..=40)
                .map(|i| f64::from(i) / 20.0)
                .map(|d| (length_ns * d / 2.0, (-(d * d)).exp2()))
                .collect(),
            Shape::SlopedEven => {
                (-40..=40).map(|i| (length_ns * f64::from(i) / 80.0, 1.0)).collect()
            }
            Shape::Air(_) => return air.to_vec(),
        };
        let at = |n: i32| {
            let ns = f64::from(n) * self.period_ns - middle_ns + self.width_ns;
            if (ns - self.width_ns).abs() > self.width_ns + 1.1 * length_ns {
                return 0.0;
            }
            parts.iter().map(|(late, part)| part * self.pulse(ns - late)).sum()
        };
        of_height_1((0..self.settings.bins).map(at).collect())
    }

    /// ∫ ξ e^(−2αR)/R² p(t − 2R/c) dR in steps of 1 cm; sample 0 is the middle of a pulse from 1 m.
    fn air(&self, visibility_m: f64) -> Vec<f64> {
        let alpha = 20f64.ln() / visibility_m;
        let at = |n: i32| {
            let ns = 1.0 / M_PER_NS + self.width_ns + f64::from(n) * self.period_ns;
            let nearest = ((ns - 2.0 * self.width_ns) * M_PER_NS * 100.0).max(90.0) as i32;
            let slices = nearest..=(ns * M_PER_NS * 100.0) as i32;
            slices
                .map(|cm| f64::from(cm) / 100.0)
                .map(|r| {
                    let overlap = ((r - 0.9) / 0.1).clamp(0.0, 1.0);
                    overlap * (-2.0 * alpha * r).exp() / (r * r) * self.pulse(ns - r / M_PER_NS)
                })
                .sum()
        };
        of_height_1((0..self.settings.bins).map(at).collect())
    }
}

fn of_height_1(wave: Vec<f64>) -> Vec<f64> {
    let top = wave.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    wave.into_iter().map(|v| v / top).collect()
}

fn log_uniform(rng: &mut impl Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.random())
}

/// Numbers of wrong and of all choices, for ratios up to each of [`RATIOS`].
#[derive(Default)]
struct Score([(u32, u32); RATIOS.len()]);

const RATIOS: [f64; 5] = [1.4, 2.0, 5.0, 20.0, 100.0];

impl Score {
    fn add(&mut self, ratio: f64, wrong: bool) {
        let bin = RATIOS.iter().position(|&most| ratio <= most).unwrap_or(RATIOS.len() - 1);
        self.0[bin].0 += u32::from(wrong);
        self.0[bin].1 += 1;
    }

    fn wrong(&self) -> f64 {
        let (wrong, all) = self.0.iter().fold((0, 0), |(w, a), (wrong, all)| (w + wrong, a + all));
        f64::from(wrong) / f64::from(all)
    }
}

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:5.2} % wrong; by ratio", 100.0 * self.wrong())?;
        for (most, (wrong, all)) in RATIOS.iter().zip(self.0) {
            write!(f, "  ≤{most}: {wrong} of {all}")?;
        }
        Ok(())
    }
}

/// Scores the choice between two echoes, the lower one within `lower` clip levels.
fn compare(clock: Clock, shapes: [Shape; 2], lower: [f64; 2], runs: u32, seed: u64) -> Score {
    let mut rng = vectors::rng(seed);
    let receiver = Receiver::default();
    let pipeline = Pipeline::new(&clock.settings, &Hardware::REFERENCE).expect("accepted settings");
    let model = BitTrue::new(&clock.settings, &Hardware::REFERENCE, pipeline.config());
    let analog = Analog {
        power_w: 75.0,
        pulse_width_ns: clock.width_ns,
        gain_db: 0.0,
        sample_period_ns: clock.period_ns,
        delay_ns: 0.0,
        ..Analog::USUAL
    };
    let (mut buffers, mut scratch) = (ShotBuffers::default(), Scratch::new());
    let mut codes = vec![0; clock.settings.bins as usize];
    // Air's echo is the same in every run, and takes longer than all else of a run.
    let air = shapes.map(|shape| match shape {
        Shape::Air(visibility_m) => clock.air(visibility_m),
        _ => Vec::new(),
    });
    let mut score = Score::default();
    for beam in 0..runs {
        let low = log_uniform(&mut rng, lower[0], lower[1]);
        let ratio = log_uniform(&mut rng, 1.2, 100.0);
        let second_is_higher: bool = rng.random();
        let heights = if second_is_higher { [low, ratio * low] } else { [ratio * low, low] };
        // Far enough apart for two runs of clipped samples.
        let first_ns = match shapes[0] {
            // Beyond the range at which v R² of the air has fallen to half of the level.
            Shape::Air(_) => 1.5 * (2.0 * heights[0]).sqrt() / M_PER_NS,
            _ => 12.0 * clock.width_ns + 20.0 * rng.random::<f64>(),
        };
        let second_ns = first_ns + 14.0 * clock.width_ns * (1.0 + rng.random::<f64>());
        let middles = [first_ns, second_ns];
        let mut signal = vec![0.0; codes.len()];
        for (i, shape) in shapes.into_iter().enumerate() {
            let echo = clock.echo(shape, &air[i], middles[i], &mut rng);
            for (sum, part) in signal.iter_mut().zip(echo) {
                *sum += heights[i] * part;
            }
        }
        let full_scale_ua = receiver.full_scale_ua;
        let background: Vec<f32> = signal.iter().map(|v| (v * full_scale_ua) as f32).collect();
        let key = noise_key(seed, Trigger { frame: 0, beam, shot: 0 });
        let exposure = Exposure {
            receiver: &receiver,
            analog: &analog,
            returns: &[],
            background: &background,
            key,
        };
        synthesise(&exposure, &mut buffers, &mut codes);
        let echoes = echoloop_kernels::process(&pipeline, &codes, &mut scratch);
        let range_m = echoes.first().expect("clipped echoes are found").range_m();
        if beam < 40 {
            let models: Vec<_> = echoes.iter().map(|&e| e.into()).collect();
            assert_eq!(model.process(&codes), models, "{shapes:?}, beam {beam}");
        }
        let between_m = 1.0 + M_PER_NS * (first_ns + second_ns) / 2.0;
        // Of air any surface is the stronger.
        let is_second = second_is_higher || matches!(shapes[0], Shape::Air(_));
        score.add(ratio, (range_m > between_m) != is_second);
    }
    score
}

/// Pairs of shapes, nearer one first; air is always in front of the sensor.
const PAIRS: [[Shape; 2]; 9] = [
    [Shape::Hard, Shape::Hard],
    [Shape::Hard, Shape::Sloped],
    [Shape::Sloped, Shape::Hard],
    [Shape::Sloped, Shape::Sloped],
    [Shape::Air(50.0), Shape::Hard],
    [Shape::Air(200.0), Shape::Hard],
    [Shape::Air(600.0), Shape::Hard],
    [Shape::Air(200.0), Shape::Sloped],
    [Shape::Air(100.0), Shape::Sloped],
];

#[test]
fn of_two_clipped_echoes_the_higher_is_kept_in_99_of_100() {
    for (bins, width_ps, runs) in [(800, 5_000, 1_000), (2_400, 5_000, 400)] {
        for (seed, shapes) in (1..).zip(PAIRS) {
            let score = compare(Clock::new(bins, width_ps), shapes, [1.05, 4.0], runs, seed);
            println!("{bins} bins, {width_ps} ps, {shapes:?}: {score}");
            assert!(score.wrong() <= 0.01, "{bins} bins, {width_ps} ps, {shapes:?}: {score}");
        }
    }
}

#[test]
fn the_higher_is_kept_with_clocks_and_pulses_that_no_constant_was_tuned_on() {
    let unseen = [
        [Shape::Hard, Shape::Hard],
        [Shape::Hard, Shape::Sloped],
        [Shape::Sloped, Shape::Hard],
        [Shape::Air(140.0), Shape::Hard],
        [Shape::Air(320.0), Shape::Sloped],
    ];
    for (bins, width_ps) in [(1_300, 4_000), (700, 9_000), (1_900, 3_000)] {
        for (seed, shapes) in (100..).zip(unseen) {
            let score = compare(Clock::new(bins, width_ps), shapes, [1.05, 4.0], 1_000, seed);
            println!("{bins} bins, {width_ps} ps, {shapes:?}: {score}");
            assert!(score.wrong() <= 0.01, "{bins} bins, {width_ps} ps, {shapes:?}: {score}");
        }
    }
}

#[test]
fn a_flat_top_is_overestimated() {
    // The clipped run of a sloped surface under a uniform beam is as long as that of a far higher
    // Gaussian one, and is taken for it. Ratios above 5 are still distinguished.
    for (seed, shapes) in
        (300..).zip([[Shape::Hard, Shape::SlopedEven], [Shape::SlopedEven, Shape::Hard]])
    {
        let score = compare(Clock::new(800, 5_000), shapes, [1.05, 4.0], 1_000, seed);
        println!("{shapes:?}: {score}");
        assert!(score.wrong() <= 0.05, "{shapes:?}: {score}");
    }
}

#[test]
fn far_above_the_clip_level_most_choices_are_right() {
    for (lower, most) in [([4.0, 8.0], 0.06), ([8.0, 16.0], 0.15)] {
        for (seed, shapes) in (200..).zip(PAIRS.into_iter().take(4)) {
            let score = compare(Clock::new(800, 5_000), shapes, lower, 500, seed);
            println!("lower one {lower:?}, {shapes:?}: {score}");
            assert!(score.wrong() <= most, "lower one {lower:?}, {shapes:?}: {score}");
        }
    }
}
