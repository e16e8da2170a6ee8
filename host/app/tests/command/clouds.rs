//! Clouds that commands write and read: with all that the sensor tells, in the format of the name,
//! to a file or to standard output.

use std::fs;
use std::process::Command;

use crate::fixture::{CommandOutput, Fixture};
use echoloop_clouds::attribute::{ATTRIBUTES, Attribute, COLUMN, ECHO, RING, TIME};
use echoloop_clouds::{CloudFormat, Recorded, read_cloud, read_recorded};

const SCAN: [&str; 4] = ["scan", "-q", "-c", "small.toml"];

fn recorded(fixture: &Fixture, name: &str) -> Recorded {
    read_recorded(&fixture.path(name)).expect(name).0
}

fn values(recorded: &Recorded, attribute: &Attribute) -> Vec<f64> {
    let column = recorded.columns.iter().find(|column| column.name == attribute.name);
    column.map(|column| column.values().collect()).unwrap_or_else(|| panic!("{attribute:?}"))
}

#[test]
fn a_scan_in_either_format_holds_every_attribute_with_the_same_numbers() {
    let fixture = Fixture::new();
    let set = ["--set", "motion.duration_s=0.1"];
    for name in ["cloud.ply", "cloud.pcd"] {
        fixture.succeed(&[&SCAN[..], &set, &["-o", name]].concat());
    }
    assert!(fixture.bytes("cloud.ply").starts_with(b"ply\nformat binary_little_endian 1.0\n"));
    assert!(fixture.bytes("cloud.pcd").starts_with(b"# .PCD v0.7"));
    let cloud = recorded(&fixture, "cloud.ply");
    assert_eq!(cloud, recorded(&fixture, "cloud.pcd"));
    let names: Vec<&str> = cloud.columns.iter().map(|column| column.name.as_str()).collect();
    let expected: Vec<&str> = ATTRIBUTES.iter().map(|attribute| attribute.name).collect();
    assert_eq!(["range_sd"].iter().chain(&names).copied().collect::<Vec<_>>(), expected);
    // 48 columns of 16 rows, fired one after the other in a tenth of a second.
    let beams = values(&cloud, &COLUMN).into_iter().zip(values(&cloud, &RING));
    for ((column, ring), time) in beams.zip(values(&cloud, &TIME)) {
        assert!(column < 48.0 && ring < 16.0);
        assert!((time - (column * 16.0 + ring + 0.5) / 768.0 * 0.1).abs() < 1e-8, "{time}");
    }
    assert!(values(&cloud, &ECHO).iter().all(|echo| *echo < 4.0));
}

#[test]
fn a_name_that_says_no_format_is_refused_before_anything_is_done() {
    let fixture = Fixture::new();
    fs::remove_file(fixture.path("yard.obj")).expect("removed"); // nothing could be traced
    let extensions = CloudFormat::extensions();
    let expected = [extensions.as_str(), "- for standard output"];
    for name in ["cloud.las", "cloud", "cloud.ply.gz"] {
        fixture.refuses(&[&SCAN[..], &["-o", name]].concat(), &[&expected[..], &[name]].concat());
        let register = ["register", "absent.ply", "absent.ply", "-o", name];
        fixture.refuses(&register, &[&expected[..], &[name]].concat());
    }
    let both = [&SCAN[..], &["-o", "cloud.ply", "--format", "pcd"]].concat();
    fixture.refuses(&both, &["cloud.ply: the name says ply, --format says pcd"]);
    fixture.refuses(&[&SCAN[..], &["--format", "pcd"]].concat(), &["--output"]);
    let names = CloudFormat::ALL.map(CloudFormat::name).join(", ");
    fixture.refuses(&[&SCAN[..], &["-o", "a.ply", "--format", "las"]].concat(), &[&names]);
    fixture.refuses(&["pairs", "-o", "folder", "--format", "las"], &[&names]);
}

#[test]
fn standard_output_takes_the_cloud_alone() {
    let fixture = Fixture::new();
    for (name, format) in [("cloud.ply", &[][..]), ("cloud.pcd", &["--format", "pcd"])] {
        fixture.succeed(&[&SCAN[..], &["-o", name]].concat());
        for path in ["-", "/dev/stdout"] {
            let output = fixture.command(&[&SCAN[..], &["-o", path], format].concat()).output();
            let output = output.expect("echoloop runs");
            assert_eq!(output.stdout, fixture.bytes(name), "{path}");
            assert!(output.stderr.is_empty(), "quiet: {:?}", String::from_utf8(output.stderr));
        }
    }
    let told = |more: &[&str]| {
        let scan = [&["scan", "-c", "small.toml", "-o", "-"], more].concat();
        let output = fixture.command(&scan).output().expect("echoloop runs");
        assert_eq!(output.stdout, fixture.bytes("cloud.ply"), "{more:?}");
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    assert!(told(&[]).contains(" points of 768 beams"), "{}", told(&[]));
    let document: serde_json::Value = serde_json::from_str(&told(&["--json", "-q"])).expect("JSON");
    assert_eq!(document["points"], read_cloud(&fixture.path("cloud.ply")).unwrap().0.points.len());
}

#[cfg(unix)]
#[test]
fn a_pipe_takes_a_cloud_to_another_command_or_ends_quietly() {
    let fixture = Fixture::new();
    let piped = |taker: &str| {
        let echoloop = env!("CARGO_BIN_EXE_echoloop");
        let line = format!(
            "set -o pipefail; '{echoloop}' scan -c small.toml -o - 2>said | {taker}; echo $?"
        );
        let mut shell = Command::new("bash");
        shell.args(["-c", &line]).current_dir(fixture.path(""));
        CommandOutput::from_output(shell.output().expect("bash runs"))
    };
    assert_eq!(piped("cat > piped.ply").stdout, "0\n");
    assert!(!recorded(&fixture, "piped.ply").cloud.points.is_empty());
    assert_eq!(piped("exec true").stdout, "141\n", "the reader has gone");
    assert!(!fixture.read("said").contains("error"), "{}", fixture.read("said"));
    // A pipe that the shell opened says no format: PLY, or what --format says.
    let echoloop = env!("CARGO_BIN_EXE_echoloop");
    let scan = format!("'{echoloop}' scan -q -c small.toml --format pcd -o >(cat > substituted)");
    let done = Command::new("bash").args(["-c", &scan]).current_dir(fixture.path("")).output();
    assert!(done.expect("bash runs").status.success());
    let whole = || fs::metadata(fixture.path("substituted")).map_or(0, |file| file.len());
    while whole() < 1000 {
        std::thread::sleep(std::time::Duration::from_millis(10)); // `cat` is not waited for
    }
    assert!(fixture.bytes("substituted").starts_with(b"# .PCD"));
}

/// Two scans of the yard, half a metre apart.
pub(crate) fn pair(fixture: &Fixture, format: &str) {
    let set = "scanner.columns=180 scanner.rows=48 data.test_pairs=1 data.train_pairs=1";
    let mut pairs = vec!["pairs", "-q", "-c", "small.toml", "-o", format, "--format", format];
    pairs.extend(set.split_whitespace().flat_map(|set| ["--set", set]));
    fixture.succeed(&pairs);
}

#[test]
fn a_registered_source_keeps_all_that_is_known_of_its_points() {
    let fixture = Fixture::new();
    pair(&fixture, "ply");
    let register = ["register", "-q", "--json", "ply/000_target.ply", "ply/000_source.ply"];
    let plain = fixture.succeed(&register).json();
    for name in ["moved.ply", "moved.pcd"] {
        let mut found = fixture.succeed(&[&register[..], &["-o", name]].concat()).json();
        found["cpu_s"] = plain["cpu_s"].clone();
        assert_eq!(found, plain, "the same registration");
        let (source, moved) = (recorded(&fixture, "ply/000_source.ply"), recorded(&fixture, name));
        fixture.write("found.json", plain.to_string());
        let motion = echoloop_clouds::pose::read_pose(&fixture.path("found.json")).unwrap();
        assert_eq!(
            (&moved.columns, &moved.cloud.range_sd_m),
            (&source.columns, &source.cloud.range_sd_m)
        );
        for (moved, source) in moved.cloud.points.iter().zip(&source.cloud.points) {
            let expected = (motion * source.cast::<f64>()).cast::<f32>();
            assert!((moved - expected).norm() < 1e-5, "{moved} {expected}");
        }
    }
    let mut piped = fixture.command(&[&register[..], &["-o", "-"]].concat());
    let piped = piped.output().expect("echoloop runs");
    assert_eq!(piped.stdout, fixture.bytes("moved.ply"));
    let text =
        fixture.succeed(&[&["register"], &register[3..], &["-o", "moved.pcd"]].concat()).stdout;
    assert!(text.ends_with("wrote moved.pcd\n"), "{text}");
}

#[test]
fn a_source_that_is_not_registered_is_not_written() {
    let fixture = Fixture::new();
    pair(&fixture, "ply");
    // Somewhere else.
    let mut away = recorded(&fixture, "ply/000_source.ply");
    away.cloud.points.iter_mut().for_each(|p| *p = [p.x * 0.1, p.z * 9.0, p.y * p.y].into());
    fixture.write("away.ply", CloudFormat::Ply.bytes(&away.cloud, &away.columns));
    let output = fixture.run(&["register", "ply/000_target.ply", "away.ply", "-o", "moved.ply"]);
    assert_eq!(output.code, Some(1), "{}", output.stderr);
    assert!(output.stderr.contains("nothing is written"), "{}", output.stderr);
    assert!(!fixture.path("moved.ply").exists());
}

#[test]
fn the_deviations_of_a_pcd_weigh_as_those_of_a_ply() {
    let fixture = Fixture::new();
    pair(&fixture, "ply");
    pair(&fixture, "pcd");
    let found = |end: &dyn Fn(&str) -> String| {
        let (target, source) = (end("target"), end("source"));
        let register = ["register", "-q", "--json", &target, &source, "--method", "icp"];
        fixture.succeed(&register).json()["target_from_source"].clone()
    };
    let (ply, pcd) =
        (found(&|end| format!("ply/000_{end}.ply")), found(&|end| format!("pcd/000_{end}.pcd")));
    assert_eq!(ply, pcd);
    for end in ["target", "source"] {
        let mut silent = recorded(&fixture, &format!("ply/000_{end}.ply"));
        silent.cloud.range_sd_m = None;
        fixture.write(&format!("{end}.pcd"), CloudFormat::Pcd.bytes(&silent.cloud, &[]));
    }
    assert_ne!(ply, found(&|end| format!("{end}.pcd")), "they are used");
}

#[test]
fn a_file_with_a_bad_attribute_is_refused_by_name_and_with_exit_code_2() {
    let fixture = Fixture::new();
    fixture.succeed(&[&SCAN[..], &["-o", "good.ply"]].concat());
    let pcd = |fields: &str, rest: &str, row: &str| {
        format!(
            "VERSION 0.7\nFIELDS x y z {fields}\n{rest}\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n\
             DATA ascii\n1 2 3 {row}\n\n\n"
        )
    };
    let counts = "SIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 3";
    let table = [
        ("count.pcd", pcd("intensity", counts, "1 2 3"), "\"intensity\", found 3"),
        ("size.pcd", pcd("ring", "SIZE 4 4 4\nTYPE F F F U", "1"), "PCD"),
        ("type.pcd", pcd("ring", "SIZE 4 4 4 2\nTYPE F F F X", "1"), "\"X\""),
        ("sd.pcd", pcd("range_sd", "SIZE 4 4 4 4\nTYPE F F F F", "-1"), "range_sd of point 0"),
        (
            "list.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
             property float z\nproperty list uchar float time\nend_header\n1 2 3 1 5\n"
                .into(),
            "\"time\"",
        ),
    ];
    for (name, content, part) in table {
        fixture.write(name, content);
        fixture.refuses(&["register", "good.ply", name], &[name, part]);
        fixture.refuses(&["register", "good.ply", name, "-o", "moved.ply"], &[name, part]);
    }
}
