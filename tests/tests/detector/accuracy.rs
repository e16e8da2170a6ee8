//! Accuracy of the detector: against the model that never rounds, the truth and the physics.
//!
//! Figures in comments are the errors reached; the bounds leave room for the seeded Monte Carlo.

use echoloop_dsp::choice::{DenoiseFilter, TimingMethod};
use echoloop_dsp::{Echo, Flags, Hardware, Pipeline, Scratch, Settings};
use echoloop_tests::float_reference::{self, FloatReference};
use echoloop_tests::moments::{mean, mean_and_deviation};
use echoloop_tests::tolerance::{self, LEAST_NOISE_CODES, TOLERANCES};
use echoloop_tests::vectors::{self, add_echo, digitise, noise};
use rand::RngExt;

/// 14 bits, so that quantisation does not hide the bias of the method.
const FINE: Hardware = Hardware { adc_bits: 14, ..Hardware::REFERENCE };

const HALF_GS: i32 = 397;
const ONE_GS: i32 = 794;
const TWO_GS: i32 = 1588;
const THREE_GS: i32 = 2382;

const PHASES: i32 = 256;

/// A detector and its model.
struct Bench {
    hardware: Hardware,
    pipeline: Pipeline,
    ideal: FloatReference,
    scratch: Scratch,
}

impl Bench {
    fn new(settings: Settings, hardware: Hardware) -> Self {
        let pipeline = Pipeline::new(&settings, &hardware).expect("accepted settings");
        Self {
            hardware,
            pipeline,
            ideal: FloatReference::new(&settings, &hardware),
            scratch: Scratch::new(),
        }
    }

    /// Adds an echo of this amplitude, in codes, to a waveform; returns the strongest echo found.
    fn see(&mut self, mut wave: Vec<f64>, at: f64, amplitude: f64) -> Option<(Echo, Vec<u16>)> {
        add_echo(&mut wave, at, amplitude, self.ideal.width());
        let codes = digitise(&wave, &self.hardware);
        echoloop_kernels::process(&self.pipeline, &codes, &mut self.scratch)
            .first()
            .map(|&echo| (echo, codes))
    }

    fn error_mm(&self, echo: &Echo, at: f64) -> f64 {
        echo.range_m() * 1e3 - self.ideal.range_mm(at)
    }

    /// Detects a noise-free echo; returns it with its true position.
    fn at_phase(&mut self, phase: i32, amplitude: f64) -> (Echo, f64) {
        let at = 150.0 + f64::from(phase) / f64::from(PHASES);
        (self.see(vec![100.0; 300], at, amplitude).expect("an echo far above the threshold").0, at)
    }

    /// Mean and worst range error of a noise-free echo at every phase.
    fn bias(&mut self, amplitude: f64) -> (f64, f64) {
        let mut error = |phase| {
            let (echo, at) = self.at_phase(phase, amplitude);
            self.error_mm(&echo, at)
        };
        let errors: Vec<f64> = (0..PHASES).map(&mut error).collect();
        (mean(&errors), errors.iter().fold(0.0, |worst: f64, v| v.abs().max(worst)))
    }

    /// Mean and standard deviation of the range error in white noise of `sigma` codes, at random
    /// phases; every echo is found.
    fn scatter(&mut self, snr: f64, sigma: f64, runs: u32) -> (f64, f64) {
        let mut rng = vectors::rng(1);
        let mut run = || {
            let at = 150.0 + rng.random::<f64>();
            let ambient = 200.0 + rng.random::<f64>();
            let wave = noise(&mut rng, 300, ambient, sigma);
            let (echo, _) = self.see(wave, at, snr * sigma).expect("an echo above the threshold");
            self.error_mm(&echo, at)
        };
        mean_and_deviation(&(0..runs).map(|_| run()).collect::<Vec<_>>())
    }
}

fn in_units(echo: &Echo) -> float_reference::Echo {
    float_reference::Echo {
        range_mm: echo.range_mm().to_num(),
        amplitude: echo.amplitude_fraction().to_num(),
        width_ns: echo.width_ns().to_num(),
        snr: echo.snr_ratio().to_num(),
        deviation_mm: echo.deviation_mm().to_num(),
        saturated: echo.flags.contains(Flags::SATURATED),
    }
}

#[test]
fn echoes_stay_within_the_tolerance_table_of_the_model_that_never_rounds() {
    let mut seen = [0; TOLERANCES.len()];
    let mut clipped = 0;
    for seed in 0..12_000 {
        let mut rng = vectors::rng(seed);
        let settings = Settings {
            bins: [HALF_GS, ONE_GS, TWO_GS, 2_400][rng.random_range(0..4)],
            upsampling: 1 << rng.random_range(0..4),
            timing: [TimingMethod::Parabola.code(), TimingMethod::WalkCorrected.code()]
                [rng.random_range(0..2)],
            saturation_ppm: [500_000, 1_000_000][rng.random_range(0..2)],
            noise_floor_ppm: 100,
            ..Settings::default()
        };
        let mut bench = Bench::new(settings, Hardware::REFERENCE);
        let sigma = LEAST_NOISE_CODES * f64::from(1 << rng.random_range(0..3));
        let wave = noise(&mut rng, 200, 100.0, sigma);
        let amplitude = 2.0 * sigma * 500f64.powf(rng.random());
        let Some((echo, codes)) = bench.see(wave, 100.0 + rng.random::<f64>(), amplitude) else {
            continue;
        };
        let (mut ours, models) = (in_units(&echo), bench.ideal.process(&codes));
        // Near the threshold, one of the two may find no echo.
        let Some((model, tolerance)) =
            models.first().and_then(|t| Some((t, tolerance::at(t.snr)?)))
        else {
            continue;
        };
        if model.snr > 250.0 {
            continue; // the SNR's U8.8 ends at 256
        }
        assert_eq!(ours.saturated, model.saturated, "seed {seed}");
        if ours.saturated && settings.timing != TimingMethod::WalkCorrected.code() {
            assert_eq!(echo.deviation, u16::MAX, "seed {seed}: a clipped echo walks");
            ours.deviation_mm = model.deviation_mm;
        }
        let class = TOLERANCES.iter().position(|t| t == tolerance).unwrap();
        seen[class] += 1;
        let taken = tolerance.taken(&ours, model);
        clipped +=
            u32::from(ours.saturated && settings.timing == TimingMethod::WalkCorrected.code());
        assert!(
            taken.iter().all(|&t| t <= 1.0),
            "seed {seed}: {taken:.2?} of {tolerance:?}\n{ours:?}\n{model:?}"
        );
    }
    assert!(seen.iter().all(|&n| n > 500) && clipped > 80, "{seen:?}, {clipped} clipped");
}

#[test]
fn the_worst_bias_of_a_noise_free_echo_is_that_of_the_parabola() {
    // (bins, upsampling, worst |bias| in mm, from benches/record/physics.md or measured, tolerance)
    for (bins, upsampling, expected_mm, within_mm) in [
        (HALF_GS, 1, 7.3, 0.6),  // 6.86
        (ONE_GS, 1, 0.91, 0.03), // 0.92
        (TWO_GS, 1, 0.12, 0.02), // 0.12
        (HALF_GS, 8, 3.85, 0.4), // 3.82
        (ONE_GS, 8, 0.17, 0.05), // 0.17
        (TWO_GS, 8, 0.08, 0.04), // 0.08
    ] {
        let settings = Settings {
            bins,
            upsampling,
            timing: TimingMethod::Parabola.code(),
            ..Settings::default()
        };
        let (mean, worst) = Bench::new(settings, FINE).bias(15_000.0);
        assert!(
            (worst - expected_mm).abs() < within_mm,
            "{bins} bins, upsampling {upsampling}: {worst} mm"
        );
        assert!(mean.abs() < 0.01, "{bins} bins, upsampling {upsampling}: mean {mean} mm");
    }
}

#[test]
fn walk_correction_removes_the_bias_of_the_parabola_behind_every_filter() {
    for (bins, within_mm) in [(HALF_GS, 0.55), (ONE_GS, 0.065), (TWO_GS, 0.08)] {
        for denoise in [
            DenoiseFilter::None.code(),
            DenoiseFilter::Gaussian.code(),
            DenoiseFilter::Matched.code(),
        ] {
            // Worst at 0.5 GS/s: 0.49, 0.48, 0.33; at 1 GS/s: 0.057, 0.026, 0.031; at 2 GS/s:
            // 0.075, 0.012, 0.009.
            let (mean, worst) =
                Bench::new(Settings { bins, denoise, ..Settings::default() }, FINE).bias(15_000.0);
            assert!(worst < within_mm, "{bins} bins, filter {denoise}: {worst} mm");
            assert!(mean.abs() < 0.01, "{bins} bins, filter {denoise}: mean {mean} mm");
        }
    }
}

#[test]
fn a_constant_fraction_is_biased_by_millimetres_and_a_rising_edge_walks() {
    for (bins, within_mm) in [(HALF_GS, 11.0), (ONE_GS, 1.6), (TWO_GS, 0.45)] {
        // Reached: 10.5, 1.53, 0.43, because it interpolates linearly.
        let settings =
            Settings { bins, timing: TimingMethod::ConstantFraction.code(), ..Settings::default() };
        let [weak, strong] =
            [150.0, 15_000.0].map(|amplitude| Bench::new(settings, FINE).bias(amplitude));
        assert!(strong.1 < within_mm, "{bins} bins: {} mm", strong.1);
        assert!(
            (weak.0 - strong.0).abs() < 0.5,
            "{bins} bins: the mean walks from {} to {} mm",
            weak.0,
            strong.0
        );
        let settings = Settings { timing: TimingMethod::RisingEdge.code(), ..settings };
        let [weak, strong] =
            [150.0, 15_000.0].map(|amplitude| Bench::new(settings, FINE).bias(amplitude).0);
        assert!(weak - strong > 300.0, "{bins} bins: from {weak} to {strong} mm");
    }
}

#[test]
fn clipped_echoes_are_timed_as_well_as_whole_ones_while_both_edges_show() {
    // (bins, deepest A/S with both edges at every phase, worst and mean error in mm)
    for (bins, deepest, worst_mm, mean_mm) in [
        (HALF_GS, 2.0, 0.4, 0.15), // 0.36, 0.13: bisection ends at 2⁻¹⁰ samples, on one side
        (ONE_GS, 5.0, 0.25, 0.08), // 0.23, 0.07
        (TWO_GS, 10.0, 0.12, 0.04), // 0.11, 0.03
        (THREE_GS, 50.0, 0.1, 0.03), // 0.09, 0.02
    ] {
        for (saturation_ppm, timing, overdrive) in clipped_cases() {
            let settings = Settings { bins, saturation_ppm, timing, ..Settings::default() };
            let mut bench = Bench::new(settings, Hardware::REFERENCE);
            let level = f64::from(bench.pipeline.config().clip_code);
            if overdrive <= deepest {
                let (mean, worst) = bench.bias(overdrive * level);
                assert!(worst < worst_mm, "A/S {overdrive} at {bins} bins: {worst} mm");
                assert!(mean.abs() < mean_mm, "A/S {overdrive} at {bins} bins: mean {mean} mm");
            }
        }
    }
}

/// Saturation levels, methods that time clipped echoes by their edges, and A/S.
fn clipped_cases() -> impl Iterator<Item = (i32, i32, f64)> {
    let methods = [TimingMethod::WalkCorrected, TimingMethod::ConstantFraction];
    let overdrives = [1.2, 2.0, 5.0, 10.0, 50.0, 500.0, 5_000.0];
    [1_000_000, 500_000].into_iter().flat_map(move |saturation_ppm| {
        let case = move |method: TimingMethod| {
            overdrives.map(|overdrive| (saturation_ppm, method.code(), overdrive))
        };
        methods.into_iter().flat_map(case)
    })
}

#[test]
fn a_constant_fraction_walks_neither_whole_nor_clipped() {
    // Half of the clipped height comes 12 mm early at A/S 1.2, 130 at 5, 254 at 500.
    for (bins, within_mm) in [(HALF_GS, 4.6), (ONE_GS, 1.2), (TWO_GS, 0.4)] {
        let timing = TimingMethod::ConstantFraction.code();
        let mut bench = Bench::new(Settings { bins, timing, ..Settings::default() }, FINE);
        let level = f64::from(bench.pipeline.config().clip_code);
        for over in [0.01, 0.05, 0.2, 0.9, 1.1, 1.2, 2.0, 5.0, 20.0, 100.0, 500.0] {
            // Reached: 4.3, 1.0, 0.3, because it interpolates linearly; clipped 0.00.
            let (mean, _) = bench.bias(over * level);
            let (echo, _) = bench.at_phase(PHASES / 3, over * level);
            assert!(mean.abs() < within_mm, "A/S {over} at {bins} bins: mean {mean} mm");
            assert!(echo.deviation < u16::MAX, "A/S {over} at {bins} bins: σ is known");
        }
    }
}

#[test]
fn clipped_echoes_with_edges_between_samples_are_unbiased_with_an_honest_sigma() {
    for (bins, ripple_mm) in [(HALF_GS, 145.0), (ONE_GS, 69.0), (TWO_GS, 31.5), (THREE_GS, 19.0)] {
        for (saturation_ppm, timing, overdrive) in clipped_cases() {
            let settings = Settings { bins, saturation_ppm, timing, ..Settings::default() };
            let mut bench = Bench::new(settings, Hardware::REFERENCE);
            let level = f64::from(bench.pipeline.config().clip_code);
            let (mean, worst) = bench.bias(overdrive * level);
            let case = format!("A/S {overdrive} at {bins} bins");
            assert!(mean.abs() < 0.15, "{case}: mean {mean} mm");
            // 142.9, 67.9, 30.7, 18.3, all of A/S 5000
            assert!(worst < ripple_mm, "{case}: {worst} mm");
            for phase in 0..PHASES {
                let (echo, at) = bench.at_phase(phase, overdrive * level);
                let (error, deviation): (f64, f64) =
                    (bench.error_mm(&echo, at), echo.deviation_mm().to_num());
                assert!(
                    error.abs() < 3.0 * deviation + 0.2,
                    "{case}: {error} mm, σ {deviation} mm"
                );
            }
        }
    }
}

#[test]
fn reflectivity_is_that_of_the_surface_whole_or_clipped() {
    let hardware = Hardware::REFERENCE;
    for timing in [TimingMethod::Parabola.code(), TimingMethod::WalkCorrected.code()] {
        for gain_cdb in [-1_000, 0, 600] {
            let settings =
                Settings { gain_cdb, power_uw: 60_000_000, timing, ..Settings::default() };
            let mut bench = Bench::new(settings, hardware);
            let at = 150.3;
            let range_m = bench.ideal.range_mm(at) / 1e3;
            let unit = f64::from(hardware.unit_echo_milli) / 1e3
                * 60.0
                * f64::powf(10.0, f64::from(gain_cdb) / 2e3);
            for amplitude in [0.01, 0.3, 0.7, 1.2, 2.0, 4.0] {
                let reflectivity = amplitude * range_m * range_m / unit;
                let (echo, _) =
                    bench.see(vec![100.0; 300], at, amplitude * 4096.0).expect("an echo");
                let got: f64 = echo.reflectivity_ratio().to_num();
                let clipped = echo.flags.contains(Flags::SATURATED);
                if clipped && timing == TimingMethod::Parabola.code() {
                    assert!(
                        got < reflectivity,
                        "ρ {reflectivity} at {gain_cdb} cdB: {got} is no lower bound"
                    );
                    continue;
                }
                let bound = if clipped { 0.02 } else { 0.003 } * reflectivity + 0.002;
                assert!(
                    (got - reflectivity).abs() < bound,
                    "ρ {reflectivity} at {gain_cdb} cdB: {got}"
                );
            }
        }
    }
}

#[test]
fn the_spread_in_white_noise_is_that_of_the_physics_and_near_the_cramer_rao_bound() {
    const RUNS: u32 = 6_000;
    let confidence = 3.0 / f64::from(2 * RUNS).sqrt(); // three standard errors of σ: 2.7 %
    // benches/record/physics.md §4, Monte Carlo in real numbers, mm at 1 GS/s.
    for (snr, physics_mm) in [(10.0, 21.0), (20.0, 10.6), (50.0, 4.35)] {
        let mut bench =
            Bench::new(Settings { bins: ONE_GS, ..Settings::default() }, Hardware::REFERENCE);
        let (mean, std) = bench.scatter(snr, 16.0, RUNS);
        let bound = bench.ideal.range_crlb_mm(snr);
        assert!(mean.abs() < 3.0 * std / f64::from(RUNS).sqrt() + 0.02, "S {snr}: mean {mean} mm");
        assert!(
            (std / physics_mm - 1.0).abs() < 0.03 + confidence,
            "S {snr}: {std} mm, physics {physics_mm}"
        );
        assert!(std > bound * (1.0 - confidence), "S {snr}: {std} mm beats {bound}");
        assert!(std < bound * (1.06 + confidence), "S {snr}: {std} mm, bound {bound}");
    }
}

#[test]
fn at_half_a_gigasample_upsampling_reduces_the_spread_and_walk_correction_reaches_the_bound() {
    let spread = |upsampling, timing| {
        let settings = Settings { bins: HALF_GS, upsampling, timing, ..Settings::default() };
        Bench::new(settings, Hardware::REFERENCE).scatter(50.0, 16.0, 3_000).1
    };
    let (plain, upsampled) =
        (spread(1, TimingMethod::Parabola.code()), spread(8, TimingMethod::Parabola.code()));
    // benches/record/physics.md: 8.02 against a bound of 6.04; reached 7.92
    assert!((plain - 8.02).abs() < 0.4, "{plain} mm");
    assert!(upsampled < 7.0, "{upsampled} mm"); // 6.65
    let corrected = spread(1, TimingMethod::WalkCorrected.code());
    assert!((corrected / 6.04 - 1.0).abs() < 0.05, "{corrected} mm"); // 5.97
}

#[test]
fn weak_echoes_in_little_noise_are_unbiased_at_every_rate_and_resolution() {
    // S makes d' = S·√(¾ f_s τ) equal to 12; σ in codes. Read from y instead of f, the range was
    // 42 mm off at 3 GS/s and σ = 1 code.
    for (bins, strength) in [(ONE_GS, 6.2), (THREE_GS, 3.57)] {
        let settings =
            Settings { bins, upsampling: 8, noise_floor_ppm: 100, ..Settings::default() };
        for (adc_bits, sigma) in [(12, 1.0), (12, 2.0), (14, 2.0), (14, 4.0)] {
            let mut bench = Bench::new(settings, Hardware { adc_bits, ..Hardware::REFERENCE });
            let (mean, quiet) = bench.scatter(strength, sigma, 3_000);
            let (_, loud) = bench.scatter(strength, 16.0, 3_000);
            let case = format!("{bins} bins, {adc_bits} bits, σ {sigma} codes");
            assert!(mean.abs() < 5.0, "{case}: {mean} mm");
            assert!(quiet < 1.15 * loud, "{case}: {quiet} mm against {loud}");
        }
    }
}

#[test]
fn false_alarms_are_as_rare_as_the_physics_says() {
    const WINDOWS: u32 = 30_000;
    // Rates per 800 ns window at k = 4 with σ known: benches/record/physics.md §4. Measuring σ in
    // the same waveform adds a fifth.
    for (bins, known_sigma) in [(HALF_GS, 0.0109), (ONE_GS, 0.0136), (THREE_GS, 0.0150)] {
        let settings = Settings {
            bins,
            snr_threshold_milli: 4_000,
            noise_floor_ppm: 100,
            ..Settings::default()
        };
        let mut bench = Bench::new(settings, Hardware::REFERENCE);
        let mut rng = vectors::rng(7);
        let mut alarm = || {
            let wave = noise(&mut rng, bins as usize, 200.0, 16.0);
            bench.see(wave, -1e3, 0.0).is_some()
        };
        let alarms = (0..WINDOWS).filter(|_| alarm()).count();
        let rate = alarms as f64 / f64::from(WINDOWS);
        let confidence = 3.0 * (alarms as f64).sqrt() / f64::from(WINDOWS);
        assert!(rate + confidence > 0.9 * known_sigma, "{bins} bins: {rate} ± {confidence}");
        assert!(rate - confidence < 1.3 * known_sigma, "{bins} bins: {rate} ± {confidence}");
    }
}

#[test]
fn measured_noise_is_unbiased_down_to_two_codes_at_every_resolution() {
    for adc_bits in [10, 12, 14] {
        let hardware = Hardware { adc_bits, ..Hardware::REFERENCE };
        let mut bench = Bench::new(Settings::default(), hardware);
        let mut rng = vectors::rng(3);
        for sigma in [2.0, 4.0, 16.0] {
            let mut ratio = || {
                let ambient = 100.0 + rng.random::<f64>();
                let codes = digitise(&noise(&mut rng, 800, ambient, sigma), &hardware);
                echoloop_kernels::process(&bench.pipeline, &codes, &mut bench.scratch);
                f64::from(bench.scratch.statistics().sigma)
                    / f64::from(1 << (19 - adc_bits))
                    / sigma
            };
            let mean = mean(&(0..1_000).map(|_| ratio()).collect::<Vec<_>>());
            // σ 2 with 1/12 code²: 1.01
            assert!((0.985..1.03).contains(&mean), "{adc_bits} bits, σ {sigma}: {mean}");
        }
    }
}
