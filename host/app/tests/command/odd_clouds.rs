//! Clouds that are not what `register` expects: in another unit.

use echoloop_clouds::{Cloud, CloudFormat, read_cloud, read_recorded};
use nalgebra::Point3;
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
