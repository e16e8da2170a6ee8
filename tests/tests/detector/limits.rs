//! Physical limits of the detector: benches/record/physics.md §4 as tests.
//!
//! Every figure is a seeded Monte Carlo. "Confidence" is three standard errors unless said
//! otherwise. Comments give the figures reached.

use std::f64::consts::PI;

use echoloop_dsp::choice::{AmbientEstimator, DenoiseFilter, TimingMethod};
use echoloop_dsp::{Echo, Flags, Hardware, PRE_TRIGGER, Pipeline, Scratch, Settings};
use echoloop_frontend::{Receiver, WaveformFrontEnd};
use echoloop_frontend::{Return, SceneResponse};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::transport::InProcess;
use echoloop_tests::moments::{mean, mean_and_deviation};
use echoloop_tests::vectors::{self, add_echo, digitise, noise};
use echoloop_tests::wall::{MM_PER_NS, Sensor, wall};
use rand::RngExt;

const HALF_GS: i32 = 397;
const ONE_GS: i32 = 794;
const TWO_GS: i32 = 1588;
const THREE_GS: i32 = 2382;

/// Hardware with white noise only, as the Cramér–Rao bound assumes.
const WHITE: Hardware = Hardware { shot_noise_ppm: 0, ..Hardware::REFERENCE };

fn at_rate(bins: i32) -> Settings {
    Settings { bins, noise_floor_ppm: 100, ..Settings::default() }
}

/// Standard deviation about the mean.
fn spread(values: &[f64]) -> f64 {
    mean_and_deviation(values).1
}

/// Three standard errors of a spread, as a fraction of it.
fn confidence(values: &[f64]) -> f64 {
    3.0 / (2.0 * values.len() as f64).sqrt()
}

/// The upper tail of the normal distribution.
fn q(x: f64) -> f64 {
    0.5 * libm::erfc(x / 2f64.sqrt())
}

/// A detector for waveforms of a pulse in white noise.
struct Bench {
    hardware: Hardware,
    pipeline: Pipeline,
    scratch: Scratch,
    /// Pulse width W f_s, samples.
    width: f64,
    mm_per_sample: f64,
}

impl Bench {
    fn new(settings: &Settings, hardware: Hardware) -> Self {
        let pipeline = Pipeline::new(settings, &hardware).expect("accepted settings");
        let period_ns = f64::from(pipeline.config().sample_period_fs) / 1e6;
        let width = f64::from(settings.pulse_width_ps) / 1e3 / period_ns;
        Self {
            hardware,
            pipeline,
            scratch: Scratch::new(),
            width,
            mm_per_sample: MM_PER_NS * period_ns,
        }
    }

    /// Echoes of a waveform in codes.
    fn see(&mut self, wave: &[f64]) -> Vec<Echo> {
        echoloop_kernels::process(
            &self.pipeline,
            &digitise(wave, &self.hardware),
            &mut self.scratch,
        )
        .to_vec()
    }

    /// Range error of an echo whose pulse is centred at a sample.
    fn error_mm(&self, echo: &Echo, at: f64) -> f64 {
        echo.range_m() * 1e3 - f64::from(self.hardware.range_min_mm) - at * self.mm_per_sample
    }

    /// Range errors of pulses of amplitude `snr · sigma` (codes) in noise of `sigma`, at random
    /// phases; all are found.
    fn errors(&mut self, snr: f64, sigma: f64, runs: usize) -> Vec<f64> {
        let mut rng = vectors::rng(1);
        let mut error = || {
            let at = 150.0 + rng.random::<f64>();
            let ambient = 200.0 + rng.random::<f64>();
            let mut wave = noise(&mut rng, 400, ambient, sigma);
            add_echo(&mut wave, at, snr * sigma, self.width);
            let echo = self.see(&wave).first().copied().expect("an echo far above the threshold");
            self.error_mm(&echo, at)
        };
        (0..runs).map(|_| error()).collect()
    }

    /// Cramér–Rao bound in white noise: (cτ/π) / (S √(f_s τ)).
    fn bound_mm(&self, snr: f64) -> f64 {
        2.0 * self.mm_per_sample * self.width / PI / (snr * self.width.sqrt())
    }
}

#[test]
fn the_range_spread_lies_on_the_cramer_rao_bound() {
    // Reached: 1.00 at 1 and 2 GS/s, 1.01 to 1.02 at 0.5 GS/s; upsampled there 1.02 to 1.05.
    for (bins, upsampling) in
        [(HALF_GS, 1), (HALF_GS, 2), (ONE_GS, 1), (ONE_GS, 4), (TWO_GS, 1), (TWO_GS, 8)]
    {
        let mut bench = Bench::new(&Settings { upsampling, ..at_rate(bins) }, WHITE);
        for snr in [8.0, 10.0, 20.0, 50.0] {
            let errors = bench.errors(snr, 16.0, 6_000);
            let ratio = spread(&errors) / bench.bound_mm(snr);
            let confidence = confidence(&errors); // 2.7 %
            let case = format!("{bins} bins, upsampling {upsampling}, S {snr}");
            assert!(ratio > 0.95 && ratio < 1.08, "{case}: {ratio} ± {confidence}");
            assert!(
                ratio > 1.0 - confidence,
                "{case}: {ratio} beats the bound by more than {confidence}"
            );
            let bias = mean(&errors).abs();
            let standard_error = spread(&errors) / (errors.len() as f64).sqrt();
            assert!(
                bias < 0.05 + 4.0 * standard_error,
                "{case}: bias {bias} ± {standard_error} mm"
            );
        }
    }
}

#[test]
fn the_bound_has_the_figures_of_the_physics() {
    let bench = Bench::new(&at_rate(ONE_GS), WHITE);
    for (snr, expected_mm) in [(5.0, 42.7), (10.0, 21.3), (20.0, 10.7), (50.0, 4.27)] {
        assert!(
            (bench.bound_mm(snr) / expected_mm - 1.0).abs() < 0.003,
            "S {snr}: {} mm",
            bench.bound_mm(snr)
        );
    }
}

/// Mean error and mean σ_R at each of 32 phases.
fn by_phase(sensor: &mut Sensor, albedo: f64, range_m: f64, count: u32) -> Vec<(f64, f64)> {
    let mut at = |phase: u32| {
        let seen = sensor.at_phase(albedo, range_m, f64::from(phase) / 32.0, count);
        assert_eq!(seen.len(), count as usize, "albedo {albedo}: every echo is found");
        let errors: Vec<f64> = seen.iter().map(|(_, error)| *error).collect();
        let deviations: Vec<f64> =
            seen.iter().map(|(echo, _)| echo.deviation_mm().to_num()).collect();
        (mean(&errors), mean(&deviations))
    };
    (0..32).map(&mut at).collect()
}

#[test]
fn range_does_not_walk_with_albedo_at_any_phase_while_the_edges_show() {
    // At 60 m, albedo 0.02 is an echo of a twelfth of full scale, 50 one of two hundred times full
    // scale. Reached: below 1.5 mm as long as both edges of the clipped pulse have samples, which
    // they do while a sample period is shorter than an edge.
    let cases = [(HALF_GS, 0.5), (ONE_GS, 2.0), (TWO_GS, 5.0), (THREE_GS, 20.0)];
    for (bins, up_to) in cases {
        let mut sensor = Sensor::new(at_rate(bins));
        for albedo in [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0, 20.0]
            .into_iter()
            .filter(|&a| a <= up_to)
        {
            let count = if albedo < 0.1 { 400 } else { 100 };
            for (phase, (bias_mm, _)) in
                by_phase(&mut sensor, albedo, 60.0, count).into_iter().enumerate()
            {
                assert!(
                    bias_mm.abs() < 5.0,
                    "{bins} bins, albedo {albedo}, phase {phase}/32: {bias_mm} mm"
                );
            }
        }
    }
}

#[test]
fn deep_in_saturation_the_mean_over_phases_is_unbiased_and_sigma_covers_each_phase() {
    // When an edge falls between two samples, one dark and the next clipped, no sample shows where.
    // Then only the mean over phases can be unbiased, and σ must cover the error of each phase.
    for bins in [HALF_GS, ONE_GS, TWO_GS, THREE_GS] {
        let mut sensor = Sensor::new(at_rate(bins));
        for albedo in [5.0, 20.0, 50.0] {
            for range_m in [25.0, 60.0] {
                let phases = by_phase(&mut sensor, albedo, range_m, 40);
                let case = format!("{bins} bins, albedo {albedo}, {range_m} m");
                let biases: Vec<f64> = phases.iter().map(|(bias, _)| *bias).collect();
                assert!(mean(&biases).abs() < 5.0, "{case}: mean {} mm", mean(&biases));
                for (bias_mm, deviation_mm) in phases {
                    let bound = 1.0 + 3.0 * deviation_mm;
                    assert!(bias_mm.abs() < bound, "{case}: {bias_mm} mm, σ {deviation_mm} mm");
                }
            }
        }
    }
}

#[test]
fn sigma_r_is_honest_from_the_threshold_to_ten_times_full_scale() {
    // Rms of the error relative to σ_R; 1 is honest. Reached: 0.96 to 1.04.
    for bins in [HALF_GS, ONE_GS, TWO_GS, THREE_GS] {
        let mut sensor = Sensor::new(at_rate(bins));
        for albedo in [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 2.0] {
            if bins == HALF_GS && albedo > 0.6 {
                continue; // the edge falls between samples
            }
            let normalised: Vec<f64> = (0..3_000)
                .filter_map(|beam| {
                    sensor.see(albedo, 60.0 + 0.37 * f64::from(beam % 97) / 97.0, beam)
                })
                .map(|(echo, error)| error / echo.deviation_mm().to_num::<f64>())
                .collect();
            assert_eq!(normalised.len(), 3_000);
            let rms = (mean(&normalised).powi(2) + spread(&normalised).powi(2)).sqrt();
            assert!((rms - 1.0).abs() < 0.1, "{bins} bins, albedo {albedo}: {rms}");
        }
    }
}

#[test]
fn sigma_r_is_honest_for_other_filters_and_methods() {
    // With a Gaussian filter, and for a constant fraction, from 5 samples per pulse width on.
    for (denoise, timing) in [
        (DenoiseFilter::Gaussian.code(), TimingMethod::WalkCorrected.code()),
        (DenoiseFilter::Gaussian.code(), TimingMethod::Parabola.code()),
        (DenoiseFilter::Matched.code(), TimingMethod::ConstantFraction.code()),
        (DenoiseFilter::Gaussian.code(), TimingMethod::ConstantFraction.code()),
    ] {
        for bins in [ONE_GS, TWO_GS] {
            let mut bench = Bench::new(&Settings { denoise, timing, ..at_rate(bins) }, WHITE);
            let mut rng = vectors::rng(2);
            let mut normalised = || {
                let at = 300.0 + rng.random::<f64>();
                let mut wave = noise(&mut rng, bins as usize, 200.0, 16.0);
                add_echo(&mut wave, at, 15.0 * 16.0, bench.width);
                let echo = bench.see(&wave).first().copied().expect("an echo");
                bench.error_mm(&echo, at) / echo.deviation_mm().to_num::<f64>()
            };
            let normalised: Vec<f64> = (0..2_000).map(|_| normalised()).collect();
            let spread = spread(&normalised);
            assert!(
                (spread - 1.0).abs() < 0.1,
                "denoise {denoise}, timing {timing}, {bins} bins: {spread}"
            );
        }
    }
}

#[test]
fn a_rising_edge_walks_as_the_physics_says_and_a_constant_fraction_does_not() {
    // Without noise or filter, (cτ/π) asin √(T/A): 0.702 m at A/T = 1.01, 0.154 at 10, 0.048 at
    // 100.
    let threshold = 0.01;
    let quiet = |timing, amplitude: f64| {
        let settings = Settings {
            denoise: DenoiseFilter::None.code(),
            timing,
            noise_floor_ppm: 10_000,
            ..at_rate(THREE_GS)
        };
        let mut bench = Bench::new(&settings, Hardware { adc_bits: 14, ..Hardware::REFERENCE });
        let mut wave = vec![100.0; 600];
        add_echo(&mut wave, 300.0, amplitude * 16_384.0, bench.width);
        let echo = bench.see(&wave).first().copied().expect("an echo above the threshold");
        bench.error_mm(&echo, 300.0) / 1e3
    };
    for (ratio, expected_m) in [(1.01, 0.702), (10.0, 0.154), (90.0, 0.0505)] {
        let walk_m = quiet(TimingMethod::RisingEdge.code(), ratio * threshold);
        assert!((walk_m - expected_m).abs() < 0.012, "A/T {ratio}: {walk_m} m");
        let error_m = quiet(TimingMethod::ConstantFraction.code(), ratio * threshold);
        assert!(error_m.abs() < 0.012, "A/T {ratio}: a constant fraction is {error_m} m off");
    }
}

#[test]
fn no_method_but_the_rising_edge_walks_from_the_threshold_to_a_hundred_times_full_scale() {
    // The table of benches/record/detector.md, Timing methods.
    const METHODS: [TimingMethod; 4] = [
        TimingMethod::RisingEdge,
        TimingMethod::Parabola,
        TimingMethod::ConstantFraction,
        TimingMethod::WalkCorrected,
    ];
    let mut edge_mm = f64::MAX;
    for albedo in [0.006, 0.06, 0.36, 1.5, 6.0, 30.0] {
        print!("albedo {albedo:5} at 60 m, bias ± spread, mm:");
        for method in METHODS {
            let mut sensor = Sensor::new(Settings { timing: method.code(), ..Settings::default() });
            let at_phase = |phase| sensor.at_phase(albedo, 60.0, f64::from(phase) / 32.0, 40);
            let errors: Vec<f64> = (0..32).flat_map(at_phase).map(|(_, error)| error).collect();
            assert_eq!(errors.len(), 32 * 40, "{method:?}, albedo {albedo}: each is found");
            let (bias_mm, spread_mm) = mean_and_deviation(&errors);
            print!("  {method:?} {bias_mm:.1} ± {spread_mm:.1}");
            if method == TimingMethod::RisingEdge {
                assert!(bias_mm > 100.0 && bias_mm < edge_mm, "albedo {albedo}: {bias_mm} mm");
                edge_mm = bias_mm;
                continue;
            }
            let doubt_mm = 4.0 * spread_mm / (errors.len() as f64).sqrt();
            assert!(bias_mm.abs() < 1.2 + doubt_mm, "{method:?}, albedo {albedo}: {bias_mm} mm");
        }
        println!();
    }
}

#[test]
fn detection_follows_the_theory_of_the_matched_filter() {
    // P_D = Q(k − d′), d′ = S √(¾ f_s τ). Noise moves the top to a higher sample, so slightly more
    // echoes are found.
    const RUNS: u32 = 3_000;
    for bins in [HALF_GS, ONE_GS, THREE_GS] {
        let mut bench =
            Bench::new(&Settings { snr_threshold_milli: 4_000, ..at_rate(bins) }, WHITE);
        for d in [2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0] {
            let amplitude = 16.0 * d / (0.75 * bench.width).sqrt();
            let mut rng = vectors::rng(9);
            let mut found = || {
                let at = 150.0 + rng.random::<f64>();
                let mut wave = noise(&mut rng, bins as usize, 200.0, 16.0);
                add_echo(&mut wave, at, amplitude, bench.width);
                bench.see(&wave).iter().any(|echo| bench.error_mm(echo, at).abs() < MM_PER_NS * 5.0)
            };
            let rate =
                f64::from((0..RUNS).map(|_| u32::from(found())).sum::<u32>()) / f64::from(RUNS);
            let expected = q(4.0 - d);
            let confidence = 3.0 * (expected * (1.0 - expected) / f64::from(RUNS)).sqrt();
            let excess = rate - expected;
            assert!(
                excess > -confidence - 0.02,
                "{bins} bins, d′ {d}: {rate} against {expected} ± {confidence}"
            );
            assert!(
                excess < confidence + 0.045,
                "{bins} bins, d′ {d}: {rate} against {expected} ± {confidence}"
            );
        }
    }
}

/// Share of the windows of 800 ns with a false alarm at k = 4, of a σ̂ from the window itself.
///
/// Monte Carlo in floating point with σ known: 0.0109, 0.0136, 0.0150 (± 0.0002 to 0.0004); Rice's
/// rate of a continuous signal is 0.0154. A σ̂ that scatters by ε raises a rate of e^(−k²/2) by
/// e^(k⁴ε²/2), and 1.4826·MAD of N samples has ε = 1.167/√N.
fn false_alarms(bins: i32) -> f64 {
    let known_sigma = match bins {
        HALF_GS => 0.0109,
        ONE_GS => 0.0136,
        _ => 0.0150,
    };
    known_sigma * libm::exp(128.0 * 1.167f64.powi(2) / f64::from(bins))
}

#[test]
fn false_alarms_follow_the_theory_when_sigma_is_measured_from_the_same_window() {
    const WINDOWS: u32 = 30_000;
    for bins in [HALF_GS, ONE_GS, THREE_GS] {
        let expected = false_alarms(bins);
        let mut bench =
            Bench::new(&Settings { snr_threshold_milli: 4_000, ..at_rate(bins) }, WHITE);
        let mut rng = vectors::rng(7);
        let mut alarm = || !bench.see(&noise(&mut rng, bins as usize, 200.0, 16.0)).is_empty();
        let alarms = f64::from((0..WINDOWS).map(|_| u32::from(alarm())).sum::<u32>());
        let (rate, confidence) =
            (alarms / f64::from(WINDOWS), 3.0 * alarms.sqrt() / f64::from(WINDOWS));
        println!("{bins} bins: {rate:.4}, theory {expected:.4}");
        assert!(
            (rate - expected).abs() < confidence + 0.06 * expected,
            "{bins} bins: {rate} against {expected}"
        );
    }
}

#[test]
fn quantisation_widens_the_spread_as_in_the_table() {
    // S = 10 at 1 GS/s: 8 bits suffice from 5 % of full scale on; at 0.5 % they double the spread,
    // and 12 bits do not.
    for (adc_bits, share, expected_mm) in
        [(8, 0.05, 21.6), (12, 0.05, 21.3), (8, 0.005, 45.8), (12, 0.005, 21.7)]
    {
        let hardware = Hardware { adc_bits, ..WHITE };
        let amplitude = share * f64::from(hardware.full_scale_code());
        let settings = Settings { snr_threshold_milli: 3_000, ..at_rate(ONE_GS) };
        let mut bench = Bench::new(&settings, hardware);
        let errors = {
            let mut rng = vectors::rng(4);
            let mut error = || {
                let at = 150.0 + rng.random::<f64>();
                let ambient = 20.0 + rng.random::<f64>();
                let mut wave = noise(&mut rng, 400, ambient, amplitude / 10.0);
                add_echo(&mut wave, at, amplitude, bench.width);
                let echo = bench.see(&wave).first().copied()?;
                Some(bench.error_mm(&echo, at))
            };
            (0..6_000).filter_map(|_| error()).collect::<Vec<_>>()
        };
        assert!(errors.len() > 5_800, "{adc_bits} bits, {share}: {} found", errors.len());
        let spread = spread(&errors);
        // At σ = 0.13 code, the fraction of the ambient's code dominates.
        let within = if adc_bits == 8 && share < 0.01 { 0.25 } else { 0.05 };
        assert!(
            (spread / expected_mm - 1.0).abs() < within,
            "{adc_bits} bits, {share}: {spread} against {expected_mm} mm"
        );
    }
}

#[test]
fn reflectivity_of_whole_and_clipped_echoes_is_that_of_the_wall() {
    // (albedo, range, bound of the mean's relative error, bound of the relative spread)
    let mut sensor = Sensor::new(at_rate(TWO_GS));
    for (albedo, range_m, bias, single) in [
        (0.1, 90.0, 0.02, 0.08),
        (0.5, 100.0, 0.02, 0.06),
        (0.1, 60.0, 0.02, 0.05),
        (0.5, 30.0, 0.02, 0.06),
        (2.0, 60.0, 0.02, 0.06),
        (5.0, 60.0, 0.03, 0.1),
    ] {
        let seen: Vec<f64> = (0..800)
            .filter_map(|beam| sensor.see(albedo, range_m + 0.01 * f64::from(beam % 31), beam))
            .map(|(echo, _)| echo.reflectivity_ratio().to_num::<f64>() / albedo)
            .collect();
        assert!(
            (mean(&seen) - 1.0).abs() < bias,
            "albedo {albedo} at {range_m} m: {}",
            mean(&seen)
        );
        assert!(spread(&seen) < single, "albedo {albedo} at {range_m} m: spread {}", spread(&seen));
    }
}

#[test]
fn reflectivity_does_not_depend_on_power_gain_width_or_rate() {
    let settings = [
        at_rate(ONE_GS),
        Settings { power_uw: 15_000_000, ..at_rate(ONE_GS) },
        Settings { gain_cdb: 1_000, ..at_rate(ONE_GS) },
        Settings { gain_cdb: -600, pulse_width_ps: 8_000, power_uw: 50_000_000, ..at_rate(TWO_GS) },
        Settings { denoise: DenoiseFilter::None.code(), ..at_rate(ONE_GS) },
        Settings { denoise: DenoiseFilter::Gaussian.code(), ..at_rate(ONE_GS) },
    ];
    for settings in settings {
        let mut sensor = Sensor::new(settings);
        let seen: Vec<f64> = (0..400)
            .filter_map(|beam| sensor.see(0.2, 80.0 + 0.003 * f64::from(beam), beam))
            .map(|(echo, _)| echo.reflectivity_ratio().to_num::<f64>())
            .collect();
        assert!((mean(&seen) / 0.2 - 1.0).abs() < 0.04, "{:?}: {}", sensor.settings, mean(&seen));
    }
}

/// Echoes of a wall seen by `beams` beams over the link, with their range errors, mm.
fn through_the_link(
    settings: &Settings,
    albedo: f64,
    range_m: f64,
    beams: u32,
) -> Vec<(Echo, f64)> {
    let wall = wall(albedo, range_m);
    let scene = SceneResponse {
        beams: (0..=beams).collect(),
        returns: vec![wall; beams as usize],
        ..SceneResponse::default()
    };
    let pattern = echoloop_dsp::ScanPattern::Grid(echoloop_dsp::Grid {
        columns: beams as u16,
        rows: 1,
        ..Default::default()
    });
    let front_end = WaveformFrontEnd::new(Receiver::default(), scene.into(), 3);
    let sensor = PcSensor::new(front_end, pattern, Hardware::REFERENCE);
    let mut client = Client::connect(InProcess(sensor), RetryPolicy::default()).expect("a sensor");
    client.configure(settings).expect("accepted settings");
    let scan = client.scan(1).expect("a scan");
    let error = |echo: &Echo| echo.range_m() * 1e3 - f64::from(wall.range_m) * 1e3;
    scan.iter().flat_map(|echoes| echoes.iter().map(|echo| (*echo, error(echo)))).collect()
}

#[test]
fn averaged_shots_improve_range_and_snr_by_the_root_of_their_number() {
    let of = |shots| {
        let seen = through_the_link(&Settings { shots, ..at_rate(ONE_GS) }, 0.01, 60.0, 1_500);
        let errors: Vec<f64> = seen.iter().map(|(_, error)| *error).collect();
        let deviation =
            mean(&seen.iter().map(|(e, _)| e.deviation_mm().to_num()).collect::<Vec<_>>());
        let snr = mean(&seen.iter().map(|(e, _)| e.snr_ratio().to_num()).collect::<Vec<_>>());
        (spread(&errors), deviation, snr)
    };
    let (spread_mm, deviation_mm, snr) = of(1);
    for shots in [2, 4, 8, 16] {
        let root = f64::from(shots).sqrt();
        let (spread_m, deviation_m, snr_m) = of(shots);
        assert!(
            (spread_mm / spread_m / root - 1.0).abs() < 0.08,
            "{shots} shots: {spread_mm} to {spread_m} mm"
        );
        assert!(
            (deviation_mm / deviation_m / root - 1.0).abs() < 0.05,
            "{shots}: {deviation_mm} to {deviation_m} mm"
        );
        assert!((snr_m / snr / root - 1.0).abs() < 0.05, "{shots} shots: SNR {snr} to {snr_m}");
    }
}

#[test]
fn filters_rank_by_their_gain_in_signal_over_noise() {
    // The matched filter gains √(¾ f_s τ) = 1.94 at 5 samples per width; the Gaussian, half as
    // wide, 1.75; no filter, 1.
    let of = |denoise| {
        let seen = through_the_link(&Settings { denoise, ..at_rate(ONE_GS) }, 0.05, 60.0, 800);
        mean(&seen.iter().map(|(echo, _)| echo.snr_ratio().to_num()).collect::<Vec<_>>())
    };
    let (none, gaussian, matched) = (
        of(DenoiseFilter::None.code()),
        of(DenoiseFilter::Gaussian.code()),
        of(DenoiseFilter::Matched.code()),
    );
    // Without a filter, noise makes the top slightly higher.
    assert!((matched / none / 1.94 - 1.0).abs() < 0.08, "{matched} over {none}");
    assert!((gaussian / none / 1.75 - 1.0).abs() < 0.08, "{gaussian} over {none}");
}

#[test]
fn the_pre_trigger_ambient_is_right_when_half_of_the_window_is_light() {
    // Haze in 55 % of the window raises the median; before the trigger there is none.
    let amplitude = |ambient: i32| {
        let settings = Settings { ambient, ..at_rate(ONE_GS) };
        let mut bench = Bench::new(&settings, Hardware::REFERENCE);
        let mut rng = vectors::rng(8);
        let before = if ambient == AmbientEstimator::PreTrigger.code() { PRE_TRIGGER } else { 0 };
        let mut wave = noise(&mut rng, before + ONE_GS as usize, 200.0, 4.0);
        for value in &mut wave[before + 100..before + 100 + 437] {
            *value += 300.0;
        }
        add_echo(&mut wave, (before + 650) as f64, 1_000.0, bench.width);
        let echoes = bench.see(&wave);
        let far = echoes
            .iter()
            .find(|echo| (bench.error_mm(echo, 650.0)).abs() < 100.0)
            .expect("the wall");
        far.amplitude_fraction().to_num::<f64>() * 4096.0
    };
    let (median, before, none) = (
        amplitude(0),
        amplitude(AmbientEstimator::PreTrigger.code()),
        amplitude(AmbientEstimator::None.code()),
    );
    assert!((before - 1_000.0).abs() < 20.0, "before the trigger: {before}");
    // The filter passes an offset of the baseline whole and the pulse by three quarters, so the
    // amplitude is off by offset · 4/3.
    assert!((median - 600.0).abs() < 20.0, "the median takes the haze for ambient: {median}");
    assert!(
        (none - 1_267.0).abs() < 20.0,
        "with none removed the ambient counts as signal: {none}"
    );
}

#[test]
fn pre_trigger_samples_are_dark_even_in_front_of_a_near_wall() {
    for range_m in [3.0, 60.0] {
        let settings = Settings { ambient: AmbientEstimator::PreTrigger.code(), ..at_rate(ONE_GS) };
        let seen = through_the_link(&settings, 0.1, range_m, 200);
        assert_eq!(seen.len(), 200);
        let biases: Vec<f64> = seen.iter().map(|(_, error)| *error).collect();
        assert!(mean(&biases).abs() < 40.0, "{range_m} m: {} mm", mean(&biases));
    }
}

#[test]
fn equal_echoes_split_where_a_matched_filter_can_split_them() {
    // ΔR = 1.14 · cτ/2 = 0.854 m. From there on two echoes, each near its place and flagged as
    // merged; well below it one.
    const RUNS: usize = 200;
    let near_mm = 1.14 * MM_PER_NS * 5.0;
    for bins in [HALF_GS, ONE_GS, 800, TWO_GS] {
        let mut bench = Bench::new(&Settings { echoes: 4, ..at_rate(bins) }, WHITE);
        let mut rng = vectors::rng(6);
        for apart in [0.75, 1.02, 1.06, 1.1, 1.2, 1.3, 1.5] {
            let gap = apart * near_mm / bench.mm_per_sample;
            let (mut two, mut errors) = (0, Vec::new());
            for _ in 0..RUNS {
                let at = 150.0 + rng.random::<f64>();
                let mut wave = noise(&mut rng, bins as usize, 200.0, 20.0);
                add_echo(&mut wave, at, 1_500.0, bench.width);
                add_echo(&mut wave, at + gap, 1_500.0, bench.width);
                let echoes = bench.see(&wave);
                if echoes.len() == 2 {
                    two += 1;
                    let near = |echo: &Echo| {
                        bench.error_mm(echo, at).abs().min(bench.error_mm(echo, at + gap).abs())
                    };
                    errors.extend(echoes.iter().map(near));
                    let merged = echoes.iter().any(|echo| echo.flags.contains(Flags::MERGED));
                    assert!(
                        merged || !(1.0..1.25).contains(&apart),
                        "{bins} bins, {apart}: overlapping echoes say so"
                    );
                }
            }
            let case = format!("{bins} bins, {apart} of the limit: {two} of {RUNS} split");
            if apart < 1.0 {
                assert!(two < RUNS / 20, "{case}");
            } else {
                assert!(two > RUNS * 95 / 100, "{case}");
                // Reached at 1.2 of the limit: 100 and 64.
                let beside_mm = if bins == HALF_GS { 150.0 } else { 90.0 };
                assert!(mean(&errors) < beside_mm, "{case}, {} mm beside the truth", mean(&errors));
            }
        }
    }
}

#[test]
fn a_bright_or_clipped_wall_is_one_echo_however_many_are_asked_for() {
    for bins in [ONE_GS, TWO_GS, THREE_GS] {
        let mut sensor = Sensor::new(Settings { echoes: 4, ..at_rate(bins) });
        for albedo in [0.05, 0.2, 1.0, 20.0, 300.0, 3_000.0] {
            for beam in 0..200 {
                sensor.expose(wall(albedo, 60.0), beam);
                let echoes = sensor.echoes();
                // Noise may give another one in the window of 800 ns.
                let near = echoes.iter().filter(|echo| (echo.range_m() - 60.0).abs() < 5.0);
                assert_eq!(near.count(), 1, "{bins} bins, albedo {albedo}, beam {beam}");
            }
        }
    }
}

#[test]
fn echoes_that_walk_or_are_cut_off_by_the_window_have_no_sigma() {
    let mut sensor =
        Sensor::new(Settings { timing: TimingMethod::Parabola.code(), ..at_rate(ONE_GS) });
    let (echo, _) = sensor.see(5.0, 60.0, 0).expect("an echo");
    assert_eq!(echo.deviation, u16::MAX);
    let mut sensor = Sensor::new(at_rate(ONE_GS));
    let (echo, _) = sensor.see(0.1, 1.1, 0).expect("an echo");
    assert!(echo.flags.contains(Flags::TRUNCATED));
    assert_eq!(echo.deviation, u16::MAX);
}

#[test]
fn a_slanted_surface_is_one_echo_however_many_are_asked_for() {
    // A footprint spread over up to a metre is one broad echo whose range is its middle.
    let settings = Settings { echoes: 4, ..at_rate(TWO_GS) };
    let mut bench = Bench::new(&settings, WHITE);
    let mut rng = vectors::rng(6);
    for depth_mm in [200.0, 500.0, 1_000.0] {
        let mut several = 0;
        for _ in 0..300 {
            let at = 400.0 + rng.random::<f64>();
            let mut wave = noise(&mut rng, TWO_GS as usize, 200.0, 10.0);
            for slice in 0..41 {
                let offset = (f64::from(slice) / 40.0 - 0.5) * depth_mm / bench.mm_per_sample;
                add_echo(&mut wave, at + offset, 1_500.0 / 41.0, bench.width);
            }
            let echoes = bench.see(&wave);
            several += u32::from(echoes.len() != 1);
            assert!(bench.error_mm(&echoes[0], at).abs() < 60.0 + 0.3 * depth_mm);
        }
        assert!(several <= 3, "{depth_mm} mm deep: {several} of 300 fall apart");
    }
}

/// Number of windows, of `of`, with a false alarm at this irradiance.
fn alarms(irradiance_w_m2_nm: f64, settings: Settings, of: u32) -> f64 {
    let mut sensor = Sensor::new(Settings { snr_threshold_milli: 4_000, ..settings });
    sensor.receiver.irradiance_w_m2_nm = irradiance_w_m2_nm;
    let nothing = Return { range_m: 50.0, strength_per_m2: 0.0 };
    let mut alarm = |beam: u32| {
        sensor.expose_all_shots(nothing, beam);
        let echoes = sensor.echoes();
        u32::from(!echoes.is_empty())
    };
    f64::from((0..of).map(&mut alarm).sum::<u32>())
}

#[test]
fn with_a_black_level_false_alarms_in_the_dark_are_those_of_the_theory() {
    // The noise without light is 6.7 codes, the black level 41.
    const WINDOWS: u32 = 20_000;
    for bins in [HALF_GS, ONE_GS, THREE_GS] {
        let expected = false_alarms(bins);
        for irradiance_w_m2_nm in [0.0, 0.65] {
            let lifted = Settings { black_level_ppm: 10_000, ..at_rate(bins) };
            let alarms = alarms(irradiance_w_m2_nm, lifted, WINDOWS);
            let (rate, confidence) =
                (alarms / f64::from(WINDOWS), 3.0 * alarms.sqrt() / f64::from(WINDOWS));
            assert!(
                (rate - expected).abs() < confidence + 0.06 * expected,
                "{bins} bins, irradiance {irradiance_w_m2_nm}: {rate} against {expected}"
            );
        }
    }
}

#[test]
fn clipped_noise_makes_no_more_false_alarms_than_whole_noise() {
    const WINDOWS: u32 = 2_000;
    let gains = [-1_000, 0, 2_000, 3_000];
    let rates = [HALF_GS, ONE_GS, THREE_GS];
    let sensors = gains.into_iter().flat_map(|gain| rates.map(|bins| (gain, bins)));
    for (gain_cdb, bins) in sensors {
        for (shots, irradiance_w_m2_nm) in
            [1, 2, 16].into_iter().flat_map(|shots| [0.0, 0.02, 0.1].map(|light| (shots, light)))
        {
            let settings = Settings { gain_cdb, shots, ..at_rate(bins) };
            let rate = alarms(irradiance_w_m2_nm, settings, WINDOWS) / f64::from(WINDOWS);
            let case = format!("{gain_cdb} cdB, {bins} bins, {shots} shots, {irradiance_w_m2_nm}");
            println!("{case}: {rate}");
            let expected = false_alarms(bins);
            let confidence = 3.0 * (expected / f64::from(WINDOWS)).sqrt();
            assert!(rate < expected + confidence, "{case}: {rate} for {expected}");
        }
    }
}

#[test]
fn in_the_dark_a_wall_is_found_as_far_as_its_echo_stands_out() {
    for (gain_cdb, bins) in [(0, ONE_GS), (2_000, ONE_GS), (2_000, THREE_GS)] {
        let mut sensor = Sensor::new(Settings { gain_cdb, ..at_rate(bins) });
        sensor.receiver.irradiance_w_m2_nm = 0.0;
        let mut errors = Vec::new();
        for beam in 0..400 {
            errors.extend(sensor.see(0.04, 60.0, beam).map(|(_, error_mm)| error_mm));
        }
        let near = errors.iter().filter(|error| error.abs() < 100.0).count();
        assert!(near >= 396, "{gain_cdb} cdB, {bins} bins: {near} of 400");
        assert!(mean(&errors).abs() < 10.0, "{gain_cdb} cdB, {bins}: {} mm", mean(&errors));
    }
}

#[test]
fn a_black_level_changes_no_range_and_raises_the_codes() {
    let see = |black_level_ppm, albedo| {
        let mut sensor = Sensor::new(Settings { black_level_ppm, ..at_rate(ONE_GS) });
        let (echo, error_mm) = sensor.see(albedo, 60.0, 3).expect("an echo");
        (echo, error_mm, sensor.codes.iter().copied().max())
    };
    let ((plain, error_mm, top), (lifted, lifted_mm, lifted_top)) = (see(0, 0.1), see(10_000, 0.1));
    assert!((error_mm - lifted_mm).abs() < 0.5, "{error_mm} and {lifted_mm} mm");
    assert!(plain.amplitude.abs_diff(lifted.amplitude) < 16, "{plain:?} and {lifted:?}");
    assert_eq!(lifted_top.zip(top).map(|(a, b)| a - b), Some(41), "1 % of 4096 codes");
    let (clipped, clipped_mm, _) = see(10_000, 2.0);
    assert!(clipped.flags.contains(Flags::SATURATED) && clipped_mm.abs() < 10.0, "{clipped_mm} mm");
}

/// Largest mean error over 64 sub-sample phases, mm.
fn worst_bias_mm(sensor: &mut Sensor, albedo: f64) -> f64 {
    let mut bias = |phase: u32| {
        let range_m = sensor.at(60.0, f64::from(phase) / 64.0);
        let mut error = |beam| sensor.see_with_all_shots(albedo, range_m, beam).expect("an echo").1;
        let errors: Vec<f64> = (0..60).map(&mut error).collect();
        mean(&errors).abs()
    };
    (0..64).map(&mut bias).fold(0.0, f64::max)
}

#[test]
fn four_dithered_shots_leave_less_than_5_mm_of_bias_at_every_phase() {
    for bins in [ONE_GS, 800, TWO_GS] {
        for albedo in [0.1, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0] {
            let bias_mm = |dither| {
                let settings = Settings { shots: 4, dither, ..at_rate(bins) };
                worst_bias_mm(&mut Sensor::new(settings), albedo)
            };
            let (dithered_mm, plain_mm) = (bias_mm(1), bias_mm(0));
            println!(
                "{bins} bins, albedo {albedo}: {dithered_mm:.2} mm, not dithered {plain_mm:.2}"
            );
            assert!(dithered_mm < 5.0, "{bins} bins, albedo {albedo}: {dithered_mm} mm");
        }
    }
}
