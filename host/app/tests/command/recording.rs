//! CARLA's semantic scans of a yard, recorded by a sensor that drives through it, in every command.

use std::fmt::Write;
use std::fs;

use crate::fixture::Fixture;
use echoloop_clouds::Pose;
use echoloop_clouds::read_cloud;
use echoloop_sim::import::{ImportOptions, load_scene};
use echoloop_sim::raycast::Raycaster;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use serde_json::json;

const SCANS: usize = 80;

/// Pose of the sensor, and CARLA's transform of it: left-handed, degrees.
fn pose(k: usize) -> (Pose, serde_json::Value) {
    let (x, y, yaw) = (-20.0 + 0.5 * k as f64, -12.0, 0.4 + 0.01 * k as f64);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    let told = json!({ "location": [x, -y, 1.8], "pitch": 0, "yaw": -yaw.to_degrees(), "roll": 0 });
    (Pose::from_parts(Translation3::new(x, y, 1.8), turn), told)
}

/// Scan of the yard by 48 × 16 beams, as CARLA writes it.
fn scan(caster: &Raycaster, world_from_sensor: &Pose, tag: u32) -> String {
    let (mut points, mut count) = (String::new(), 0);
    for beam in 0..48 * 16 {
        let azimuth = (f64::from(beam % 48) - 23.5) * 2.5_f64.to_radians();
        let elevation = (f64::from(beam / 48) - 7.5) * 4.0_f64.to_radians();
        let out = elevation.cos();
        let local = Vector3::new(out * azimuth.cos(), out * azimuth.sin(), elevation.sin());
        let origin = world_from_sensor.translation.vector.cast::<f32>().into();
        let way = (world_from_sensor.rotation * local).cast::<f32>().into();
        let Some(hit) = caster.cast(origin, way).filter(|hit| hit.range_m < 60.0) else { continue };
        let [x, y, z]: [f64; 3] = (local * f64::from(hit.range_m)).into();
        count += 1;
        let _ = writeln!(points, "{x} {} {z} {} {beam} {tag}", -y, hit.cos_incidence);
    }
    let properties: String = ["x", "y", "z", "CosAngle"]
        .iter()
        .map(|name| format!("property float32 {name}\n"))
        .chain(["ObjIdx", "ObjTag"].iter().map(|name| format!("property uint32 {name}\n")))
        .collect();
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{points}")
}

/// A folder with a recording of the fixture's yard.
fn recorded(fixture: &Fixture, tag: u32) {
    let yard = load_scene(&fixture.path("yard.obj"), &ImportOptions::default()).expect("a yard");
    let caster = Raycaster::new(&yard);
    fs::create_dir(fixture.path("drive")).expect("a folder");
    let poses: Vec<_> = (0..SCANS).map(pose).collect();
    for (k, (pose, _)) in poses.iter().enumerate() {
        fixture.write(&format!("drive/{k:06}.ply"), scan(&caster, pose, tag));
    }
    let transforms: Vec<_> = poses.into_iter().map(|(_, told)| told).collect();
    fixture.write("drive/transforms.json", json!(transforms).to_string());
}

const DRIVE: [&str; 5] = ["-q", "-c", "small.toml", "--scene", "drive"];

#[test]
fn a_recording_is_judged_tuned_on_and_written_as_pairs_like_a_scene() {
    let fixture = Fixture::new();
    recorded(&fixture, 3);
    let judged = fixture.succeed(&[&["evaluate", "--json"], &DRIVE[..]].concat()).json();
    assert_eq!(judged["summary"]["recall_pct"], 100.0, "{judged}");
    let error_m = judged["summary"]["median_translation_m"].as_f64().expect("an error");
    assert!(error_m < 0.05, "{error_m} m");
    assert!(judged["set"]["test"]["overlap"][0].as_f64() > Some(0.3), "{}", judged["set"]);

    let tuned = fixture.succeed(&[&["tune", "--json"], &DRIVE[..]].concat()).json();
    assert_eq!(tuned["default_summary"]["recall_pct"], 100.0);
    assert_eq!(tuned["tuned_summary"]["recall_pct"], 100.0);

    let written = [&["pairs", "-o", "pairs"], &DRIVE[..]].concat();
    fixture.succeed(&written);
    let list: serde_json::Value =
        serde_json::from_str(&fixture.read("pairs/pairs.json")).expect("a list");
    for pair in list["pairs"].as_array().expect("pairs") {
        let baseline_m = pair["baseline_m"].as_f64().expect("a distance");
        assert!((baseline_m - 0.5).abs() < 1e-6, "{baseline_m}");
    }
}

#[test]
fn a_scan_of_a_recording_has_its_points_where_they_were_recorded() {
    let fixture = Fixture::new();
    recorded(&fixture, 3);
    let scan = [&["scan", "-o", "first.ply", "--json"], &DRIVE[..]].concat();
    let told = fixture.succeed(&scan).json();
    let (cloud, _) = read_cloud(&fixture.path("first.ply")).expect("a cloud");
    let points: Vec<[f64; 3]> =
        cloud.points.iter().map(|p| p.coords.cast::<f64>().into()).collect();
    let recorded: Vec<[f64; 3]> = fixture
        .read("drive/000000.ply")
        .lines()
        .skip_while(|line| *line != "end_header")
        .skip(1)
        .map(|line| {
            let numbers: Vec<f64> =
                line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            [numbers[0], -numbers[1], numbers[2]]
        })
        .collect();
    assert!(points.len() > recorded.len() / 2, "{} of {}: {told}", points.len(), recorded.len());
    let off = |point: &[f64; 3]| {
        let to = |other: &[f64; 3]| (0..3).map(|i| (point[i] - other[i]).powi(2)).sum::<f64>();
        recorded.iter().map(to).fold(f64::INFINITY, f64::min).sqrt()
    };
    let mut errors: Vec<f64> = points.iter().map(off).collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors[errors.len() / 2] < 0.03, "{} m", errors[errors.len() / 2]);
    assert!(errors[errors.len() * 9 / 10] < 0.15, "{} m", errors[errors.len() * 9 / 10]);
}

#[test]
fn what_a_recording_cannot_give_is_said_with_exit_code_2_and_nothing_is_written() {
    let fixture = Fixture::new();
    recorded(&fixture, 3);
    for (command, said) in [
        (&["store", "-o", "kept.pairs"][..], "recorded scans need no store"),
        (&["scene", "-o", "page.html"], "recorded scans, which have no surfaces"),
        (
            &["scan", "-o", "one.ply", "--pose", "0", "0", "2", "0", "0", "0"],
            "--scene: recorded scans",
        ),
        (&["evaluate", "--set", "data.test_pairs=90"], "but of its 80 scans"),
        (&["evaluate", "--set", "scene.tags=carla-0.8"], "scene.tags"),
    ] {
        let output = fixture.run(&[command, &DRIVE[..]].concat());
        assert_eq!(output.code, Some(2), "{command:?}: {}", output.stderr);
        assert!(output.stderr.contains(said), "{command:?}: {}", output.stderr);
    }
    for name in ["kept.pairs", "page.html", "one.ply"] {
        assert!(!fixture.path(name).exists(), "{name}");
    }
    let unknown = Fixture::new();
    recorded(&unknown, 77);
    let output = unknown.run(&[&["evaluate"], &DRIVE[..]].concat());
    assert_eq!(output.code, Some(2), "{}", output.stderr);
    assert!(output.stderr.contains("ObjTag 77"), "{}", output.stderr);
}
