//! Front ends that fail: the sensor reports it, never fires with part of the settings, and recovers
//! at the next request.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use echoloop_dsp::choice::AmbientEstimator;
use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_link::{
    Command, Decoder, Greeting, MAX_FRAME, Nack, Report, decode, encode, settings_hash,
};
use echoloop_sensor::afe::{WRITE, adc, delay_fs, emitter, gain_full_fs, gain_slope};
use echoloop_sensor::app::LinkLost;
use echoloop_sensor::mailbox::REGISTERS;
use echoloop_sensor::{App, Board};
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use proptest::collection::vec;
use proptest::prelude::{Strategy, any, prop_assert, prop_assert_eq, prop_oneof, proptest};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Device {
    Emitter,
    Adc,
}

/// Fault of the front end.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    /// The bus fails after this number of transactions.
    Bus(usize),
    WrongId(Device, u32),
    /// The register keeps its value.
    Stuck(Device, u8),
    /// Shots give no samples.
    NoSamples,
}

/// Registers of both devices, and their values at every shot.
struct Analog {
    emitter: [u32; REGISTERS],
    adc: [u32; REGISTERS],
    fault: Fault,
    transactions: usize,
    shots: Vec<([u32; REGISTERS], [u32; REGISTERS])>,
}

struct Spi {
    device: Device,
    analog: Rc<RefCell<Analog>>,
}

impl ErrorType for Spi {
    type Error = ErrorKind;
}

impl SpiDevice for Spi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let analog = &mut *self.analog.borrow_mut();
        analog.transactions += 1;
        if let Fault::Bus(left) = &mut analog.fault {
            if *left == 0 {
                return Err(ErrorKind::Other);
            }
            *left -= 1;
        }
        let registers =
            if self.device == Device::Emitter { &mut analog.emitter } else { &mut analog.adc };
        match operations {
            [Operation::Write([address, a, b, c, d])] => {
                let register = address & !WRITE;
                if analog.fault != Fault::Stuck(self.device, register) {
                    registers[usize::from(register)] = u32::from_be_bytes([*a, *b, *c, *d]);
                }
                if (self.device, register) == (Device::Emitter, emitter::FIRE) {
                    analog.shots.push((analog.emitter, analog.adc));
                }
            }
            [Operation::Write([register]), Operation::Read(bytes)] => {
                let value = match analog.fault {
                    Fault::WrongId(device, id) if device == self.device && *register == 0 => id,
                    _ => registers[usize::from(*register)],
                };
                bytes.copy_from_slice(&value.to_be_bytes());
            }
            other => panic!("{other:?}"),
        }
        Ok(())
    }
}

struct Link {
    to_sensor: VecDeque<u8>,
    to_host: Vec<u8>,
    /// Largest number of bytes taken at once.
    takes: usize,
}

impl embedded_io::ErrorType for Link {
    type Error = Infallible;
}

impl embedded_io::Read for Link {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let length = buffer.len().min(self.to_sensor.len());
        buffer.iter_mut().zip(self.to_sensor.drain(..length)).for_each(|(slot, byte)| *slot = byte);
        Ok(length)
    }
}

impl embedded_io::ReadReady for Link {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.to_sensor.is_empty())
    }
}

impl embedded_io::Write for Link {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let taken = bytes.len().min(self.takes);
        self.to_host.extend(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

struct Bench {
    emitter: Spi,
    adc: Spi,
    link: Link,
    store: RamNorFlash,
    fed: usize,
    analog: Rc<RefCell<Analog>>,
}

impl Board for Bench {
    type Spi = Spi;
    type Link = Link;
    type Store = RamNorFlash;

    fn hardware(&self) -> Hardware {
        Hardware::REFERENCE
    }

    fn pattern(&self) -> ScanPattern {
        ScanPattern::Grid(Grid { columns: 4, rows: 2, ..Grid::default() })
    }

    fn emitter(&mut self) -> &mut Spi {
        &mut self.emitter
    }

    fn adc(&mut self) -> &mut Spi {
        &mut self.adc
    }

    fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    fn store(&mut self) -> &mut RamNorFlash {
        &mut self.store
    }

    fn feed_watchdog(&mut self) {
        self.fed += 1;
    }

    fn restarts(&self) -> u32 {
        3
    }

    fn samples(&mut self, codes: &mut [u16]) -> bool {
        codes.fill(200);
        self.analog.borrow().fault != Fault::NoSamples
    }
}

struct Sensor {
    app: Box<App<Bench>>,
    analog: Rc<RefCell<Analog>>,
    sequence: u16,
}

impl Sensor {
    fn new() -> Self {
        let (mut emitter, mut adc) = ([0; REGISTERS], [0; REGISTERS]);
        (emitter[0], adc[0]) = (emitter::ID_VALUE, adc::ID_VALUE);
        let fault = Fault::None;
        let analog = Rc::new(RefCell::new(Analog {
            emitter,
            adc,
            fault,
            transactions: 0,
            shots: Vec::new(),
        }));
        let spi = |device| Spi { device, analog: Rc::clone(&analog) };
        let bench = Bench {
            emitter: spi(Device::Emitter),
            adc: spi(Device::Adc),
            link: Link { to_sensor: VecDeque::new(), to_host: Vec::new(), takes: usize::MAX },
            store: RamNorFlash::default(),
            fed: 0,
            analog: Rc::clone(&analog),
        };
        Self { app: Box::new(App::new(bench)), analog, sequence: 0 }
    }

    fn opened() -> Self {
        let mut sensor = Self::new();
        assert!(matches!(sensor.ask(&Command::Hello(Greeting::OURS)), Report::Hello { .. }));
        sensor
    }

    fn hear(&mut self, bytes: &[u8]) -> Vec<(u16, Report)> {
        self.app.board_mut().link.to_sensor.extend(bytes);
        self.app.poll().unwrap();
        let mut decoder = Decoder::new();
        let sent = std::mem::take(&mut self.app.board_mut().link.to_host);
        sent.iter().filter_map(|&b| decoder.push(b).map(|f| decode(f.unwrap()).unwrap())).collect()
    }

    fn ask(&mut self, command: &Command<'_>) -> Report {
        self.sequence += 1;
        let answers = self.hear(encode(self.sequence, command, &mut [0; MAX_FRAME]).unwrap());
        let [(sequence, report)] = <[_; 1]>::try_from(answers).unwrap();
        assert_eq!(sequence, self.sequence);
        report
    }

    fn configure(&mut self, settings: &Settings) {
        let hash = settings_hash(settings);
        assert_eq!(self.ask(&Command::Stage(*settings)), Report::Staged { hash });
        let base_generation = self.app.session().version().0;
        let committed = Report::Committed { generation: base_generation + 1, hash };
        assert_eq!(
            self.ask(&Command::Commit { hash, base_generation, confirm_within: 0 }),
            committed
        );
    }

    fn measure(&mut self, frame: u32) -> Report {
        self.ask(&Command::ReadBeams { frame, first: 6, count: 2 })
    }

    fn fail(&mut self, fault: Fault) {
        self.analog.borrow_mut().fault = fault;
    }

    /// Asserts that every shot since the last call was fired with all of these settings and for
    /// this scan.
    fn assert_shots(&mut self, count: usize, settings: &Settings, frame: u32) {
        let shots = std::mem::take(&mut self.analog.borrow_mut().shots);
        assert_eq!(shots.len(), count);
        let (hardware, bins) = (Hardware::REFERENCE, settings.bins as u32);
        for (laser, converter) in shots {
            assert_eq!(
                laser[1..4],
                [settings.power_uw as u32, settings.pulse_width_ps as u32, frame]
            );
            let period = sample_period_fs(bins, &hardware);
            let before = settings.pre_trigger_samples();
            let delay = delay_fs(settings, &hardware);
            let black = settings.black_level_ppm as u32;
            let (slope, full) = (gain_slope(settings), gain_full_fs(settings));
            let gain = settings.gain_cdb as u32;
            assert_eq!(converter[1..9], [gain, period, delay, bins, before, black, slope, full]);
            assert_eq!(laser[usize::from(emitter::SHOT)], 0);
            assert_eq!(laser[usize::from(emitter::OVERLAP)], settings.overlap_mm as u32);
        }
    }
}

/// Settings that differ from the default in every register.
fn other() -> Settings {
    let ambient = AmbientEstimator::PreTrigger.code();
    Settings {
        power_uw: 50_000_000,
        pulse_width_ps: 6_000,
        gain_cdb: -300,
        bins: 1_000,
        ambient,
        black_level_ppm: 9_000,
        gain_slope_mdb_m: 700,
        gain_range_mm: 30_000,
        overlap_mm: 3_000,
        ..Settings::default()
    }
}

/// A sensor that scanned, got other settings and a fault, and its report of the next scan.
fn after(fault: Fault) -> (Sensor, Report) {
    let mut sensor = Sensor::opened();
    assert!(matches!(sensor.measure(1), Report::Beams { .. }));
    sensor.assert_shots(2, &Settings::default(), 1);
    sensor.configure(&other());
    sensor.fail(fault);
    let report = sensor.measure(2);
    (sensor, report)
}

fn assert_recovers(mut sensor: Sensor) {
    let version = sensor.app.session().version();
    assert_eq!(version, (1, settings_hash(&other())));
    sensor.analog.borrow_mut().shots.clear();
    sensor.fail(Fault::None);
    let Report::Beams { generation, hash, beams, .. } = sensor.measure(2) else {
        panic!("no recovery")
    };
    assert_eq!(((generation, hash), beams.len()), (version, 2));
    sensor.assert_shots(2, &other(), 2);
}

/// Transactions of one request after new settings: the identity and 4 registers of the emitter,
/// written and read back (9); the identity and 8 registers of the converter (17); the number of the
/// scan (2); the register of its noise, which is not read back (1); two shots (2).
const TRANSACTIONS: usize = 9 + 17 + 2 + 1 + 2;

#[test]
fn a_bus_that_fails_anywhere_is_reported_and_the_next_request_starts_anew() {
    for at in 0..TRANSACTIONS {
        let (mut sensor, report) = after(Fault::Bus(at));
        assert_eq!(report, Report::Nack(Nack::FrontEnd), "transaction {at}");
        sensor.assert_shots(usize::from(at == TRANSACTIONS - 1), &other(), 2);
        assert_recovers(sensor);
    }
    let (mut sensor, report) = after(Fault::Bus(TRANSACTIONS));
    assert!(matches!(report, Report::Beams { .. }));
    sensor.assert_shots(2, &other(), 2);
}

#[test]
fn a_device_with_another_identity_is_never_written_to() {
    for device in [Device::Emitter, Device::Adc] {
        for id in [0, u32::MAX, emitter::ID_VALUE ^ 1] {
            let mut sensor = Sensor::opened();
            sensor.fail(Fault::WrongId(device, id));
            assert_eq!(sensor.measure(1), Report::Nack(Nack::FrontEnd), "{device:?} {id:#x}");
            sensor.assert_shots(0, &other(), 1);
            let written = if device == Device::Emitter {
                sensor.analog.borrow().emitter
            } else {
                sensor.analog.borrow().adc
            };
            assert_eq!(written[1..], [0; REGISTERS - 1], "{device:?}");
            sensor.configure(&other());
            assert_recovers(sensor);
        }
    }
}

#[test]
fn a_register_that_does_not_keep_its_value_is_reported_before_a_shot() {
    let emitter = [emitter::POWER, emitter::PULSE_WIDTH, emitter::OVERLAP, emitter::FRAME]
        .map(|r| (Device::Emitter, r));
    let adc =
        [adc::GAIN, adc::GAIN_SLOPE, adc::GAIN_FULL, adc::SAMPLE_PERIOD, adc::DELAY, adc::SAMPLES]
            .map(|r| (Device::Adc, r));
    for (device, register) in emitter.into_iter().chain(adc) {
        let (mut sensor, report) = after(Fault::Stuck(device, register));
        assert_eq!(report, Report::Nack(Nack::FrontEnd), "{device:?} {register}");
        assert_eq!(sensor.measure(2), Report::Nack(Nack::FrontEnd), "and again");
        sensor.assert_shots(0, &other(), 2);
        assert_recovers(sensor);
    }
}

#[test]
fn samples_that_never_come_are_reported() {
    let (sensor, report) = after(Fault::NoSamples);
    assert_eq!(report, Report::Nack(Nack::FrontEnd));
    // After a brown-out the registers are empty, so all of them must be written again.
    sensor.analog.borrow_mut().emitter[1..].fill(0);
    sensor.analog.borrow_mut().adc[1..].fill(0);
    assert_recovers(sensor);
}

#[test]
fn settings_are_written_to_the_front_end_once() {
    let mut sensor = Sensor::opened();
    let spent = |sensor: &mut Sensor, frame| {
        let before = sensor.analog.borrow().transactions;
        assert!(matches!(sensor.measure(frame), Report::Beams { .. }));
        sensor.analog.borrow().transactions - before
    };
    assert_eq!(spent(&mut sensor, 1), TRANSACTIONS);
    assert_eq!(spent(&mut sensor, 1), 2, "two shots");
    assert_eq!(spent(&mut sensor, 2), 2 + 2 + 1, "two shots, the scan's number and noise");
}

#[test]
fn shots_of_a_beam_are_numbered_and_the_next_beam_begins_anew() {
    let mut sensor = Sensor::opened();
    sensor.configure(&Settings { shots: 4, ..Settings::default() });
    assert!(matches!(sensor.measure(1), Report::Beams { .. }));
    let shots = std::mem::take(&mut sensor.analog.borrow_mut().shots);
    let fired: Vec<(u32, u32)> = shots
        .iter()
        .map(|(laser, _)| (laser[usize::from(emitter::FIRE)], laser[usize::from(emitter::SHOT)]))
        .collect();
    assert_eq!(fired, [(6, 0), (6, 1), (6, 2), (6, 3), (7, 0), (7, 1), (7, 2), (7, 3)]);
    // With one shot again, its number is 0.
    sensor.configure(&Settings::default());
    assert!(matches!(sensor.measure(2), Report::Beams { .. }));
    sensor.assert_shots(2, &Settings::default(), 2);
}

#[test]
fn dithered_shots_are_sampled_at_four_moments_of_a_period() {
    let mut sensor = Sensor::opened();
    let settings = Settings { shots: 8, dither: 1, ..Settings::default() };
    sensor.configure(&settings);
    assert!(matches!(sensor.measure(1), Report::Beams { .. }));
    let shots = std::mem::take(&mut sensor.analog.borrow_mut().shots);
    let hardware = Hardware::REFERENCE;
    let period = i64::from(sample_period_fs(800, &hardware));
    let offsets: Vec<i64> = shots
        .iter()
        .take(8)
        .map(|(_, converter)| i64::from(converter[usize::from(adc::DELAY)]))
        .map(|delay| delay - i64::from(delay_fs(&settings, &hardware)))
        .collect();
    let expected = [-3, -1, 1, 3].map(|eighths| eighths * period / 8);
    assert_eq!(offsets, [expected, expected].concat());
    // Without dither the window opens as before.
    sensor.configure(&Settings::default());
    assert!(matches!(sensor.measure(2), Report::Beams { .. }));
    sensor.assert_shots(2, &Settings::default(), 2);
}

#[test]
fn a_broken_front_end_does_not_stop_the_conversation() {
    let mut sensor = Sensor::opened();
    sensor.fail(Fault::Bus(0));
    assert_eq!(sensor.measure(1), Report::Nack(Nack::FrontEnd));
    sensor.configure(&other());
    let Report::Settings { generation, settings, .. } = sensor.ask(&Command::ReadSettings) else {
        panic!()
    };
    assert_eq!((generation, settings), (1, other()));
}

#[test]
fn the_watchdog_is_fed_at_every_turn_and_every_beam() {
    let mut sensor = Sensor::opened();
    let fed = |sensor: &mut Sensor| std::mem::take(&mut sensor.app.board_mut().fed);
    fed(&mut sensor);
    sensor.app.poll().unwrap();
    assert_eq!(fed(&mut sensor), 1, "idle");
    assert!(matches!(sensor.measure(1), Report::Beams { .. }));
    assert_eq!(fed(&mut sensor), 1 + 2 + 1, "a turn, two beams, and the bytes read");
}

#[test]
fn a_slow_link_gets_everything_and_one_that_takes_nothing_is_lost() {
    let mut sensor = Sensor::opened();
    sensor.app.board_mut().link.takes = 3;
    assert!(matches!(sensor.measure(1), Report::Beams { .. }));
    sensor.app.board_mut().link.takes = 0;
    let command = encode(9, &Command::ReadSettings, &mut [0; MAX_FRAME]).unwrap().to_vec();
    sensor.app.board_mut().link.to_sensor.extend(command);
    assert_eq!(sensor.app.poll(), Err(LinkLost));
}

#[test]
fn the_counters_include_restarts() {
    let mut sensor = Sensor::opened();
    let Report::Counters(counters) = sensor.ask(&Command::ReadCounters) else { panic!() };
    assert_eq!(counters.restarts, 3);
}

#[test]
fn a_front_end_that_fails_during_a_trial_does_not_prolong_it() {
    let mut sensor = Sensor::opened();
    let hash = settings_hash(&other());
    sensor.ask(&Command::Stage(other()));
    sensor.ask(&Command::Commit { hash, base_generation: 0, confirm_within: 2 });
    sensor.fail(Fault::Bus(0));
    for frame in 1..=3 {
        assert_eq!(sensor.app.session().version(), (1, hash), "before frame {frame}");
        assert_eq!(sensor.measure(frame), Report::Nack(Nack::FrontEnd));
    }
    assert_eq!(*sensor.app.session().settings(), Settings::default());
}

fn commands() -> impl Strategy<Value = Command<'static>> {
    let value = || prop_oneof![-2..12i32, any::<i32>()];
    let settings = (vec(value(), 15), 0..16usize).prop_map(|(values, changed)| {
        let mut settings = Settings::default();
        for (parameter, value) in echoloop_dsp::PARAMETERS.iter().zip(values).skip(changed) {
            settings.set(parameter.id, Some(value));
        }
        settings
    });
    let hash =
        prop_oneof![any::<u32>(), proptest::prelude::Just(settings_hash(&Settings::default()))];
    prop_oneof![
        1 => proptest::prelude::Just(Command::Hello(Greeting::OURS)),
        3 => settings.prop_map(Command::Stage),
        3 => (hash.clone(), prop_oneof![0..4u32, any::<u32>()], 0..3u16).prop_map(
            |(hash, base_generation, confirm_within)| {
                Command::Commit { hash, base_generation, confirm_within }
            }
        ),
        1 => (0..4u32).prop_map(|generation| Command::Confirm { generation }),
        1 => hash.prop_map(|hash| Command::Save { hash }),
        1 => proptest::prelude::Just(Command::Forget),
        1 => proptest::prelude::Just(Command::ReadSettings),
        1 => proptest::prelude::Just(Command::ReadCounters),
        3 => (0..3u32, prop_oneof![0..9u32, any::<u32>()], prop_oneof![0..4u16, any::<u16>()])
            .prop_map(|(frame, first, count)| Command::ReadBeams { frame, first, count }),
    ]
}

proptest! {
    /// Also, active settings always pass the check.
    #[test]
    fn every_command_in_any_order_gets_one_answer(commands in vec(commands(), 1..40)) {
        let mut sensor = Sensor::new();
        for command in &commands {
            sensor.ask(command);
            prop_assert!(sensor.app.session().settings().check(&Hardware::REFERENCE).is_ok());
        }
    }

    #[test]
    fn noise_on_the_line_gets_no_answer_and_changes_nothing(noise in vec(any::<u8>(), 0..6_000)) {
        let mut sensor = Sensor::opened();
        prop_assert_eq!(sensor.hear(&noise), vec![]);
        sensor.configure(&other());
        assert_recovers(sensor);
    }
}
