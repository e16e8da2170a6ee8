//! Timing of the sensor: the next shot is fired before the last one is processed, and scans that
//! take longer than their deadline are counted.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use echoloop_dsp::{Echoes, Grid, Hardware, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_link::{
    Command, Decoder, Greeting, MAX_FRAME, Report, Room, Times, decode, encode, settings_hash,
};
use echoloop_sensor::afe::{adc, emitter};
use echoloop_sensor::mailbox::{Registers, serve};
use echoloop_sensor::{App, Board};
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::transport::InProcess;
use echoloop_tests::faults::Target;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

const PATTERN: ScanPattern =
    ScanPattern::Grid(Grid { columns: 5, rows: 8, azimuth_cdeg: 9_000, elevation_cdeg: 3_000 });
const ONCE: RetryPolicy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };

/// An action of the board.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    Fire { beam: u32, shot: u32 },
    Take,
    Detect,
}

type Log = Rc<RefCell<Vec<Event>>>;

struct Chip {
    registers: [u32; 16],
    log: Log,
}

impl Registers for Chip {
    fn get(&self, register: u8) -> u32 {
        self.registers[usize::from(register)]
    }

    fn set(&mut self, register: u8, value: u32) {
        self.registers[usize::from(register)] = value;
        if self.registers[0] == emitter::ID_VALUE && register == emitter::FIRE {
            let shot = self.registers[usize::from(emitter::SHOT)];
            self.log.borrow_mut().push(Event::Fire { beam: value, shot });
        }
    }
}

impl ErrorType for Chip {
    type Error = ErrorKind;
}

impl SpiDevice for Chip {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        serve(self, operations)
    }
}

/// A line: bytes to the sensor, and bytes from it.
#[derive(Default)]
struct Line {
    heard: std::collections::VecDeque<u8>,
    sent: Vec<u8>,
}

impl embedded_io::ErrorType for Line {
    type Error = core::convert::Infallible;
}

impl embedded_io::Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let length = buffer.len().min(self.heard.len());
        buffer.iter_mut().zip(self.heard.drain(..length)).for_each(|(slot, byte)| *slot = byte);
        Ok(length)
    }
}

impl embedded_io::ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.heard.is_empty())
    }
}

impl embedded_io::Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        self.sent.extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// A board that logs its actions.
struct Noting {
    emitter: Chip,
    adc: Chip,
    line: Line,
    store: RamNorFlash,
    log: Log,
}

impl Board for Noting {
    type Spi = Chip;
    type Link = Line;
    type Store = RamNorFlash;

    fn hardware(&self) -> Hardware {
        Hardware::REFERENCE
    }

    fn pattern(&self) -> ScanPattern {
        PATTERN
    }

    fn emitter(&mut self) -> &mut Chip {
        &mut self.emitter
    }

    fn adc(&mut self) -> &mut Chip {
        &mut self.adc
    }

    fn link(&mut self) -> &mut Line {
        &mut self.line
    }

    fn store(&mut self) -> &mut RamNorFlash {
        &mut self.store
    }

    fn samples(&mut self, codes: &mut [u16]) -> bool {
        self.log.borrow_mut().push(Event::Take);
        codes.fill(200);
        true
    }

    fn detect(&mut self, _: &Pipeline, _: &[u16], _: &mut Scratch) -> Echoes {
        self.log.borrow_mut().push(Event::Detect);
        Echoes::new()
    }
}

fn noting() -> (Box<App<Noting>>, Log) {
    let log = Log::default();
    let chip = |id| {
        let mut registers = [0; 16];
        registers[0] = id;
        Chip { registers, log: Rc::clone(&log) }
    };
    let (emitter, adc) = (chip(emitter::ID_VALUE), chip(adc::ID_VALUE));
    let (line, store) = (Line::default(), RamNorFlash::default());
    (Box::new(App::new(Noting { emitter, adc, line, store, log: Rc::clone(&log) })), log)
}

fn ask(app: &mut App<Noting>, number: u16, command: &Command<'_>) -> Report {
    let mut frame = [0; MAX_FRAME];
    let frame = encode(number, command, &mut frame).unwrap();
    app.board_mut().line.heard.extend(frame);
    app.poll().unwrap();
    let mut decoder = Decoder::new();
    let sent = std::mem::take(&mut app.board_mut().line.sent);
    let mut answers = sent.iter().filter_map(|&byte| {
        decoder.push(byte).map(|frame| decode::<Report>(frame.unwrap()).unwrap().1)
    });
    answers.next().unwrap()
}

#[test]
fn the_next_shot_is_fired_before_the_last_one_is_processed_and_none_in_vain() {
    let (mut app, log) = noting();
    ask(&mut app, 1, &Command::Hello(Greeting::OURS));
    let settings = Settings { shots: 2, ..Settings::default() };
    ask(&mut app, 2, &Command::Stage(settings));
    let hash = settings_hash(&settings);
    ask(&mut app, 3, &Command::Commit { hash, base_generation: 0, confirm_within: 0 });
    let report = ask(&mut app, 4, &Command::ReadBeams { frame: 1, first: 7, count: 2 });
    assert!(matches!(report, Report::Beams { first: 7, beams, .. } if beams.len() == 2));
    let fire = |beam, shot| Event::Fire { beam, shot };
    let (take, detect) = (Event::Take, Event::Detect);
    assert_eq!(
        *log.borrow(),
        [
            fire(7, 0),
            take,
            fire(7, 1),
            take,
            fire(8, 0), // before beam 7 is processed
            detect,
            take,
            fire(8, 1),
            take,
            detect,
        ]
    );
}

/// A sensor whose clock advances by some microseconds at each reading: twice per command.
fn timed(step_us: u32) -> Client<InProcess<Target>> {
    let mut sensor = PcSensor::new(Target::default(), PATTERN, Hardware::REFERENCE);
    let mut now = u32::MAX - 10; // it wraps
    sensor.set_clock(move || {
        now = now.wrapping_add(step_us);
        now
    });
    Client::connect(InProcess(sensor), ONCE).unwrap()
}

/// Requests of a scan of forty beams.
const QUESTIONS: u32 = 2;

#[test]
fn a_scan_that_takes_longer_than_its_deadline_is_late() {
    let mut client = timed(50);
    assert_eq!(client.read_times().unwrap(), Times { clock: true, ..Times::default() });
    client.scan(1).unwrap();
    let took = QUESTIONS * 50;
    for (deadline_us, late) in [(took, 0), (took - 1, 3), (0, 0)] {
        client.set_deadline(deadline_us).unwrap();
        (2..5).for_each(|scan| drop(client.scan(scan).unwrap()));
        let expected =
            Times { clock: true, deadline_us, scans: 3, late, last_us: took, longest_us: took };
        assert_eq!(client.read_times().unwrap(), expected);
    }
}

/// Times that a sensor reports after these commands, a second apart; its clock advances by 50 µs at
/// each reading.
fn times_after(questions: &[Command<'_>]) -> Times {
    let now = Arc::new(AtomicU32::new(0));
    let mut sensor = PcSensor::new(Target::default(), PATTERN, Hardware::REFERENCE);
    let clock = Arc::clone(&now);
    sensor.set_clock(move || clock.fetch_add(50, Relaxed));
    let mut last = None;
    for (number, question) in (1..).zip(questions) {
        now.fetch_add(1_000_000, Relaxed);
        sensor.send(encode(number, question, &mut [0; MAX_FRAME]).unwrap());
        let mut sent = vec![0; 8192];
        let length = sensor.receive(&mut sent);
        last = Some(decode::<Report>(&mut sent[1..length - 1]).unwrap().1);
    }
    let Some(Report::Times(times)) = last else { panic!("{last:?}") };
    times
}

const HELLO: Command<'_> = Command::Hello(Greeting::OURS);
const DEADLINE: Command<'_> = Command::SetDeadline { scan_us: 150 };
/// The two requests of a scan.
const FIRST: Command<'_> = Command::ReadBeams { frame: 9, first: 0, count: 32 };
const REST: Command<'_> = Command::ReadBeams { frame: 9, first: 32, count: 8 };

#[test]
fn time_between_the_host_s_requests_makes_no_scan_late() {
    // The answer to the first request was lost: a repeated request counts twice.
    let times = times_after(&[HELLO, DEADLINE, FIRST, FIRST, REST, Command::ReadTimes]);
    let (last_us, longest_us) = (150, 150);
    let expected = Times { clock: true, deadline_us: 150, scans: 1, late: 0, last_us, longest_us };
    assert_eq!(times, expected);
}

#[test]
fn a_scan_of_another_session_is_another_scan_even_with_the_same_number() {
    let whole = [HELLO, DEADLINE, FIRST, REST];
    let given_up = [HELLO, FIRST];
    let again = [HELLO, FIRST, REST, Command::ReadTimes];
    let times = times_after(&[&whole[..], &given_up, &again].concat());
    assert_eq!((times.scans, times.late, times.last_us), (2, 0, 100));
}

#[test]
fn scans_of_waveforms_over_the_link_are_timed_as_well() {
    let mut client = timed(50);
    client.set_deadline(1).unwrap();
    let room = Room { frames: 1, ..client.read_room().unwrap() };
    let mut dark = |_, _, codes: &mut [u16]| {
        codes.fill(200);
        Ok(())
    };
    client.scan_waveforms(1, room, &mut dark).unwrap();
    let Times { scans, late, last_us, .. } = client.read_times().unwrap();
    assert_eq!((scans, late), (1, 1));
    assert!(last_us >= 18 * 50, "40 shots of 1,200 bytes are 18 parts, not {last_us} µs");
}

#[test]
fn a_board_without_a_clock_reports_so() {
    let sensor = PcSensor::new(Target::default(), PATTERN, Hardware::REFERENCE);
    let mut client = Client::connect(InProcess(sensor), ONCE).unwrap();
    client.set_deadline(1).unwrap();
    client.scan(1).unwrap();
    assert_eq!(client.read_times().unwrap(), Times { deadline_us: 1, ..Times::default() });
}
