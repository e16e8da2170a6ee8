//! The command line: bad input, interrupted runs, what scripts rely on.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// A run of a few seconds: few beams, few pairs, few generations.
const SMALL: [&str; 9] = [
    "scanner.columns=48",
    "scanner.rows=16",
    "scene.towns=[1]",
    "data.train_pairs=3",
    "data.test_pairs=2",
    "tune.generations=3",
    "tune.population=4",
    "tune.pairs_per_generation=2",
    "tune.shortlist=2",
];

fn echoloop() -> Command {
    Command::new(env!("CARGO_BIN_EXE_echoloop"))
}

fn small(command: &str) -> Command {
    let mut echoloop = echoloop();
    echoloop.arg(command);
    for set in SMALL {
        echoloop.args(["--set", set]);
    }
    echoloop
}

fn run(command: &mut Command) -> Output {
    command.stdin(Stdio::null()).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn tune(runs: &Path, extra: &[&str]) -> PathBuf {
    let output = run(small("tune").arg("--runs").arg(runs).args(extra));
    assert!(output.status.success(), "{}", stderr(&output));
    fs::canonicalize(runs.join("latest")).unwrap()
}

/// Ends with exit code 2 and says every part.
fn refused(command: &mut Command, parts: &[&str]) {
    let output = run(command);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{command:?}: {said}");
    for part in parts {
        assert!(said.contains(part), "{command:?} does not say {part:?}: {said}");
    }
    assert!(!said.contains("panicked"), "{said}");
}

fn data(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("ECHOLOOP_DATA") else {
        eprintln!("SKIPPED: ECHOLOOP_DATA is not set, {name} was not used");
        return None;
    };
    Some(PathBuf::from(folder).join(name))
}

#[test]
fn every_bad_value_is_named_and_ends_with_exit_code_2() {
    let cases: [(&str, &[&str]); 14] = [
        ("lidar.powr=3", &["--set lidar.powr=3", "unknown field `powr`", "pulse_width"]),
        ("lidar.power=nan", &["power must be finite"]),
        ("lidar.power=-5", &["power -5 W is below its minimum 5 W"]),
        ("lidar.power=500", &["power 500 W is above its maximum 100 W"]),
        ("lidar.power=100", &["pulse_width is 500.0 nJ, above the pulse energy limit of 400.0 nJ"]),
        ("lidar.saturation=0.1", &["saturation 0.1 of full scale is below its minimum 0.25"]),
        ("lidar.waveform_resolution=200", &["pulse_width 5 ns spans fewer than 2.5 samples of 3.969 ns"]),
        ("lidar.upsampling=3", &["upsampling 3 is none of 1, 2, 4, 8"]),
        ("lidar.timing=cfd", &["timing 'cfd' is not implemented by this firmware"]),
        ("lidar.shots=4", &["shots 4 is not implemented by this firmware; it runs 1"]),
        ("registration.voxel_m=-1", &["registration.voxel_m = -1 is outside 0.05 to 1 m"]),
        ("registration.method=fgr", &["unknown variant `fgr`"]),
        ("data.baseline_m=inf", &["data.baseline_m = inf must be 0 to 100"]),
        ("receiver.transmission=0", &["receiver.transmission = 0 must be above 0"]),
    ];
    let runs = TempDir::new().unwrap();
    for (set, parts) in cases {
        refused(echoloop().args(["tune", "--set", set, "--runs"]).arg(runs.path()), parts);
    }
    assert_eq!(fs::read_dir(runs.path()).unwrap().count(), 0, "no run folder for a run that cannot begin");
}

#[test]
fn a_configuration_file_s_mistakes_are_shown_with_line_and_caret() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("bad.toml");
    for (text, parts) in [
        ("seed = 1\n[lidar]\npowr = 3\n", ["bad.toml", "line 3", "^^^^", "unknown field `powr`"]),
        ("[lidar]\nsaturation = 0.9\npower = \"much\"\n", ["bad.toml", "line 3", "^^^^", "a number (W)"]),
        ("[tune\n", ["bad.toml", "line 1", "^", "expected"]),
    ] {
        fs::write(&file, text).unwrap();
        refused(echoloop().args(["config", "--config"]).arg(&file), &parts);
    }
    refused(echoloop().args(["config", "--config", "missing.toml"]), &["cannot read missing.toml"]);
}

#[test]
fn unusable_scenes_are_named() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path
    };
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let scenes = [
        (write("empty.ply", b""), "empty.ply"),
        (write("noise.ply", &[7; 300]), "noise.ply"),
        (write("cut.ply", format!("{header}0 0 0\n").as_bytes()), "cut.ply"),
        (write("index.ply", format!("{header}0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n").as_bytes()), "index.ply"),
        (write("scene.stl", b"solid"), "scene.stl"),
        (folder.path().join("missing.ply"), "missing.ply"),
    ];
    for (path, name) in scenes {
        refused(small("tune").arg("--scene").arg(path).arg("--runs").arg(folder.path().join("runs")), &[name]);
    }
    refused(small("tune").args(["--scene", "urban"]), &["scene.source = \"urban\""]);
    refused(small("tune").args(["--set", "scene.ground=flat", "--scene", "x.ply"]), &["scene.ground = \"flat\""]);
    assert!(!folder.path().join("runs").exists());
}

#[test]
fn unusable_clouds_are_named() {
    let folder = TempDir::new().unwrap();
    let good = folder.path().join("good.xyz");
    fs::write(&good, "1 0 0\n0 1 0\n0 0 1\n").unwrap();
    let header =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let cases: [(&str, Vec<u8>); 7] = [
        ("empty.xyz", Vec::new()),
        ("words.xyz", b"1 2 three\n".to_vec()),
        ("nan.xyz", b"nan nan nan\n".to_vec()),
        ("cut.bin", vec![0; 17]),
        ("cut.ply", format!("{header}0 0 1\n").into_bytes()),
        ("huge.ply", header.replace("vertex 2", "vertex 4000000000").into_bytes()),
        ("noise.pcd", vec![9; 100]),
    ];
    for (name, bytes) in cases {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        refused(echoloop().arg("register").arg(&good).arg(&path), &[name]);
        refused(echoloop().arg("register").arg(&path).arg(&good), &[name]);
    }
    refused(
        echoloop().arg("register").arg(&good).arg(folder.path()),
        &["good.xyz", folder.path().to_str().unwrap()][1..].as_ref(),
    );
    refused(echoloop().arg("register").arg(&good).arg("missing.ply"), &["missing.ply"]);
    refused(echoloop().arg("register").arg(&good).arg(&good).args(["--voxel-m", "-1"]), &["voxel_m is -1"]);
}

#[test]
fn output_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "kept").unwrap();
    refused(small("tune").arg("--runs").arg(file.join("below")), &["file/below"]);
    refused(small("scan").arg("-o").arg(file.join("cloud.ply")), &["cloud.ply"]);
    assert_eq!(fs::read_to_string(&file).unwrap(), "kept");
}

#[test]
fn unusable_candidates_are_named() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("candidate.json");
    for (text, part) in [
        ("{", "candidate.json"),
        ("{\"parameters\": {\"lidar.powr\": 1}}", "unknown parameter `lidar.powr`"),
        ("{\"parameters\": {\"lidar.power\": 1000}}", "above its maximum 100 W"),
        ("{\"parameters\": {\"registration.voxel_m\": 7}}", "registration.voxel_m = 7 is outside"),
        ("{\"values\": {}}", "unknown field `values`"),
    ] {
        fs::write(&path, text).unwrap();
        refused(small("evaluate").arg("--candidate").arg(&path), &[part]);
    }
}

#[test]
fn the_tuned_result_has_the_same_bytes_on_one_and_on_two_threads() {
    let folder = TempDir::new().unwrap();
    let one = tune(&folder.path().join("one"), &["--threads", "1"]);
    let two = tune(&folder.path().join("two"), &["--threads", "2"]);
    for name in ["config.toml", "history.jsonl", "result.json", "report.html", "before.ply", "after.ply"] {
        assert!(fs::read(one.join(name)).unwrap() == fs::read(two.join(name)).unwrap(), "{name} differs");
    }
    let other = tune(&folder.path().join("seed"), &["--seed", "2"]);
    assert_ne!(fs::read(one.join("result.json")).unwrap(), fs::read(other.join("result.json")).unwrap());
}

#[test]
fn a_run_repeats_from_its_own_configuration_and_is_judged_again_the_same() {
    let folder = TempDir::new().unwrap();
    let first = tune(folder.path(), &[]);
    let output =
        run(echoloop().arg("tune").arg("--config").arg(first.join("config.toml")).arg("--runs").arg(folder.path()));
    assert!(output.status.success(), "{}", stderr(&output));
    let second = fs::canonicalize(folder.path().join("latest")).unwrap();
    assert_ne!(first, second);
    assert_eq!(fs::read(first.join("result.json")).unwrap(), fs::read(second.join("result.json")).unwrap());
    for name in ["README.txt", "report.html", "before.ply", "after.ply", "history.jsonl"] {
        assert!(first.join(name).is_file(), "{name}");
    }
    let output = run(echoloop().args(["evaluate", "--json", "--run"]).arg(&first));
    let judged: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let result: serde_json::Value = serde_json::from_slice(&fs::read(first.join("result.json")).unwrap()).unwrap();
    assert_eq!(judged["summary"], result["tuned_summary"]);
    assert_eq!(judged["parameters"], result["tuned"]);
}

/// Starts a longer run, waits for two generations in its journal, and ends it by a signal.
#[cfg(unix)]
fn interrupted(runs: &Path, signal: &str) -> (PathBuf, Option<i32>) {
    let mut child = long(runs).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let journal = runs.join("latest").join("history.jsonl");
    let deadline = Instant::now() + Duration::from_secs(120);
    while fs::read(&journal).map_or(0, |bytes| bytes.iter().filter(|&&b| b == b'\n').count()) < 3 {
        assert!(Instant::now() < deadline, "no generation within two minutes");
        assert!(child.try_wait().unwrap().is_none(), "the run ended before it could be interrupted");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let status = child.wait().unwrap();
    (fs::canonicalize(runs.join("latest")).unwrap(), status.code())
}

#[cfg(unix)]
fn long(runs: &Path) -> Command {
    let mut command = small("tune");
    command.args(["--generations", "25", "--runs"]).arg(runs);
    command
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_goes_on_to_the_numbers_of_an_uninterrupted_one() {
    let folder = TempDir::new().unwrap();
    let whole = folder.path().join("whole");
    assert!(run(&mut long(&whole)).status.success());
    for (name, signal, code) in [("int", "-INT", Some(130)), ("kill", "-KILL", None)] {
        let (run_folder, status) = interrupted(&folder.path().join(name), signal);
        assert_eq!(status, code);
        let journal = fs::read_to_string(run_folder.join("history.jsonl")).unwrap();
        assert!(journal.lines().count() < 26, "it was interrupted before its end");
        assert!(!run_folder.join("result.json").exists());
        let output = run(echoloop().args(["tune", "--resume"]).arg(&run_folder));
        assert!(output.status.success(), "{}", stderr(&output));
        for file in ["result.json", "history.jsonl", "report.html"] {
            let same = fs::read(run_folder.join(file)).unwrap() == fs::read(whole.join("latest").join(file)).unwrap();
            assert!(same, "{file} after {signal}");
        }
    }
}

#[test]
fn a_damaged_journal_is_named_left_alone_and_repaired_only_when_asked() {
    let folder = TempDir::new().unwrap();
    let run_folder = tune(folder.path(), &[]);
    let journal = run_folder.join("history.jsonl");
    let (whole, result) = (fs::read(&journal).unwrap(), fs::read(run_folder.join("result.json")).unwrap());
    let cut = &whole[..whole.len() - 40];
    fs::write(&journal, cut).unwrap();
    refused(
        echoloop().args(["tune", "--resume"]).arg(&run_folder),
        &["history.jsonl", "line 4 is cut off", "--repair"],
    );
    assert_eq!(fs::read(&journal).unwrap(), cut);
    let output = run(echoloop().args(["tune", "--repair", "--resume"]).arg(&run_folder));
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(fs::read(&journal).unwrap(), whole);
    assert_eq!(fs::read(run_folder.join("result.json")).unwrap(), result);
    assert_eq!(fs::read(run_folder.join("history.jsonl.damaged")).unwrap(), cut);
}

#[test]
fn a_run_resumes_only_as_it_began() {
    let folder = TempDir::new().unwrap();
    let run_folder = tune(folder.path(), &[]);
    let config = run_folder.join("config.toml");
    let text = fs::read_to_string(&config).unwrap();
    fs::write(&config, text.replace("generations = 3", "generations = 4")).unwrap();
    refused(echoloop().args(["tune", "--resume"]).arg(&run_folder), &["history.jsonl", "another configuration"]);
    refused(echoloop().args(["tune", "--resume"]).arg(folder.path()), &["config.toml"]);
}

#[test]
fn a_flag_s_default_never_wipes_a_configured_value() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.toml");
    fs::write(&file, "seed = 7\n[tune]\ngenerations = 5\nprotocol = \"lidar\"\n[registration]\npreset = \"paper\"\n")
        .unwrap();
    let output = run(echoloop().args(["config", "--json", "--config"]).arg(&file));
    let config: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(config["seed"], 7);
    assert_eq!(config["tune"]["generations"], 5);
    assert_eq!(config["tune"]["protocol"], "lidar");
    assert_eq!(config["registration"]["preset"], "paper");
}

#[test]
fn scripts_get_json_silence_and_no_escapes() {
    let folder = TempDir::new().unwrap();
    let output = run(small("tune").args(["--json", "-q", "--runs"]).arg(folder.path()));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(result["tuned_summary"]["recall_pct"].is_number());
    assert_eq!(stderr(&output), "");
    let output = run(small("tune").arg("--runs").arg(folder.path()));
    assert!(!stderr(&output).contains('\u{1b}') && stderr(&output).contains("generation  3/3"));
    let output = run(small("tune").args(["-q", "--require-recall", "101", "--runs"]).arg(folder.path()));
    assert_eq!(output.status.code(), Some(4));
}

#[test]
fn help_has_units_and_ranges_and_completions_print() {
    let help = String::from_utf8(run(echoloop().args(["tune", "--help"])).stdout).unwrap();
    for part in
        ["lidar.pulse_width                         2       20        5  ns", "registration.voxel_m", "walk-corrected"]
    {
        assert!(help.contains(part), "{help}");
    }
    for shell in ["bash", "zsh", "fish"] {
        let output = run(echoloop().args(["completions", shell]));
        assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).contains("register"), "{shell}");
    }
    assert_eq!(run(echoloop().arg("tuen")).status.code(), Some(2));
}

#[test]
fn a_candidate_from_standard_input_is_judged() {
    let mut command = small("evaluate");
    command.args(["--candidate", "-", "--json", "-q"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let text = "{\"parameters\": {\"lidar.power\": 40, \"registration.voxel_m\": 0.2}}";
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let judged: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(judged["parameters"]["lidar.power"], 40.0);
    assert_eq!(judged["summary"]["pairs"], 2);
}

#[test]
fn the_sensor_says_who_it_is_and_refuses_what_it_cannot_do() {
    let output = run(echoloop().args(["sensor", "--json", "--set", "lidar.power=50"]));
    let sensor: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(sensor["settings"]["power"], 50.0);
    assert!(sensor["build"].as_str().unwrap().starts_with("echoloop-sensor"));
    refused(echoloop().args(["sensor", "--set", "lidar.power=100"]), &["the sensor refused the settings", "400.0 nJ"]);
}

#[test]
fn two_street_scans_register_within_five_centimetres_and_half_a_degree() {
    let Some(folder) = data("pair_small_gicp") else { return };
    let clouds = [folder.join("target.ply"), folder.join("source.ply")];
    let output = run(echoloop().args(["register", "--method", "icp", "--json"]).args(&clouds));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for key in ["target_from_source", "stop", "pairs", "rmse_m", "cpu_s"] {
        assert!(!found[key].is_null(), "{key}");
    }
    let rows: Vec<f64> = (0..16).map(|i| found["target_from_source"][i / 4][i % 4].as_f64().unwrap()).collect();
    let estimate = echoloop_host::pose::from_rows(&rows.try_into().unwrap()).unwrap();
    let truth = echoloop_host::pose::read_pose(&folder.join("T_target_source.txt")).unwrap();
    let (translation_m, rotation_deg) = (
        echoloop_host::pose::translation_error_m(&estimate, &truth),
        echoloop_host::pose::rotation_error_deg(&estimate, &truth),
    );
    assert!(translation_m < 0.05 && rotation_deg < 0.5, "{translation_m} m, {rotation_deg}°");
}

#[test]
fn a_street_s_mesh_is_a_scene_too() {
    let Some(mesh) = data("city_ingolstadt/ingolstadt_north.ply") else { return };
    let folder = TempDir::new().unwrap();
    let run_folder = tune(folder.path(), &["--scene", mesh.to_str().unwrap()]);
    let result: serde_json::Value = serde_json::from_slice(&fs::read(run_folder.join("result.json")).unwrap()).unwrap();
    assert!(result["tuned_summary"]["mean_points"].as_f64().unwrap() > 100.0);
}
