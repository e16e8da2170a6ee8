//! Clouds that are not what `register` expects: in another unit, of few points, of one shape, of a
//! tunnel. The refusal names the cloud and the cure, and the cure works.

use echoloop_clouds::{Cloud, CloudFormat, read_cloud, read_recorded};
use nalgebra::{Point3, Vector3};
use serde_json::Value;

use crate::clouds::pair;
use crate::fixture::Fixture;

const REGISTER: [&str; 3] = ["register", "-q", "--json"];

fn write(fixture: &Fixture, name: &str, points: impl Iterator<Item = Point3<f32>>) {
    fixture.write(name, CloudFormat::Ply.bytes(&Cloud::new(points.collect()), &[]));
}

/// Two scans of the yard as `target.ply` and `source.ply`, and in another unit as `target_UNIT.ply`
/// and `source_UNIT.ply`.
fn pair_in(fixture: &Fixture, units: &[(&str, f32)]) {
    pair(fixture, "ply");
    for end in ["target", "source"] {
        let (cloud, _) = read_cloud(&fixture.path(&format!("ply/000_{end}.ply"))).expect("a scan");
        write(fixture, &format!("{end}.ply"), cloud.points.iter().copied());
        for (unit, per_metre) in units {
            let name = format!("{end}_{unit}.ply");
            write(fixture, &name, cloud.points.iter().map(|p| p * *per_metre));
        }
    }
}

fn motion(document: &Value) -> Vec<f64> {
    let rows = document["target_from_source"].as_array().expect("rows").iter();
    rows.flat_map(|row| row.as_array().expect("a row")).filter_map(Value::as_f64).collect()
}

/// Standard error of what must not register.
fn refusal(fixture: &Fixture, files: &[&str]) -> String {
    let output = fixture.run(&[&REGISTER[..], files].concat());
    assert_eq!(output.code, Some(1), "{files:?}: {}", output.stderr);
    assert!(output.stderr.starts_with("error: not registered: "), "{}", output.stderr);
    output.stderr
}

#[test]
fn clouds_in_any_unit_register_with_its_scale_and_are_written_in_metres() {
    let fixture = Fixture::new();
    pair_in(&fixture, &[("mm", 1000.0), ("ft", 1.0 / 0.3048)]);
    let run = |files: &[&str]| {
        let document = fixture.succeed(&[&REGISTER[..], files, &["-o", "moved.ply"]].concat());
        let moved = read_recorded(&fixture.path("moved.ply")).expect("a cloud").0;
        (motion(&document.json()), moved.cloud.points)
    };
    let (in_metres, expected) = run(&["target.ply", "source.ply"]);
    for files in [
        &["target_mm.ply", "source_mm.ply", "--scale", "0.001"][..],
        &["target_mm.ply", "source.ply", "--scale", "0.001,1"],
        &["target_mm.ply", "source_ft.ply", "--scale", "0.001,0.3048"],
    ] {
        let (found, moved) = run(files);
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-3;
        assert!(found.iter().zip(&in_metres).all(near), "{files:?}: {found:?} {in_metres:?}");
        let near = |(a, b): (&Point3<f32>, &Point3<f32>)| (a - b).norm() < 0.05;
        assert!(moved.iter().zip(&expected).all(near), "{files:?}");
    }
    let many = ["register", "target.ply", "source.ply", "--scale", "1,1,1"];
    fixture.refuses(&many, &["--scale", "found 3"]);
    fixture.refuses(&["register", "target.ply", "source.ply", "--scale", "0"], &["--scale"]);
}

#[test]
fn a_refusal_names_the_cloud_in_another_unit_and_the_flag_that_cures_it() {
    let fixture = Fixture::new();
    pair_in(&fixture, &[("mm", 1000.0)]);
    let [both, one] = [["target_mm.ply", "source_mm.ply"], ["target.ply", "source_mm.ply"]]
        .map(|files| refusal(&fixture, &files));
    assert!(both.contains("hint: 9 of 10 points of ") && both.contains("--scale"), "{both}");
    assert!(one.contains("hint: source_mm.ply is ") && one.ends_with("1,0.001\n"), "{one}");
    // Another place is no other unit.
    write(&fixture, "away.ply", yard_on_its_side(&fixture));
    let away = refusal(&fixture, &["target.ply", "away.ply"]);
    assert!(!away.contains("hint"), "{away}");
}

/// The source, bent to something else of about its size.
fn yard_on_its_side(fixture: &Fixture) -> impl Iterator<Item = Point3<f32>> + use<> {
    let (cloud, _) = read_cloud(&fixture.path("source.ply")).expect("a scan");
    cloud.points.into_iter().map(|p| Point3::new(p.z * 7.0, p.x * 0.5, p.y * p.y * 0.02))
}

#[test]
fn a_refusal_names_clouds_of_few_points_or_of_one_shape() {
    let fixture = Fixture::new();
    pair_in(&fixture, &[]);
    let (cloud, _) = read_cloud(&fixture.path("source.ply")).expect("a scan");
    write(&fixture, "few.ply", cloud.points.iter().step_by(200).copied());
    let line = |i: i32| Point3::from(Vector3::new(1.0, 0.2, 0.1) * i as f32 * 0.01);
    write(&fixture, "line.ply", (1..3000).map(line));
    let ring = |i: i32| {
        let azimuth = (i as f32 * 0.12).to_radians();
        let range_m = 5.0 + 3.0 * (3.0 * azimuth).sin();
        Point3::new(azimuth.cos(), azimuth.sin(), 0.1) * range_m
    };
    write(&fixture, "ring.ply", (0..3000).map(ring));
    for (name, expected) in [
        ("few.ply", "hint: few.ply has "),
        ("line.ply", "hint: the points of line.ply lie on a line"),
        ("ring.ply", "hint: the points of ring.ply are one ring of a scan"),
    ] {
        for files in [["target.ply", name], [name, "target.ply"]] {
            let said = refusal(&fixture, &files);
            assert!(said.contains(expected), "{said}");
        }
    }
}

/// A smooth tunnel 6 m wide along x, as a sensor that sees 100 m far has it from `x_m`, with 2 cm
/// of noise.
fn tunnel(x_m: f32) -> impl Iterator<Item = Point3<f32>> {
    (0..360 * 45).filter_map(move |i| {
        let (azimuth, elevation) = ((i % 360) as f32, (i / 360) as f32 * 1.4 - 32.0);
        let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
        let (cos, sin) = (elevation.cos(), elevation.sin());
        let way = Vector3::new(azimuth.cos() * cos, azimuth.sin() * cos, sin);
        let to = |along: f32, low: f32, high: f32| (if along < 0.0 { low } else { high }) / along;
        let range_m = to(way.y, -3.2, 2.8).min(to(way.z, -1.5, 3.0));
        let noise_m = 0.02 * ((i as f32 + 7.0 * x_m) * 12.9898).sin();
        (range_m < 100.0).then(|| Point3::from(way * (range_m + noise_m)))
    })
}

#[test]
fn a_tunnel_is_degenerate_with_one_open_direction_along_it_and_a_motion_all_the_same() {
    let fixture = Fixture::new();
    write(&fixture, "target.ply", tunnel(0.0));
    write(&fixture, "source.ply", tunnel(2.0));
    for method in ["auto", "icp"] {
        let files = ["target.ply", "source.ply", "--method", method];
        let output = fixture.run(&[&REGISTER[..], &files].concat());
        assert_eq!(output.code, Some(1), "{}", output.stderr);
        assert!(output.stderr.contains("degenerate") && !output.stderr.contains("hint"));
        let document = output.json();
        assert_eq!(
            (&document["stop"], &document["converged"]),
            (&"Degenerate".into(), &false.into())
        );
        let open = document["open_directions"].as_array().expect("a list");
        assert_eq!(open.len(), 1, "{document}");
        let shift_m = |axis: usize| open[0]["translation_m"][axis].as_f64().expect("m").abs();
        assert!(shift_m(0) > 0.95 && shift_m(1) < 0.1 && shift_m(2) < 0.1, "{document}");
        let sd_m =
            |axis: usize| document["covariance"][3 + axis][3 + axis].as_f64().expect("m²").sqrt();
        assert!(sd_m(0) > 3.0 && sd_m(1) < 0.5 && sd_m(2) < 0.5, "{document}");
        // What the walls tell stands: neither turn nor shift across the tunnel.
        let motion = motion(&document);
        let identity = |i: usize| f64::from(u8::from(i.is_multiple_of(5)));
        let is_told = (0..16).filter(|i| *i != 3).all(|i| (motion[i] - identity(i)).abs() < 0.05);
        assert!(is_told && motion.len() == 16, "{document}");
    }
}
