//! `--front-end host`: a board that has a link and a DSP, and no laser, closes the loop with the
//! numbers of the sensor in process; so does a board that is simulated at the other end of a line.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::board::{Board, ask_a_liar, ask_a_liar_about, end, run, start, succeed, terminals};
use crate::fixture::Fixture;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_dsp::{Grid, Hardware, MAX_CODES, ScanPattern};
use echoloop_link::{Decoder, Greeting, MAX_FRAME, Report, Room, decode, encode};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::sensor::Model;
use echoloop_sensors::serve::serve;
use echoloop_sensors::transport::{Serial, Transport};
use serialport::TTYPort;

const HOST: [&str; 2] = ["--front-end", "host"];

/// Few beams, and pairs enough to compare.
const GRID: [&str; 2] = ["--set", "scanner.pattern=grid"];

const FEW: [&str; 12] = [
    "-q",
    "--json",
    "-c",
    "small.toml",
    "--set",
    "scanner.columns=24",
    "--set",
    "scanner.rows=8",
    "--set",
    "data.train_pairs=2",
    "--set",
    "data.test_pairs=2",
];

/// Effect of a line on the bytes it carries.
#[derive(Default)]
struct Harm {
    /// Bytes to the board that still pass; then some are lost, and it passes bytes again.
    stall_after: Option<usize>,
    /// Answers that still pass; then the line is gone.
    cut_after: Option<usize>,
    /// Answers that were sent.
    answers: Arc<AtomicUsize>,
}

/// A board's end of a line with something wrong with it.
struct Harmed {
    line: Serial,
    harm: Harm,
}

impl Transport for Harmed {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let sent = self.harm.answers.fetch_add(1, Ordering::Relaxed);
        if self.harm.cut_after.is_some_and(|after| sent >= after) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        if self.harm.stall_after.is_some() && sent % 9 == 5 {
            return self.line.send(&bytes[..bytes.len() / 2]); // and no more of it
        }
        self.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let length = self.line.receive(buffer, timeout)?;
        let Some(left) = &mut self.harm.stall_after else { return Ok(length) };
        if let Some(rest) = left.checked_sub(length) {
            *left = rest;
            return Ok(length);
        }
        *left = 40_000;
        Ok(length / 2) // in the middle of a frame
    }
}

/// A board without a front end on a terminal: it sees nothing of its own.
struct Bare {
    spec: String,
    stop: Arc<AtomicBool>,
    answers: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
    _plug: TTYPort,
}

impl Bare {
    fn new(fixture: &Fixture) -> Self {
        Self::harmed(fixture, &[], Harm::default())
    }

    /// One for the configuration with these changes.
    fn harmed(fixture: &Fixture, changes: &[&str], harm: Harm) -> Self {
        let (here, plug, path) = terminals();
        Self::on((here, plug, path), &config(fixture, changes), harm)
    }

    fn on((here, plug, path): (TTYPort, TTYPort, String), config: &RunConfig, harm: Harm) -> Self {
        let model = Model::from(config);
        let mut sensor = PcSensor::new(model.front_end(), model.pattern, model.hardware);
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, answers) = (Arc::clone(&stop), Arc::clone(&harm.answers));
        let line = Serial::from_open_port(here, "board").expect("a port");
        let mut line = Harmed { line, harm };
        let answer = move || drop(serve(&mut line, &mut sensor, &|| flag.load(Ordering::Relaxed)));
        let thread = Some(std::thread::spawn(answer));
        Self { spec: format!("serial:{path}@4000000"), stop, answers, thread, _plug: plug }
    }
}

impl Drop for Bare {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

/// The small configuration, of few beams and pairs.
fn config(fixture: &Fixture, changes: &[&str]) -> RunConfig {
    let yard = format!("scene.source={}", fixture.path("yard.obj").display());
    let few = FEW.iter().filter(|text| text.contains('='));
    let overrides: Vec<_> = [&yard[..]]
        .into_iter()
        .chain(few.copied())
        .chain(changes.iter().copied())
        .map(|text| text.parse().expect("an override"))
        .collect();
    load(Some(&fixture.path("small.toml")), &overrides).expect("a configuration")
}

/// Output of a command without the name of its sensor.
fn printed(fixture: &Fixture, arguments: &[&str]) -> serde_json::Value {
    let mut document = succeed(fixture, arguments).json();
    assert!(document["sensor"].take().is_string(), "{document}");
    document
}

#[test]
fn a_scan_is_byte_for_byte_that_of_the_sensor_in_process() {
    let fixture = Fixture::new();
    let board = Bare::new(&fixture);
    for more in [&[][..], &["--set", "lidar.shots=4", "--set", "lidar.dither=on"]] {
        let scan = |sensor: &[&str], name| {
            let scan = [&["scan"][..], &FEW, more, sensor, &["-o", name]].concat();
            printed(&fixture, &scan)
        };
        let near = scan(&[], "near.ply");
        let far = scan(&[&["--sensor", &board.spec], &HOST[..]].concat(), "far.ply");
        let here = scan(&HOST, "here.ply");
        assert_eq!([&far, &here], [&near; 2], "{more:?}");
        assert!(near["points"].as_u64() > Some(100), "{near}");
        for name in ["far.ply", "here.ply"] {
            assert!(fixture.bytes(name) == fixture.bytes("near.ply"), "{name} {more:?}");
        }
        for name in ["near.ply", "far.ply", "here.ply"] {
            std::fs::remove_file(fixture.path(name)).expect("a file");
        }
    }
    assert!(board.answers.load(Ordering::Relaxed) > 100, "it had a part in it");
}

#[test]
fn the_host_chooses_where_a_board_without_a_front_end_looks() {
    let fixture = Fixture::new();
    let board = Bare::new(&fixture);
    let pose = ["--pose", "1", "2", "2", "30", "0", "0"];
    let near = printed(&fixture, &[&["scan"][..], &FEW, &pose].concat());
    let there = ["--sensor", &board.spec];
    let far = printed(&fixture, &[&["scan"][..], &FEW, &pose, &there, &HOST].concat());
    assert_eq!(far, near);
}

#[test]
fn an_evaluation_is_that_of_the_sensor_in_process() {
    let fixture = Fixture::new();
    let (bare, seeing) = (Bare::new(&fixture), Board::of(&config(&fixture, &[])));
    let evaluate = |more: &[&str]| printed(&fixture, &[&["evaluate"][..], &FEW, more].concat());
    let near = evaluate(&[]);
    assert!(near["summary"]["mean_points"].as_f64() > Some(100.0), "{near}");
    assert_eq!(evaluate(&[&["--sensor", &bare.spec], &HOST[..]].concat()), near, "waveforms");
    assert_eq!(evaluate(&["--sensor", &seeing.spec]), near, "its own front end");
    let both = [&["--sensor", &seeing.spec], &HOST[..]].concat();
    assert_eq!(evaluate(&both), near, "a front end of its own that is not used");
}

/// Tunes for a moment; what is in the run's folder must not depend on the sensor.
fn tune(fixture: &Fixture, runs: &str, more: &[&str]) -> Vec<Vec<u8>> {
    let moment = ["--generations", "1", "--population", "2", "--set", "tune.shortlist=1"];
    succeed(fixture, &[&["tune"][..], &FEW, &moment, &["--runs", runs], more].concat());
    let files = ["result.json", "report.html", "config.toml"];
    let mut files = files.map(|file| fixture.repeatable(&format!("{runs}/latest/{file}"))).to_vec();
    files.push(fixture.generations(&format!("{runs}/latest/history.jsonl")).into());
    files
}

#[test]
fn a_run_ends_with_the_files_of_the_run_in_process() {
    let fixture = Fixture::new();
    let (bare, seeing) = (Bare::new(&fixture), Board::of(&config(&fixture, &[])));
    let near = tune(&fixture, "near", &[]);
    let fed = tune(&fixture, "fed", &[&["--sensor", &bare.spec], &HOST[..]].concat());
    let served = tune(&fixture, "served", &["--sensor", &seeing.spec, "--threads", "2"]);
    assert!(near.iter().all(|file| file.len() > 100));
    assert!(fed == near, "waveforms");
    assert!(served == near, "its own front end");
    let advice = "resume with that sensor";
    let resumed = ["tune", "--resume", "served/latest"];
    fixture.refuses(&resumed, &["line 1: sensor is \"serial, echoloop", "\"in-process", advice]);
    let fed = [&resumed[..], &["--sensor", &bare.spec], &HOST].concat();
    fixture.refuses(&fed, &["\"serial with waveforms, ", advice]);
    fixture.succeed(&[&resumed[..], &["--sensor", &seeing.spec]].concat());
}

#[test]
fn a_line_that_stalls_in_the_middle_of_frames_changes_no_number() {
    let fixture = Fixture::new();
    let harm = Harm { stall_after: Some(20_000), ..Harm::default() };
    let board = Bare::harmed(&fixture, &[], harm);
    let scan = |more: &[&str]| printed(&fixture, &[&["scan"][..], &FEW, more].concat());
    assert_eq!(scan(&[&["--sensor", &board.spec], &HOST[..]].concat()), scan(&[]));
}

#[test]
fn a_board_of_another_converter_range_or_pattern_is_refused_with_both_values() {
    let grid = ScanPattern::Grid(Grid::default());
    let enough = Room { codes: MAX_CODES as u32, frames: 1 };
    let bits = Hardware { adc_bits: 14, ..Hardware::REFERENCE };
    let range = Hardware { range_max_mm: 90_000, ..Hardware::REFERENCE };
    let small = Grid { columns: 64, rows: 16, ..Grid::default() };
    let table = [
        (bits, grid, enough, ["its adc_bits is 14", "front end 12"]),
        (range, grid, enough, ["its range_max_mm is 90000", "front end 120000"]),
        (bits, ScanPattern::Grid(small), enough, ["64 × 16", "192 × 64"]),
    ];
    for (hardware, pattern, room, parts) in table {
        for command in ["scan", "evaluate", "tune"] {
            let asked = [&[command], &HOST[..], &GRID].concat();
            let output = ask_a_liar_about("liar", (hardware, pattern), room, &asked);
            assert_eq!(output.code, Some(2), "{command}: {}", output.stderr);
            for part in parts.iter().chain(&["serial:/dev/"]) {
                assert!(output.stderr.contains(part), "{part}: {}", output.stderr);
            }
        }
    }
    // A front end of its own may be what it is.
    let output = ask_a_liar_about("liar", (bits, grid), enough, &[&["scan"], &GRID[..]].concat());
    assert!(!output.stderr.contains("adc_bits"), "{}", output.stderr);
}

#[test]
fn a_board_of_too_little_memory_is_refused_with_what_it_has_and_what_it_takes() {
    for codes in [0, 1_024, MAX_CODES as u32 - 1] {
        let hardware = (Hardware::REFERENCE, ScanPattern::default());
        let room = Room { codes, frames: 3 };
        let asked = [&["evaluate"], &HOST[..], &GRID].concat();
        let output = ask_a_liar_about("liar", hardware, room, &asked);
        assert_eq!(output.code, Some(2), "{}", output.stderr);
        let said = format!("memory for waveforms of {codes} codes; they have up to 2528");
        assert!(output.stderr.contains(&said), "{}", output.stderr);
    }
}

#[test]
fn a_board_of_another_protocol_is_refused_with_both() {
    let fixture = Fixture::new();
    let (here, _there, path) = terminals();
    let theirs = Greeting { protocol: 7, schema: 0x0123_4567_89ab_cdef, ..Greeting::OURS };
    let other = std::thread::spawn(move || greet(here, theirs));
    let sensor = format!("serial:{path}");
    let output = run(&fixture, &[&["scan", "--sensor", &sensor], &HOST[..]].concat());
    assert_eq!(output.code, Some(3), "{}", output.stderr);
    let ours = format!("protocol {}", Greeting::OURS.protocol);
    for part in ["protocol 7", "0x0123456789abcdef", &ours, &sensor[..]] {
        assert!(output.stderr.contains(part), "{part}: {}", output.stderr);
    }
    other.join().expect("a sensor");
}

/// Answers one hello.
fn greet(line: TTYPort, greeting: Greeting) {
    let mut line = Serial::from_open_port(line, "other").expect("a port");
    let (mut decoder, mut buffer) = (Decoder::new(), [0; 4096]);
    let deadline = Instant::now() + Duration::from_secs(20);
    while Instant::now() < deadline {
        let length = line.receive(&mut buffer, Duration::from_millis(20)).expect("a line");
        for &byte in &buffer[..length] {
            let Some(Ok(asked)) = decoder.push(byte) else { continue };
            let Ok((sequence, _)) = decode::<echoloop_link::Command<'_>>(asked) else { continue };
            let (hardware, pattern) = (Hardware::REFERENCE, ScanPattern::default());
            let build = "other".try_into().expect("it is short");
            let hello = Report::Hello { greeting, build, hardware, pattern };
            let mut frame = [0; MAX_FRAME];
            line.send(encode(sequence, &hello, &mut frame).expect("it fits")).expect("a line");
            std::thread::sleep(Duration::from_millis(200)); // it is read before the line ends
            return;
        }
    }
    panic!("nobody said hello");
}

#[test]
fn a_port_that_vanishes_and_returns_lets_the_run_go_on_to_the_same_end() {
    let fixture = Fixture::new();
    let small = ["-c", "small.toml", "--strategy", "paper", "--set", "tune.shortlist=1"];
    let few = ["--set", "scanner.columns=24", "--set", "scanner.rows=8"];
    let short = ["--generations", "2", "--population", "2"];
    let tiny = [&small[..], &few, &short].concat();
    let changes = ["data.train_pairs=4", "data.test_pairs=3"];
    let tune = |board: &Bare, more: &[&str]| {
        run(&fixture, &[&["tune", "-q", "--sensor", &board.spec], &HOST[..], more].concat())
    };
    let whole_board = Bare::harmed(&fixture, &changes, Harm::default());
    let whole = tune(&whole_board, &tiny);
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    let answers = whole_board.answers.load(Ordering::Relaxed);
    let harm = Harm { cut_after: Some(answers / 2), ..Harm::default() };
    let lost = tune(&Bare::harmed(&fixture, &changes, harm), &tiny);
    assert_eq!(lost.code, Some(3), "{}", lost.stderr);
    let line = lost.stderr.lines().find(|line| line.starts_with("error:")).expect("an error");
    assert!(line.contains("the link is lost") && line.contains("serial:"), "{line}");
    let folder = "runs/0002-yard-icp-joint";
    let hint = format!("--resume {folder}");
    assert!(lost.stderr.contains(&hint), "{}", lost.stderr);
    assert!(lost.stderr.contains("--front-end host"), "{}", lost.stderr);
    let back = Bare::harmed(&fixture, &changes, Harm::default());
    let resumed = tune(&back, &["--resume", folder]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    for name in ["history.jsonl", "result.json", "report.html"] {
        let [one, other] = [folder, "runs/0001-yard-icp-joint"]
            .map(|run| fixture.repeatable(&format!("{run}/{name}")));
        assert!(one == other, "{name}");
    }
}

#[test]
fn a_second_host_on_the_port_is_refused_and_the_first_does_not_notice() {
    let fixture = Fixture::new();
    let board = Bare::new(&fixture);
    let sensor = [&["--sensor", &board.spec], &HOST[..]].concat();
    let long = ["--set", "data.test_pairs=2", "--set", "lidar.shots=16"];
    let first = start(&fixture, &[&["evaluate"][..], &FEW, &long, &sensor].concat());
    let begun = Instant::now();
    while board.answers.load(Ordering::Relaxed) < 20 {
        assert!(begun.elapsed() < Duration::from_secs(60), "the first never began");
        std::thread::sleep(Duration::from_millis(5));
    }
    let second = run(&fixture, &[&["scan"][..], &FEW, &sensor].concat());
    assert_eq!(second.code, Some(2), "{}", second.stderr);
    for part in ["cannot be opened", "is another program using it?", &board.spec[..]] {
        assert!(second.stderr.contains(part), "{part}: {}", second.stderr);
    }
    let first = end(first);
    assert_eq!(first.code, Some(0), "{}", first.stderr);
    let near = succeed(&fixture, &[&["evaluate"][..], &FEW, &long].concat()).json();
    assert_eq!(first.json()["summary"], near["summary"]);
}

#[test]
fn where_the_front_end_is_must_be_one_of_two() {
    let fixture = Fixture::new();
    for command in ["scan", "evaluate", "tune", "sensor"] {
        let asked = [command, "--front-end", "board"];
        fixture.refuses(&asked, &["--front-end", "sensor", "host"]);
    }
    let output = ask_a_liar("liar", ScanPattern::default(), &["sensor", "--front-end", "host"]);
    assert_eq!(output.code, Some(0), "who it is may be asked of any: {}", output.stderr);
}
