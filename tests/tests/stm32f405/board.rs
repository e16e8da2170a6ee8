//! The board in the emulator, with its log and its answers.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use echoloop_dsp::{Hardware, ScanPattern, Settings};
use echoloop_link::{Decoder, Report, decode};
use echoloop_sensors::boards::qemu::{Machine, Qemu, QemuOptions};
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::defmt_log;
use echoloop_sensors::transport::Transport;
use echoloop_tests::faults::Target;
use echoloop_tests::gdb::Gdb;
use echoloop_tests::target::machine;
use tempfile::TempDir;

/// Timeouts long enough for an emulator on a busy machine.
pub(crate) const RETRY_POLICY: RetryPolicy =
    RetryPolicy { timeout: Duration::from_secs(5), tries: 4 };

/// The board, with a folder that outlives the emulator. Prints what the emulator lacks.
pub(crate) fn board() -> Option<(QemuOptions, TempDir)> {
    let mut options = machine(Machine::NetduinoPlus2)?;
    let folder = tempfile::tempdir().unwrap();
    options.folder = Some(folder.path().to_owned());
    // Past the test harness, which captures the output of passing tests.
    let _ = writeln!(
        std::io::stderr(),
        "netduinoplus2: emulated; no clocks, flash interface, independent watchdog of the part"
    );
    Some((options, folder))
}

/// Switches the board on. It has no front end, so the one given here is not used.
pub(crate) fn start(options: &QemuOptions) -> Qemu<Target> {
    Qemu::start(options, Target::default(), ScanPattern::default(), Hardware::REFERENCE).unwrap()
}

/// Switches the board on and waits for its log: bytes sent before its port is open are lost.
pub(crate) fn start_and_wait(options: &QemuOptions) -> Qemu<Target> {
    let board = start(options);
    wait_for_log(&board);
    board
}

pub(crate) fn wait_for_log(board: &Qemu<Target>) {
    let deadline = Instant::now() + Duration::from_secs(30);
    while fs::metadata(board.log_file()).map_or(0, |log| log.len()) == 0 {
        assert!(Instant::now() < deadline, "the log stays empty");
        std::thread::sleep(Duration::from_millis(2));
    }
}

pub(crate) fn connect(options: &QemuOptions) -> Client<Qemu<Target>> {
    Client::connect_from(start_and_wait(options), RETRY_POLICY, 0).unwrap()
}

/// Adds a debugger's socket to the options.
pub(crate) fn with_gdb(options: &mut QemuOptions, folder: &TempDir) -> PathBuf {
    let socket = folder.path().join("gdb");
    options.arguments = Gdb::arguments(&socket).into();
    socket
}

pub(crate) fn gain(gain_cdb: i32) -> Settings {
    Settings { gain_cdb, ..Settings::default() }
}

/// Lines of the log.
pub(crate) fn log(image: &Path, frames: &[u8]) -> Vec<String> {
    defmt_log::decode(&fs::read(image).unwrap(), frames).unwrap()
}

/// The next `count` answers, with their numbers; fewer after a timeout.
pub(crate) fn answers(board: &mut Qemu<Target>, count: usize) -> Vec<(u16, Report)> {
    let (mut decoder, mut found) = (Decoder::new(), Vec::new());
    let mut buffer = [0; 4096];
    while found.len() < count {
        let length = board.receive(&mut buffer, Duration::from_secs(30)).unwrap();
        if length == 0 {
            break;
        }
        for &byte in &buffer[..length] {
            if let Some(frame) = decoder.push(byte) {
                found.push(decode(frame.unwrap()).unwrap());
            }
        }
    }
    found
}
