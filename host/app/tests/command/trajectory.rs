//! `scan` along poses, and where no pair of sensors fits.

use std::fs;

use crate::fixture::Fixture;
use echoloop_clouds::pose::{read_trajectory, to_rows};
use echoloop_clouds::read_cloud;

const SCAN: [&str; 4] = ["scan", "-q", "-c", "small.toml"];

fn along<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SCAN[..], more].concat()
}

#[test]
fn scans_along_poses_are_those_from_each_pose_and_come_with_the_poses() {
    let fixture = Fixture::new();
    // Half a turn about z at the second.
    fixture.write("way.tum", "# time x y z qx qy qz qw\n5 1 2 2 0 0 0 1\n5.1 1.5 2 2 0 0 1 0\n");
    let document =
        fixture.succeed(&along(&["--json", "--trajectory", "way.tum", "-o", "way"])).json();
    let scans = document["scans"].as_array().expect("scans");
    assert_eq!((scans.len(), &scans[1]["file"]), (2, &"000001.ply".into()));
    assert_eq!(scans[1]["time_s"], 5.1);
    let written = read_trajectory(&fixture.path("way/poses.txt")).expect("KITTI rows");
    let given = read_trajectory(&fixture.path("way.tum")).expect("a trajectory");
    for ((written, given), scan) in written.iter().zip(&given).zip(scans) {
        assert_eq!(to_rows(&written.pose), to_rows(&given.pose));
        let name = scan["file"].as_str().expect("a name");
        let (cloud, _) = read_cloud(&fixture.path("way").join(name)).expect("a cloud");
        assert_eq!(scan["points"], cloud.points.len());
    }
    assert_eq!(fs::read_to_string(fixture.path("way/times.txt")).expect("times"), "5\n5.1\n");
    // The first is the scan that --pose gives: the same scene, noise and number.
    fixture.succeed(&along(&["--pose", "1", "2", "2", "0", "0", "0", "-o", "one.ply"]));
    let bytes = |name: &str| fs::read(fixture.path(name)).expect("a file");
    assert_eq!(bytes("one.ply"), bytes("way/000000.ply"));
    // On one thread, and as PCD.
    let more = ["--threads", "1", "--trajectory", "way.tum", "-o"];
    fixture.succeed(&along(&[&more[..], &["alone"]].concat()));
    assert_eq!(bytes("alone/000001.ply"), bytes("way/000001.ply"));
    fixture.succeed(&along(&[&more[..], &["pcd", "--format", "pcd"]].concat()));
    assert!(bytes("pcd/000001.pcd").starts_with(b"# .PCD"));
}

#[test]
fn what_is_no_trajectory_or_has_no_room_is_refused_and_leaves_nothing() {
    let fixture = Fixture::new();
    fixture.write("bad.txt", "0 0 0 2 0 0 0 1\n1 2 3\n");
    fixture.write("good.txt", "0 0 0 2 0 0 0 1\n");
    fs::create_dir(fixture.path("full")).expect("a folder");
    fixture.write("full/already.txt", "");
    fixture.write("inside.txt", "0 0 0 2 0 0 0 1\n1 0 0 900 0 0 0 1\n");
    for (more, parts) in [
        (&["--trajectory", "bad.txt", "-o", "way"][..], &["bad.txt:2: found 3 numbers"][..]),
        (&["--trajectory", "absent.txt", "-o", "way"], &["absent.txt"]),
        (&["--trajectory", "good.txt", "-o", "full"], &["full", "not empty"]),
        (&["--trajectory", "good.txt", "-o", "-"], &["--output -", "a folder"]),
        (&["--trajectory", "good.txt", "-o", "way.pcd"], &["--output way.pcd", "a folder"]),
        (&["--trajectory", "good.txt", "--pose", "0", "0", "2", "0", "0", "0"], &["--pose"]),
        (&["--trajectory", "good.txt", "--sensor", "serial:none"], &["--trajectory", "serial"]),
    ] {
        fixture.refuses(&along(more), parts);
    }
    let output = fixture.run(&along(&["--trajectory", "inside.txt", "-o", "way"]));
    assert_eq!(output.code, Some(1), "{}", output.stderr);
    assert!(output.stderr.contains("inside.txt:2: no beam returned an echo"), "{}", output.stderr);
    assert!(!fixture.path("way").exists());
}

#[test]
fn a_mesh_in_which_no_pair_fits_is_scanned_and_what_the_sensor_stands_on_is_said() {
    let fixture = Fixture::new();
    let sheet = |half: f32, z: f32| {
        let corner = |x: f32, y: f32| format!("v {} {} {z}\n", x * half, y * half);
        [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)].concat()
    };
    let plain = sheet(60.0, 0.0) + "f 1 2 3 4\n";
    fixture.write("plain.obj", &plain);
    fixture.write("canopy.obj", plain + &sheet(60.0, 4.0) + "f 5 6 7 8\n");
    fixture.write("crown.obj", sheet(3.0, 7.0) + "f 1 2 3 4\n");
    for (mesh, said) in [
        ("plain.obj", "one stands on open ground, with little to see"),
        ("canopy.obj", "one stands on the ground, below something"),
        ("crown.obj", "stands on something else than ground"),
    ] {
        let scan = ["scan", "-c", "small.toml", "--scene", mesh, "--set", "scene.ground=none"];
        let output = fixture.succeed(&scan);
        assert!(output.stderr.contains(said), "{mesh}: {}", output.stderr);
        let none = !output.stderr.contains("something else than ground");
        assert_eq!(none, mesh != "crown.obj", "{mesh}: {}", output.stderr);
    }
}
