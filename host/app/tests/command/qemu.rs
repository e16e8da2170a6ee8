//! `--sensor qemu`: the loop through the image in an emulated microcontroller.
//!
//! `cargo xtask firmware` builds the image. Without it or QEMU these tests are skipped aloud; where
//! `CI` is set, they fail.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::fixture::{CommandOutput, Fixture};
use echoloop_closed_loop::config::RunConfig;
use echoloop_dsp::{Hardware, ScanPattern};
use echoloop_sensors::boards::qemu::{Machine, Qemu, QemuOptions, check_installed};
use echoloop_sensors::sensor::Model;

/// The image, if it can be run.
fn image() -> Option<String> {
    let machine = Machine::An386;
    let image =
        QemuOptions::new(machine, &Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")).image;
    let missing = match check_installed(machine) {
        Err(error) => error.to_string(),
        Ok(()) if !image.is_file() => format!("no image {}: cargo xtask firmware", image.display()),
        Ok(()) => return Some(image.canonicalize().expect("it is there").display().to_string()),
    };
    echoloop_needs::missing(&missing);
    None
}

#[test]
fn a_scan_through_the_emulated_board_is_that_of_the_sensor_in_process() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    let scan = ["scan", "-c", "small.toml", "--json"];
    fixture.succeed(&[&scan[..], &["-o", "pc.ply"]].concat());
    let on_board =
        ["--sensor", "qemu", "--firmware", &image, "--sensor-log", "log.txt", "-o", "board.ply"];
    let output = fixture.succeed(&[&scan[..], &on_board].concat()).json();
    assert!(
        output["sensor"]
            .as_str()
            .is_some_and(|name| name.starts_with("qemu:mps2-an386, echoloop-sensor")),
        "{output}"
    );
    assert!(fixture.bytes("board.ply") == fixture.bytes("pc.ply"), "the clouds differ");
    let (log, hash) =
        (fixture.read("log.txt"), output["settings"].as_str().unwrap_or("?").to_owned());
    assert!(log.contains(&format!("settings {hash} active")), "{hash}: {log}");
}

#[test]
fn the_emulated_board_has_the_configured_energy_limit() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    let ask = |width: &str| {
        let limit = ["--set", "emitter.energy_limit_nj=600", "--set", "lidar.power=60"];
        let board = ["sensor", "--json", "--sensor", "qemu", "--firmware", &image];
        fixture.run(&[&board[..], &limit, &["--set", width]].concat())
    };
    let output = ask("lidar.pulse_width=10");
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    assert_eq!(output.json()["hardware"]["energy_limit_pj"], 600_000);
    let refused = ask("lidar.pulse_width=10.01");
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("pulse energy limit of 600.0 nJ"), "{}", refused.stderr);
}

#[test]
fn a_run_through_the_emulated_board_ends_with_the_numbers_of_the_run_in_process() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    let few = [
        "--set",
        "scanner.columns=24",
        "--set",
        "data.train_pairs=2",
        "--set",
        "data.test_pairs=1",
    ];
    let tiny =
        [&["--generations", "1", "--population", "2", "--set", "tune.shortlist=1"], &few[..]]
            .concat();
    fixture.tune(&[&tiny[..], &["--runs", "pc"]].concat());
    fixture.tune(
        &[
            &tiny[..],
            &["--runs", "board", "--sensor", "qemu", "--firmware", &image, "--threads", "2"],
        ]
        .concat(),
    );
    let [pc, board] =
        ["pc", "board"].map(|runs| fixture.generations(&format!("{runs}/latest/history.jsonl")));
    assert!(pc == board && pc.len() > 100, "the journals differ");
    for file in ["result.json", "report.html"] {
        let [pc, board] =
            ["pc", "board"].map(|runs| fixture.repeatable(&format!("{runs}/latest/{file}")));
        assert!(pc == board, "{file} differs");
    }
    let again = ["evaluate", "--run", "board/latest", "--json", "-q"];
    let on_board = fixture
        .succeed(&[&again[..], &["--sensor", "qemu:mps2-an386", "--firmware", &image]].concat())
        .json();
    assert_eq!(on_board["summary"], fixture.succeed(&again).json()["summary"]);
}

#[test]
fn an_emulated_board_that_gets_waveforms_over_its_uart_gives_the_numbers_of_the_run_in_process() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    let few = ["-c", "small.toml", "--set", "scanner.columns=16", "--set", "scanner.rows=8"];
    let pairs = ["--set", "data.train_pairs=2", "--set", "data.test_pairs=2"];
    let fed = ["--sensor", "qemu", "--firmware", &image, "--front-end", "host"];
    let scan = [&["scan", "-q"][..], &few, &pairs].concat();
    fixture.succeed(&[&scan[..], &["-o", "pc.ply"]].concat());
    fixture.succeed(&[&scan[..], &fed, &["-o", "board.ply"]].concat());
    assert!(fixture.bytes("board.ply") == fixture.bytes("pc.ply"), "the clouds differ");
    let evaluate = [&["evaluate", "-q", "--json"][..], &few, &pairs].concat();
    let on_board = fixture.succeed(&[&evaluate[..], &fed].concat()).json();
    let on_pc = fixture.succeed(&evaluate).json();
    assert_eq!(on_board["summary"], on_pc["summary"]);
    assert!(on_pc["summary"]["mean_points"].as_f64() > Some(50.0), "{on_pc}");
}

#[test]
fn an_emulated_board_says_whether_its_scans_are_in_time() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    let ask = |hz: &str| {
        let few = ["scanner.columns=8", "scanner.rows=4", "lidar.waveform_resolution=400"];
        let few = few.map(|set| ["--set", set]).concat();
        let line = [&["rate", "--json", "--scans", "2", "--hz", hz][..], &few].concat();
        let board = ["--sensor", "qemu", "--firmware", &image, "--front-end", "host"];
        fixture.succeed(&[&line[..], &board].concat()).json()["measured"].clone()
    };
    let (fast, slow) = (ask("10000"), ask("0.001"));
    assert_eq!([&fast["scans"], &fast["late"], &fast["deadline_us"]], [2, 2, 100], "{fast}");
    assert_eq!([&slow["scans"], &slow["late"]], [2, 0], "{slow}");
    assert!(slow["longest_us"].as_u64() >= slow["last_us"].as_u64(), "{slow}");
}

/// Processes that another has started.
fn children(parent: u32) -> Vec<u32> {
    let list = |task: PathBuf| fs::read_to_string(task.join("children")).unwrap_or_default();
    let tasks = fs::read_dir(format!("/proc/{parent}/task")).into_iter().flatten().flatten();
    tasks
        .flat_map(|task| {
            list(task.path())
                .split_whitespace()
                .filter_map(|id| id.parse().ok())
                .collect::<Vec<_>>()
        })
        .collect()
}

fn is_emulator(id: &u32) -> bool {
    fs::read_to_string(format!("/proc/{id}/comm")).is_ok_and(|name| name.starts_with("qemu"))
}

/// Paths of an emulator's memory, log and line.
fn folder_of(emulator: u32) -> Option<PathBuf> {
    let line = fs::read_to_string(format!("/proc/{emulator}/cmdline")).ok()?;
    let (_, after) = line.split_once("mem-path=")?;
    Some(Path::new(after.split(',').next()?).parent()?.to_owned())
}

/// Waits until something is so.
fn wait_for(what: &str, is_so: impl Fn() -> bool) {
    // Killed, a process is there until the system has taken it down: on a busy machine for a while.
    let deadline = Instant::now() + Duration::from_secs(20);
    while !is_so() {
        assert!(Instant::now() < deadline, "not so after 20 s: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn an_emulator_that_dies_is_a_lost_sensor_and_no_end_of_the_command_leaves_anything_behind() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    let long = [
        "tune",
        "-c",
        "small.toml",
        "--generations",
        "500",
        "--sensor",
        "qemu",
        "--firmware",
        &image,
    ];
    let judge = [
        "evaluate",
        "-c",
        "small.toml",
        "--set",
        "data.test_pairs=40",
        "--sensor",
        "qemu",
        "--firmware",
        &image,
    ];
    let ends = [
        (&long[..], "-KILL", true, Some(3), "qemu"),
        (&long, "-INT", false, Some(130), "--resume"),
        (&judge, "-TERM", false, Some(130), ""),
        (&long, "-KILL", false, None, ""),
    ];
    for (command, signal, to_child, code, says) in ends {
        let child = fixture
            .command(command)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("echoloop starts");
        let deadline = Instant::now() + Duration::from_secs(60);
        let (started, emulators, folders) = loop {
            let started = children(child.id());
            let emulators: Vec<u32> = started.iter().copied().filter(is_emulator).collect();
            let folders: Vec<PathBuf> = emulators.iter().filter_map(|&id| folder_of(id)).collect();
            // An emulator just forked has no command line of its own yet.
            let all_have_one =
                folders.len() == emulators.len() && folders.iter().all(|f| f.exists());
            let is_tuning = fixture.path("runs/latest/history.jsonl").exists();
            if !emulators.is_empty() && all_have_one && (command[0] != "tune" || is_tuning) {
                break (started, emulators, folders);
            }
            assert!(Instant::now() < deadline, "no emulator was started in a folder of its own");
            std::thread::sleep(Duration::from_millis(20));
        };
        let whom = if to_child { emulators } else { vec![child.id()] };
        for id in whom {
            let _ = std::process::Command::new("kill").args([signal, &id.to_string()]).status();
        }
        let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
        assert_eq!(output.code, code, "{}", output.stderr);
        assert!(output.stderr.contains(says), "{}", output.stderr);
        for id in started {
            wait_for(&format!("{id} has ended"), || !Path::new(&format!("/proc/{id}")).exists());
        }
        for folder in folders {
            wait_for(&format!("{} has gone", folder.display()), || !folder.exists());
        }
        // The next waits for a journal of its own.
        if command[0] == "tune" {
            fs::remove_dir_all(fixture.path("runs")).expect("the run can be removed");
        }
    }
}

#[test]
fn an_image_that_is_not_there_is_named_with_what_builds_it() {
    let Some(image) = image() else { return };
    let fixture = Fixture::new();
    fixture.refuses(
        &["scan", "-c", "small.toml", "--sensor", "qemu", "--firmware", "nothing.elf"],
        &["nothing.elf", "cargo xtask firmware --target thumbv7em-none-eabihf"],
    );
    let scan = |board, file| ["scan", "-c", "small.toml", "--sensor", board, "--firmware", file];
    fixture.refuses(&scan("qemu", "small.toml"), &["small.toml", "not an ELF file"]);
    fixture.refuses(
        &scan("qemu", env!("CARGO_BIN_EXE_echoloop")),
        &["echoloop", "for X86_64", "runs Arm code at 0x0"],
    );
    fixture.refuses(
        &scan("qemu:mps2-an505", &image),
        &["echoloop-sensor", "runs Arm code at 0x10000000", "thumbv8m.main"],
    );
    fixture
        .refuses(&["scan", "-c", "small.toml", "--sensor", "qemu:mps3"], &["mps3", "mps2-an386"]);
    fixture.refuses(
        &["scan", "-c", "small.toml", "--sensor", "qemu:netduinoplus2"],
        &["netduinoplus2", "no front end", "--front-end host"],
    );
}

#[test]
fn what_the_emulator_shares_with_its_host_is_for_this_user_alone_and_ends_with_it() {
    use std::os::unix::fs::PermissionsExt;
    let Some(image) = image() else { return };
    let kept = Fixture::new();
    let front_end = || Model::from(&RunConfig::default()).front_end();
    for folder in [None, Some(kept.path("new/board"))] {
        let mut options = QemuOptions::new(Machine::An386, Path::new(""));
        (options.image, options.folder) = (image.clone().into(), folder.clone());
        let (pattern, hardware) = (ScanPattern::default(), Hardware::REFERENCE);
        let board = Qemu::start(&options, front_end(), pattern, hardware).expect("a board");
        let (lies, inside) = (board.folder().to_owned(), board.folder().join("memory.bin"));
        let mode = fs::metadata(&lies).expect("a folder").permissions().mode();
        assert_eq!(mode & 0o777, 0o700, "{}", lies.display());
        assert!(inside.exists());
        drop(board);
        assert_eq!(inside.exists(), folder.is_some(), "{}", lies.display());
    }
}
