//! Survey coordinates: `register` finds far from the origin what it finds near it, and writes
//! coordinates in their file's own type.

use echoloop_clouds::pose::{from_rows, to_rows};
use echoloop_clouds::survey::{Exact, Precision};
use echoloop_clouds::{CloudFormat, Pose, Recorded, read_cloud, read_points, read_recorded};
use nalgebra::{Point3, Vector3};
use serde_json::Value;

use crate::clouds::pair;
use crate::fixture::Fixture;

/// A place in UTM, m.
const PLACE_M: [f64; 3] = [694_386.25, 5_155_487.125, 381.0];

const REGISTER: [&str; 5] = ["register", "-q", "--json", "--method", "icp"];

/// Points of a scan of the yard, m.
fn points(fixture: &Fixture, end: &str) -> Vec<Point3<f64>> {
    let name = format!("ply/000_{end}.ply");
    let (cloud, _) = read_cloud(&fixture.path(&name)).expect("a scan");
    cloud.points.iter().map(|p| p.cast()).collect()
}

fn write_doubles(fixture: &Fixture, name: &str, at_m: Vec<Point3<f64>>) {
    let cloud = echoloop_clouds::Cloud::new(at_m.iter().map(|p| p.cast()).collect());
    let exact = Some(Exact { at_m, precision: Precision::Double });
    let recorded = Recorded { cloud, exact, ..Recorded::default() };
    let format = CloudFormat::of(&fixture.path(name)).expect("a format");
    fixture.write(name, format.recorded(&recorded));
}

/// Both scans at the place, as `far_target` and `far_source`, and the same points less the shift
/// that the reader takes from the target, as `near_target` and `near_source`. Returns the shift.
fn far_and_near(fixture: &Fixture, extension: &str) -> Vector3<f64> {
    pair(fixture, "ply");
    let far = |end| points(fixture, end).iter().map(|p| p + Vector3::from(PLACE_M)).collect();
    let (target, source): (Vec<_>, Vec<_>) = (far("target"), far("source"));
    write_doubles(fixture, &format!("far_target.{extension}"), target.clone());
    let (read, _) = read_points(&fixture.path(&format!("far_target.{extension}"))).expect("far");
    let near = |far: &[Point3<f64>]| far.iter().map(|p| p - read.shift_m).collect();
    write_doubles(fixture, &format!("near_target.{extension}"), near(&target));
    write_doubles(fixture, &format!("near_source.{extension}"), near(&source));
    write_doubles(fixture, &format!("far_source.{extension}"), source);
    read.shift_m
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("{value}"));
    list.iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn motion(document: &Value) -> Pose {
    let rows = document["target_from_source"].as_array().expect("rows");
    let rows: Vec<f64> = rows.iter().flat_map(numbers).collect();
    from_rows(&rows.try_into().expect("16 numbers")).expect("a motion")
}

fn exact(fixture: &Fixture, name: &str) -> Vec<Point3<f64>> {
    let (read, _) = read_recorded(&fixture.path(name)).expect(name);
    let exact = read.exact.expect("doubles");
    assert_eq!(exact.precision, Precision::Double, "{name}");
    exact.at_m
}

#[test]
fn clouds_far_from_the_origin_are_registered_and_written_as_the_same_clouds_near_it() {
    for extension in ["ply", "pcd"] {
        let fixture = Fixture::new();
        let shift_m = far_and_near(&fixture, extension);
        let run = |place: &str| {
            let [target, source, moved] =
                ["target", "source", "moved"].map(|end| format!("{place}_{end}.{extension}"));
            fixture.succeed(&[&REGISTER[..], &[&target, &source, "-o", &moved]].concat()).json()
        };
        let (far, near) = (run("far"), run("near"));
        assert_eq!((&far["pairs"], &far["rmse_m"]), (&near["pairs"], &near["rmse_m"]));

        let (about, near_motion) = (&far["motion_about_centre"], motion(&near));
        let centre = Vector3::from_vec(numbers(&about["centre_m"]));
        let moved = near_motion * Point3::from(centre - shift_m) + shift_m - centre;
        let close = |found: &Value, expected: Vector3<f64>| {
            let found = Vector3::from_vec(numbers(found));
            assert!((found - expected).norm() < 1e-6, "{found} {expected}");
        };
        close(&about["shift_m"], moved.coords);
        close(&about["turn_deg"], near_motion.rotation.scaled_axis().map(f64::to_degrees));
        close(&far["covariance_about"], centre + moved.coords);
        assert_eq!(near["motion_about_centre"], Value::Null, "ordinary clouds have none");
        assert_eq!(near["covariance_about"], Value::Null);
        for (row, values) in far["covariance"].as_array().expect("rows").iter().enumerate() {
            let variance = numbers(values)[row];
            assert!(variance > 0.0 && variance < 1e-3, "{variance}");
        }

        let moved = |place: &str| exact(&fixture, &format!("{place}_moved.{extension}"));
        let source = exact(&fixture, &format!("far_source.{extension}"));
        let far_motion = motion(&far);
        for ((far, near), source) in moved("far").iter().zip(moved("near")).zip(&source) {
            assert!((far - shift_m - near.coords).coords.norm() < 1e-6, "{far} {near}");
            assert!((far - far_motion * source).norm() < 1e-6, "the printed motion is exact");
        }
    }
}

#[test]
fn the_printed_matrix_of_survey_coordinates_is_exact_to_a_millimetre() {
    let fixture = Fixture::new();
    far_and_near(&fixture, "ply");
    let files = ["far_target.ply", "far_source.ply"];
    let found = motion(&fixture.succeed(&[&REGISTER[..], &files].concat()).json());
    let text = fixture.succeed(&[&["register", "-q", "--method", "icp"], &files[..]].concat());
    let rows = text.stdout.lines().skip(1).take(4).collect::<Vec<_>>().join("\n");
    fixture.write("printed.txt", rows);
    let printed = echoloop_clouds::pose::read_pose(&fixture.path("printed.txt")).expect("a pose");
    let place = Point3::from(PLACE_M);
    assert!((printed * place - found * place).norm() < 1e-3, "{}", text.stdout);
    for part in ["about the source's centre, 6943", "axes through that centre"] {
        assert!(text.stdout.contains(part), "{}", text.stdout);
    }
    // The motion found is where a second registration starts, and stays.
    let again = [&REGISTER[..], &files, &["--initial", "printed.txt"]].concat();
    let again = motion(&fixture.succeed(&again).json());
    assert!((again * place - found * place).norm() < 0.01);
}

#[test]
fn a_scan_in_its_sensors_frame_is_laid_on_survey_coordinates_and_written_as_doubles() {
    let fixture = Fixture::new();
    far_and_near(&fixture, "ply");
    let place = to_rows(&Pose::from_parts(PLACE_M.into(), nalgebra::UnitQuaternion::identity()));
    fixture.write("place.txt", place.map(|v| v.to_string()).join(" "));
    let files = ["far_target.ply", "ply/000_source.ply", "--initial", "place.txt"];
    let run = [&REGISTER[..], &files, &["-o", "moved.ply"]].concat();
    let found = motion(&fixture.succeed(&run).json());
    for (moved, source) in exact(&fixture, "moved.ply").iter().zip(points(&fixture, "source")) {
        assert!((moved - found * source).norm() < 1e-6, "{moved}");
    }
}

#[test]
fn single_precision_stays_single_wherever_it_is() {
    let fixture = Fixture::new();
    pair(&fixture, "ply");
    for end in ["target", "source"] {
        let far =
            points(&fixture, end).into_iter().map(|p| (p + Vector3::new(4e3, 0.0, 0.0)).cast());
        let cloud = echoloop_clouds::Cloud::new(far.collect());
        fixture.write(&format!("{end}.ply"), CloudFormat::Ply.bytes(&cloud, &[]));
    }
    for [target, source] in
        [["target.ply", "source.ply"], ["ply/000_target.ply", "ply/000_source.ply"]]
    {
        fixture.succeed(&[&REGISTER[..], &[target, source, "-o", "moved.ply"]].concat());
        let moved = fixture.bytes("moved.ply");
        let header = String::from_utf8_lossy(&moved[..200]).into_owned();
        assert!(header.contains("property float x"), "{header}");
    }
}

#[test]
fn coordinates_beyond_ten_million_metres_are_refused_with_the_cure() {
    let fixture = Fixture::new();
    fixture.write("near.xyz", "1 2 3\n4 5 6\n");
    fixture.write("lost.xyz", "1 2 3\n694386.5 51554870 381\n");
    let parts =
        ["lost.xyz: point 1, counted from 0", "y = 5.155487e7 m", "subtract a common offset"];
    fixture.refuses(&["register", "lost.xyz", "near.xyz"], &parts);
    fixture.refuses(&["register", "near.xyz", "lost.xyz"], &parts);
}
