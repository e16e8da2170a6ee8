//! The simulated front end against physics: link budget, energy, noise, quantisation, sub-rays, and
//! the effect of every option.
//!
//! All Monte Carlo is seeded; comments give bounds in standard errors.

use std::f64::consts::PI;
use std::sync::Arc;

use echoloop_closed_loop::config::{JitterPer, Motion, RunConfig, ScannerConfig};
use echoloop_closed_loop::dataset::{Place, respond_at};
use echoloop_clouds::Pose;
use echoloop_dsp::{Echo, Hardware, Pipeline, Scratch, Settings};
use echoloop_frontend::{Analog, FrontEnd, Trigger};
use echoloop_frontend::{Mode, Precipitation, Receiver, WaveformFrontEnd, Weather, litl};
use echoloop_frontend::{Return, SceneResponse};
use echoloop_sensor::afe::delay_fs;
use echoloop_sensors::boards::pc::hardware_for;
use echoloop_sensors::sensor::{Model, Sensor, View};
use echoloop_sim::raycast::Raycaster;
use echoloop_sim::scanner::{self, BeamOptics};
use echoloop_sim::scene::{MATERIALS, Material, Mesh, Scene};
use echoloop_tests::moments::mean_and_deviation;

/// Range per nanosecond of round trip, m.
const METRES_PER_NS: f64 = 0.299_792_458 / 2.0;

/// Settings at 1 GS/s with a window that begins with the pulse.
const ANALOG: Analog = Analog {
    power_w: 75.0,
    pulse_width_ns: 5.0,
    gain_db: 0.0,
    sample_period_ns: 1.0,
    delay_ns: 0.0,
    ..Analog::USUAL
};

/// A receiver without noise: the rest of the shot noise is below 10⁻¹⁵⁰ µA.
fn silent() -> Receiver {
    Receiver {
        adc_bits: 14,
        irradiance_w_m2_nm: 0.0,
        amplifier_noise_na: 0.0,
        bandwidth_mhz: f64::MIN_POSITIVE,
        ..Receiver::default()
    }
}

fn one_beam(returns: &[Return]) -> Arc<SceneResponse> {
    Arc::new(SceneResponse {
        beams: vec![0, returns.len() as u32],
        returns: returns.to_vec(),
        ..SceneResponse::default()
    })
}

fn wall(range_m: f64, rho: f64) -> Return {
    Return { range_m: range_m as f32, strength_per_m2: (rho / PI / range_m / range_m) as f32 }
}

fn shot(front_end: &mut WaveformFrontEnd, analog: &Analog, frame: u32, samples: usize) -> Vec<u16> {
    let mut codes = vec![0; samples + analog.pre_trigger];
    front_end.capture(analog, Trigger { frame, beam: 0, shot: 0 }, &mut codes);
    codes
}

/// Codes of one shot.
fn waveform(receiver: &Receiver, analog: &Analog, returns: &[Return], samples: usize) -> Vec<u16> {
    shot(&mut WaveformFrontEnd::new(receiver.clone(), one_beam(returns), 1), analog, 0, samples)
}

/// Mean and variance of every sample over many shots, codes.
fn ensemble(
    receiver: &Receiver,
    analog: &Analog,
    returns: &[Return],
    samples: usize,
    shots: u32,
) -> Vec<(f64, f64)> {
    let mut front_end = WaveformFrontEnd::new(receiver.clone(), one_beam(returns), 1);
    let mut sums = vec![(0.0, 0.0); samples + analog.pre_trigger];
    for frame in 0..shots {
        for (sum, code) in sums.iter_mut().zip(shot(&mut front_end, analog, frame, samples)) {
            let code = f64::from(code);
            *sum = (sum.0 + code, sum.1 + code * code);
        }
    }
    let n = f64::from(shots);
    sums.into_iter()
        .map(|(sum, squares)| (sum / n, (squares - sum * sum / n) / (n - 1.0)))
        .collect()
}

/// A front end with the firmware's detector.
struct Bench {
    front_end: WaveformFrontEnd,
    analog: Analog,
    samples: usize,
    pipeline: Pipeline,
    scratch: Scratch,
}

impl Bench {
    fn new(receiver: &Receiver, returns: &[Return]) -> Self {
        let settings = Settings { bins: 794, upsampling: 8, ..Settings::default() };
        let hardware = hardware_for(receiver);
        let period_fs = echoloop_dsp::hardware::sample_period_fs(794, &hardware);
        let analog = Analog {
            sample_period_ns: f64::from(period_fs) / 1e6,
            delay_ns: f64::from(delay_fs(&settings, &hardware)) / 1e6,
            ..ANALOG
        };
        Self {
            front_end: WaveformFrontEnd::new(receiver.clone(), one_beam(returns), 1),
            analog,
            samples: 794,
            pipeline: Pipeline::new(&settings, &hardware).expect("accepted settings"),
            scratch: Scratch::new(),
        }
    }

    /// Strongest echo of a scan.
    fn see(&mut self, frame: u32) -> Option<Echo> {
        let codes = shot(&mut self.front_end, &self.analog, frame, self.samples);
        echoloop_kernels::process(&self.pipeline, &codes, &mut self.scratch).first().copied()
    }

    /// Ranges of many scans, m.
    fn ranges_m(&mut self, scans: u32) -> Vec<f64> {
        (0..scans).filter_map(|frame| self.see(frame)).map(|echo| echo.range_m()).collect()
    }
}

// The link budget, energy and noise.

#[test]
fn the_link_budget_agrees_with_the_table_of_the_physics() {
    // The table's currents include the extinction of clear air, 9·10⁻⁵ /m.
    let receiver = Receiver { extinction_per_m: 9e-5, ..Receiver::default() };
    let near = |got: f64, expected: f64| (got / expected - 1.0).abs() < 0.006;
    assert!(near(receiver.ambient_w(), 3.2e-9), "{}", receiver.ambient_w());
    for (range_m, current_ua) in [(10.0, 448.0), (50.0, 17.8), (100.0, 4.4), (200.0, 1.08)] {
        let got = receiver.peak_current_ua(75.0, range_m, 0.1 / PI / range_m / range_m);
        assert!(near(got, current_ua), "{range_m} m: {got} µA");
    }
    let far = receiver.peak_current_ua(75.0, 200.0, 0.1 / PI / 200.0 / 200.0);
    let snr = far / receiver.quiescent_variance_ua2().sqrt();
    assert!((snr / 12.6 - 1.0).abs() < 0.01, "A/σ {snr}");
}

#[test]
fn a_pulse_carries_exactly_its_power_times_its_width() {
    // Σ x·Δ of a sin² pulse over a whole number of samples is A·W at every phase; the rounding of
    // codes leaves an error below 1/A.
    let receiver = silent();
    for width_ns in [2.0, 3.1, 5.0, 8.0, 13.7, 20.0] {
        for samples in [5, 8, 17, 40] {
            for (phase, power_w) in (0..16).zip([20.0, 50.0, 75.0, 100.0].into_iter().cycle()) {
                let sample_period_ns = 2.0 * width_ns / f64::from(samples);
                let delay_ns = -sample_period_ns * f64::from(phase) / 16.0;
                let analog = Analog {
                    power_w,
                    pulse_width_ns: width_ns,
                    sample_period_ns,
                    delay_ns,
                    ..ANALOG
                };
                let echo = wall(30.0, 0.3 * 12.0 / power_w);
                let codes = waveform(
                    &receiver,
                    &analog,
                    &[echo],
                    (200.0 / sample_period_ns) as usize + samples as usize + 3,
                );
                let sum_ns = codes.iter().map(|&c| f64::from(c)).sum::<f64>() * sample_period_ns;
                let per_code_ua = receiver.full_scale_ua / 16_384.0;
                let per_w_ua = receiver.peak_current_ua(1.0, 30.0, echo.strength_per_m2.into());
                let energy_nj = sum_ns * per_code_ua / per_w_ua;
                let error = energy_nj / (power_w * width_ns) - 1.0;
                let peak = power_w * per_w_ua / per_code_ua;
                assert!(
                    error.abs() < 1.0 / peak + 1e-6,
                    "W {width_ns} ns, {samples} samples, phase {phase}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn shot_noise_grows_linearly_with_the_signal_at_the_slope_of_the_physics() {
    const SHOTS: u32 = 6_000;
    let receiver = Receiver { adc_bits: 14, ..Receiver::default() };
    let analog = Analog { pulse_width_ns: 20.0, ..ANALOG };
    let per_ua = 16_384.0 / receiver.full_scale_ua;
    let all = ensemble(&receiver, &analog, &[wall(30.0, 0.05)], 300, SHOTS);
    let quiet = receiver.quiescent_current_ua();
    let confidence = (2.0 / f64::from(SHOTS)).sqrt(); // of one sample's variance
    let (mut products, mut squares) = (0.0, 0.0);
    for (n, &(mean, variance)) in all.iter().enumerate().skip(200).take(40) {
        let signal_ua = mean / per_ua - quiet;
        let variance_ua2 = (variance - 1.0 / 12.0) / per_ua / per_ua;
        let expected = receiver.quiescent_variance_ua2() + receiver.shot_variance_ua() * signal_ua;
        assert!(
            (variance_ua2 / expected - 1.0).abs() < 4.5 * confidence,
            "sample {n}: {variance_ua2} against {expected}"
        );
        products +=
            signal_ua * (variance_ua2 - receiver.quiescent_variance_ua2()) / expected.powi(2);
        squares += signal_ua * signal_ua / expected.powi(2);
    }
    let slope = products / squares;
    // One standard error of the slope, about 0.5 %.
    let error = confidence / squares.sqrt() / receiver.shot_variance_ua();
    assert!(error < 0.01, "{error}");
    assert!((slope / receiver.shot_variance_ua() - 1.0).abs() < 4.0 * error, "{slope} µA");
}

#[test]
fn ambient_light_does_not_depend_on_range() {
    const SHOTS: u32 = 2_000;
    let receiver = Receiver { adc_bits: 14, irradiance_w_m2_nm: 10.0, ..Receiver::default() };
    // From benches/record/physics.md by hand: 10 W/m²/nm are 49.22 nW on the diode, 2.6945 µA of 30
    // µA.
    let expected = 1_471.542;
    let analog = Analog { pre_trigger: 100, ..ANALOG };
    for range_m in [5.0, 30.0, 100.0] {
        let all = ensemble(&receiver, &analog, &[wall(range_m, 0.01)], 800, SHOTS);
        let sigma = all[0].1.sqrt();
        // Before the shot, and in parts of the window without an echo.
        for span in [0..100, 100..130, 500..600, 820..900] {
            let count = span.len() as f64 * f64::from(SHOTS);
            let mean = all[span.clone()].iter().map(|s| s.0).sum::<f64>() / span.len() as f64;
            assert!(
                (mean - expected).abs() < 4.0 * sigma / count.sqrt(),
                "{range_m} m, {span:?}: {mean} of {expected}"
            );
        }
    }
}

/// Range error of a parabola behind a matched filter, mm: the estimator of the physics' table.
fn filter_error_mm(codes: &[u16], centre: f64) -> f64 {
    let tap = |k: i32| 0.5 + 0.5 * (PI * f64::from(k) / 5.0).cos();
    let y = |n: i32| (-4..=4).map(|k| tap(k) * f64::from(codes[(n + k) as usize])).sum::<f64>();
    let near = centre.round() as i32;
    let top = (near - 8..=near + 8).max_by(|&a, &b| y(a).total_cmp(&y(b))).unwrap();
    let (before, at, after) = (y(top - 1), y(top), y(top + 1));
    let curvature = before - 2.0 * at + after;
    let delta =
        if curvature < 0.0 { ((before - after) / (2.0 * curvature)).clamp(-0.5, 0.5) } else { 0.0 };
    (f64::from(top) + delta - centre) * METRES_PER_NS * 1e3
}

#[test]
fn quantisation_widens_the_spread_as_in_the_table_of_the_physics() {
    const LEVELS: u32 = 100;
    const PHASES: u32 = 60;
    // (amplitude relative to full scale, bits, mm, tolerance) for S = 10 at 1 GS/s,
    // benches/record/physics.md §4.
    for (fraction, bits, table_mm, within) in [
        (0.05, 8, 21.6, 0.04),
        (0.05, 12, 21.3, 0.04),
        (0.005, 8, 45.8, 0.12),
        (0.005, 12, 21.7, 0.04),
    ] {
        let amplitude_ua = 30.0 * fraction;
        let mut squares = 0.0;
        for level in 0..LEVELS {
            // A level anywhere between two codes of 8 bits.
            let offset_na = 1e3 * 30.0 * (0.2 + f64::from(level) / f64::from(LEVELS) / 256.0);
            let receiver = Receiver {
                adc_bits: bits,
                amplifier_noise_na: 1e3 * amplitude_ua / 10.0,
                surface_dark_current_na: offset_na,
                ..silent()
            };
            for phase in 0..PHASES {
                let centre = 100.0 + f64::from(phase) / f64::from(PHASES);
                let range_m = (centre - 5.0) * METRES_PER_NS;
                let unit = receiver.peak_current_ua(75.0, range_m, 1.0);
                let echo = Return {
                    range_m: range_m as f32,
                    strength_per_m2: (amplitude_ua / unit) as f32,
                };
                let mut front_end =
                    WaveformFrontEnd::new(receiver.clone(), one_beam(&[echo]), level.into());
                squares +=
                    filter_error_mm(&shot(&mut front_end, &ANALOG, phase, 200), centre).powi(2);
            }
        }
        // Standard error 0.9 % for normal errors.
        let std_mm = (squares / f64::from(LEVELS * PHASES)).sqrt();
        assert!(
            (std_mm / table_mm - 1.0).abs() < within,
            "{bits} bits at {fraction}: {std_mm} of {table_mm} mm"
        );
    }
}

// Sub-rays.

const MATT: Material =
    Material { name: "matt", reflectance_905nm: 0.1, specular_f0: 0.0, roughness: 1.0 };

/// A square of ± 100 m through (x, 0, 0), turned about z.
fn plane(x: f32, turn: f32) -> Mesh {
    let mut mesh = Mesh::default();
    let (sin, cos) = turn.sin_cos();
    for (along, z) in [(100.0, -100.0), (-100.0, -100.0), (-100.0, 100.0), (100.0, 100.0)] {
        mesh.vertices.push([x - sin * along, cos * along, z]);
    }
    mesh.triangles.extend([[0, 1, 2], [0, 2, 3]]);
    mesh.materials.extend([0, 0]);
    mesh
}

#[test]
fn results_do_not_depend_on_the_number_of_sub_rays() {
    const SCANS: u32 = 1_000;
    // 95 m, ρ 0.1: an echo of about 5 µA, A/σ about 50 in quiet air; its Cramér–Rao bound is that
    // of benches/record/physics.md §4.
    for turn_deg in [0.0_f32, 30.0, 60.0] {
        let caster = Raycaster::from_mesh(&plane(95.0, turn_deg.to_radians()));
        let mut means = Vec::new();
        let mut bound_mm = 0.0;
        for subrays in [1, 3, 5, 7, 9] {
            let optics = BeamOptics { subrays, ..BeamOptics::default() };
            let response =
                scanner::scan(&caster, &[MATT], &Pose::identity(), &[[1.0, 0.0, 0.0]], &optics);
            let receiver = Receiver { subrays, ..Receiver::default() };
            let mut bench = Bench::new(&receiver, response.of(0));
            let (mean, std) = mean_and_deviation(&bench.ranges_m(SCANS));
            let strength: f32 = response.of(0).iter().map(|r| r.strength_per_m2).sum();
            let amplitude_ua = receiver.peak_current_ua(75.0, 95.0, strength.into());
            let noise_ua = receiver.quiescent_variance_ua2()
                + 0.5 * receiver.shot_variance_ua() * amplitude_ua;
            let snr = amplitude_ua / noise_ua.sqrt();
            bound_mm = 1e3 * 2.0 * METRES_PER_NS * 5.0 / PI / (snr * 5f64.sqrt());
            assert!(std * 1e3 > 0.9 * bound_mm, "{subrays}²: {std} m beats {bound_mm} mm");
            means.push(mean * 1e3);
        }
        let spread = means.iter().fold(0.0, |most: f64, m| most.max((m - means[0]).abs()));
        assert!(spread < bound_mm, "{turn_deg}°: {means:?} mm, bound {bound_mm} mm");
        assert!((means[0] - 95_000.0).abs() < bound_mm, "{turn_deg}°: {means:?}");
    }
}

// Weather.

fn in_weather(receiver: Receiver, kind: Precipitation, value: f64) -> Receiver {
    Receiver { weather: Weather { kind, visibility_m: value, rate_mm_h: value }, ..receiver }
}

#[test]
fn a_target_in_fog_is_weaker_by_the_extinction_of_the_round_trip() {
    // A bright target, so that the light of the fog is below 10⁻³ of it.
    for (range_m, visibility_m) in [(10.0, 50.0), (20.0, 100.0), (60.0, 200.0)] {
        let peak = |receiver: &Receiver| {
            let mut analog = Analog { power_w: 5.0, gain_db: -30.0, ..ANALOG };
            analog.delay_ns = 2.0 / 0.299_792_458 * range_m - 20.0;
            // 25 µA of 30 in clear air, at −30 dB.
            let strength = 25.0 * 1000f64.sqrt() / silent().peak_current_ua(5.0, range_m, 1.0);
            let echo = Return { range_m: range_m as f32, strength_per_m2: strength as f32 };
            let codes = waveform(receiver, &analog, &[echo], 60);
            f64::from(codes[20..].iter().copied().max().unwrap())
        };
        let fog = in_weather(silent(), Precipitation::Fog, visibility_m);
        let expected = (-2.0 * 20f64.ln() / visibility_m * range_m).exp();
        let got = peak(&fog) / peak(&silent());
        let rounding = 2.0 / peak(&fog);
        assert!(
            (got / expected - 1.0).abs() < 0.012 + rounding,
            "{range_m} m in {visibility_m} m: {got} of {expected}"
        );
        let alpha = fog.extinction_per_m();
        assert!(
            (fog.peak_current_ua(75.0, range_m, 1e-3)
                / silent().peak_current_ua(75.0, range_m, 1e-3)
                / (-2.0 * alpha * range_m).exp()
                - 1.0)
                .abs()
                < 1e-9
        );
    }
}

#[test]
fn a_far_wall_in_rain_and_snow_is_weaker_by_the_extinction_of_the_round_trip() {
    // Beyond the range of single drops and flakes (60 m at most), and so bright that the medium's
    // light does not count. dB/km computed by hand from Rec. ITU-R P.1814 at 905 nm.
    let table = [
        (Precipitation::Rain, 10.0, 5.033),
        (Precipitation::Rain, 50.0, 14.80),
        (Precipitation::Snow, 1.0, 5.545),
        (Precipitation::Snow, 5.0, 51.11),
        (Precipitation::WetSnow, 1.0, 3.878),
        (Precipitation::WetSnow, 5.0, 12.36),
    ];
    for (kind, rate_mm_h, db_per_km) in table {
        for range_m in [70.0, 100.0] {
            let peak = |receiver: &Receiver| {
                let delay_ns = range_m / METRES_PER_NS - 20.0;
                let analog = Analog { power_w: 5.0, gain_db: -30.0, delay_ns, ..ANALOG };
                // 25 µA of 30 in clear air, at −30 dB.
                let strength = 25.0 * 1000f64.sqrt() / silent().peak_current_ua(5.0, range_m, 1.0);
                let echo = Return { range_m: range_m as f32, strength_per_m2: strength as f32 };
                f64::from(
                    waveform(receiver, &analog, &[echo], 60)[20..].iter().copied().max().unwrap(),
                )
            };
            let (dimmed, clear) = (peak(&in_weather(silent(), kind, rate_mm_h)), peak(&silent()));
            // e^(−2αR), from dB/km.
            let expected = 10f64.powf(-2.0 * range_m * db_per_km / 1e4);
            let got = dimmed / clear;
            // The coefficients have four digits, and both peaks are rounded.
            assert!(
                (got / expected - 1.0).abs() < 2e-3 + 1.0 / dimmed,
                "{kind:?} {rate_mm_h} mm/h, {range_m} m: {got} of {expected}"
            );
        }
    }
}

#[test]
fn backscatter_of_fog_peaks_at_short_range_grows_with_density_and_clips() {
    let peak = |visibility_m: f64, gain_db: f64| {
        let fog = in_weather(silent(), Precipitation::Fog, visibility_m);
        let codes = waveform(&fog, &Analog { gain_db, ..ANALOG }, &[], 400);
        let top = codes.iter().copied().max().unwrap();
        (codes.iter().position(|&c| c == top).unwrap() as f64, f64::from(top))
    };
    let mut previous = 0.0;
    for visibility_m in [998.0, 400.0, 200.0, 100.0, 50.0, 25.0] {
        let (at, height) = peak(visibility_m, -30.0);
        // The light of 1 to 2 m, half a pulse later.
        assert!((at - 5.0) * METRES_PER_NS < 2.0, "{visibility_m} m: peak at sample {at}");
        assert!(height > previous, "{visibility_m} m: {height} codes");
        // In proportion to 1/MOR except for the extinction on the first metres.
        let expected = height * visibility_m / 998.0 / peak(998.0, -30.0).1;
        let alpha = 20f64.ln() / visibility_m;
        assert!(
            expected < 1.01 && expected > (-2.0 * alpha * 2.0_f64).exp(),
            "{visibility_m} m: {expected}"
        );
        previous = height;
    }
    for visibility_m in [50.0, 100.0, Weather::default().visibility_m, 600.0] {
        assert_eq!(
            peak(visibility_m, 0.0).1,
            16_383.0,
            "{visibility_m} m: at 0 dB it fills the converter"
        );
    }
    assert!(peak(998.0, 0.0).1 < 16_383.0, "the thinnest fog does not");
}

#[test]
fn in_dense_fog_the_fog_is_seen_instead_of_a_far_wall() {
    let wall = [wall(60.0, 0.3)];
    let clear: Vec<f64> = Bench::new(&Receiver::default(), &wall).ranges_m(100);
    assert!(clear.iter().all(|r| (r - 60.0).abs() < 0.1) && clear.len() == 100);
    let fog = in_weather(Receiver::default(), Precipitation::Fog, 30.0);
    let ranges = Bench::new(&fog, &wall).ranges_m(100);
    assert_eq!(ranges.len(), 100);
    // A false alarm behind the air is kept in its place: light of the fog adds noise.
    let false_alarms = ranges.iter().filter(|r| **r >= 4.0).count();
    assert!(false_alarms <= 2, "{ranges:?}");
}

#[test]
fn single_drops_are_seen_near_and_differ_from_scan_to_scan_but_not_from_shot_to_shot() {
    let rain = in_weather(silent(), Precipitation::Rain, 20.0);
    let mut front_end = WaveformFrontEnd::new(rain, one_beam(&[]), 1);
    let mut codes = |frame, shot| {
        let mut codes = vec![0; 400];
        front_end.capture(&ANALOG, Trigger { frame, beam: 0, shot }, &mut codes);
        codes
    };
    assert_eq!(codes(1, 0), codes(1, 3));
    assert_ne!(codes(1, 0), codes(2, 0));
    let lit = (0..50).filter(|&frame| codes(frame, 0)[..100].iter().any(|&c| c > 160)).count();
    assert!(lit > 25, "{lit} of 50 scans show a drop above 1 % of full scale within 15 m");
}

// Channels, timing and modes.

#[test]
fn timing_jitter_spreads_ranges_by_half_the_distance_of_light() {
    const SCANS: u32 = 4_000;
    let wall = [wall(60.0, 0.1)];
    let (_, still) = mean_and_deviation(&Bench::new(&Receiver::default(), &wall).ranges_m(SCANS));
    for jitter_ns in [0.2, 0.5, 1.0] {
        let receiver = Receiver { timing_jitter_ns: jitter_ns, ..Receiver::default() };
        let (mean, std) = mean_and_deviation(&Bench::new(&receiver, &wall).ranges_m(SCANS));
        let expected = (jitter_ns * METRES_PER_NS).hypot(still);
        let confidence = 4.0 / f64::from(2 * SCANS).sqrt(); // four standard errors: 4.5 %
        assert!(
            (std / expected - 1.0).abs() < confidence,
            "{jitter_ns} ns: {std} m instead of {expected} m"
        );
        assert!(
            (mean - 60.0).abs() < 4.0 * std / f64::from(SCANS).sqrt() + 0.005,
            "{jitter_ns} ns: {mean} m"
        );
    }
}

/// Amplitude of each beam's echo, in scans of a wall by a small sensor with this configuration.
fn scans(text: &str, count: u32) -> Vec<Vec<Option<f64>>> {
    let text = format!("[scanner]\npattern = \"grid\"\ncolumns = 12\nrows = 32\n{text}");
    let config: RunConfig = toml::from_str(&text).unwrap();
    config.check().unwrap();
    let model = Model::from(&config);
    let beams = model.pattern.beams();
    let scene = Arc::new(SceneResponse {
        beams: (0..=beams).collect(),
        returns: (0..beams).map(|_| wall(60.0, 0.1)).collect(),
        ..SceneResponse::default()
    });
    let mut sensor = Sensor::in_process(&model).unwrap();
    sensor.configure(&config.lidar.0).unwrap();
    let mut scan = |scan: u32| {
        let view = View { scene: &scene, noise_seed: scan.into(), scan, viewpoint: 1 };
        let amplitude = |e: &Echo| e.amplitude_fraction().to_num();
        sensor.scan(&view).unwrap().iter().map(|echoes| echoes.first().map(amplitude)).collect()
    };
    (1..=count).map(&mut scan).collect()
}

#[test]
fn dead_channels_have_no_echoes_in_any_scan() {
    let scans = scans("[receiver]\ndead_channels = 0.25\n", 3);
    let dead: Vec<usize> = (0..32).filter(|&row| scans[0][row].is_none()).collect();
    assert!((2..=16).contains(&dead.len()), "{dead:?}"); // all but 1 in 5000 of binomial(32, ¼)
    for scan in &scans {
        for (beam, echo) in scan.iter().enumerate() {
            assert_eq!(echo.is_none(), dead.contains(&(beam % 32)), "beam {beam}");
        }
    }
}

#[test]
fn weak_channels_are_weaker_by_the_configured_loss() {
    let sound = scans("", 1).remove(0);
    let weak = scans("[receiver]\nweak_channels = 0.5\nweak_channel_db = 6.0\n", 1).remove(0);
    let ratios: Vec<f64> = sound.iter().zip(&weak).map(|(a, b)| b.unwrap() / a.unwrap()).collect();
    let (low, same): (Vec<f64>, Vec<f64>) = ratios.iter().partition(|r| **r < 0.6);
    assert!(
        low.len() > 100 && same.len() > 100 && low.len() % 12 == 0,
        "{} and {}",
        low.len(),
        same.len()
    );
    assert!((mean_and_deviation(&low).0 - 0.2512).abs() < 0.003, "{:?}", mean_and_deviation(&low));
    assert!(same.iter().all(|&r| r == 1.0), "intact channels are unchanged");
}

#[test]
fn the_same_firmware_detects_echoes_of_the_compatibility_mode() {
    let receiver = Receiver { mode: Mode::LitlCompat, ..Receiver::default() };
    for range_m in [10.0, 20.0, 30.0] {
        let mut bench = Bench::new(&receiver, &[wall(range_m, 0.2)]);
        let echoes: Vec<Echo> = (0..500).filter_map(|frame| bench.see(frame)).collect();
        assert_eq!(echoes.len(), 500, "{range_m} m");
        let (mean, std) = mean_and_deviation(&echoes.iter().map(Echo::range_m).collect::<Vec<_>>());
        assert!((mean - range_m).abs() < 0.005 + 4.0 * std / 500f64.sqrt(), "{range_m} m: {mean}");
        let amplitude: Vec<f64> = echoes.iter().map(|e| e.amplitude_fraction().to_num()).collect();
        let expected = litl::POWER * litl::SCALE_M2 * 0.2 / range_m / range_m / litl::SATURATION;
        let (mean, _) = mean_and_deviation(&amplitude);
        assert!((mean / expected - 1.0).abs() < 0.03, "{range_m} m: {mean} instead of {expected}");
    }
}

// Motion.

/// A wall at x = 20 m and nothing else.
fn place() -> Place {
    let mesh = plane(20.0, 0.0);
    let caster = Raycaster::from_mesh(&mesh);
    let area = ([-50.0; 2], [50.0; 2]);
    Place { scene: Scene::new("wall", mesh, area), caster, later: None }
}

fn moving(motion: Motion) -> RunConfig {
    let mut config = RunConfig { motion, ..RunConfig::default() };
    config.scanner = ScannerConfig::of("grid");
    (config.scanner.columns, config.scanner.rows) = (Some(60), Some(8));
    (config.scanner.azimuth_deg, config.scanner.elevation_deg) = (Some(90.0), Some(20.0));
    config.receiver.subrays = 1;
    config.check().unwrap();
    config
}

/// Points of a scan of the wall, computed as if from one pose: beam, x, y in m.
fn points(config: &RunConfig, viewpoint: u32) -> Vec<(usize, f64, f64)> {
    let beams = config.scanner.beams();
    let directions = beams.directions(viewpoint);
    let response = respond_at(config, &Arc::new(place()), &Pose::identity(), viewpoint, &beams);
    let point = |(beam, d): (usize, &nalgebra::Vector3<f32>)| {
        let range_m = response.of(beam).first()?.range_m;
        Some((beam, f64::from(range_m * d.x), f64::from(range_m * d.y)))
    };
    directions.iter().enumerate().filter_map(point).collect()
}

#[test]
fn a_wall_shears_as_the_velocity_says() {
    let motion = Motion { duration_s: 0.1, linear_m_s: [30.0, 0.0, 0.0], ..Motion::default() };
    let points = points(&moving(motion), 1);
    assert_eq!(points.len(), 480);
    for (beam, x, _) in points {
        let t = ((beam as f64 + 0.5) / 480.0 - 0.5) * 0.1;
        // The sensor is 30·t nearer when it measures; the point is computed as if it were not.
        assert!((x - (20.0 - 30.0 * t)).abs() < 1e-4, "beam {beam}: {x} m");
    }
}

#[test]
fn a_wall_shears_by_the_firing_times_of_a_spinning_sensor_s_lasers() {
    let mut config =
        moving(Motion { duration_s: 0.1, linear_m_s: [30.0, 0.0, 0.0], ..Motion::default() });
    config.scanner = ScannerConfig::of("vlp-16");
    config.scanner.columns = Some(90);
    config.check().unwrap();
    let points = points(&config, 1);
    assert!(points.len() > 200, "{}", points.len());
    for (beam, x, _) in points {
        // Columns of 24 slots, a laser in each of the first sixteen.
        let slot = (24 * (beam / 16) + beam % 16) as f64;
        let t = ((slot + 0.5) / (24.0 * 90.0) - 0.5) * 0.1;
        assert!((x - (20.0 - 30.0 * t)).abs() < 1e-4, "beam {beam}: {x} m");
    }
}

#[test]
fn points_of_a_rosette_s_scan_use_the_beams_of_its_own_viewpoint() {
    let mut config = moving(Motion::default());
    config.scanner = ScannerConfig::of("livox-mid-40");
    config.scanner.beams = Some(600);
    let beams = config.scanner.beams();
    let own = points(&config, 5);
    assert_eq!(own.len(), 600);
    assert!(own.iter().all(|(_, x, _)| (x - 20.0).abs() < 1e-4));
    let response = respond_at(&config, &Arc::new(place()), &Pose::identity(), 5, &beams);
    let others = beams.directions(4);
    let off = |beam: &usize| (response.of(*beam)[0].range_m * others[*beam].x - 20.0).abs() > 0.01;
    assert!((0..600).filter(off).count() > 500, "another viewpoint has other beams");
}

#[test]
fn a_wall_turns_into_a_curve_as_the_angular_velocity_says() {
    let motion = Motion { duration_s: 0.1, angular_deg_s: [0.0, 0.0, 50.0], ..Motion::default() };
    let config = moving(motion);
    for (beam, x, y) in points(&config, 1) {
        let t = ((beam as f64 + 0.5) / 480.0 - 0.5) * 0.1;
        let turn = (50.0 * t).to_radians();
        // Turned back by the sensor's rotation, the point is on the wall.
        let there = x * turn.cos() - y * turn.sin();
        assert!((there - 20.0).abs() < 1e-4, "beam {beam}: {there} m");
    }
}

#[test]
fn a_sensor_that_stands_still_scans_as_without_motion() {
    let plain = moving(Motion::default());
    let beams = plain.scanner.beams();
    let directions = beams.directions(1);
    let scan =
        |config: &RunConfig| respond_at(config, &Arc::new(place()), &Pose::identity(), 1, &beams);
    let divergence_mrad = plain.receiver.divergence_mrad;
    let optics = BeamOptics { divergence_mrad, subrays: 1, ..BeamOptics::default() };
    let arrays: Vec<[f32; 3]> = directions.iter().map(|&d| d.into()).collect();
    let at_once = scanner::scan(&place().caster, MATERIALS, &Pose::identity(), &arrays, &optics);
    assert_eq!(scan(&plain), at_once);
    for still in [
        Motion { duration_s: 0.1, ..Motion::default() },
        Motion { linear_m_s: [9.0; 3], angular_deg_s: [9.0; 3], ..Motion::default() },
        Motion { jitter_per: JitterPer::Beam, ..Motion::default() },
    ] {
        assert_eq!(scan(&moving(still)), at_once, "{still:?}");
    }
}

#[test]
fn vibration_spreads_the_points_of_a_wall_and_differs_from_scan_to_scan() {
    let config =
        moving(Motion { jitter_mm: 20.0, jitter_per: JitterPer::Beam, ..Motion::default() });
    let (one, again, other) = (points(&config, 1), points(&config, 1), points(&config, 2));
    assert_eq!(one, again);
    assert_ne!(one, other);
    let (mean, std) = mean_and_deviation(&one.iter().map(|p| p.1).collect::<Vec<_>>());
    assert!((mean - 20.0).abs() < 4.0 * 0.02 / 480f64.sqrt(), "{mean} m");
    // Four standard errors, 13 %.
    assert!((std / 0.02 - 1.0).abs() < 4.0 / 960f64.sqrt(), "{std} m");
}

// All options off.

#[test]
fn with_every_option_off_the_codes_are_those_of_the_plain_front_end() {
    use echoloop_frontend::{Exposure, ShotBuffers, before_the_trigger, noise_key, synthesise};
    let returns = [wall(12.0, 0.1), wall(60.0, 0.3)];
    let receiver = RunConfig::default().front_end();
    let mut front_end = WaveformFrontEnd::new(receiver, one_beam(&returns), 5);
    let analog = Analog { pre_trigger: 64, ..ANALOG };
    for frame in 0..50 {
        let trigger = Trigger { frame, beam: 0, shot: 0 };
        let key = noise_key(5, trigger);
        let (mut before, mut window) = (vec![0; 64], vec![0; 800]);
        let plain = Receiver::default();
        let in_window =
            Exposure { receiver: &plain, analog: &analog, returns: &returns, background: &[], key };
        let earlier = Exposure { returns: &[], key: before_the_trigger(key), ..in_window };
        synthesise(&earlier, &mut ShotBuffers::default(), &mut before);
        synthesise(&in_window, &mut ShotBuffers::default(), &mut window);
        let codes = shot(&mut front_end, &analog, frame, 800);
        assert_eq!((&codes[..64], &codes[64..]), (&before[..], &window[..]));
    }
}

#[test]
fn the_compatibility_mode_has_the_reference_sensor_s_window_and_its_own_units() {
    let litl = hardware_for(&Receiver { mode: Mode::LitlCompat, ..Receiver::default() });
    // ρ = 1 at 1 m and 1 W: 200/75 · 720 units, of 1000 at full scale.
    assert_eq!(litl.unit_echo_milli, 1_920);
    assert_eq!(litl.shot_noise_ppm, 1_000);
    assert_eq!(litl.range_max_mm, Hardware::REFERENCE.range_max_mm);
}
