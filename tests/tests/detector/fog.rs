//! Range of the detector in fog, for targets of three reflectances square to the beam.
//!
//! `cargo test -p echoloop-tests --test detector fog:: -- --nocapture` prints the table of
//! benches/record/front-end.md.

use std::f64::consts::PI;
use std::sync::Arc;

use echoloop_dsp::choice::EchoChoice;
use echoloop_dsp::{Hardware, Pipeline, Scratch, Settings};
use echoloop_frontend::{
    Analog, FrontEnd, Precipitation, Receiver, Return, SceneResponse, Trigger, WaveformFrontEnd,
    Weather,
};
use echoloop_sensors::boards::pc::analog_for;

const BEAMS: u32 = 200;

const VISIBILITIES_M: [f64; 8] = [10.0, 20.0, 40.0, 60.0, 100.0, 200.0, 400.0, 998.0];
const REFLECTANCES: [f64; 3] = [0.1, 0.5, 0.9];

fn keep(choice: EchoChoice, echoes: i32) -> Settings {
    Settings { echo_choice: choice.code(), echoes, ..Settings::default() }
}

/// Settings of the table's rows: choice and number of echoes, overlap.
fn kept() -> [(&'static str, Settings); 6] {
    let strongest = Settings::default();
    [
        ("strongest", strongest),
        ("…, `overlap` 5 m", Settings { overlap_mm: 5_000, ..strongest }),
        ("…, `overlap` 10 m", Settings { overlap_mm: 10_000, ..strongest }),
        ("last", keep(EchoChoice::Last, 1)),
        ("2 strongest", keep(EchoChoice::Strongest, 2)),
        ("4 strongest", keep(EchoChoice::Strongest, 4)),
    ]
}

struct Fog {
    receiver: Receiver,
    settings: Settings,
    analog: Analog,
    pipeline: Pipeline,
}

impl Fog {
    fn new(visibility_m: f64, settings: Settings) -> Self {
        let weather = Weather { kind: Precipitation::Fog, visibility_m, ..Weather::default() };
        Self::in_weather(weather, settings)
    }

    fn in_weather(weather: Weather, settings: Settings) -> Self {
        let hardware = Hardware::REFERENCE;
        let analog = analog_for(&settings, &hardware);
        let pipeline = Pipeline::new(&settings, &hardware).expect("accepted settings");
        Self { receiver: Receiver { weather, ..Receiver::default() }, settings, analog, pipeline }
    }

    /// Number of beams that find a target.
    fn found(&self, reflectance: f64, range_m: f64) -> u32 {
        self.found_of(reflectance, range_m, &[])
    }

    /// Number of beams that find a target which has others behind it.
    fn found_of(&self, reflectance: f64, range_m: f64, behind: &[Return]) -> u32 {
        let strength_per_m2 = (reflectance / PI / range_m / range_m) as f32;
        let target = Return { range_m: range_m as f32, strength_per_m2 };
        let scene = SceneResponse {
            beams: (0..=BEAMS).map(|beam| beam * (1 + behind.len() as u32)).collect(),
            returns: [&[target], behind].concat().repeat(BEAMS as usize),
            ..SceneResponse::default()
        };
        let mut front_end = WaveformFrontEnd::new(self.receiver.clone(), Arc::new(scene), 7);
        let mut codes = vec![0; self.settings.bins as usize];
        let mut scratch = Scratch::new();
        let mut finds = |beam: u32| {
            front_end.capture(&self.analog, Trigger { frame: 0, beam, shot: 0 }, &mut codes);
            let echoes = echoloop_kernels::process(&self.pipeline, &codes, &mut scratch);
            echoes.iter().any(|echo| (echo.range_m() - range_m).abs() < 0.3)
        };
        (0..BEAMS).filter(|&beam| finds(beam)).count() as u32
    }

    /// Farthest range, in steps of 5 % from 5 m on, at which nine of ten beams find the target. In
    /// dense fog a nearer one may be lost, because its echo merges with the air's.
    fn reach_m(&self, reflectance: f64) -> f64 {
        let ranges = (0..65).map(|i| 5.0 * 1.05f64.powi(i)).take_while(|&r| r < 119.0);
        let seen = |&r: &f64| 10 * self.found(reflectance, r) >= 9 * BEAMS;
        ranges.filter(seen).last().unwrap_or(0.0)
    }

    /// Peak of a target's echo, fraction of full scale.
    fn target(&self, reflectance: f64, range_m: f64) -> f64 {
        let strength = reflectance / PI / range_m / range_m;
        let peak_ua = self.receiver.peak_current_ua(self.analog.power_w, range_m, strength);
        peak_ua / self.receiver.full_scale_ua
    }

    /// Range at which a falling function passes 1, m.
    fn where_one(of: impl Fn(f64) -> f64) -> f64 {
        (100..11_900).map(|cm| f64::from(cm) / 100.0).find(|&r| of(r) < 1.0).unwrap_or(119.0)
    }
}

#[test]
fn in_fog_the_strongest_echo_is_the_target_where_the_last_one_is() {
    // The air clips at 75 W, and does not at 5 W.
    for power_uw in [75_000_000, 5_000_000] {
        for visibility_m in VISIBILITIES_M {
            let reach = |choice, reflectance| {
                let settings = Settings { power_uw, ..keep(choice, 1) };
                Fog::new(visibility_m, settings).reach_m(reflectance)
            };
            for reflectance in REFLECTANCES {
                let last = reach(EchoChoice::Last, reflectance);
                if last < 16.0 {
                    continue; // the echo merges with the air's
                }
                let strongest = reach(EchoChoice::Strongest, reflectance);
                let case = format!("{power_uw} µW, {visibility_m} m, reflectance {reflectance}");
                assert!(strongest > 0.8 * last, "{case}: {strongest} m, {last} m of the last");
            }
        }
    }
}

#[test]
fn a_surface_just_behind_the_clipped_air_is_kept_where_it_is_found() {
    for gain_cdb in [0, 400, 800, 1_200] {
        for visibility_m in [70.0, 100.0, 200.0] {
            let settings = Settings { gain_cdb, ..Settings::default() };
            let one = Fog::new(visibility_m, settings);
            let four = Fog::new(visibility_m, Settings { echoes: 4, ..settings });
            let (mut kept, mut found) = (0, 0);
            for range_m in [4.0, 5.0, 6.0, 7.0, 8.0, 10.0] {
                kept += one.found(0.1, range_m);
                found += four.found(0.1, range_m);
            }
            let case = format!("{gain_cdb} cdB, {visibility_m} m: {kept} of {found}");
            assert!(found >= BEAMS && 100 * kept >= 99 * found, "{case}");
        }
    }
}

#[test]
fn in_clear_air_a_surface_before_the_sensor_is_no_fog() {
    for (pulse_width_ps, power_uw) in [(5_000, 30_000_000), (10_000, 15_000_000), (5_000, 50_000)] {
        let settings = Settings { pulse_width_ps, power_uw, ..Settings::default() };
        let clear = Fog::in_weather(Weather::default(), settings);
        let farther = Return { range_m: 9.0, strength_per_m2: (0.001 / PI / 81.0) as f32 };
        for (step, reflectance) in (0..24).flat_map(|step| [0.1, 0.9].map(|r| (step, r))) {
            let range_m = 1.4 + 0.1 * f64::from(step);
            let found = clear.found_of(reflectance, range_m, &[farther]);
            let case = format!("{power_uw} µW, {range_m} m, reflectance {reflectance}");
            let alone = clear.found(reflectance, range_m);
            assert!(found >= alone, "{case}: {found} found, {alone} alone");
        }
    }
}

#[test]
fn the_last_echo_is_the_target_as_far_as_noise_allows() {
    for visibility_m in VISIBILITIES_M {
        let fog = Fog::new(visibility_m, keep(EchoChoice::Last, 1));
        for reflectance in REFLECTANCES {
            // Nine of ten beams: 1.3 σ above the threshold, in the noise without light. The fog
            // adds noise and raises the ambient.
            let sigma = fog.receiver.quiescent_variance_ua2().sqrt() / fog.receiver.full_scale_ua;
            let samples = fog.analog.pulse_width_ns / fog.analog.sample_period_ns;
            let least = ((4.7 + 1.3) * sigma / (0.75 * samples).sqrt()).max(0.004);
            let expected_m = Fog::where_one(|r| fog.target(reflectance, r) / least);
            let reach_m = fog.reach_m(reflectance);
            let case = format!("visibility {visibility_m} m, reflectance {reflectance}");
            assert!(
                reach_m > 0.8 * expected_m && reach_m < 1.08 * expected_m,
                "{case}: {reach_m} m, where the physics gives {expected_m} m"
            );
        }
    }
}

#[test]
#[ignore = "prints the table of benches/record/front-end.md"]
fn the_table_of_the_documentation() {
    for (name, settings) in kept() {
        for reflectance in REFLECTANCES {
            print!("| {name}, {:.0} % |", 100.0 * reflectance);
            for visibility_m in VISIBILITIES_M {
                let reach_m = Fog::new(visibility_m, settings).reach_m(reflectance);
                if reach_m == 0.0 { print!(" – |") } else { print!(" {reach_m:.0} |") }
            }
            println!();
        }
    }
}

#[test]
fn the_target_is_found_behind_the_echo_of_air_as_far_as_with_the_last_echo() {
    for visibility_m in VISIBILITIES_M {
        let reach = |choice, echoes| Fog::new(visibility_m, keep(choice, echoes)).reach_m(0.5);
        let (two, last) = (reach(EchoChoice::Strongest, 2), reach(EchoChoice::Last, 1));
        assert!(two > 0.9 * last, "visibility {visibility_m} m: {two} m of two, {last} m of last");
    }
}
