//! A sensor on a serial line, over pairs of pseudo-terminals: the same echoes as in process, and an
//! end in bounded time whatever becomes of the line.

use std::io::{self, BufRead};
use std::process::Child;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::board::{Board, ask_a_liar, end, end_within, run, start, succeed, terminals};

use crate::fixture::Fixture;
use echoloop_closed_loop::seed::scan_noise;
use echoloop_dsp::{BeamTable, Grid, Rosette, ScanPattern, Settings, Spinning, SpinningModel};
use echoloop_link::{Command, Greeting, MAX_FRAME, encode};
use echoloop_sensors::sensor::{Model, Port, Sensor, SensorError, View};
use echoloop_sensors::transport::{Serial, Transport};
use serialport::TTYPort;

#[test]
fn over_a_line_a_sensor_gives_the_echoes_it_gives_in_process() {
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let settings = Settings { power_uw: 50_000_000, upsampling: 2, ..Settings::default() };
    let mut far = Sensor::serial(&board.port, None).expect("a sensor");
    let mut near = Sensor::in_process(&Model::from(&board.config)).expect("a sensor");
    assert_eq!(far.client.identity(), near.client.identity());
    assert_eq!(
        far.configure(&settings).expect("accepted"),
        near.configure(&settings).expect("accepted")
    );
    for (scene, number) in board.dataset.views().zip(1..).take(3) {
        let noise_seed = scan_noise(board.config.seed);
        let view = View { scene: &scene, noise_seed, scan: number, viewpoint: number };
        let echoes = far.scan(&view).expect("a scan");
        assert_eq!(echoes, near.scan(&view).expect("a scan"), "viewpoint {number}");
        assert!(echoes.iter().flatten().count() > 300);
    }
    let nowhere = board.dataset.views().next().expect("a view");
    let view = View { scene: &nowhere, noise_seed: 0, scan: 1, viewpoint: 1_000 };
    assert_eq!(
        far.scan(&view).expect("a scan").iter().flatten().count(),
        0,
        "there is no such viewpoint"
    );
}

#[test]
fn scan_writes_the_cloud_it_writes_in_process() {
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let scan = |sensor: &str, name: &str| {
        succeed(&fixture, &["scan", "--json", "-c", "small.toml", "--sensor", sensor, "-o", name])
            .json()
    };
    let [near, far] = [scan("in-process", "near.ply"), scan(&board.spec, "far.ply")];
    assert!(fixture.bytes("near.ply") == fixture.bytes("far.ply"), "the clouds differ");
    assert_eq!(near["settings"], far["settings"]);
    assert_eq!(far["sensor"], format!("{}, echoloop-sensor 0.1.0", board.spec));
    assert_eq!(
        (&far["scene"], &far["world_from_sensor"]),
        (&().into(), &().into()),
        "not ours to know"
    );
    let output = run(
        &fixture,
        &[
            "scan",
            "-c",
            "small.toml",
            "--sensor",
            &board.spec,
            "--pose",
            "0",
            "0",
            "2",
            "0",
            "0",
            "0",
        ],
    );
    assert_eq!(output.code, Some(2), "{}", output.stderr);
    assert!(output.stderr.contains("--pose"), "{}", output.stderr);
}

#[test]
fn a_run_over_a_line_ends_with_a_report_and_is_the_same_on_one_thread_and_two() {
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let tiny = [
        "-c",
        "small.toml",
        "--generations",
        "1",
        "--population",
        "2",
        "--set",
        "tune.shortlist=1",
    ];
    for threads in ["1", "2"] {
        let output = succeed(
            &fixture,
            &[&["tune", "--sensor", &board.spec, "--threads", threads], &tiny[..]].concat(),
        );
        assert!(
            output.stderr.contains(&format!("sensor {}, echoloop-sensor", board.spec)),
            "{}",
            output.stderr
        );
    }
    for name in ["config.toml", "history.jsonl", "result.json", "report.html", "after.ply"] {
        let [one, two] =
            [1, 2].map(|run| fixture.repeatable(&format!("runs/000{run}-yard-icp-joint/{name}")));
        assert!(one.len() > 100 && one == two, "{name}");
    }
    let judged = ["evaluate", "-q", "--json", "--run", "runs/latest", "--sensor", &board.spec];
    let judged = succeed(&fixture, &judged).json();
    let result: serde_json::Value =
        serde_json::from_str(&fixture.read("runs/latest/result.json")).expect("JSON");
    assert_eq!(judged["summary"], result["tuned_summary"]);
}

#[test]
fn a_board_keeps_its_settings_until_others_are_asked_for() {
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let sensor = |more: &[&str]| {
        succeed(&fixture, &[&["sensor", "--json", "--sensor", &board.spec], more].concat()).json()
    };
    assert_eq!(sensor(&["--set", "lidar.power=33.33"])["settings"]["power"], 33.33);
    let other = sensor(&["--set", "lidar.gain=3"]);
    assert_eq!(
        (&other["settings"]["power"], &other["settings"]["gain"]),
        (&33.33.into(), &3.0.into())
    );
    let read = sensor(&[]);
    assert_eq!((&read["settings"], &read["hash"]), (&other["settings"], &other["hash"]));
    assert!(read["counters"]["frames"].as_u64() > other["counters"]["frames"].as_u64(), "{read}");
    let output = run(
        &fixture,
        &[
            "sensor",
            "--sensor",
            &board.spec,
            "--set",
            "lidar.pulse_width=20",
            "--set",
            "lidar.power=75",
        ],
    );
    assert_eq!(output.code, Some(2), "{}", output.stderr);
    assert!(
        output.stderr.contains("refused") && output.stderr.contains(&board.port.path),
        "{}",
        output.stderr
    );
    assert_eq!(sensor(&[])["hash"], other["hash"]);
}

#[test]
fn a_board_of_other_beams_than_the_configuration_s_is_refused() {
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let other = ["-c", "small.toml", "--set", "scanner.columns=64", "--sensor", &board.spec];
    for command in ["tune", "evaluate", "scan"] {
        let output = run(&fixture, &[&[command], &other[..]].concat());
        assert_eq!(output.code, Some(2), "{}", output.stderr);
        for part in [&board.port.path, "48 × 16 over 180° × 60°", "64 × 16 over 180° × 60°"]
        {
            assert!(output.stderr.contains(part), "{part}: {}", output.stderr);
        }
    }
    assert!(!fixture.path("runs").exists());
}

#[test]
fn a_board_of_another_pattern_is_refused_with_both() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mine.csv");
    let rows = "azimuth_deg,elevation_deg,time_s,channel\n1,2,0,0\n3,4,0,1\n";
    std::fs::write(&path, rows).expect("a file");
    let mine = format!("scanner.pattern={}", path.display());
    let vlp = ScanPattern::Spinning(Spinning { model: SpinningModel::Vlp16, columns: 1808 });
    let table = ScanPattern::Table(BeamTable { beams: 2, channels: 2, hash: 0x1234 });
    for (theirs, ours, parts) in [
        (vlp, "scanner.pattern=os1-64", ["1808 × 16 of a Vlp16", "1024 × 64 of a Os1x64"]),
        (ScanPattern::Rosette(Rosette::MID_40), "seed=1", ["10000 of a rosette", "200 × 32 over"]),
        (table, &mine, ["(2 channels, hash 0x00001234)", "2 of a table (2 channels, hash 0x"]),
        (ScanPattern::Raster(Grid::default()), "seed=1", ["line by line", "200 × 32 over"]),
    ] {
        let output = ask_a_liar("liar", theirs, &["scan", "--set", ours]);
        assert_eq!(output.code, Some(2), "{}", output.stderr);
        for part in parts {
            assert!(output.stderr.contains(part), "{part}: {}", output.stderr);
        }
    }
}

#[test]
fn a_table_or_rosette_of_more_beams_than_there_can_be_is_refused() {
    for beams in [0, 131_073, u32::MAX] {
        let table = ScanPattern::Table(BeamTable { beams, channels: 2, hash: 1 });
        for pattern in [table, ScanPattern::Rosette(Rosette { beams, ..Rosette::MID_40 })] {
            let output = ask_a_liar("liar", pattern, &["scan"]);
            assert_eq!(output.code, Some(3), "{}", output.stderr);
            let said = format!("it has {beams} beams; expected");
            assert!(output.stderr.contains(&said), "{}", output.stderr);
        }
    }
}

#[test]
fn a_sensor_of_more_beams_than_there_can_be_is_refused_before_there_is_room_for_them() {
    for (columns, rows) in [(65_535, 65_535), (4_097, 1), (1, 1_025), (0, 64), (64, 0)] {
        let pattern = ScanPattern::Grid(Grid { columns, rows, ..Grid::default() });
        for command in ["scan", "evaluate", "sensor"] {
            let output = ask_a_liar("liar", pattern, &[command]);
            assert_eq!(output.code, Some(3), "{command}: {}", output.stderr);
            let said = format!("it has {columns} × {rows} beams; expected 1 to 4096 × 1 to 1024,");
            assert!(output.stderr.contains(&said), "{command}: {}", output.stderr);
        }
    }
}

#[test]
fn no_name_of_a_sensor_s_build_moves_the_cursor() {
    for build in ["\x1b]0;owned\x07\x1b[31m", "a\rb\nc\t\x08", "\u{9b}2J \u{202e}abc"] {
        for command in [&["sensor"][..], &["sensor", "--json"], &["scan"]] {
            let output = ask_a_liar(build, ScanPattern::default(), command);
            let quiet = |text: &str| {
                let moves = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
                !text.contains(moves) && !text.contains("a\rb") && !text.contains("b\nc")
            };
            assert!(quiet(&output.stdout), "{command:?}: {:?}", output.stdout);
            assert!(quiet(&output.stderr), "{command:?}: {:?}", output.stderr);
        }
    }
    let output = ask_a_liar("it's \"mine\" é 1.0", ScanPattern::default(), &["sensor"]);
    assert!(output.stdout.contains("it's \"mine\" é 1.0"), "{}", output.stdout);
}

#[test]
fn a_line_cut_in_the_middle_is_a_lost_link_with_the_port_s_name() {
    let fixture = Fixture::new();
    for command in ["scan", "evaluate", "tune"] {
        let board = Board::cut_after(&fixture, 12);
        let output = run(
            &fixture,
            &[command, "-c", "small.toml", "--threads", "2", "--sensor", &board.spec],
        );
        assert_eq!(output.code, Some(3), "{command}: {}", output.stderr);
        let line = output.stderr.lines().find(|line| line.starts_with("error:")).expect("an error");
        assert!(line.contains(&board.port.path) && line.contains("the link is lost"), "{line}");
        let hint = format!("--resume runs/0001-yard-icp-joint --sensor {}", board.spec);
        assert_eq!(output.stderr.contains(&hint), command == "tune", "{}", output.stderr);
    }
}

#[test]
fn a_run_that_lost_its_board_goes_on_with_another_to_the_same_end() {
    let fixture = Fixture::new();
    let tune = |board: &Board, more: &[&str]| {
        run(&fixture, &[&["tune", "-q", "--sensor", &board.spec], more].concat())
    };
    let tiny = [
        "-c",
        "small.toml",
        "--strategy",
        "paper",
        "--generations",
        "2",
        "--population",
        "2",
        "--set",
        "tune.shortlist=1",
    ];
    let whole = tune(&Board::new(&fixture), &tiny);
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    // 50 answers a registration, 4 registrations a generation: lost in the second.
    assert_eq!(tune(&Board::cut_after(&fixture, 300), &tiny).code, Some(3));
    let lost = "runs/0002-yard-icp-joint";
    assert_eq!(
        fixture.read(&format!("{lost}/history.jsonl")).lines().count(),
        2,
        "a header and a generation"
    );
    let resumed = tune(&Board::new(&fixture), &["--resume", lost]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    for name in ["history.jsonl", "result.json", "report.html"] {
        assert!(
            fixture.repeatable(&format!("{lost}/{name}"))
                == fixture.repeatable(&format!("runs/0001-yard-icp-joint/{name}")),
            "{name}"
        );
    }
}

#[test]
fn a_port_that_answers_nothing_is_given_up_in_bounded_time() {
    let fixture = Fixture::new();
    let (_here, _there, path) = terminals();
    let begun = Instant::now();
    let output = run(&fixture, &["sensor", "--sensor", &format!("serial:{path}@4000000")]);
    assert_eq!(output.code, Some(3), "{}", output.stderr);
    assert!(
        output.stderr.contains(&path)
            && output.stderr.contains("no answer from the sensor to hello"),
        "{}",
        output.stderr
    );
    assert!(begun.elapsed() < Duration::from_secs(30));
}

#[test]
fn a_port_that_is_none_is_refused_by_name() {
    let fixture = Fixture::new();
    for name in ["/dev/no-such-port", "yard.obj", "."] {
        for command in ["tune", "evaluate", "scan", "sensor"] {
            fixture.refuses(
                &[command, "--sensor", &format!("serial:{name}")],
                &[name, "cannot be opened"],
            );
        }
        fixture.refuses(&["serve", "-c", "small.toml", name], &[name, "cannot be opened"]);
    }
    let port = Port { path: "/dev/no-such-port".into(), baud: 9_600 };
    let error = Sensor::serial(&port, None).map(|_| ()).expect_err("no port");
    assert!(matches!(error, SensorError::Open { .. }), "{error}");
}

#[test]
fn the_ideal_detector_is_in_process_alone() {
    let fixture = Fixture::new();
    for sensor in ["qemu", "serial:/dev/ttyX"] {
        let line = ["scan", "--set", "detector.kind=ideal", "--sensor", sensor, "-o", "a.ply"];
        let said = format!("detector.kind = ideal is for --sensor in-process, not {sensor}");
        fixture.refuses(&line, &[&said]);
    }
    let serve = ["serve", "/dev/ttyX", "--set", "detector.kind=ideal"];
    fixture.refuses(&serve, &["detector.kind = ideal is for --sensor in-process"]);
    fixture.refuses(&["scan", "--set", "detector.kind=none"], &["detector.kind", "ideal"]);
}

#[test]
fn a_sensor_that_is_none_is_refused_by_name() {
    let fixture = Fixture::new();
    let table = [
        ("uart:/dev/ttyS0", "expected in-process, qemu[:BOARD] or serial:PORT[@BAUD]"),
        ("serial", "needs its port"),
        ("serial:/dev/ttyS0@fast", "'fast' is no speed"),
        ("qemu:toaster", "no board 'toaster'"),
    ];
    for (sensor, problem) in table {
        for command in ["tune", "evaluate", "scan", "sensor"] {
            fixture.refuses(&[command, "--sensor", sensor], &["--sensor", problem]);
        }
    }
    fixture.refuses(&["serve", "/dev/ttyS0@fast"], &["'fast' is no speed"]);
}

/// Carries bytes both ways between two terminals until told to stop.
fn bridge(one: TTYPort, other: TTYPort, stop: &Arc<AtomicBool>) -> JoinHandle<()> {
    let mut lines =
        [one, other].map(|port| Serial::from_open_port(port, "bridge").expect("a port"));
    let stop = Arc::clone(stop);
    std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        while !stop.load(Ordering::Relaxed) {
            for (from, to) in [(0, 1), (1, 0)] {
                let length =
                    lines[from].receive(&mut buffer, Duration::from_millis(1)).expect("a line");
                lines[to].send(&buffer[..length]).expect("a line");
            }
        }
    })
}

#[test]
fn serve_is_the_other_end_until_interrupted() {
    let fixture = Fixture::new();
    let ((one, _plug, served), (other, _other_plug, used)) = (terminals(), terminals());
    let stop = Arc::new(AtomicBool::new(false));
    let bridge = bridge(one, other, &stop);
    let server = start(&fixture, &["serve", "-c", "small.toml", &served]);
    succeed(
        &fixture,
        &["scan", "-q", "-c", "small.toml", "--sensor", &format!("serial:{used}"), "-o", "far.ply"],
    );
    fixture.succeed(&["scan", "-q", "-c", "small.toml", "-o", "near.ply"]);
    assert!(fixture.bytes("near.ply") == fixture.bytes("far.ply"), "the clouds differ");
    signal(&server, "-INT");
    let output = end(server);
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    assert!(
        output.stderr.contains(&format!("serving 38 viewpoints on {served}@921600 until ^C")),
        "{}",
        output.stderr
    );
    stop.store(true, Ordering::Relaxed);
    bridge.join().expect("a bridge");
}

fn signal(child: &Child, name: &str) {
    let kill = std::process::Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(kill.expect("kill runs").success());
}

/// `serve` on a terminal whose other end asks for beams and never reads, when it answers.
fn never_read(fixture: &Fixture, here: TTYPort, served: &str) -> (Child, Serial) {
    let mut server = start(fixture, &["serve", "-c", "small.toml", served]);
    let mut said = io::BufReader::new(server.stderr.as_mut().expect("a pipe"));
    let mut line = String::new();
    while !line.contains("until ^C") {
        line.clear();
        assert!(said.read_line(&mut line).expect("text") > 0, "serve has ended");
    }
    let mut host = Serial::from_open_port(here, "host").expect("a port");
    let ask = |sequence, command| {
        let mut frame = [0; MAX_FRAME];
        encode(sequence, &command, &mut frame).expect("it fits").to_vec()
    };
    host.send(&ask(1, Command::Hello(Greeting::OURS))).expect("a line");
    for i in 0..200 {
        let (frame, first) = (1 + u32::from(i) / 24, u32::from(i) % 24 * 32);
        let question = ask(2 + i, Command::ReadBeams { frame, first, count: 32 });
        // As far as the line takes it: its buffers are small.
        let _ = host.send_some(&question, Duration::from_millis(20));
        // Read a little, oddly much: what follows fills the line's buffer in part.
        if [1, 30, 60].contains(&i) {
            let _ = host.receive(&mut [0; 77], Duration::from_secs(1));
        }
    }
    (server, host)
}

#[test]
fn a_line_that_nobody_reads_takes_what_it_can_and_keeps_no_one_waiting() {
    let (here, _there, _path) = terminals();
    let (done, ended) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut line = Serial::from_open_port(here, "line").expect("a port");
        let bytes = [7; 1_000_000];
        let first = line.send_some(&bytes, Duration::from_millis(50)).expect("a line");
        let failed = line.send(&bytes).expect_err("there is no room for all");
        done.send((first, failed)).expect("somebody waits");
    });
    let (first, failed) = ended.recv_timeout(Duration::from_secs(10)).expect("within its limit");
    assert!((1..1_000_000).contains(&first), "{first}");
    assert_eq!(failed.kind(), io::ErrorKind::TimedOut);
    assert_eq!(
        failed.to_string(),
        "line: the line took no byte for 5s: nobody reads at its other end"
    );
}

#[test]
fn a_host_that_never_reads_ends_serve_within_its_limit() {
    let fixture = Fixture::new();
    let (here, _plug, served) = terminals();
    let (server, _host) = never_read(&fixture, here, &served);
    let output = end_within(server, Duration::from_secs(10));
    assert_eq!(output.code, Some(3), "{}", output.stderr);
}

#[test]
fn the_first_signal_ends_serve_although_nobody_reads() {
    let fixture = Fixture::new();
    for name in ["-TERM", "-INT"] {
        let (here, _plug, served) = terminals();
        let (server, _host) = never_read(&fixture, here, &served);
        std::thread::sleep(Duration::from_millis(300)); // it is in the midst of an answer
        signal(&server, name);
        assert_eq!(end_within(server, Duration::from_secs(3)).code, Some(0), "{name}");
    }
}

#[test]
fn the_first_signal_ends_serve_while_it_traces_its_scenes() {
    let fixture = Fixture::new();
    let (_here, _plug, served) = terminals();
    let large = ["--set", "scanner.columns=4000", "--set", "scanner.rows=1000"];
    let mut server =
        start(&fixture, &[&["serve", "-c", "small.toml", &served], &large[..]].concat());
    let mut said = io::BufReader::new(server.stderr.as_mut().expect("a pipe"));
    assert!(said.read_line(&mut String::new()).expect("text") > 0, "it says what it does");
    drop(said);
    signal(&server, "-TERM");
    assert_eq!(end_within(server, Duration::from_secs(3)).code, Some(130));
}
