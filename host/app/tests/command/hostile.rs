//! Files and command lines that nobody means well with: few words, exit code 2, and an end.

use std::fs::{self, OpenOptions};
use std::process::{Command, Stdio};

use crate::fixture::Fixture;

const TRIANGLE: &str = "v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n";
const POSE: [&str; 7] = ["--pose", "1", "1", "1", "0", "0", "0"];

/// Refusal of a mesh by `scan`.
fn scan_refuses(fixture: &Fixture, mesh: &str, parts: &[&str]) {
    let scan = ["scan", "-c", "small.toml", "--scene", mesh];
    fixture.refuses(&[&scan[..], &POSE].concat(), parts);
}

#[test]
fn a_mesh_opens_no_file_that_is_not_its_own() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("mesh")).expect("a folder");
    fixture.write("other.mtl", "newmtl a\n");
    fixture.write("mesh/legal.mtl", "newmtl a\nKd 0.5\n");
    let pipe = fixture.path("mesh/pipe.mtl");
    assert!(Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()));
    for i in 0..50 {
        fixture.write(&format!("mesh/{i}.mtl"), "newmtl a\n");
    }
    let many: Vec<String> = (0..50).map(|i| format!("{i}.mtl")).collect();
    let table = [
        ("legal.mtl", ""),
        ("absent.mtl", ""),
        ("/dev/zero", "another folder"),
        ("../other.mtl", "another folder"),
        ("pipe.mtl", "not a regular file"),
        (".", "not a regular file"),
        (&many.join(" "), "more than 16"),
    ];
    for (library, fault) in table {
        fixture.write("mesh/a.obj", format!("mtllib {library}\n{TRIANGLE}"));
        if fault.is_empty() {
            let scan = ["scan", "-c", "small.toml", "--scene", "mesh/a.obj"];
            fixture.succeed(&[&scan[..], &POSE].concat());
        } else {
            // A pipe among the files cannot be compared before and after.
            let scan = ["scan", "-c", "small.toml", "--scene", "mesh/a.obj"];
            let said = fixture.run(&[&scan[..], &POSE].concat());
            assert_eq!(said.code, Some(2), "{library}: {}", said.stderr);
            assert!(said.stderr.contains(fault), "{library}: {}", said.stderr);
        }
    }
    fixture.write("mesh/a.obj", format!("mtllib ../other.mtl\n{TRIANGLE}"));
    for libraries in ["anywhere", "none"] {
        let set = format!("scene.libraries={libraries}");
        let scan = ["scan", "-c", "small.toml", "--scene", "mesh/a.obj", "--set", &set];
        fixture.succeed(&[&scan[..], &POSE].concat());
    }
    fixture.write("mesh/a.obj", format!("mtllib /dev/zero\n{TRIANGLE}"));
    let set = "scene.libraries=anywhere";
    let scan = ["scan", "-c", "small.toml", "--scene", "mesh/a.obj", "--set", set];
    assert!(fixture.run(&[&scan[..], &POSE].concat()).stderr.contains("not a regular file"));
}

#[test]
fn numbers_that_overflow_and_names_that_stand_twice_are_refused() {
    let fixture = Fixture::new();
    let faces = ["f 1 2 9223372036854775808", "f 1 2 -9223372036854775808", "f 1 2 4294967297"];
    for face in faces {
        fixture.write("a.obj", format!("{TRIANGLE}{face}\n"));
        scan_refuses(&fixture, "a.obj", &["a.obj"]);
    }
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\n\
               property float y\nproperty float z\nend_header\n1 1 2 3\n";
    fixture.write("twice.ply", ply);
    fixture.refuses(&["register", "twice.ply", "twice.ply"], &["names \"x\" twice"]);
}

#[test]
fn a_ground_that_is_none_is_refused_for_generated_towns_too() {
    let fixture = Fixture::new();
    for ground in ["nonsense", "1e38,0,0", "nan,0,0", "0,0,1e300", "0,0"] {
        let set = format!("scene.ground=\"{ground}\"");
        fixture.refuses(&["config", "--set", &set], &["scene.ground", ground]);
        let scan = ["scan", "--scene", "yard.obj", "--set", &set];
        fixture.refuses(&scan, &["scene.ground", ground]);
    }
}

/// At most so many characters of a file, no escapes of a terminal.
fn says_little(fixture: &Fixture, arguments: &[&str]) {
    let said = fixture.run(arguments);
    let name = arguments.iter().find(|a| a.len() < 40).unwrap_or(&"").to_owned();
    assert_eq!(said.code, Some(2), "{name}: {}", said.stderr.chars().take(500).collect::<String>());
    assert!(said.stderr.len() < 4_000, "{name}: {} bytes", said.stderr.len());
    let hidden = said.stderr.chars().find(|c| c.is_control() && *c != '\n');
    assert_eq!(hidden, None, "{name}: {}", said.stderr);
}

#[test]
fn a_message_repeats_little_of_a_file_or_of_the_command_line() {
    let fixture = Fixture::new();
    let long = "x".repeat(100_000) + "\x1b[31m\x07";
    fixture.write("long.toml", format!("{long}\n"));
    fixture.write("value.toml", format!("[lidar]\npower = \"{}\"\n", "x ".repeat(50_000)));
    fixture.write("long.ply", format!("ply\nformat ascii 1.0\n{long}\n"));
    fixture.write("long.pcd", format!("VERSION {long}\nDATA ascii\n"));
    fixture.write("long.xyz", format!("1 2 3\n{long}\n"));
    fixture.write("long.vtk", format!("# vtk DataFile Version 3.0\nt\n{}\n", &long[99_800..]));
    fixture.write("long.csv", format!("1,{long}\n"));
    fixture.write("long.obj", format!("{TRIANGLE}f 1 2 {long}\n"));
    fixture.write("lib.obj", format!("mtllib ../{long}\n{TRIANGLE}"));
    fixture.write("long.txt", format!("1 0 0 {long}"));
    fixture
        .write("name.json", format!("{{\"parameters\": {{{long:?}: 1}}}}").replace("\\u{", "u{"));
    fixture.write("key.json", format!("{{\"{}\": 1}}", "y".repeat(100_000)));
    fixture.write(
        "value.json",
        format!("{{\"parameters\": {{\"lidar.power\": \"{}\"}}}}", &long[..9_000]),
    );
    let set = format!("lidar.{long}=1");
    let value = format!("lidar.power={long}");
    let table: [&[&str]; 16] = [
        &["config", "-c", "long.toml"],
        &["config", "-c", "value.toml"],
        &["config", "--set", &set],
        &["config", "--set", &value],
        &["config", "--set", &long],
        &["config", "--scene", &long, &long],
        &["register", "long.ply", "long.ply"],
        &["register", "long.pcd", "long.pcd"],
        &["register", "long.xyz", "long.xyz"],
        &["register", "long.vtk", "long.vtk"],
        &["scan", "--scene", "long.obj"],
        &["scan", "--scene", "lib.obj"],
        &["echoes", "long.csv", "--sample-ns", "1"],
        &["evaluate", "-c", "small.toml", "--candidate", "name.json"],
        &["evaluate", "-c", "small.toml", "--candidate", "key.json"],
        &["evaluate", "-c", "small.toml", "--candidate", "value.json"],
    ];
    for arguments in table {
        says_little(&fixture, arguments);
    }
    fixture.write("good.xyz", "0 0 1\n1 0 1\n0 1 1\n");
    says_little(&fixture, &["register", "good.xyz", "good.xyz", "--initial", "long.txt"]);
    says_little(&fixture, &["scan", "--scene", &long]);
}

#[test]
fn a_key_of_many_names_and_a_value_of_many_brackets_are_refused() {
    let fixture = Fixture::new();
    let dots = vec!["a"; 60_000].join(".") + "=1";
    let brackets = format!("seed={}", "[".repeat(60_000));
    for text in [&dots, &brackets] {
        says_little(&fixture, &["config", "--set", text]);
        fixture.write("deep.toml", text);
        says_little(&fixture, &["config", "-c", "deep.toml"]);
    }
    fixture.write("deep.json", "[".repeat(100_000));
    says_little(&fixture, &["evaluate", "-c", "small.toml", "--candidate", "deep.json"]);
}

#[test]
fn files_without_an_end_are_given_up() {
    let fixture = Fixture::new();
    says_little(&fixture, &["config", "-c", "/dev/zero"]);
    says_little(&fixture, &["evaluate", "-c", "small.toml", "--candidate", "/dev/zero"]);
    says_little(&fixture, &["echoes", "/dev/zero", "--sample-ns", "1"]);
}

#[test]
fn a_full_standard_error_ends_nothing() {
    let full = || OpenOptions::new().write(true).open("/dev/full").expect("Linux has one");
    let fixture = Fixture::new();
    let run = |arguments: &[&str]| {
        let mut command = fixture.command(arguments);
        command.stderr(full()).stdout(Stdio::null()).status().expect("it starts").code()
    };
    assert_eq!(run(&["scan", "--scene", "none.ply"]), Some(2));
    assert_eq!(run(&["config", "--no-such-flag"]), Some(2));
    assert_eq!(run(&["tune", "-c", "small.toml"]), Some(0));
    let loud = fixture.read("runs/latest/result.json");
    fixture.tune(&["--runs", "quiet"]);
    assert_eq!(fixture.read("quiet/latest/result.json"), loud);
}
