//! The example's board on a PC with a host on its line; registers, buffer and flash are in memory.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use echoloop_dsp::{Hardware, Settings};
use echoloop_link::{Command, Decoder, Greeting, MAX_FRAME, Nack, Report, decode, encode};
use echoloop_own_firmware::{Buffer, Detector, OwnBoard, Watchdog};
use echoloop_sensor::App;
use echoloop_sensor::afe::{adc, emitter};
use echoloop_sensor::mailbox::{Registers, serve};
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use embedded_hal::spi::{ErrorKind, Operation, SpiDevice};

/// Waveform of a sin² pulse of 5 ns at 1 GS/s, centred at sample 200, on an ambient level of 100.
fn waveform() -> [u16; 800] {
    std::array::from_fn(|n| {
        let t = (n as f64 - 195.0) / 10.0;
        let pulse = (std::f64::consts::PI * t).sin().powi(2);
        100 + n as u16 % 3 + if (0.0..1.0).contains(&t) { (1_000.0 * pulse) as u16 } else { 0 }
    })
}

#[derive(Default)]
struct Chip([u32; 16]);

impl Registers for Chip {
    fn get(&self, register: u8) -> u32 {
        self.0.get(usize::from(register)).copied().unwrap_or(0)
    }

    fn set(&mut self, register: u8, value: u32) {
        if let Some(slot) = self.0.get_mut(usize::from(register)) {
            *slot = value;
        }
    }
}

impl embedded_hal::spi::ErrorType for Chip {
    type Error = ErrorKind;
}

impl SpiDevice for Chip {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        serve(self, operations)
    }
}

/// Both ends of a line.
#[derive(Clone, Default)]
struct Line {
    to_sensor: Rc<RefCell<VecDeque<u8>>>,
    to_host: Rc<RefCell<VecDeque<u8>>>,
}

impl embedded_io::ErrorType for Line {
    type Error = Infallible;
}

impl embedded_io::Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut queue = self.to_sensor.borrow_mut();
        let length = buffer.len().min(queue.len());
        buffer.iter_mut().zip(queue.drain(..length)).for_each(|(slot, byte)| *slot = byte);
        Ok(length)
    }
}

impl embedded_io::ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.to_sensor.borrow().is_empty())
    }
}

impl embedded_io::Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.to_host.borrow_mut().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Buffer of a converter that answers every shot with the same codes, or no shot.
struct Shots(Option<[u16; 800]>);

impl Buffer for Shots {
    fn finished(&mut self) -> Option<&[u16]> {
        self.0.as_ref().map(|codes| &codes[..])
    }

    fn arm(&mut self) {}
}

struct Dog(Rc<RefCell<u32>>);

impl Watchdog for Dog {
    fn feed(&mut self) {
        *self.0.borrow_mut() += 1;
    }
}

type Sensor = App<OwnBoard<Chip, Line, RamNorFlash, Shots, Dog>>;

fn sensor(line: &Line, shots: Shots, fed: &Rc<RefCell<u32>>) -> Box<Sensor> {
    let chip = |id| Chip(std::array::from_fn(|register| if register == 0 { id } else { 0 }));
    Box::new(App::new(OwnBoard {
        emitter: chip(emitter::ID_VALUE),
        adc: chip(adc::ID_VALUE),
        link: line.clone(),
        flash: RamNorFlash::default(),
        buffer: shots,
        watchdog: Dog(Rc::clone(fed)),
        restarts: 0,
        now_us: || None,
    }))
}

fn ask(sensor: &mut Sensor, line: &Line, sequence: u16, command: &Command) -> Report {
    let mut frame = [0; MAX_FRAME];
    let bytes = encode(sequence, command, &mut frame).expect("a command fits");
    line.to_sensor.borrow_mut().extend(bytes.iter());
    sensor.poll().expect("a line in memory is never lost");
    let mut decoder = Decoder::new();
    let bytes: Vec<u8> = line.to_host.borrow_mut().drain(..).collect();
    for byte in bytes {
        if let Some(frame) = decoder.push(byte) {
            return decode(frame.expect("a whole frame")).expect("a report").1;
        }
    }
    panic!("no answer to {command:?}")
}

#[test]
fn the_detector_alone_finds_the_pulse_where_it_is() {
    let hardware = Hardware::REFERENCE;
    let settings = Settings { bins: 800, ..Settings::default() };
    let mut detector = Detector::new(&settings, &hardware).expect("the defaults run");
    let echoes = detector.echoes(&waveform());
    assert_eq!(echoes.len(), 1);
    let expected_m = 1.0 + 200.0 * 119.0 / 800.0;
    assert!((echoes[0].range_m() - expected_m).abs() < 0.01, "{} m", echoes[0].range_m());
}

#[test]
fn a_host_scans_with_the_board_and_gets_the_same_echo() {
    let (line, fed) = (Line::default(), Rc::default());
    let mut sensor = sensor(&line, Shots(Some(waveform())), &fed);
    let hello = ask(&mut sensor, &line, 1, &Command::Hello(Greeting::OURS));
    assert!(matches!(hello, Report::Hello { greeting: Greeting::OURS, .. }), "{hello:?}");
    let scan = Command::ReadBeams { frame: 1, first: 0, count: 4 };
    let Report::Beams { beams, .. } = ask(&mut sensor, &line, 2, &scan) else { panic!("no beams") };
    let alone = Detector::new(&Settings::default(), &Hardware::REFERENCE)
        .expect("the defaults run")
        .echoes(&waveform());
    assert_eq!(beams.len(), 4);
    assert!(beams.iter().all(|echoes| *echoes == alone), "{beams:?}");
    assert!(*fed.borrow() >= 4, "the watchdog is fed at every beam");
}

#[test]
fn a_shot_without_codes_is_reported_and_the_sensor_goes_on() {
    let (line, fed) = (Line::default(), Rc::default());
    let mut sensor = sensor(&line, Shots(None), &fed);
    ask(&mut sensor, &line, 1, &Command::Hello(Greeting::OURS));
    let scan = Command::ReadBeams { frame: 1, first: 0, count: 1 };
    assert_eq!(ask(&mut sensor, &line, 2, &scan), Report::Nack(Nack::FrontEnd));
    assert!(matches!(ask(&mut sensor, &line, 3, &Command::ReadSettings), Report::Settings { .. }));
}
