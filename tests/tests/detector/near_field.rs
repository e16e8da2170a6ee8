//! Near field: a gain that rises with range, and the overlap of emitter and receiver. Comments give
//! the figures reached.

use echoloop_dsp::choice::TimingMethod;
use echoloop_dsp::{Echo, Flags, Hardware, Settings};
use echoloop_tests::wall::Sensor;

/// Settings at 1 GS/s with a gain that rises by a slope, 0.001 dB/m, up to a range, mm.
fn rising(gain_slope_mdb_m: i32, gain_range_mm: i32) -> Settings {
    Settings { bins: 794, gain_slope_mdb_m, gain_range_mm, ..Settings::default() }
}

/// Summary of some echoes.
#[derive(Debug)]
struct Seen {
    bias_mm: f64,
    spread_mm: f64,
    /// Root mean square of the echoes' σ.
    sigma_mm: f64,
    /// Mean reflectivity.
    reflectivity: f64,
    /// Number of clipped echoes.
    clipped: usize,
    /// Number of echoes.
    of: usize,
}

/// Summary of 320 echoes of a wall, at 16 sub-sample phases.
fn look(settings: Settings, albedo: f64, range_m: f64) -> Seen {
    summary(&see_all(settings, albedo, range_m))
}

/// As [`look`], by phase.
fn look_by_phase(settings: Settings, albedo: f64, range_m: f64) -> Vec<Seen> {
    let seen = see_all(settings, albedo, range_m);
    let of_phase = |phase: usize| seen.iter().skip(phase).step_by(16).copied().collect::<Vec<_>>();
    (0..16).map(|phase| summary(&of_phase(phase))).collect()
}

fn see_all(settings: Settings, albedo: f64, range_m: f64) -> Vec<(Echo, f64)> {
    let mut sensor = Sensor::new(settings);
    let see = |beam: u32| {
        let range_m = sensor.at(range_m, f64::from(beam % 16) / 16.0);
        sensor.see(albedo, range_m, beam).expect("an echo")
    };
    (0..320).map(see).collect()
}

fn summary(seen: &[(Echo, f64)]) -> Seen {
    let mean = |value: &dyn Fn(&(Echo, f64)) -> f64| {
        seen.iter().map(value).sum::<f64>() / seen.len() as f64
    };
    let bias_mm = mean(&|(_, error_mm)| *error_mm);
    Seen {
        bias_mm,
        spread_mm: mean(&|(_, error_mm)| (error_mm - bias_mm).powi(2)).sqrt(),
        sigma_mm: mean(&|(echo, _)| echo.deviation_mm().to_num::<f64>().powi(2)).sqrt(),
        reflectivity: mean(&|(echo, _)| echo.reflectivity_ratio().to_num()),
        clipped: seen.iter().filter(|(echo, _)| echo.flags.contains(Flags::SATURATED)).count(),
        of: seen.len(),
    }
}

/// Ranges before the ramp's end, across it and behind it.
const RANGES_M: [f64; 10] = [3.0, 6.0, 10.0, 11.5, 12.0, 12.5, 20.0, 30.0, 39.7, 40.2];

#[test]
fn a_rising_gain_shifts_no_echo_at_any_slope() {
    // Uncorrected, 1 dB/m would shift the 5 ns pulse behind a matched filter by 9.8 mm, and an edge
    // of a clipped one by up to 13. Reached: 0.9 mm, of which 0.5 are the noise of the mean.
    for (slope, range_mm) in [(300, 40_000), (1_000, 12_000), (1_000, 40_000)] {
        for albedo in [0.02, 0.1, 0.5, 2.0] {
            for range_m in RANGES_M {
                let seen = look(rising(slope, range_mm), albedo, range_m);
                let doubt_mm = 4.0 * seen.spread_mm / (seen.of as f64).sqrt();
                assert!(
                    seen.of == 320 && seen.bias_mm.abs() < 1.2 + doubt_mm,
                    "{slope} mdB/m to {range_mm} mm, albedo {albedo} at {range_m} m: {seen:?}"
                );
            }
        }
    }
}

#[test]
fn a_rising_gain_shifts_no_whole_echo_for_any_method_and_pulse_width() {
    // Uncorrected, 1 dB/m would shift the top of a 20 ns pulse by 156 mm, three samples at 3 GS/s.
    // Every phase is checked alone.
    for timing in [TimingMethod::Parabola, TimingMethod::ConstantFraction] {
        for (pulse_width_ps, bins) in
            [(2_000, 2_400), (5_000, 794), (12_000, 2_400), (20_000, 1_588), (20_000, 2_400)]
        {
            let settings = Settings {
                timing: timing.code(),
                pulse_width_ps,
                bins,
                power_uw: 20_000_000,
                ..rising(1_000, 40_000)
            };
            for range_m in [6.0, 12.0, 30.0] {
                for seen in look_by_phase(settings, 0.02, range_m) {
                    let doubt_mm = 4.0 * seen.spread_mm / (seen.of as f64).sqrt();
                    assert!(
                        seen.clipped == 0 && seen.bias_mm.abs() < 3.0 + doubt_mm,
                        "{timing:?}, {pulse_width_ps} ps, {bins} bins, {range_m} m: {seen:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_rising_edge_walks_as_much_as_at_a_constant_gain() {
    // At 10 m of 1 dB/m to 40 m the gain is 30 dB down.
    let edge = |gain_cdb, settings: Settings| Settings {
        timing: TimingMethod::RisingEdge.code(),
        gain_cdb,
        noise_floor_ppm: 8_000,
        ..settings
    };
    let same = look(edge(-1_000, rising(0, 40_000)), 0.002, 10.0);
    let ramp = look(edge(0, rising(1_000, 20_000)), 0.002, 10.0);
    assert!((same.bias_mm - ramp.bias_mm).abs() < 10.0, "{same:?} and {ramp:?}");
}

#[test]
fn dithered_shots_with_a_rising_gain_keep_range_sigma_and_reflectivity() {
    for shots in [4, 16] {
        let settings = Settings { shots, dither: 1, ..rising(1_000, 40_000) };
        for (albedo, range_m) in [(0.5, 10.0), (2.0, 6.0), (0.1, 6.0), (0.02, 12.0)] {
            let mut sensor = Sensor::new(settings);
            let see = |beam: u32| {
                let range_m = sensor.at(range_m, f64::from(beam % 16) / 16.0);
                sensor.see_with_all_shots(albedo, range_m, beam)
            };
            let seen = summary(&(0..320).filter_map(see).collect::<Vec<_>>());
            let ratio = seen.reflectivity / albedo;
            assert!(
                seen.of == 320
                    && seen.bias_mm.abs() < 1.0
                    && seen.spread_mm < 0.5 + 1.5 * seen.sigma_mm
                    && (albedo > 1.0 || (ratio - 1.0).abs() < 0.03),
                "{shots} shots, {albedo} at {range_m} m: {seen:?}"
            );
        }
    }
}

#[test]
fn near_walls_that_clip_at_full_gain_are_ranged_several_times_better() {
    // Spread with full gain and with the ramp: 10 and 0.6 mm, 8 and 0.6, 21 and 0.7.
    for (albedo, range_m) in [(0.1, 6.0), (0.5, 10.0), (0.5, 6.0)] {
        let (full, ramp) = (
            look(rising(0, 40_000), albedo, range_m),
            look(rising(1_000, 40_000), albedo, range_m),
        );
        assert_eq!(full.clipped, full.of, "{full:?}");
        assert!(ramp.spread_mm < full.spread_mm / 5.0, "{albedo} at {range_m} m: {ramp:?}");
    }
}

#[test]
fn sigma_and_reflectivity_are_those_of_the_wall_at_every_gain() {
    for albedo in [0.02, 0.1] {
        for range_m in [6.0, 10.0, 12.0, 20.0, 30.0, 39.7] {
            let seen = look(rising(1_000, 40_000), albedo, range_m);
            let honest = seen.spread_mm / seen.sigma_mm;
            let ratio = seen.reflectivity / albedo;
            assert!(
                50 * seen.clipped < seen.of
                    && honest > 0.7
                    && honest < 1.35
                    && (ratio - 1.0).abs() < 0.03,
                "{albedo} at {range_m} m: {seen:?}"
            );
        }
    }
}

#[test]
fn a_ramp_that_ends_beyond_the_middle_of_the_window_is_refused_with_its_field() {
    let short = Hardware { range_max_mm: 50_000, ..Hardware::REFERENCE };
    let refusal = rising(500, 30_000).check(&short).unwrap_err().to_string();
    assert_eq!(
        refusal,
        "gain_range 30 m is beyond the middle of the window, 25.5 m (lower it, or set gain_slope \
         to 0)"
    );
    rising(500, 25_000).check(&short).unwrap();
    rising(0, 40_000).check(&short).unwrap(); // no ramp
}

#[test]
fn a_wall_in_partial_overlap_is_weaker_and_keeps_its_reflectivity() {
    let overlap = |overlap_mm| Settings { overlap_mm, noise_floor_ppm: 500, ..rising(0, 40_000) };
    let look_at = |overlap_mm, range_m| {
        let mut sensor = Sensor::new(overlap(overlap_mm));
        (0..40).filter_map(|beam| sensor.see(0.002, range_m, beam)).collect::<Vec<_>>()
    };
    let mean = |seen: &[(Echo, f64)], value: fn(&Echo) -> f64| {
        seen.iter().map(|(echo, _)| value(echo)).sum::<f64>() / seen.len() as f64
    };
    let amplitude = |echo: &Echo| echo.amplitude_fraction().to_num();
    let reflectivity = |echo: &Echo| echo.reflectivity_ratio().to_num();
    let (all, half) = (look_at(1_000, 19.0), look_at(20_000, 19.0));
    assert!((mean(&half, amplitude) / mean(&all, amplitude) - 0.5).abs() < 0.03);
    for seen in [all, half, look_at(20_000, 20.5)] {
        assert!((mean(&seen, reflectivity) / 0.002 - 1.0).abs() < 0.1, "in steps of 1/1024");
    }
    // Bright surfaces, too: at 19 m, half of the light is received.
    for albedo in [1.0, 3.0] {
        let mut sensor =
            Sensor::new(Settings { gain_cdb: -1_000, power_uw: 5_000_000, ..overlap(20_000) });
        let seen: Vec<_> = (0..40).filter_map(|beam| sensor.see(albedo, 19.0, beam)).collect();
        assert!((mean(&seen, reflectivity) / albedo - 1.0).abs() < 0.05, "{albedo}");
    }
    // Below nine tenths of the overlap range, the receiver is blind; a false alarm may be anywhere.
    assert!(look_at(20_000, 17.9).iter().all(|(_, error_mm)| error_mm.abs() > 1e3));
}
