//! `--sensor-log` of a board on a serial line: what comes on its second port, or from a debugger's
//! RTT server, is written down as that of an emulated board is; and nothing about it ends a run.
//!
//! The frames are those of the emulated STM32F405, whose image `cargo xtask firmware` builds.
//! Without it or QEMU these tests are skipped aloud; where `CI` is set, they fail.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::board::{Board, end, run, start, terminals};
use crate::fixture::{CommandOutput, Fixture};
use echoloop_closed_loop::config::RunConfig;
use echoloop_dsp::{Hardware, ScanPattern, Settings};
use echoloop_sensors::boards::qemu::{Machine, Qemu, QemuOptions, check_installed};
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::defmt_log;
use echoloop_sensors::sensor::Model;
use echoloop_sensors::transport::Transport;

/// A board's log: the image that wrote it, and its frames.
struct Log {
    image: PathBuf,
    frames: Vec<u8>,
}

impl Log {
    /// Log of an STM32F405 in the emulator that answers several requests.
    fn record() -> Option<Self> {
        let options = emulated()?;
        let front_end = Model::from(&RunConfig::default()).front_end();
        let (pattern, hardware) = (ScanPattern::default(), Hardware::REFERENCE);
        let qemu = Qemu::start(&options, front_end, pattern, hardware).expect("a board");
        let file = qemu.log_file();
        let deadline = Instant::now() + Duration::from_secs(30);
        while fs::metadata(&file).map_or(0, |log| log.len()) == 0 {
            assert!(Instant::now() < deadline, "it says nothing");
            std::thread::sleep(Duration::from_millis(2));
        }
        let retry_policy = RetryPolicy { timeout: Duration::from_secs(5), tries: 4 };
        let mut client = Client::connect(qemu, retry_policy).expect("it answers");
        client.configure(&Settings { gain_cdb: 700, ..Settings::default() }).expect("accepted");
        for _ in 0..8 {
            client.transport_mut().send(&[1, 2, 3, 0]).expect("it listens"); // no frame: it says so
            client.read_settings().expect("an answer");
        }
        let frames = fs::read(&file).expect("a log");
        Some(Self { image: options.image, frames })
    }

    /// As the emulated board's log is written.
    fn lines(&self) -> String {
        let elf = fs::read(&self.image).expect("an image");
        let lines = defmt_log::decode(&elf, &self.frames).expect("a log");
        assert!(lines.len() > 9 && lines[0].contains("QEMU"), "{lines:?}");
        lines.iter().map(|line| format!("sensor 1 {line}\n")).collect()
    }

    fn flags<'a>(&'a self, from: &'a str) -> [&'a str; 6] {
        let image = self.image.to_str().expect("UTF-8");
        ["--log-from", from, "--firmware", image, "--sensor-log", "log.txt"]
    }
}

/// The emulated STM32F405 with its image, if they can be had.
fn emulated() -> Option<QemuOptions> {
    let machine = Machine::NetduinoPlus2;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let options = QemuOptions::new(machine, &root.canonicalize().expect("the workspace"));
    let missing = match check_installed(machine) {
        Err(error) => error.to_string(),
        Ok(()) if !options.image.is_file() => {
            format!("no image {}: cargo xtask firmware", options.image.display())
        }
        Ok(()) => return Some(options),
    };
    echoloop_needs::missing(&missing);
    None
}

/// The same on lines of this machine: its link is a terminal, its log a port that it waits at.
struct OnLines {
    emulator: Child,
    link: String,
    log: String,
}

impl OnLines {
    fn start(image: &Path, folder: &Path) -> Self {
        // What the image finds there instead of a flash.
        fs::write(folder.join("flash.bin"), [0xFF; 32 << 10]).expect("a file");
        let free = TcpListener::bind("127.0.0.1:0").expect("a port");
        let log = format!("tcp:{}", free.local_addr().expect("an address"));
        drop(free);
        let mut command = Command::new(Machine::NetduinoPlus2.emulator());
        command.args(["-M", Machine::NetduinoPlus2.name(), "-display", "none", "-monitor", "none"]);
        command.args(["-semihosting-config", "enable=on,target=native", "-serial", "pty"]);
        command.args(["-serial", &format!("{log},server=on,wait=on"), "-kernel"]).arg(image);
        command.current_dir(folder).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut emulator = command.spawn().expect("an emulator");
        let mut said = BufReader::new(emulator.stdout.as_mut().expect("a pipe"));
        let mut line = String::new();
        said.read_line(&mut line).expect("text"); // char device redirected to /dev/pts/0 (label …)
        let link = line.split_whitespace().find(|word| word.starts_with('/'));
        let link = link.unwrap_or_else(|| panic!("no terminal: {line}")).to_owned();
        Self { emulator, link, log }
    }
}

impl Drop for OnLines {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

/// A scan through a board on a line, beside which its log comes from somewhere.
fn scan(fixture: &Fixture, board: &Board, log: &[&str]) -> Child {
    let scan = ["scan", "-c", "small.toml", "-o", "far.ply", "--sensor", &board.spec];
    start(fixture, &[&scan[..], log].concat())
}

/// A scan whose board has a debugger: the scan, the debugger's end of the log, and its name.
fn debugged(fixture: &Fixture, board: &Board, log: &Log) -> (Child, TcpStream, String) {
    let debugger = TcpListener::bind("127.0.0.1:0").expect("a port");
    let from = format!("tcp:{}", debugger.local_addr().expect("an address"));
    let child = scan(fixture, board, &log.flags(&from));
    let (line, _) = debugger.accept().expect("it calls");
    (child, line, from)
}

fn succeeded(child: Child) -> CommandOutput {
    let output = end(child);
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    output
}

#[test]
fn a_board_on_a_line_is_heard_as_the_emulated_one_is_from_its_first_word() {
    let Some(options) = emulated() else { return };
    let (fixture, image) = (Fixture::new(), options.image.to_str().expect("UTF-8"));
    let ask = ["sensor", "--front-end", "host", "--set", "lidar.gain=3", "--firmware", image];
    let near = ["--sensor", "qemu:netduinoplus2", "--sensor-log", "near.txt"];
    fixture.succeed(&[&ask[..], &near].concat());
    let board = OnLines::start(&options.image, &fixture.path(""));
    let sensor = format!("serial:{}", board.link);
    let far = ["--sensor", &sensor, "--sensor-log", "far.txt", "--log-from", &board.log];
    fixture.succeed(&[&ask[..], &far].concat());
    let [near, far] = ["near.txt", "far.txt"].map(|name| fixture.read(name));
    assert!(near.contains("QEMU") && near.contains("echoloop-sensor"), "{near}");
    // Whoever calls while a board starts, on a line or emulated, is heard from the middle of a
    // frame on: what is left of it is dropped, for its bytes or for its checksum.
    let of = |log: &str| -> (Vec<String>, Vec<String>) {
        log.lines().map(str::to_owned).partition(|line| line.contains(" warn  frame dropped: "))
    };
    let ([near_dropped, near], [far_dropped, far]) = (of(&near).into(), of(&far).into());
    assert_eq!(far, near);
    assert!(near_dropped.len().max(far_dropped.len()) <= 3, "{near_dropped:?} {far_dropped:?}");
}

#[test]
fn what_a_debugger_hands_on_is_written_as_an_emulated_board_s_log_is() {
    let Some(log) = Log::record() else { return };
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let (child, mut line, _) = debugged(&fixture, &board, &log);
    for part in log.frames.chunks(7) {
        line.write_all(part).expect("it listens");
    }
    let output = succeeded(child);
    assert_eq!(fixture.read("log.txt"), log.lines());
    assert!(!output.stderr.contains("warning"), "{}", output.stderr);
}

#[test]
fn what_comes_on_a_second_port_is_written_from_where_it_is_joined() {
    let Some(log) = Log::record() else { return };
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let (mut here, _plug, path) = terminals();
    let child = scan(&fixture, &board, &log.flags(&format!("serial:{path}@921600")));
    // Opening the port drops what is in it: the file is begun once it is open.
    let deadline = Instant::now() + Duration::from_secs(30);
    while fixture.path("log.txt").metadata().is_err() {
        assert!(Instant::now() < deadline, "no log was begun");
        std::thread::sleep(Duration::from_millis(2));
    }
    // The start of a message is lost: until then nobody listened.
    here.write_all(&log.frames[3..]).expect("it listens");
    let output = succeeded(child);
    let whole = log.lines();
    let (_, rest) = whole.split_once('\n').expect("lines");
    assert_eq!(fixture.read("log.txt"), rest);
    assert!(!output.stderr.contains("warning"), "{}", output.stderr);
}

#[test]
fn a_log_that_ends_does_not_end_the_run() {
    let Some(log) = Log::record() else { return };
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let (child, mut line, from) = debugged(&fixture, &board, &log);
    let half = log.frames.len() / 2;
    line.write_all(&log.frames[..half]).expect("it listens");
    line.shutdown(Shutdown::Both).expect("it is open");
    let output = succeeded(child);
    let said = format!("warning: the log from {from} has ended");
    assert!(output.stderr.contains(&said), "{}", output.stderr);
    let found = fixture.read("log.txt");
    assert!(found.lines().count() > 1 && log.lines().starts_with(&found), "{found}");
    assert!(found.len() < log.lines().len(), "{found}");
    assert!(fixture.bytes("far.ply").len() > 1_000);
}

#[test]
fn a_log_that_cannot_be_read_is_said_to_be_lost_bytes_or_another_image() {
    let Some(log) = Log::record() else { return };
    let fixture = Fixture::new();
    let board = Board::new(&fixture);
    let (child, mut line, _) = debugged(&fixture, &board, &log);
    // Numbers of messages that the image has none for; then what never ends.
    line.write_all(&[0xfe, 0xfe, 0xfe, 0x7f, 0].repeat(3)).expect("it listens");
    line.write_all(&[0x55; 40_000]).expect("it listens");
    line.write_all(&[0]).expect("it listens");
    line.write_all(&log.frames).expect("it listens");
    let output = succeeded(child);
    let said = "cannot be read: bytes were lost, or the board does not run";
    assert!(output.stderr.contains(said), "{}", output.stderr);
    assert_eq!(fixture.read("log.txt"), log.lines());
}

#[test]
fn flags_that_do_not_go_together_and_what_cannot_be_used_are_refused() {
    let fixture = Fixture::new();
    for (flag, value, sensors) in [
        ("--firmware", "file", "qemu or serial"),
        ("--sensor-log", "file", "qemu or serial"),
        ("--log-from", "tcp:localhost:1", "serial"),
    ] {
        let said = format!("{flag} is for --sensor {sensors}, not in-process");
        fixture.refuses(&["scan", flag, value], &[&said]);
        let alone = ["scan", "--sensor", "serial:/dev/ttyX", flag, value];
        fixture.refuses(&alone, &[flag, "--log-from SOURCE", "--firmware ELF"]);
    }
    let on_qemu = ["scan", "--sensor", "qemu", "--log-from", "tcp:localhost:1"];
    fixture.refuses(&on_qemu, &["--log-from is for --sensor serial"]);
    let from = |from: &str, image: &str, problem: &[&str]| {
        let log = ["--log-from", from, "--firmware", image, "--sensor-log", "log.txt"];
        let line = [&["sensor", "--sensor", "serial:/dev/ttyX"][..], &log].concat();
        fixture.refuses(&line, problem);
    };
    from("rtt", "a.elf", &["--log-from", "expected serial:PORT[@BAUD] or tcp:HOST:PORT"]);
    from("serial:/dev/ttyX@9600", "a.elf", &["/dev/ttyX", "the link's port"]);
    from("tcp:localhost:1", "a.elf", &["--firmware a.elf", "No such file"]);
    from("tcp:localhost:1", "small.toml", &["--firmware small.toml", "log table"]);
    // Not the program here: built with all of the workspace, it has defmt's tables, too.
    from("tcp:localhost:1", "/bin/sh", &["--firmware", "built without defmt"]);
}

#[test]
fn a_source_that_is_not_there_is_named() {
    let Some(log) = Log::record() else { return };
    let fixture = Fixture::new();
    for from in ["tcp:127.0.0.1:1", "serial:/dev/nowhere"] {
        let line = [&["sensor", "--sensor", "serial:/dev/ttyX"][..], &log.flags(from)].concat();
        let output = run(&fixture, &line);
        assert_eq!(output.code, Some(2), "{}", output.stderr);
        assert!(output.stderr.contains(&format!("--log-from {from}")), "{}", output.stderr);
    }
}
