//! Least power: the bounds of the laser's power reach down to where nothing is detected.
//!
//! `cargo test -p echoloop-tests --test detector power:: -- --nocapture` prints the table of
//! benches/record/detector.md.

use std::sync::Arc;

use echoloop_closed_loop::config::load;
use echoloop_closed_loop::dataset::{Dataset, ScanPair};
use echoloop_dsp::{Hardware, ParameterId, Settings};
use echoloop_frontend::SceneResponse;
use echoloop_sensors::sensor::{Model, Sensors, View};

const KINDS: [&str; 3] = ["structured", "semi-structured", "unstructured"];
const BEAMS: usize = 48 * 16;
const POWERS_UW: [i32; 6] = [75_000_000, 5_000_000, 100_000, 1_000, 100, 10];

/// The default settings, and those that see farthest: the longest pulse, all shots, and a floor
/// below the noise.
fn settings() -> [(&'static str, Settings); 2] {
    let strongest = Settings {
        pulse_width_ps: 20_000,
        power_uw: Hardware::REFERENCE.strongest_power_uw(20_000),
        shots: 16,
        bins: 2_400,
        noise_floor_ppm: 100,
        ..Settings::default()
    };
    [("default", Settings::default()), ("20 ns, 16 shots, 2,400 bins", strongest)]
}

fn town(kind: &str) -> (Dataset, Sensors) {
    let keys = [
        &format!("scene.source={kind}"),
        "scene.towns=[41]",
        "scanner.pattern=grid",
        "scanner.columns=48",
        "scanner.rows=16",
        "data.train_pairs=3",
        "data.test_pairs=1",
    ];
    let overrides: Vec<_> = keys.iter().map(|key| key.parse().expect("an override")).collect();
    let config = load(None, &overrides).expect("a configuration");
    let dataset = Dataset::build(&config, &|_, _| ()).expect("a town");
    (dataset, Sensors::in_process(Model::from(&config)))
}

/// Number of echoes in a scan from each pair's first viewpoint; `dark`: of a scene without returns.
fn echoes(sensors: &Sensors, dataset: &Dataset, settings: &Settings, dark: bool) -> usize {
    let nothing = Arc::new(SceneResponse {
        beams: vec![0; BEAMS + 1],
        returns: Vec::new(),
        ..SceneResponse::default()
    });
    let scan = |pair: &ScanPair| {
        let lit = pair.first.to(&dataset.beams);
        let scene = if dark { &nothing } else { &lit };
        let view = View { scene, noise_seed: 9, scan: 1, viewpoint: pair.viewpoints[0] };
        let scan = sensors.with(|sensor| {
            sensor.configure(settings)?;
            sensor.scan(&view)
        });
        scan.expect("a scan").iter().map(|echoes| echoes.len()).sum::<usize>()
    };
    dataset.train.iter().map(scan).sum()
}

#[test]
fn at_the_least_power_nothing_is_detected_in_any_kind_of_scene() {
    let least_uw = ParameterId::Power.parameter().min;
    for kind in KINDS {
        let (dataset, sensors) = town(kind);
        for (name, settings) in settings() {
            let at = |power_uw, dark| {
                let settings = Settings { power_uw, ..settings };
                echoes(&sensors, &dataset, &settings, dark)
            };
            let of_noise = at(least_uw, true);
            let strongest = settings.power_uw;
            let powers = POWERS_UW.into_iter().filter(|&power_uw| power_uw <= strongest);
            let found: Vec<(i32, usize)> =
                powers.map(|power_uw| (power_uw, at(power_uw, false))).collect();
            println!("{kind}, {name}: {of_noise} of noise alone; {found:?}");
            let (last_uw, last) = found[found.len() - 1];
            assert_eq!(last_uw, least_uw);
            let one_in_500 = 3 * BEAMS / 500;
            assert!(last <= of_noise + one_in_500, "{kind}, {name}: {last}, of noise {of_noise}");
            let first = found[0].1;
            assert!(first > BEAMS, "{kind}, {name}: {first} of {} at full power", 3 * BEAMS);
            for pair in found.windows(2) {
                assert!(
                    pair[1].1 <= pair[0].1 + one_in_500,
                    "{kind}, {name}: more by less: {found:?}"
                );
            }
        }
    }
}
