//! Scan patterns: the sensor's projection against the host's, and scans from end to end.

use std::collections::HashSet;
use std::f32::consts::PI;
use std::sync::Arc;

use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::beams::list::BeamList;
use echoloop_closed_loop::config::{RunConfig, ScannerConfig};
use echoloop_closed_loop::evaluation::scan_cloud::{cloud_from_scan, recorded_from_scan};
use echoloop_dsp::{Echo, Grid, ScanPattern, Settings};
use echoloop_frontend::{Return, SceneResponse};
use echoloop_sensors::sensor::{Model, Sensor, View};
use nalgebra::Vector3;

const SPINNING: [&str; 6] = ["vlp-16", "vlp-32c", "vls-128", "hdl-64e", "os1-64", "os1-128"];

fn pattern(name: &str) -> ScanPattern {
    let scanner = ScannerConfig::of(name);
    toml::from_str::<RunConfig>(&format!("[scanner]\npattern = \"{name}\""))
        .expect("a configuration")
        .check()
        .expect("within bounds");
    scanner.pattern()
}

#[test]
fn sensor_and_host_agree_on_every_beam_s_direction_to_a_millionth() {
    let odd = Grid { columns: 333, rows: 77, azimuth_cdeg: 36_000, elevation_cdeg: 4_321 };
    let grids = [ScanPattern::Grid(odd), ScanPattern::Raster(odd)];
    for pattern in ScannerConfig::patterns().map(pattern).chain(grids) {
        let beams = Beams::new(pattern);
        let (mut worst, mut worst_of_host) = (0.0_f64, 0.0_f64);
        for scan in [0, 1, 299, 1_000_000] {
            let of_host = beams.directions(scan);
            for beam in 0..pattern.beams() {
                let exact = beams.exact_direction(scan, beam).expect("a beam");
                let off = |of: Vector3<f32>| (of.cast::<f64>() - exact).norm();
                let own = pattern.direction(scan, beam).expect("a beam");
                worst = worst.max(off(own));
                worst_of_host = worst_of_host.max(off(of_host[beam as usize]));
            }
        }
        println!("{pattern:?}: {worst:.1e}, host {worst_of_host:.1e}");
        assert!(worst < 1e-6, "{pattern:?}: {worst}");
        assert!(worst_of_host < 1e-6, "{pattern:?}: {worst_of_host}");
        let echo = Echo { range: 120_000 * 256, ..Echo::default() };
        let point = pattern.point_m(7, 5, &echo).expect("a beam").coords.cast::<f64>();
        let there = beams.exact_direction(7, 5).expect("a beam") * 120.0;
        assert!((point - there).norm() < 0.12e-3, "{pattern:?}");
    }
}

#[test]
fn all_beams_of_a_scan_have_different_directions() {
    for name in ["grid", "raster"].iter().chain(&SPINNING) {
        let beams = Beams::new(pattern(name));
        let directions = beams.directions(1);
        let different: HashSet<[u32; 3]> =
            directions.iter().map(|d| [d.x, d.y, d.z].map(f32::to_bits)).collect();
        assert_eq!(different.len(), beams.pattern().beams() as usize, "{name}");
    }
}

#[test]
fn ten_scans_of_a_rosette_share_hardly_any_beam() {
    let beams = Beams::new(pattern("livox-mid-40"));
    let bits = |d: &Vector3<f32>| [d.x, d.y, d.z].map(f32::to_bits);
    let scans: Vec<HashSet<_>> =
        (1..=10).map(|scan| beams.directions(scan).iter().map(bits).collect()).collect();
    for (i, scan) in scans.iter().enumerate() {
        assert!(scan.len() > 9_990, "scan {i}: {}", scan.len());
        for other in &scans[i + 1..] {
            let common = scan.intersection(other).count();
            assert!(common < 10, "scan {i}: {common} beams of a later one");
        }
    }
}

/// Rings count lasers by elevation, not in the maker's order.
#[test]
fn rings_rise_with_elevation_and_columns_count_along_the_turn() {
    for name in SPINNING {
        let beams = Beams::new(pattern(name));
        let lasers = u32::from(beams.pattern().channels());
        let directions = beams.directions(1);
        let mut of_column: Vec<(u32, f32)> =
            (0..lasers).map(|b| (beams.ring(5 * lasers + b), directions[b as usize].z)).collect();
        of_column.sort_by_key(|(ring, _)| *ring);
        assert!(of_column.iter().map(|(ring, _)| *ring).eq(0..lasers), "{name}");
        assert!(of_column.is_sorted_by(|a, b| a.1 < b.1), "{name}");
        assert_eq!((beams.column(5 * lasers), beams.column(6 * lasers - 1)), (5, 5), "{name}");
    }
}

#[test]
fn the_time_of_a_beam_is_the_firing_time_of_its_laser() {
    let near = |got: f64, expected: f64| {
        assert!((got - expected).abs() < 1e-9, "{got} for {expected}");
    };
    // A column of a VLP-16 at 10 Hz and 1808 columns takes 55.31 µs, each laser 1/24 of it.
    let vlp = Beams::new(pattern("vlp-16"));
    let round = 0.1 / 1808.0;
    near(vlp.time_s(16 * 100 + 7, 0.1), (100.0 + 7.5 / 24.0) * round);
    let os1 = Beams::new(pattern("os1-128"));
    near(os1.time_s(128 * 3 + 99, 0.1), 3.5 * 0.1 / 1024.0);
    near(os1.time_s(128 * 3 + 99, 0.0), 0.0);
    let grid = Beams::new(pattern("grid"));
    near(grid.time_s(64, 0.1), 64.5 / 12_288.0 * 0.1);
}

/// A wall all around the sensor, at 20 m.
fn tube(beams: u32) -> Arc<SceneResponse> {
    let back = Return { range_m: 20.0, strength_per_m2: 0.5 / PI / 400.0 };
    SceneResponse {
        beams: (0..=beams).collect(),
        returns: vec![back; beams as usize],
        ..SceneResponse::default()
    }
    .into()
}

#[test]
fn a_scan_of_131072_beams_comes_over_the_link_whole() {
    let mut config = RunConfig { scanner: ScannerConfig::of("os1-128"), ..RunConfig::default() };
    config.receiver.dead_channels = 0.1;
    config.check().expect("within bounds");
    let settings = Settings { bins: 400, ..Settings::default() }; // fewer samples are faster
    let mut sensor = Sensor::in_process(&Model::from(&config)).expect("a sensor");
    sensor.configure(&settings).expect("accepted");
    let scene = tube(131_072);
    let view = View { scene: &scene, noise_seed: 3, scan: 1, viewpoint: 1 };
    let scan = sensor.scan(&view).expect("a scan");
    assert_eq!(scan.len(), 131_072);
    // A laser has echoes in every column or in none.
    let heard = |laser: usize| (0..1024).filter(|c| !scan[c * 128 + laser].is_empty()).count();
    let counts: Vec<usize> = (0..128).map(heard).collect();
    let dead = counts.iter().filter(|count| **count == 0).count();
    assert!((1..40).contains(&dead), "{dead} dead lasers");
    assert!(counts.iter().all(|count| *count == 0 || *count > 1000), "{counts:?}");
    let beams = config.scanner.beams();
    let cloud = cloud_from_scan(&scan, &beams.directions(1));
    let far = cloud.points.iter().map(|p| (p.coords.norm() - 20.0).abs()).fold(0.0, f32::max);
    assert!(cloud.points.len() > 100_000 && far < 0.3, "{} points, {far} m", cloud.points.len());
    let counters = sensor.client.read_counters().expect("counters");
    assert_eq!((counters.crc_failures, counters.unintelligible, counters.stale), (0, 0, 0));
}

#[test]
fn a_table_s_scan_has_its_channels_times_and_directions() {
    let rows: String = (0..40)
        .map(|i| format!("{},{},{},{}\n", 9 * i - 180, i - 20, (40 - i) as f64 * 1e-3, i % 3))
        .collect();
    let text = "azimuth_deg,elevation_deg,time_s,channel\n".to_owned() + &rows;
    let list = Arc::new(BeamList::from_csv(text.as_bytes()).expect("a table"));
    let beams = Beams::of_list(Arc::clone(&list));
    let model = Model { pattern: *beams.pattern(), ..Model::from(&RunConfig::default()) };
    let mut sensor = Sensor::in_process(&model).expect("a sensor");
    assert_eq!(sensor.client.identity().pattern, ScanPattern::Table(list.name()));
    let scene = tube(40);
    let view = View { scene: &scene, noise_seed: 3, scan: 1, viewpoint: 1 };
    let scan = sensor.scan(&view).expect("a scan");
    let recorded = recorded_from_scan(&scan, &beams, 1, 0.1);
    assert_eq!(recorded.cloud.points.len(), 40);
    let column = |name: &str| -> Vec<f64> {
        recorded
            .columns
            .iter()
            .find(|column| column.name == name)
            .expect("there")
            .values()
            .collect()
    };
    for (i, point) in recorded.cloud.points.iter().enumerate() {
        let azimuth = point.y.atan2(point.x).to_degrees();
        let expected = (9 * i) as f32 - 180.0;
        let off = (azimuth - expected + 540.0).rem_euclid(360.0) - 180.0;
        assert!(off.abs() < 1e-3, "{i}: {azimuth} for {expected}");
        assert_eq!(column("ring")[i], (i % 3) as f64);
        assert_eq!(column("column")[i], (i / 3) as f64);
        assert_eq!(column("time")[i], f64::from(((40 - i) as f64 * 1e-3) as f32));
    }
}
