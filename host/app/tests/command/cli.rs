//! The command as a user meets it: what it refuses and how it says so, what it leaves behind, and
//! that an interrupted run goes on as if nothing had been.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::fixture::{CommandOutput, Fixture, SMALL};
use echoloop_needs::data;
use serde_json::Value;

#[test]
fn a_bad_configuration_file_is_refused_with_file_line_and_caret() {
    let fixture = Fixture::new();
    let table = [
        ("[lidar]\npowr = 3\n", "line 2", "unknown field `powr`"),
        ("sed = 1\n", "line 1", "unknown field `sed`"),
        ("[lidar]\npower = nan\n", "line 2", "power must be finite"),
        ("[lidar]\npower = -3\n", "line 2", "power -3 W is below its minimum 0.00001 W"),
        ("[lidar]\npower = 500\n", "line 2", "above its maximum 100 W"),
        ("[lidar]\nupsampling = 3\n", "line 2", "upsampling 3 is none of 1, 2, 4, 8"),
        ("[lidar]\ntiming = \"late\"\n", "line 2", "rising-edge"),
        ("[lidar]\npower = \"much\"\n", "line 2", "much"),
        ("[data]\ntest_pairs = -1\n", "line 2", "-1"),
        ("[tune]\nprotocol = \"all\"\n", "line 2", "unknown variant `all`"),
        ("seed = \n", "line 1", ""),
    ];
    for (text, line, problem) in table {
        fixture.write("bad.toml", text);
        for command in ["tune", "evaluate", "scan", "sensor", "config"] {
            fixture.refuses(&[command, "-c", "bad.toml"], &["bad.toml", line, "^", problem]);
        }
    }
}

#[test]
fn a_value_that_makes_no_sense_is_refused_by_name_everywhere() {
    let fixture = Fixture::new();
    let table: [(&str, &[&str]); 39] = [
        ("lidar.powr=1", &["--set lidar.powr=1", "unknown field `powr`"]),
        ("optics.power=1", &["unknown field `optics`"]),
        ("lidar.power", &["a.b=value"]),
        ("lidar.power=nan", &["power must be finite"]),
        ("lidar.power=inf", &["power must be finite"]),
        ("lidar.saturation=0.1", &["saturation 0.1 of full scale is below its minimum"]),
        ("lidar.noise_floor=0.5", &["noise_floor 0.5 of full scale is above its maximum"]),
        ("lidar.upsampling=3", &["upsampling 3"]),
        ("lidar.timing=late", &["rising-edge"]),
        ("lidar.pulse_width=20", &["pulse energy limit"]),
        ("lidar.waveform_resolution=200", &["pulse_width", "fewer than 2.5 samples"]),
        ("receiver.adc_bits=30", &["receiver.adc_bits = 30 must be 8 to 14"]),
        ("receiver.bandwidth_mhz=nan", &["receiver.bandwidth_mhz = NaN"]),
        ("emitter.energy_limit_nj=374.9", &["power", "pulse energy limit of 374.9 nJ"]),
        ("emitter.energy_limit_nj=0", &["emitter.energy_limit_nj = 0 must be 0.001 to 2000"]),
        ("emitter.energy_limit_nj=nan", &["emitter.energy_limit_nj = NaN"]),
        ("data.baseline_m=-2", &["data.baseline_m = -2 must be 0 to 100"]),
        ("data.baseline_m=nan", &["data.baseline_m = NaN"]),
        ("data.train_pairs=0", &["data.train_pairs = 0"]),
        ("data.test_pairs=0", &["data.test_pairs = 0"]),
        ("scanner.columns=0", &["scanner.columns = 0"]),
        (
            "scanner.pattern=os2",
            &["scanner.pattern = \"os2\" must be one of grid, raster, steered"],
        ),
        ("scanner.pattern=os1-64", &["scanner.rows = 16 must be left out"]),
        ("scanner.height_m=0", &["scanner.height_m = 0"]),
        ("scene.towns=[]", &["scene.towns"]),
        ("tune.generations=0", &["tune.generations = 0"]),
        ("tune.population=1", &["tune.population = 1"]),
        ("front.cost=love", &["front", "energy"]),
        ("front.points=1", &["front.points = 1 must be 2 to 1000"]),
        ("front.population=3", &["front.population = 3 must be 4 to 10000"]),
        ("front.generations=0", &["front.generations = 0 must be 1 to 100000"]),
        ("front.pairs=0", &["front.pairs = 0 must be 1 to 10000"]),
        ("tune.weights.energy=-1", &["tune.weights.energy = -1 must be 0 to 10"]),
        ("tune.weights.instructions=-1", &["tune.weights.instructions = -1 must be 0 to 10"]),
        ("tune.weights.bits=-0.1", &["tune.weights.bits = -0.1 must be 0 to 10"]),
        ("tune.weights.seconds=nan", &["tune.weights.seconds = NaN must be 0 to 10"]),
        ("tune.at_most_error=0.5", &["tune.at_most_error = 0.5 must be 1 to 100"]),
        ("tune.minimise=light", &["unknown variant `light`"]),
        ("tune.error_cap=-1", &["tune.error_cap = -1"]),
    ];
    for (set, parts) in table {
        for command in ["tune", "evaluate", "scan"] {
            fixture.refuses(&[command, "-c", "small.toml", "--set", set], parts);
        }
    }
    for command in ["tune", "evaluate"] {
        fixture.refuses(
            &[command, "-c", "small.toml", "--set", "registration.voxel_m=-1"],
            &["registration.voxel_m = -1"],
        );
        fixture.refuses(
            &[command, "-c", "small.toml", "--set", "registration.voxel_m=nan"],
            &["voxel_m = NaN"],
        );
    }
    fixture
        .refuses(&["sensor", "--set", "lidar.pulse_width=20"], &["refused", "pulse energy limit"]);
    fixture.refuses(&["scan", "--pose", "0", "0", "nan", "0", "0", "0"], &["--pose", "finite"]);
    for flag in ["--generations=-1", "--seed=x", "--method=magic", "--threads=many"] {
        fixture.refuses(&["tune", flag], &[flag.split('=').next().expect("a name")]);
    }
    fixture.refuses(&["tune", "--repair"], &["--resume"]);
    fixture.refuses(&["conjure"], &["conjure"]);
}

#[test]
fn a_search_whose_every_registration_finds_nothing_says_so_and_keeps_its_journal() {
    for (strategy, protocol, method, stop) in [
        ("fast", "registration", "icp", "TooFewPairs"),
        ("paper", "registration", "icp", "TooFewPairs"),
        ("fast", "joint", "mac", "EmptyCloud"),
        ("paper", "registration", "fgr", "TooFewMatches"),
        ("fast", "lidar", "gicp", "EmptyCloud"),
    ] {
        let fixture = Fixture::new();
        // So little light that no scan has a point.
        let dark = ["lidar.power=0.00001", "emitter.energy_limit_nj=0.001"];
        let dark = dark.iter().flat_map(|set| ["--set", set]);
        let tune = ["tune", "-c", "small.toml", "-q", "--protocol", protocol, "--method", method];
        let more = ["--strategy", strategy, "--generations", "2", "--runs", "runs"];
        let arguments: Vec<&str> = tune.into_iter().chain(more).chain(dark).collect();
        let output = fixture.run(&arguments);
        let what = format!("{strategy} {protocol} {method}");
        assert_eq!(output.code, Some(2), "{what}: {}", output.stderr);
        for part in ["none of the ", "found a motion", stop, "journal"] {
            assert!(output.stderr.contains(part), "{what}: no {part:?}: {}", output.stderr);
        }
        assert!(!fixture.path("runs/latest/result.json").exists(), "{what}");
        let journal = fixture.bytes("runs/latest/history.jsonl");
        let again = fixture.run(&["tune", "-q", "--resume", "runs/latest"]);
        assert_eq!((again.code, &again.stderr), (Some(2), &output.stderr), "{what}");
        assert!(journal.split(|byte| *byte == b'\n').count() > 2, "{what}: no generations");
        assert!(fixture.bytes("runs/latest/history.jsonl") == journal, "{what}");
    }
}

/// A scene that is not there: what is refused before it is looked for was refused in time.
const NOWHERE: [&str; 4] = ["-c", "small.toml", "--scene", "absent.ply"];

#[test]
fn a_flag_that_takes_no_such_number_says_which_it_takes_before_anything_is_traced() {
    let fixture = Fixture::new();
    let huge = "1180591620717411303424";
    let generations = "expected a whole number, 1 to 100000";
    let recall = "expected a number, 0 to 100";
    let seed = "expected a whole number, 0 or more, below 2^63";
    for (command, flag, value, expected) in [
        ("tune", "--generations", "0", generations),
        ("tune", "--generations", "-1", generations),
        ("tune", "--generations", "1.5", generations),
        ("tune", "--generations", huge, generations),
        ("tune", "--population", "1", "expected a whole number, 0 (automatic) or 2 to 10000"),
        ("tune", "--at-most-error", "0.5x", "expected a number, 1 to 100 times, as 1.2x"),
        ("tune", "--threads", "-1", "expected a whole number, 0 to 1024"),
        ("tune", "--seed", "-1", seed),
        ("tune", "--seed", "9223372036854775808", seed),
        ("tune", "--require-recall", "200", recall),
        ("evaluate", "--require-recall", "nan", recall),
        ("evaluate", "--require-recall", "-1", recall),
        ("scan", "--threads", "1.5", "expected a whole number, 0 to 1024"),
    ] {
        fixture.refuses(&[&[command][..], &NOWHERE, &[flag, value]].concat(), &[flag, expected]);
    }
    for (flags, parts) in [
        (&["--minimise=energy", "--strategy=paper"][..], &["tune.minimise = energy", "paper"][..]),
        (&["--objective=weighted", "--strategy=paper"], &["tune.objective = weighted", "paper"]),
        (&["--minimise=bits", "--protocol=registration"], &["tune.minimise", "of the sensor"]),
        (&["--minimise=seconds"], &["tune.minimise", "lidar.shots"]),
        (&["--pareto=seconds"], &["front.cost", "lidar.shots"]),
        (
            &["--pareto=energy", "--fix=lidar.power", "--fix=lidar.pulse_width"],
            &["front.cost", "lidar.power or lidar.pulse_width"],
        ),
        (&["--at-most-error=1.5x"], &["--at-most-error 1.5", "--minimise"]),
    ] {
        fixture.refuses(&[&["tune"][..], &NOWHERE, flags].concat(), parts);
    }
    let points = ["tune", "--pareto", "--points", "1"];
    fixture.refuses(&points, &["--points", "expected a whole number, 2 to 1000"]);
    fixture
        .refuses(&["echoes", "a.csv", "--sample-ns", "1", "--least-echoes", "3"], &["16 or more"]);
    let register = ["register", "absent.xyz", "absent.xyz", "--method", "icp"];
    for (flag, value, expected) in [
        ("--max-iterations", "-1", "expected a whole number, icp, gicp: 1 or more"),
        ("--max-iterations", "0", "max_iterations is 0, expected 1 or more"),
        ("--voxel-m", "-1", "voxel_m is -1, expected a length above 0 m"),
    ] {
        fixture.refuses(&[&register[..], &[flag, value]].concat(), &[expected]);
    }
}

#[test]
fn config_refuses_what_evaluate_refuses_in_the_same_words() {
    let fixture = Fixture::new();
    for set in [
        "registration.voxel_m=-1",
        "registration.max_iterations=1.5",
        "registration.refine=true",
        "registration.least_clique=4",
        "tune.axes.lidar.power=0.000001..1",
        "tune.axes.registration.least_clique=free",
        "registration.rotation_tolerance_rad=-1",
        "lidar.pulse_width=20",
        "data.train_pairs=0",
    ] {
        let said = |command: &str| {
            let output = fixture.run(&[&[command][..], &NOWHERE, &["-q", "--set", set]].concat());
            assert_eq!((output.code, &*output.stdout), (Some(2), ""), "{command} {set}");
            output.stderr
        };
        assert_eq!(said("config"), said("evaluate"), "{set}");
        fixture.refuses(&["config", "--set", set, "--json"], &[]);
    }
    // The hardware is the configuration's.
    let wide = ["lidar.pulse_width=20", "emitter.energy_limit_nj=1500", "scanner.pattern=grid"];
    let wide = wide.map(|set| ["--set", set]).concat();
    fixture.succeed(&[&["config"], &wide[..]].concat());
}

#[test]
fn a_key_is_explained_with_its_bound_and_its_defaults() {
    let fixture = Fixture::new();
    let explain = |more: &[&str]| fixture.succeed(&[&["config", "--explain"], more].concat());
    assert_eq!(
        explain(&["data.baseline_m", "--set", "data.baseline_m=3"]).stdout,
        "data.baseline_m = 2.0 m\n    \
         Distance of a pair's scans, m: the paper's 2 for local methods, 5 for global ones.\n    \
         must be 0 to 100\n    \
         5.0 with registration.method = \"fgr\", \"mac\", \"auto\"\n    \
         now 3.0\n"
    );
    assert_eq!(explain(&["baseline_m"]).stdout.lines().next(), Some("data.baseline_m = 2.0 m"));
    let keys = |more: &[&str]| -> Vec<String> {
        let rows = explain(&[more, &["--json"]].concat()).json();
        let rows = rows.as_array().expect("rows").iter();
        rows.map(|row| row["key"].as_str().expect("a name").to_owned()).collect()
    };
    let weights =
        ["energy", "instructions", "bits", "seconds"].map(|k| format!("tune.weights.{k}"));
    assert_eq!(keys(&["tune.weights"]), weights);
    let of_tune = keys(&["tune"]);
    assert!(weights.iter().all(|key| of_tune.contains(key)), "a section has those below it");
    let all = keys(&[]);
    for key in ["seed", "scene.towns", "lidar.power", "registration.voxel_m", "motion.jitter_per"] {
        assert!(all.iter().any(|name| name == key), "{key}");
    }
    let row = &explain(&["lidar.power", "--json"]).json()[0];
    assert_eq!(
        (&row["min"], &row["max"], &row["unit"]),
        (&1e-5.into(), &100.0.into(), &"W".into())
    );
    let parts = ["--explain conjured", "scene", "tune.weights", "motion"];
    fixture.refuses(&["config", "--explain", "conjured"], &parts);
    fixture.refuses(&["config", "--explain", "data", "--set", "data.train_pairs=0"], &["data"]);
}

#[test]
fn flags_count_before_the_command_s_name_as_after_it() {
    let fixture = Fixture::new();
    let plain = fixture.succeed(&["config", "--seed", "3", "--set", "lidar.power=20"]).stdout;
    assert!(plain.starts_with("seed = 3\n") && plain.contains("power = 20.0"), "{plain}");
    let before = fixture.succeed(&["--seed", "3", "--set", "lidar.power=20", "config"]).stdout;
    let between = fixture.succeed(&["--seed=3", "config", "--set", "lidar.power=20"]).stdout;
    assert_eq!([&before, &between], [&plain, &plain]);
    // What a command has no use for is not passed over.
    fixture.refuses(&["--seed", "3", "echoes", "a.csv", "--sample-ns", "1"], &["--seed"]);
    fixture.refuses(&["--generations", "3", "config"], &["--generations"]);
    fixture.refuses(&["--seed", "3", "config", "--seed", "4"], &["--seed"]);
    fixture.refuses(&["--seed", "x", "evaluate"], &["--seed", "expected a whole number"]);
    fixture.refuses(&[&["--seed", "3"], &NOWHERE[..]].concat(), &["absent.ply"]);
}

#[test]
fn a_sensor_says_what_it_saved() {
    let fixture = Fixture::new();
    let saves = ["sensor", "--set", "lidar.power=50", "--set", "lidar.timing=cfd", "--save"];
    let said = fixture.succeed(&saves).stdout;
    let last = said.lines().last().expect("a line");
    let hash = said.lines().find_map(|line| line.strip_prefix("settings ")).expect("their hash");
    let own = "power = 50 W, timing = cfd; all others are the defaults";
    assert_eq!(last, format!("saved {hash}: {own}"));
    let document = fixture.succeed(&[&saves[..], &["--json"]].concat()).json();
    assert_eq!(document["saved"], serde_json::json!(["power", "timing"]));
    assert_eq!(document["hash"], hash);
    let said = fixture.succeed(&["sensor", "--save"]).stdout;
    assert!(said.ends_with(": all settings are the defaults\n"), "{said}");
    let said = fixture.succeed(&["sensor", "--forget"]).stdout;
    assert!(
        said.ends_with("forgot what was saved: its next start is with its defaults\n"),
        "{said}"
    );
    assert!(!fixture.succeed(&["sensor"]).stdout.contains("saved"), "nothing was");
}

#[test]
fn a_higher_energy_limit_lets_a_stronger_pulse_through_and_no_more() {
    let fixture = Fixture::new();
    let limit =
        ["sensor", "--json", "--set", "emitter.energy_limit_nj=600", "--set", "lidar.power=60"];
    let with = |width: &'static str| [&limit[..], &["--set", width]].concat();
    let output = fixture.succeed(&with("lidar.pulse_width=10")).json();
    assert_eq!(output["hardware"]["energy_limit_pj"], 600_000);
    assert_eq!(output["settings"]["pulse_width"], 10.0);
    fixture.refuses(&with("lidar.pulse_width=10.01"), &["pulse energy limit of 600.0 nJ"]);
    let usual = ["sensor", "--set", "lidar.power=60", "--set", "lidar.pulse_width=10"];
    fixture.refuses(&usual, &["pulse energy limit of 400.0 nJ"]);
}

#[test]
fn a_configuration_file_that_cannot_be_read_is_named() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("folder.toml")).expect("a folder");
    fixture.write("noise.toml", [0xff; 40]);
    for name in ["absent.toml", "folder.toml", "noise.toml"] {
        fixture.refuses(&["tune", "-c", name], &[name]);
    }
}

#[test]
fn a_scene_that_is_none_is_refused_by_name() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("folder.ply")).expect("a folder");
    let triangle = "v 0 0 0\nv 9 0 0\nv 0 9 0\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
               property float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let header = ply.replace("ascii", "binary_little_endian");
    let files: [(&str, String); 9] = [
        ("empty.ply", String::new()),
        ("garbage.ply", "\u{1}\u{2}garbage".repeat(99)),
        ("truncated.ply", header),
        ("short.ply", format!("{ply}0 0 0\n1 0 0\n")),
        ("index.ply", format!("{ply}0 0 0\n9 0 0\n0 9 0\n3 0 1 7\n")),
        ("nan.obj", "v 0 0 nan\nv 9 0 0\nv 0 9 0\nf 1 2 3\n".into()),
        ("faceless.obj", triangle.into()),
        ("flat.obj", format!("{triangle}f 1 1 1\n")),
        ("index.obj", format!("{triangle}f 1 2 8\n")),
    ];
    for (name, content) in &files {
        fixture.write(name, content);
    }
    fixture.write("mesh.stl", "solid\n");
    let names = files.iter().map(|(name, _)| *name).chain([
        "absent.ply",
        "folder.ply",
        "mesh.stl",
        "narnia",
    ]);
    for name in names {
        for command in ["tune", "evaluate", "scan"] {
            fixture.refuses(&[command, "-c", "small.toml", "--scene", name], &[name]);
        }
    }
    fixture.refuses(
        &["scan", "-c", "small.toml", "--set", "scene.ground=lawn"],
        &["scene.ground", "lawn"],
    );
    // A shape from which nothing can be seen: nowhere to stand.
    fixture.write("speck.obj", "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nf 1 2 3\n");
    fixture.refuses(
        &["tune", "-c", "small.toml", "--scene", "speck.obj"],
        &["speck", "no viable viewpoint"],
    );
}

#[test]
fn a_cloud_that_is_none_is_refused_by_name() {
    let fixture = Fixture::new();
    fixture.write("good.xyz", "0 0 1\n1 0 1\n0 1 1\n");
    fs::create_dir(fixture.path("folder.ply")).expect("a folder");
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 99\nproperty float x\n\
               property float y\n\
        property float z\nend_header\n1234";
    let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\n\
               POINTS 9\nDATA binary\n12";
    let files: [(&str, &[u8]); 11] = [
        ("empty.ply", b""),
        ("empty.xyz", b""),
        ("empty.bin", b""),
        ("comment.xyz", b"# no point\n"),
        ("nan.xyz", b"nan nan nan\n"),
        ("word.xyz", b"1 two 3\n"),
        ("cut.ply", ply.as_bytes()),
        ("cut.pcd", pcd.as_bytes()),
        ("cut.bin", &[1; 17]),
        ("garbage.pcd", &[0x9c; 300]),
        ("cloud.las", b"LASF"),
    ];
    for (name, content) in files {
        fixture.write(name, content);
    }
    for (name, _) in files.into_iter().chain([("absent.ply", &b""[..]), ("folder.ply", b"")]) {
        fixture.refuses(&["register", "good.xyz", name], &[name]);
        fixture.refuses(&["register", name, "good.xyz"], &[name]);
    }
    let flags = [
        ("--voxel-m", "0"),
        ("--voxel-m", "nan"),
        ("--max-pair-distance-m", "-1"),
        ("--max-iterations", "0"),
        ("--normal-neighbours", "2"),
        ("--normal-neighbours", "18446744073709551615"),
    ];
    for (flag, value) in flags {
        let option = format!("{flag}={value}");
        fixture.refuses(
            &["register", "good.xyz", "good.xyz", "--method", "icp", &option],
            &[&flag[2..].replace('-', "_")],
        );
    }
    fixture.write("matrix.txt", "1 0 0 0\n0 1 0 0\n");
    fixture.refuses(
        &["register", "good.xyz", "good.xyz", "--initial", "matrix.txt"],
        &["matrix.txt", "4×4"],
    );
}

#[test]
#[cfg(unix)]
fn a_file_without_permission_is_refused_by_name() {
    use std::os::unix::fs::PermissionsExt;
    let fixture = Fixture::new();
    fixture.write("locked.xyz", "0 0 1\n");
    fs::set_permissions(fixture.path("locked.xyz"), fs::Permissions::from_mode(0o000))
        .expect("permissions");
    if fs::read(fixture.path("locked.xyz")).is_ok() {
        eprintln!("SKIPPED: this user may read everything");
        return;
    }
    let output = fixture.run(&["register", "locked.xyz", "locked.xyz"]);
    assert_eq!(output.code, Some(2));
    assert!(output.stderr.contains("locked.xyz"), "{}", output.stderr);
}

#[test]
fn an_output_that_cannot_be_written_is_refused_by_name() {
    let fixture = Fixture::new();
    fixture.write("file", "kept");
    fixture.refuses(&["tune", "-q", "-c", "small.toml", "--runs", "file/below"], &["file/below"]);
    fixture.refuses(&["tune", "-q", "-c", "small.toml", "--runs", "file"], &["file"]);
    fixture.refuses(
        &["scan", "-c", "small.toml", "-o", "file/below/cloud.ply"],
        &["file/below/cloud.ply"],
    );
    fixture.refuses(&["scan", "-c", "small.toml", "-o", "absent/cloud.ply"], &["absent/cloud.ply"]);
}

#[test]
fn a_candidate_that_is_none_is_refused_by_name() {
    let fixture = Fixture::new();
    let table = [
        (r#"{"parameters": {"lidar.powr": 50}}"#, "unknown parameter `lidar.powr`"),
        (r#"{"parameters": {"voxel_m": 1}}"#, "unknown parameter `voxel_m`"),
        (r#"{"parameters": {"lidar.power": 500}}"#, "lidar.power 500 W is above its maximum 100 W"),
        (r#"{"parameters": {"lidar.upsampling": 3}}"#, "lidar.upsampling 3"),
        (
            r#"{"parameters": {"registration.voxel_m": 0}}"#,
            "registration.voxel_m = 0 is outside 0.05 to 1 m",
        ),
        (r#"{"parameters": {"lidar.power": "much"}}"#, "lidar.power = \"much\" must be a number"),
        (r#"{"parameters": {"lidar.powr": "much"}}"#, "lidar.powr"),
        (
            r#"{"parameters": {"lidar.denoise": "box"}}"#,
            "lidar.denoise = \"box\" must be one of none, gaussian, matched",
        ),
        (r#"{"parameters": {"lidar.denoise": 1.5}}"#, "lidar.denoise = 1.5 must be a whole number"),
        (r#"{"parameters": {"lidar.denoise": 3}}"#, "lidar.denoise"),
        (r#"{"parameters": {"lidar.echoes": 1.2}}"#, "lidar.echoes = 1.2 must be a whole number"),
        (
            r#"{"parameters": {"lidar.denoise": [1]}}"#,
            "lidar.denoise = [1] must be one of none, gaussian, matched",
        ),
        (r#"{"parameters": {"lidar.power": null}}"#, "bad.json"),
        (r#"{"parameters": {"lidar.power": 1e999}}"#, "bad.json"),
        (r#"{"lidar.power": 50}"#, "bad.json"),
        ("power = 50", "bad.json"),
        ("", "bad.json"),
    ];
    for (text, problem) in table {
        fixture.write("bad.json", text);
        fixture.refuses(
            &[&["evaluate", "-q", "--candidate", "bad.json"], &NOWHERE[..]].concat(),
            &["error: bad.json: ", problem],
        );
    }
    fixture
        .refuses(&["evaluate", "-c", "small.toml", "--candidate", "absent.json"], &["absent.json"]);
}

#[test]
fn a_run_leaves_everything_to_look_at_and_repeats_itself() {
    let fixture = Fixture::new();
    let output = fixture.tune(&["--threads", "2"]);
    assert!(output.stderr.is_empty(), "quiet: {}", output.stderr);
    let folder = "runs/0001-yard-icp-joint";
    let names = [
        "config.toml",
        "history.jsonl",
        "result.json",
        "about.json",
        "tuned.toml",
        "report.html",
        "README.txt",
        "before.ply",
        "after.ply",
    ];
    for name in names {
        assert!(fixture.bytes(&format!("{folder}/{name}")).len() > 100, "{name}");
    }
    let mut found: Vec<_> = fs::read_dir(fixture.path(folder))
        .expect("a folder")
        .map(|e| e.expect("entry").file_name())
        .collect();
    found.sort();
    let mut expected = names.map(std::ffi::OsString::from);
    expected.sort();
    assert_eq!(found, expected, "and nothing else");
    #[cfg(unix)]
    assert_eq!(
        fs::read_link(fixture.path("runs/latest")).expect("a link"),
        Path::new("0001-yard-icp-joint")
    );

    let config = format!("{folder}/config.toml");
    fixture.succeed(&["tune", "-q", "--threads", "1", "--config", &config]);
    for name in
        ["config.toml", "history.jsonl", "result.json", "report.html", "before.ply", "after.ply"]
    {
        let again = fixture.repeatable(&format!("runs/0002-yard-icp-joint/{name}"));
        assert!(
            again == fixture.repeatable(&format!("{folder}/{name}")),
            "{name} differs on one thread"
        );
    }

    let judged = fixture.succeed(&["evaluate", "-q", "--json", "--run", folder]).json();
    let result: Value =
        serde_json::from_str(&fixture.read(&format!("{folder}/result.json"))).expect("JSON");
    assert_eq!(
        judged["summary"], result["tuned_summary"],
        "the tuned parameters are worth what the run said"
    );
    assert_eq!(judged["parameters"], result["tuned"]);
    for values in [&result["default"], &result["finalists"][0]["values"], &judged["parameters"]] {
        let count = &values["registration.normal_neighbours"];
        assert!(count.is_u64() && values["lidar.power"].is_f64(), "{values}");
    }

    let resumed = fixture.succeed(&["tune", "-q", "--json", "--resume", folder]);
    assert_eq!(resumed.json(), result, "resuming a finished run says the same again");
    look_at(&fixture.read(&format!("{folder}/report.html")));
}

#[test]
fn a_search_of_all_fifteen_is_shown_with_the_names_of_choices_and_the_value_of_what_follows() {
    let fixture = Fixture::new();
    let output = fixture.tune(&[
        "--set",
        "tune.protocol=lidar",
        "--set",
        "tune.lidar=full",
        "--generations",
        "1",
    ]);
    let line = |name: &str| {
        output.stdout.lines().find(|line| line.starts_with(name)).expect(name).to_owned()
    };
    assert!(!output.stdout.contains("NaN"), "{}", output.stdout);
    let separation = line("lidar.min_separation");
    assert!(
        separation.contains(" 0.854 "),
        "1.14 of half the way that light goes in 5 ns: {separation}"
    );
    let report = fixture.read("runs/latest/report.html");
    for (name, default, range) in [
        ("lidar.denoise", "matched", "none, gaussian, matched"),
        ("lidar.timing", "walk-corrected", "rising-edge, parabola, cfd, walk-corrected"),
        ("lidar.echo_choice", "strongest", "strongest, first, last"),
    ] {
        assert!(line(name).contains(default) && line(name).ends_with(range), "{}", line(name));
        assert!(
            report.contains(&format!("<th scope=\"row\">{name}</th><td>{default}</td>")),
            "{name}"
        );
    }
    assert!(report.contains("<th scope=\"row\">lidar.min_separation</th><td>0.854</td>"));
    let readme = fixture.read("runs/latest/README.txt");
    for parameter in &echoloop_dsp::PARAMETERS {
        assert!(readme.contains(&format!("lidar.{} ", parameter.name)), "{}", parameter.name);
    }
    let result: Value =
        serde_json::from_str(&fixture.read("runs/latest/result.json")).expect("JSON");
    assert_eq!(result["default"]["lidar.denoise"], 2.0);
}

/// Opens a run's report: both views show points, and the console stays silent.
fn look_at(html: &str) {
    let Some(page) = crate::browser::open("run.html", html, &[]) else { return };
    page.assert_silent();
    for name in ["data-lit-before", "data-lit-after"] {
        assert!(page.pixels(name) > 500, "{name} is {}", page.pixels(name));
    }
}

#[test]
fn a_flag_left_out_never_wipes_a_configured_value() {
    let fixture = Fixture::new();
    fixture.write(
        "five.toml",
        "seed = 9\n[tune]\ngenerations = 5\npopulation = 7\n\
        protocol = \"lidar\"\n[scene]\nsource = \"unstructured\"\n[registration]\n\
        preset = \"paper\"\n",
    );
    let config = fixture.succeed(&["config", "--json", "-c", "five.toml"]).json();
    let tune = &config["tune"];
    assert_eq!(
        (&config["seed"], &tune["generations"], &tune["population"]),
        (&9.into(), &5.into(), &7.into())
    );
    assert_eq!(
        (&tune["protocol"], &config["scene"]["source"]),
        (&"lidar".into(), &"unstructured".into())
    );
    assert_eq!(config["registration"]["preset"], "paper");
    let sets = ["--set", "tune.generations=6", "--seed", "10"];
    let config =
        fixture.succeed(&[&["config", "--json", "-c", "five.toml"], &sets[..]].concat()).json();
    assert_eq!((&config["seed"], &config["tune"]["generations"]), (&10.into(), &6.into()));

    fixture.write(
        "two.toml",
        SMALL.replace("generations = 2", "generations = 2\nprotocol = \"registration\""),
    );
    fixture.succeed(&["tune", "-q", "-c", "two.toml"]);
    let result: Value =
        serde_json::from_str(&fixture.read("runs/0001-yard-icp-registration/result.json"))
            .expect("JSON");
    assert_eq!((&result["generations"], &result["protocol"]), (&2.into(), &"registration".into()));
}

#[test]
fn the_recall_asked_for_decides_the_exit_code() {
    let fixture = Fixture::new();
    let evaluate = ["evaluate", "-q", "-c", "small.toml", "--require-recall", "100"];
    let strict = ["--set", "data.success_translation_m=1e-9"];
    let output = fixture.run(&[&evaluate[..], &strict].concat());
    assert_eq!(output.code, Some(4), "{}", output.stderr);
    assert!(output.stderr.contains("below the 100 % asked"), "{}", output.stderr);
    fixture.succeed(&["evaluate", "-q", "-c", "small.toml", "--require-recall", "0"]);
}

#[test]
fn a_candidate_comes_from_standard_input_too() {
    let fixture = Fixture::new();
    let mut child = fixture
        .command(&["evaluate", "-q", "--json", "-c", "small.toml", "--candidate", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("echoloop starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    std::io::Write::write_all(
        &mut stdin,
        br#"{"parameters": {"lidar.power": 50, "lidar.timing": "cfd", "lidar.gain": 1.5}}"#,
    )
    .expect("written");
    drop(stdin);
    let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    assert_eq!(output.json()["parameters"]["lidar.power"], 50.0);
    assert_eq!(output.json()["parameters"]["lidar.gain"], 1.5);
    assert_eq!(
        output.json()["parameters"]["lidar.timing"],
        f64::from(echoloop_dsp::TimingMethod::ConstantFraction.code())
    );
}

#[test]
fn a_candidate_is_judged_on_training_pairs_unless_the_test_pairs_are_asked_for() {
    let fixture = Fixture::new();
    fixture.write("candidate.json", r#"{"parameters": {"lidar.power": 50}}"#);
    let judge = |more: &[&str]| {
        let evaluate = ["evaluate", "-q", "--json", "-c", "small.toml"];
        fixture.succeed(&[&evaluate[..], more].concat()).json()
    };
    let usual = judge(&["--candidate", "candidate.json"]);
    let [train, test] =
        ["train", "test"].map(|pairs| judge(&["--set", "lidar.power=50", "--pairs", pairs]));
    assert_eq!(usual, train);
    assert_eq!(judge(&["--candidate", "candidate.json", "--pairs", "test"]), test);
    assert_eq!(judge(&["--set", "lidar.power=50"]), test, "what is no candidate is not searched");
    assert_eq!([&train["pairs"], &test["pairs"]], ["train", "test"]);
    // As many as the configuration says, and not the same.
    assert_eq!((&train["summary"]["pairs"], &test["summary"]["pairs"]), (&4.into(), &3.into()));
    assert_ne!(train["summary"]["mean_frobenius"], test["summary"]["mean_frobenius"]);
}

#[test]
fn progress_on_a_pipe_is_plain_lines_and_quiet_is_silent() {
    let fixture = Fixture::new();
    let output = fixture.succeed(&["tune", "-c", "small.toml", "--generations", "1"]);
    assert!(output.stderr.contains("generation  1/6"), "{}", output.stderr);
    assert!(
        !output.stderr.contains('\u{1b}') && !output.stderr.contains('\r'),
        "{:?}",
        output.stderr
    );
    assert!(
        !output.stdout.contains('\u{1b}') && output.stdout.contains("recall"),
        "{:?}",
        output.stdout
    );
    for arguments in
        [&["scan", "-q", "-c", "small.toml"][..], &["evaluate", "-q", "-c", "small.toml"]]
    {
        assert_eq!(fixture.succeed(arguments).stderr, "", "{arguments:?}");
    }
}

#[test]
fn help_names_units_and_completions_exist_for_every_shell() {
    let fixture = Fixture::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = fixture.succeed(&["completions", shell]).stdout;
        assert!(
            script.contains("echoloop") && script.contains("register") && script.len() > 1000,
            "{shell}"
        );
    }
    fixture.refuses(&["completions", "tcsh-ish"], &["tcsh-ish"]);
    let register = fixture.succeed(&["register", "--help"]).stdout;
    for part in ["a length above 0 m", "3 to 1000", "target_from_source"] {
        assert!(register.contains(part), "{part}: {register}");
    }
    let echoes = fixture
        .succeed(&["echoes", "--help"])
        .stdout
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(echoes.contains("Print a JSON document a waveform, each a line,"), "{echoes}");
    assert!(!echoes.contains("one JSON document"), "{echoes}");
    let scan = fixture.succeed(&["scan", "--help"]).stdout;
    assert!(scan.contains("Print one JSON document"), "{scan}");
    assert!(scan.contains("in m") && scan.contains("degrees"), "{scan}");
    assert!(fixture.succeed(&["tune", "--help"]).stdout.contains("percent"));
    let help = fixture.succeed(&["--help"]).stdout;
    assert!(help.contains("Exit codes") && help.contains("130"), "{help}");
    assert!(fixture.succeed(&["--version"]).stdout.starts_with("echoloop "));
}

#[test]
#[cfg(unix)]
fn a_reader_that_leaves_early_ends_the_command_quietly() {
    let fixture = Fixture::new();
    for arguments in
        [&["completions", "bash"][..], &["config", "--parameters"], &["scan", "-c", "small.toml"]]
    {
        let mut command = fixture.command(arguments);
        let mut child =
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("echoloop starts");
        drop(child.stdout.take());
        let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
        assert!(!output.stderr.contains("panicked"), "{arguments:?}: {}", output.stderr);
        assert!(matches!(output.code, Some(0 | 141)), "{arguments:?}: {:?}", output.code);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn output_that_cannot_be_written_is_a_failure_with_a_message() {
    let fixture = Fixture::new();
    fixture.write("waves.csv", "0,0,0,0,9,40,9,0,0,0,0,0\n");
    let waves = ["echoes", "waves.csv", "--sample-ns", "1", "--no-response"];
    let waves_json = [&waves[..], &["--json"]].concat();
    let table: [&[&str]; 6] = [
        &waves,
        &waves_json,
        &["completions", "bash"],
        &["config"],
        &["config", "--parameters"],
        &["scan", "-q", "-c", "small.toml"],
    ];
    for arguments in table {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("a full disk");
        let mut command = fixture.command(arguments);
        let child = command.stdout(full).stderr(Stdio::piped()).spawn().expect("echoloop starts");
        let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
        assert_eq!(output.code, Some(1), "{arguments:?}: {}", output.stderr);
        assert!(
            output.stderr.starts_with("error: cannot write to standard output: "),
            "{arguments:?}: {}",
            output.stderr
        );
        assert_eq!(output.stderr.lines().count(), 1, "{arguments:?}: {}", output.stderr);
    }
}

#[test]
fn every_parameter_is_listed_with_its_unit_and_range() {
    let fixture = Fixture::new();
    let listed = fixture.succeed(&["config", "--parameters"]).stdout;
    let json = fixture.succeed(&["config", "--parameters", "--json"]).json();
    let names: Vec<&str> =
        json.as_array().expect("a list").iter().filter_map(|p| p["name"].as_str()).collect();
    assert_eq!(names.len(), echoloop_dsp::PARAMETERS.len() + 8);
    for (name, is_whole) in [
        ("lidar.power", false),
        ("lidar.upsampling", true),
        ("lidar.denoise", true),
        ("registration.voxel_m", false),
        ("registration.normal_neighbours", true),
    ] {
        let row = json.as_array().and_then(|rows| rows.iter().find(|row| row["name"] == name));
        let row = row.expect(name);
        assert!(
            ["min", "max", "default"].iter().all(|key| row[*key].is_u64() == is_whole),
            "{row}"
        );
    }
    for parameter in &echoloop_dsp::PARAMETERS {
        let name = format!("lidar.{}", parameter.name);
        assert!(names.contains(&name.as_str()), "{name}");
        let line = listed.lines().find(|line| line.starts_with(&name)).expect(&name);
        assert!(line.contains(parameter.unit) && line.contains(parameter.acts_in), "{line}");
        let default = match (parameter.kind, parameter.default) {
            (echoloop_dsp::Kind::Choice { names }, Some(code)) => names[code as usize].to_owned(),
            (_, Some(code)) => parameter.to_unit(code).to_string(),
            (_, None) => "follows".to_owned(),
        };
        let columns = line.split(parameter.acts_in).next().expect("what is before it");
        assert!(
            columns.split_whitespace().skip(1).any(|word| word == default),
            "{default}: {line}"
        );
    }
    // What the sensor accepted is what was set, as the sensor reads it back.
    let sensor = fixture.succeed(&["sensor", "--json", "--set", "lidar.power=33.33"]).json();
    assert_eq!(sensor["settings"]["power"], 33.33);
}

#[test]
fn a_scan_writes_a_cloud_that_reads_back() {
    let fixture = Fixture::new();
    let output = fixture.succeed(&["scan", "--json", "-c", "small.toml", "-o", "cloud.ply"]).json();
    let (cloud, _) = echoloop_clouds::read_cloud(&fixture.path("cloud.ply")).expect("a cloud");
    assert_eq!(output["points"], cloud.points.len());
    assert!(cloud.points.len() > 300, "{}", cloud.points.len());
}

/// A bumpy ground with walls, and the same points seen from a sensor moved by a known motion.
fn synthetic_pair(fixture: &Fixture) -> nalgebra::Isometry3<f64> {
    use nalgebra::{Isometry3, Point3, Vector3};
    let truth = Isometry3::new(Vector3::new(0.3, -0.2, 0.05), Vector3::new(0.01, -0.005, 0.04));
    let mut points = Vec::new();
    for i in -60..=60 {
        for j in -60..=60 {
            let (x, y) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
            points.push(Point3::new(x, y, -1.8 + 0.1 * (x * 0.5).sin() * (y * 0.7).cos()));
        }
        for k in 0..20 {
            let (along, up) = (f64::from(i) * 0.2, f64::from(k) * 0.2 - 1.5);
            points.push(Point3::new(along, 9.0, up));
            points.push(Point3::new(11.0 + 0.1 * along, along, up));
        }
    }
    let text = |points: &[Point3<f64>]| {
        points.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect::<String>()
    };
    fixture.write("target.xyz", text(&points));
    let source: Vec<_> = points.iter().map(|p| truth.inverse() * p).collect();
    fixture.write("source.xyz", text(&source));
    truth
}

fn motion(document: &Value) -> nalgebra::Isometry3<f64> {
    let rows: Vec<f64> = document["target_from_source"]
        .as_array()
        .expect("rows")
        .iter()
        .flat_map(|row| row.as_array().expect("a row"))
        .filter_map(Value::as_f64)
        .collect();
    echoloop_clouds::pose::from_rows(rows.as_slice().try_into().expect("4 × 4")).expect("rigid")
}

#[test]
fn register_recovers_a_known_motion_and_prints_the_documented_keys() {
    let fixture = Fixture::new();
    let truth = synthetic_pair(&fixture);
    let icp = ["register", "-q", "--json", "--method", "icp", "target.xyz", "source.xyz"];
    let document = fixture.succeed(&icp).json();
    let keys: Vec<&String> = document.as_object().expect("an object").keys().collect();
    let expected = [
        "format",
        "target_from_source",
        "stop",
        "converged",
        "pairs",
        "rmse_m",
        "cpu_s",
        "iterations",
        "inlier_fraction",
        "supported",
        "contradicted",
        "seen_through",
        "known",
        "lead",
        "rival",
        "unobservable_directions",
        "open_directions",
        "covariance",
        "matches",
        "searched",
        "inliers",
        "margin",
        "method",
        "refine",
        "voxel_m",
        "normal_radius_m",
        "normal_neighbours",
        "max_pair_distance_m",
        "first_pair_distance_m",
        "kernel_width",
        "max_normal_angle_rad",
        "max_iterations",
        "translation_tolerance_m",
        "still_m",
        "rotation_tolerance_rad",
        "still_rad",
        "fitness_tolerance",
        "still_fraction",
        "rmse_tolerance_m",
        "still_rmse_m",
        "degeneracy_threshold",
        "least_information",
    ];
    assert_eq!(keys, expected);
    assert_eq!(document["converged"], true);
    assert_eq!((&document["stop"], &document["method"]), (&"Still".into(), &"icp".into()));
    assert!(
        document["cpu_s"].as_f64().expect("a number") > 0.0
            && document["pairs"].as_u64().expect("a number") > 100
    );
    let estimate = motion(&document);
    assert!(echoloop_clouds::pose::translation_error_m(&estimate, &truth) < 0.01, "{estimate}");
    assert!(echoloop_clouds::pose::rotation_error_deg(&estimate, &truth) < 0.1, "{estimate}");

    let rows = document["covariance"].as_array().expect("rows");
    for (i, row) in rows.iter().enumerate() {
        let row = row.as_array().expect("a row");
        let variance = row[i].as_f64().expect("a number");
        assert!(row.len() == 6 && variance > 0.0 && variance < 1e-3, "{rows:?}");
    }
    assert_eq!(rows.len(), 6);

    let text = fixture.succeed(&["register", "target.xyz", "source.xyz"]).stdout;
    assert!(text.starts_with("target_from_source\n") && text.contains("pairs"), "{text}");
    assert!(text.contains("standard deviations x y z: 0."), "{text}");
    fixture.write(
        "initial.txt",
        echoloop_clouds::pose::to_rows(&truth).map(|v| v.to_string()).join(" "),
    );
    fixture.succeed(&["register", "-q", "target.xyz", "source.xyz", "--initial", "initial.txt"]);
}

#[test]
fn a_registration_that_fails_exits_with_one_and_says_why() {
    let fixture = Fixture::new();
    synthetic_pair(&fixture);
    fixture.write("far.xyz", "900 0 0\n901 0 0\n900 1 0\n900 0 1\n");
    for (method, why, stop) in [
        ("icp", "not registered: too few pairs", "TooFewPairs"),
        ("auto", "not registered: unconfirmed", "Unconfirmed"),
    ] {
        let output =
            fixture.run(&["register", "--json", "target.xyz", "far.xyz", "--method", method]);
        assert_eq!(output.code, Some(1), "{}", output.stderr);
        assert!(output.stderr.contains(why), "{}", output.stderr);
        assert_eq!(output.json()["stop"], stop);
    }
}

#[test]
fn register_agrees_with_the_published_motion_of_a_real_pair() {
    let Some(folder) = data("pair_small_gicp") else { return };
    let fixture = Fixture::new();
    let [target, source] =
        ["target.ply", "source.ply"].map(|n| folder.join(n).to_string_lossy().into_owned());
    let document = fixture.succeed(&["register", "-q", "--json", &target, &source]).json();
    let truth =
        echoloop_clouds::pose::read_pose(&folder.join("T_target_source.txt")).expect("a pose");
    let estimate = motion(&document);
    assert!(echoloop_clouds::pose::translation_error_m(&estimate, &truth) < 0.05, "{estimate}");
    assert!(echoloop_clouds::pose::rotation_error_deg(&estimate, &truth) < 0.5, "{estimate}");
}

#[test]
fn a_real_city_can_be_tuned_in() {
    let Some(mesh) = data("city_ingolstadt/ingolstadt_north.ply") else { return };
    let fixture = Fixture::new();
    let mesh = mesh.to_string_lossy();
    fixture.tune(&[
        "--scene",
        &mesh,
        "--generations",
        "1",
        "--set",
        "data.train_pairs=2",
        "--set",
        "data.test_pairs=1",
    ]);
    assert!(fixture.path("runs/0001-ingolstadt_north-icp-joint/result.json").exists());
}

#[test]
fn a_damaged_journal_is_kept_until_repair_which_finishes_the_run() {
    let fixture = Fixture::new();
    fixture.tuned(&[]);
    let folder = "runs/0001-yard-icp-joint";
    let [history, result] = ["history.jsonl", "result.json"].map(|name| format!("{folder}/{name}"));
    let (whole, finished) = (fixture.read(&history), fixture.read(&result));
    let cut = &whole[..whole.len() - 100];
    fixture.write(&history, cut);
    fs::remove_file(fixture.path(&result)).expect("removed");
    let last = format!("history.jsonl: line {} is cut off", whole.lines().count());
    fixture.refuses(&["tune", "--resume", folder], &[&*last, "--repair"]);
    fixture.succeed(&["tune", "-q", "--resume", folder, "--repair"]);
    assert!(
        fixture.read(&history) == whole && fixture.read(&result) == finished,
        "the repaired run is the whole one"
    );
    assert_eq!(fixture.read(&format!("{folder}/history.jsonl.damaged")), cut);

    // A second damage does not cost the copy of the first.
    let cut_again = &whole[..whole.len() - 50];
    fixture.write(&history, cut_again);
    fixture.succeed(&["tune", "-q", "--resume", folder, "--repair"]);
    assert_eq!(fixture.read(&format!("{folder}/history.jsonl.damaged")), cut, "the first copy");

    let garbled: String = whole
        .lines()
        .enumerate()
        .map(|(i, l)| if i == 2 { "{}\n".into() } else { format!("{l}\n") })
        .collect();
    fixture.write(&history, &garbled);
    fixture.refuses(
        &["tune", "--resume", folder],
        &["history.jsonl: line 3", "the 1 generations before it"],
    );
    for headless in ["", "{}\n", "{\"jour"] {
        fixture.write(&history, headless);
        fixture.refuses(
            &["tune", "--resume", folder, "--repair"],
            &["history.jsonl: line 1", "begin anew"],
        );
    }
}

#[test]
fn the_table_of_a_run_has_the_numbers_of_its_result() {
    let fixture = Fixture::new();
    let printed = fixture.tuned(&["--generations", "1"]);
    let result = fixture.read("runs/0001-yard-icp-joint/result.json");
    let result: Value = serde_json::from_str(&result).expect("JSON");
    let mut numbers = 0;
    for line in printed.lines().filter(|line| line.starts_with("registration.")) {
        let cells: Vec<&str> = line.split_whitespace().collect();
        for (cell, stored) in cells[1..3].iter().zip(["default", "tuned"]) {
            let stored = result[stored][cells[0]].as_f64().expect("a number");
            assert_eq!(cell.parse(), Ok(stored), "{line}");
            numbers += 1;
        }
    }
    assert!(numbers > 10, "{printed}");
}

#[test]
fn a_journal_without_checksums_is_refused_and_says_what_to_do() {
    let fixture = Fixture::new();
    fixture.tuned(&["--generations", "1"]);
    let folder = "runs/0001-yard-icp-joint";
    let history = format!("{folder}/history.jsonl");
    let unsealed = |line: &str| line.split(",\"check\"").next().map(|body| format!("{body}}}\n"));
    let earlier: String = fixture.read(&history).lines().filter_map(unsealed).collect();
    fixture.write(&history, earlier.replace("{\"journal\":4", "{\"journal\":1"));
    for more in [&[][..], &["--repair"]] {
        fixture.refuses(
            &[&["tune", "--resume", folder], more].concat(),
            &["history.jsonl: line 1 is of journal format 1", "begin anew with `echoloop tune"],
        );
    }
}

#[test]
fn a_run_goes_on_only_with_the_scene_it_began_with() {
    let fixture = Fixture::new();
    fixture.tuned(&["--generations", "1"]);
    let folder = "runs/0001-yard-icp-joint";
    let (scene, result) = ("yard.obj", format!("{folder}/result.json"));
    let (yard, finished) = (fixture.read(scene), fixture.read(&result));
    fixture.write(scene, yard.replace(" 7\n", " 5\n"));
    let parts = ["history.jsonl: line 1: content.scene is ", "put it back"];
    fixture.refuses(&["tune", "-q", "--resume", folder, "--repair"], &parts);
    fixture.write(scene, yard);
    fixture.succeed(&["tune", "-q", "--resume", folder]);
    assert_eq!(fixture.read(&result), finished);
}

#[test]
#[cfg(unix)]
fn what_is_in_the_way_is_named_before_anything_is_traced() {
    let fixture = Fixture::new();
    fixture.tuned(&["--generations", "1"]);
    let folder = "runs/0001-yard-icp-joint";
    // Without its scene a run is refused as soon as it would trace.
    fs::remove_file(fixture.path("yard.obj")).expect("removed");
    fixture.write("victim", "precious");
    std::os::unix::fs::symlink("../../victim", fixture.path(&format!("{folder}/result.json.part")))
        .expect("a link");
    let resume = ["tune", "-q", "--resume", folder];
    fixture.refuses(&resume, &["result.json.part: a link is in the way"]);
    fs::remove_file(fixture.path(&format!("{folder}/result.json.part"))).expect("removed");
    let history = fixture.path(&format!("{folder}/history.jsonl"));
    fs::rename(&history, fixture.path("journal")).expect("moved");
    let fifo = Command::new("mkfifo").arg(&history).status().expect("mkfifo runs");
    assert!(fifo.success());
    let output = fixture.run(&resume);
    assert_eq!(output.code, Some(2));
    assert!(output.stderr.contains("history.jsonl: a FIFO is in the way"), "{}", output.stderr);
    let scan = ["scan", "-q", "-c", "small.toml", "-o"];
    let output = fixture.run(&[&scan[..], &[history.to_str().expect("UTF-8")]].concat());
    assert_eq!(output.code, Some(2));
    assert!(output.stderr.contains("a FIFO is in the way"), "{}", output.stderr);
    fs::remove_file(history).expect("removed");
    fixture.refuses(&[&scan[..], &["runs"]].concat(), &["runs: a folder is in the way"]);
    fs::remove_file(fixture.path("runs/latest")).expect("removed");
    fs::create_dir(fixture.path("runs/latest")).expect("a folder");
    fixture.refuses(&["tune", "-q", "-c", "small.toml"], &["runs/latest", "no link"]);
}

#[test]
fn only_a_run_s_own_folder_can_be_resumed() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("empty")).expect("a folder");
    for folder in ["empty", "absent", "yard.obj"] {
        fixture.refuses(&["tune", "--resume", folder], &[folder]);
        fixture.refuses(&["evaluate", "--run", folder], &[folder]);
    }
    fixture.tuned(&["--generations", "1"]);
    let folder = "runs/0001-yard-icp-joint";
    let config = format!("{folder}/config.toml");
    let edited = fixture.read(&config).replace("power = 75.0", "power = 74.0");
    fixture.write(&config, edited);
    fixture
        .refuses(&["tune", "-q", "--resume", folder], &["history.jsonl", "another configuration"]);
    fixture.refuses(&["tune", "--resume", folder, "--seed", "3"], &["--seed"]);
}

/// Long enough to be interrupted: some fifty milliseconds a generation.
const LONG: [&str; 8] = [
    "tune",
    "-c",
    "small.toml",
    "-q",
    "--generations",
    "20",
    "--set",
    "tune.pairs_per_generation=1",
];

/// Starts the long run, waits for whole generations in its journal, and does something to the
/// process of this number or to its files.
#[cfg(unix)]
fn while_it_runs(fixture: &Fixture, harm: impl Fn(u32)) -> CommandOutput {
    let mut child = fixture
        .command(&LONG)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("echoloop starts");
    let journal = fixture.path("runs/0001-yard-icp-joint/history.jsonl");
    let deadline = Instant::now() + Duration::from_secs(120);
    let lines =
        || fs::read(&journal).map_or(0, |bytes| bytes.iter().filter(|&&b| b == b'\n').count());
    while lines() < 3 {
        assert!(Instant::now() < deadline, "two generations take less than this");
        assert!(child.try_wait().expect("a child").is_none(), "it must not end by itself");
        std::thread::sleep(Duration::from_millis(2));
    }
    harm(child.id());
    let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
    assert!(lines() < 41, "it was over before the harm came: make it longer");
    assert!(!fixture.path("runs/0001-yard-icp-joint/result.json").exists());
    output
}

/// Sends the long run a signal.
#[cfg(unix)]
fn interrupted(fixture: &Fixture, signal: &str) -> CommandOutput {
    while_it_runs(fixture, |process| {
        let killed = Command::new("kill").args([signal, &process.to_string()]).status();
        assert!(killed.expect("kill runs").success());
    })
}

#[test]
#[cfg(unix)]
fn two_processes_never_write_one_run() {
    let fixture = Fixture::new();
    fixture.tuned(&LONG[4..]);
    let folder = "runs/0001-yard-icp-joint";
    let history = format!("{folder}/history.jsonl");
    let whole = fixture.bytes(&history);
    let lines: Vec<&[u8]> = whole.split_inclusive(|&byte| byte == b'\n').collect();
    fixture.write(&history, lines[..4].concat());
    let resume = ["tune", "-q", "--resume", folder];
    let start = || fixture.command(&resume).stderr(Stdio::piped()).stdout(Stdio::null()).spawn();
    let both = [start(), start()].map(|child| child.expect("echoloop starts"));
    let ended = both.map(|child| child.wait_with_output().expect("it ends"));
    let mut codes = ended.each_ref().map(|output| output.status.code());
    codes.sort_unstable();
    assert_eq!(codes, [Some(0), Some(2)]);
    let said = ended.map(|output| String::from_utf8_lossy(&output.stderr).into_owned()).concat();
    assert!(said.contains("run.lock: another process writes this run"), "{said}");
    assert!(fixture.bytes(&history) == whole, "the journal is that of one process");
    assert!(!fixture.path(&format!("{folder}/run.lock")).exists());
}

/// The scene comes through a pipe, so that it is traced when the journal has gone. It comes once:
/// the pairs of the check are of the same.
#[test]
#[cfg(unix)]
fn a_journal_that_vanishes_before_a_run_goes_on_is_missed() {
    let fixture = Fixture::new();
    fixture.tuned(&LONG[4..]);
    let folder = "runs/0001-yard-icp-joint";
    let [mesh, history] = ["yard.obj".into(), format!("{folder}/history.jsonl")];
    let scene = fixture.bytes(&mesh);
    fs::remove_file(fixture.path(&mesh)).expect("removed");
    assert!(Command::new("mkfifo").arg(fixture.path(&mesh)).status().expect("mkfifo").success());
    let mut resume = fixture.command(&["tune", "-q", "--resume", folder]);
    let child = resume.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("it starts");
    let mut pipe = fs::OpenOptions::new().write(true).open(fixture.path(&mesh)).expect("a reader");
    fs::remove_file(fixture.path(&history)).expect("removed");
    std::io::copy(&mut &scene[..], &mut pipe).expect("it is read");
    drop(pipe);
    let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
    assert_eq!(output.code, Some(2), "{}", output.stderr);
    assert!(output.stderr.contains("history.jsonl"), "{}", output.stderr);
    assert!(!fixture.path(&history).exists());
}

#[test]
#[cfg(unix)]
fn an_interrupted_or_killed_run_goes_on_to_the_very_result_of_one_that_was_not() {
    let fixture = Fixture::new();
    fixture.tuned(&LONG[4..]);
    let folder = "runs/0001-yard-icp-joint";
    let names = ["history.jsonl", "result.json", "report.html", "after.ply"]
        .map(|name| format!("{folder}/{name}"));
    let whole: Vec<_> = names.iter().map(|name| fixture.repeatable(name)).collect();
    for (signal, code) in [("-INT", Some(130)), ("-KILL", None)] {
        fs::remove_dir_all(fixture.path("runs")).expect("removed");
        let output = interrupted(&fixture, signal);
        assert_eq!(output.code, code, "{signal}: {}", output.stderr);
        if signal == "-INT" {
            assert!(
                output.stderr.contains("interrupted after") && output.stderr.contains("--resume"),
                "{}",
                output.stderr
            );
        }
        fixture.succeed(&["tune", "-q", "--resume", "runs/latest"]);
        for (name, whole) in names.iter().zip(&whole) {
            assert!(fixture.repeatable(name) == *whole, "{signal}: {name} differs");
        }
    }
}

#[test]
fn a_rate_goes_with_the_clock_and_against_beams_samples_and_shots() {
    let fixture = Fixture::new();
    let ask = |more: &[&str]| {
        let grid = ["--set", "scanner.pattern=grid", "--set", "scanner.columns=96"];
        let line = [&["rate", "--json"][..], &grid, more].concat();
        fixture.succeed(&line).json()
    };
    let usual = ask(&[]);
    assert_eq!([&usual["beams"], &usual["samples"], &usual["taps"]], [6_144, 800, 11]);
    let of = |rate: &Value, what: &str| {
        let processors = rate["processors"].as_array().expect("a list").clone();
        assert!(processors.len() >= 4, "{rate}");
        processors.iter().map(|one| one[what].as_f64().expect("a number")).collect::<Vec<_>>()
    };
    let ratio = |more: &[&str], what: &str| {
        let pairs = of(&ask(more), what).into_iter().zip(of(&usual, what));
        pairs.map(|(new, old)| new / old).collect::<Vec<_>>()
    };
    let near = |ratios: Vec<f64>, expected: f64| {
        assert!(ratios.iter().all(|ratio| (ratio - expected).abs() < 1e-9), "{ratios:?}");
    };
    near(ratio(&["--hz", "20"], "clock_mhz_needed"), 2.0);
    near(ratio(&["--hz", "20"], "scans_a_second"), 1.0);
    near(ratio(&["--set", "scanner.columns=192"], "scans_a_second"), 0.5);
    near(ratio(&["--cycles-per-instruction", "3"], "scans_a_second"), 0.5);
    for more in ["lidar.waveform_resolution=1600", "lidar.shots=4"] {
        let ratios = ratio(&["--set", more], "scans_a_second");
        assert!(ratios.iter().all(|&ratio| ratio < 0.75), "{more}: {ratios:?}");
    }
    for (key, expected) in [("lidar.shots=4", 0.25), ("scanner.columns=192", 0.5)] {
        let light = ask(&["--set", key])["light_scans_a_second"].as_f64().expect("a number");
        let before = usual["light_scans_a_second"].as_f64().expect("a number");
        assert!((light / before - expected).abs() < 1e-9, "{key}");
    }
    let text = fixture.succeed(&["rate"]).stdout;
    for part in ["cortex-m4", "STM32F405", "at 115200 baud", "6400 beams of 800 samples"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    for (flag, wrong) in [("--hz", "0"), ("--echoes", "5"), ("--cycles-per-instruction", "-1")] {
        fixture.refuses(&["rate", flag, wrong], &[flag]);
    }
    let strong = ["rate", "--set", "lidar.power=75", "--set", "lidar.pulse_width=15"];
    fixture.refuses(&strong, &["pulse_width"]);
}
