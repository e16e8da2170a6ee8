//! Boards on pseudo-terminals, and commands that are started beside them.

use std::io;
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::dataset::Dataset;
use echoloop_closed_loop::seed::scan_noise;
use echoloop_dsp::{Hardware, MAX_CODES, ScanPattern, Settings};
use echoloop_link::{
    Command, Counters, Decoder, Greeting, MAX_FRAME, Nack, Report, Room, decode, encode,
    settings_hash,
};
use echoloop_sensors::sensor::{Model, Port};
use echoloop_sensors::serve::{Viewpoints, serve};
use echoloop_sensors::transport::{Serial, Transport};
use serialport::{SerialPort, TTYPort};

use crate::fixture::{CommandOutput, Fixture};

/// Held while terminals are made and while commands start: a new terminal is inherited until it is
/// marked.
static STARTING: Mutex<()> = Mutex::new(());

fn starting() -> MutexGuard<'static, ()> {
    STARTING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Two connected terminals that no command inherits, and the second one's path.
pub(crate) fn terminals() -> (TTYPort, TTYPort, String) {
    let _alone = starting();
    let (here, there) = TTYPort::pair().expect("terminals");
    let path = there.name().expect("a path");
    let marked = |port: &TTYPort| port.try_clone_native().expect("a copy is closed on exec");
    (marked(&here), marked(&there), path)
}

pub(crate) fn start(fixture: &Fixture, arguments: &[&str]) -> Child {
    let _alone = starting();
    let mut command = fixture.command(arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("echoloop starts")
}

pub(crate) fn end(child: Child) -> CommandOutput {
    CommandOutput::from_output(child.wait_with_output().expect("it ends"))
}

/// As [`end`], of a command that must have ended by then: what hangs is a failure, too.
pub(crate) fn end_within(mut child: Child, limit: Duration) -> CommandOutput {
    let deadline = Instant::now() + limit;
    while child.try_wait().expect("a child").is_none() {
        if Instant::now() > deadline {
            let _ = child.kill();
            panic!("it runs on after {limit:?}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    end(child)
}

pub(crate) fn run(fixture: &Fixture, arguments: &[&str]) -> CommandOutput {
    end(start(fixture, arguments))
}

pub(crate) fn succeed(fixture: &Fixture, arguments: &[&str]) -> CommandOutput {
    let output = run(fixture, arguments);
    assert_eq!(output.code, Some(0), "{arguments:?}: {}", output.stderr);
    output
}

/// A line that is cut after so many answers.
struct Cut {
    line: Serial,
    answers_left: usize,
}

impl Transport for Cut {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.answers_left = self.answers_left.checked_sub(1).ok_or(io::ErrorKind::BrokenPipe)?;
        self.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.line.receive(buffer, timeout)
    }
}

/// A board on a terminal, looking at the fixture's yard.
pub(crate) struct Board {
    /// As `--sensor` takes it.
    pub(crate) spec: String,
    pub(crate) port: Port,
    pub(crate) config: RunConfig,
    pub(crate) dataset: Dataset,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Open between commands too, so that the line is not hung up when one ends.
    _plug: TTYPort,
}

impl Board {
    pub(crate) fn new(fixture: &Fixture) -> Self {
        Self::cut_after(fixture, usize::MAX)
    }

    pub(crate) fn cut_after(fixture: &Fixture, answers_left: usize) -> Self {
        let yard = format!("scene.source={}", fixture.path("yard.obj").display())
            .parse()
            .expect("an override");
        let config = load(Some(&fixture.path("small.toml")), &[yard]).expect("a configuration");
        Self::with(config, answers_left)
    }

    /// Board of another configuration than the small one.
    pub(crate) fn of(config: &RunConfig) -> Self {
        Self::with(config.clone(), usize::MAX)
    }

    fn with(config: RunConfig, answers_left: usize) -> Self {
        let dataset = Dataset::build_with_check(&config, &|_, _| ()).expect("a yard");
        let views: Vec<_> = dataset.views().collect();
        let mut sensor =
            Viewpoints::new(&Model::from(&config), views, scan_noise(config.seed)).sensor();
        let (here, _plug, path) = terminals();
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let line = Serial::from_open_port(here, "board").expect("a port");
        let mut line = Cut { line, answers_left };
        let answer = move || drop(serve(&mut line, &mut sensor, &|| flag.load(Ordering::Relaxed)));
        let thread = Some(std::thread::spawn(answer));
        let port = Port { path, baud: 4_000_000 };
        Self { spec: format!("serial:{port}"), port, config, dataset, stop, thread, _plug }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

/// A sensor that says of itself what it likes and knows nothing else, until told to stop.
fn liar(hello: Report, room: Room, line: TTYPort, stop: &Arc<AtomicBool>) -> JoinHandle<()> {
    let mut line = Serial::from_open_port(line, "liar").expect("a port");
    let stop = Arc::clone(stop);
    std::thread::spawn(move || {
        let (mut decoder, mut buffer) = (Decoder::new(), [0; 4096]);
        while !stop.load(Ordering::Relaxed) {
            let length = line.receive(&mut buffer, Duration::from_millis(20)).expect("a line");
            for &byte in &buffer[..length] {
                let Some(Ok(asked)) = decoder.push(byte) else { continue };
                let Ok((sequence, command)) = decode::<Command<'_>>(asked) else { continue };
                let hash = settings_hash(&Settings::default());
                let answer = match command {
                    Command::Hello(_) => hello.clone(),
                    Command::ReadSettings => {
                        Report::Settings { generation: 0, hash, settings: Settings::default() }
                    }
                    Command::ReadRoom => Report::Room(room),
                    Command::ReadCounters => Report::Counters(Counters::default()),
                    _ => Report::Nack(Nack::FrontEnd),
                };
                let mut frame = [0; MAX_FRAME];
                line.send(encode(sequence, &answer, &mut frame).expect("it fits")).expect("a line");
            }
        }
    })
}

/// Output of a command to a sensor of this build and pattern.
pub(crate) fn ask_a_liar(build: &str, pattern: ScanPattern, arguments: &[&str]) -> CommandOutput {
    let room = Room { codes: MAX_CODES as u32, frames: 1 };
    ask_a_liar_about(build, (Hardware::REFERENCE, pattern), room, arguments)
}

/// As [`ask_a_liar`], of this hardware and room.
pub(crate) fn ask_a_liar_about(
    build: &str,
    (hardware, pattern): (Hardware, ScanPattern),
    room: Room,
    arguments: &[&str],
) -> CommandOutput {
    let fixture = Fixture::new();
    let (here, _there, path) = terminals();
    let stop = Arc::new(AtomicBool::new(false));
    let build = build.try_into().expect("32 bytes at most");
    let greeting = Greeting::OURS;
    let sensor = liar(Report::Hello { greeting, build, hardware, pattern }, room, here, &stop);
    let output = run(&fixture, &[arguments, &["--sensor", &format!("serial:{path}")]].concat());
    stop.store(true, Ordering::Relaxed);
    sensor.join().expect("a liar");
    output
}
