//! Waveforms sent to a sensor over its link: the echoes are those of a sensor with its own front
//! end, whatever the faults of the line.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use echoloop_dsp::{Echoes, Grid, Hardware, MAX_CODES, ScanPattern, Settings};
use echoloop_frontend::{Receiver, Return, SceneResponse};
use echoloop_link::packed::pack;
use echoloop_link::{
    Command, Decoder, Greeting, MAX_FRAME, Nack, Place, Report, Room, decode, encode,
};
use echoloop_sensor::{App, Board};
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use echoloop_sensors::boards::pc::{PcSensor, hardware_for};
use echoloop_sensors::boards::shots::Shots;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::sensor::{Detector, Line, Model, Sensor, View};
use echoloop_sensors::transport::{InProcess, Transport};
use echoloop_tests::faults::{Faulty, Rates, Shared};
use echoloop_tests::vectors;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

const PATTERN: ScanPattern =
    ScanPattern::Grid(Grid { columns: 10, rows: 7, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 });

/// A scene with a wall in every beam and a nearer target in every third.
fn scene() -> Arc<SceneResponse> {
    let mut response =
        SceneResponse { beams: vec![0], returns: Vec::new(), ..SceneResponse::default() };
    for beam in 0..PATTERN.beams() {
        let near_m = 4.0 + 0.37 * beam as f32;
        let wall = |range_m: f32| Return { range_m, strength_per_m2: 0.1 / range_m.powi(2) };
        response.returns.extend((beam % 3 == 0).then(|| wall(near_m)));
        response.returns.push(wall(near_m + 9.0));
        response.beams.push(response.returns.len() as u32);
    }
    Arc::new(response)
}

fn model(adc_bits: u32) -> Model {
    let receiver = Receiver { adc_bits, ..Receiver::default() };
    let hardware = hardware_for(&receiver);
    Model { receiver, pattern: PATTERN, hardware, detector: Detector::Firmware }
}

fn view(scene: &Arc<SceneResponse>) -> View<'_> {
    View { scene, noise_seed: 11, scan: 2, viewpoint: 9 }
}

/// Settings with a pulse that even the fewest samples resolve.
fn settings(bins: i32, shots: i32) -> Settings {
    let (pulse_width_ps, power_uw) = (15_000, 20_000_000);
    Settings { bins, shots, pulse_width_ps, power_uw, ..Settings::default() }
}

/// Echoes of a sensor with its own front end.
fn at_the_sensor(model: &Model, settings: &Settings) -> Vec<Echoes> {
    let mut sensor = Sensor::in_process(model).unwrap();
    sensor.configure(settings).unwrap();
    sensor.scan(&view(&scene())).unwrap()
}

#[test]
fn echoes_are_those_of_a_sensor_with_its_own_front_end_for_all_settings() {
    let mut rng = vectors::rng(1);
    let (mut compared, mut found) = (0, 0);
    for case in 0..120 {
        let model = model([8, 10, 12, 13, 14][case % 5]);
        let drawn = vectors::settings(&mut rng, &model.hardware);
        let settings = Settings {
            dither: (case % 2) as i32,
            black_level_ppm: [0, 20_000][case / 2 % 2],
            gain_slope_mdb_m: [0, 0, 300][case % 3],
            ..drawn
        };
        if settings.check(&model.hardware).is_err() {
            continue;
        }
        compared += 1;
        let mut sensor = Sensor::in_process_fed(&model).unwrap();
        sensor.configure(&settings).unwrap();
        let fed = sensor.scan(&view(&scene())).unwrap();
        assert_eq!(fed, at_the_sensor(&model, &settings), "case {case}: {settings:?}");
        found += fed.iter().flatten().count();
    }
    assert!(compared > 80 && found > 2_000, "{found} echoes of {compared} compare little");
}

#[test]
fn one_sensor_takes_scan_after_scan_with_other_settings() {
    let (model, scene) = (model(12), scene());
    let mut sensor = Sensor::in_process_fed(&model).unwrap();
    for (bins, shots) in [(300, 1), (2_400, 16), (300, 1), (800, 2)] {
        let wanted = settings(bins, shots);
        sensor.configure(&wanted).unwrap();
        let expected = at_the_sensor(&model, &wanted);
        for _ in 0..2 {
            assert_eq!(sensor.scan(&view(&scene)).unwrap(), expected, "{bins} bins, {shots} shots");
        }
    }
}

/// Scans with waveforms of the model's front end.
fn feed<T: Transport>(client: &mut Client<T>, model: &Model) -> Result<Vec<Echoes>, ClientError> {
    let mut shots = Shots::new(model.front_end(), model.pattern, model.hardware);
    shots.front_end_mut().look_at(scene(), 11);
    let settings = client.settings()?;
    shots.begin(&settings, 2).unwrap();
    let room = Room { codes: MAX_CODES as u32, frames: 4 };
    client.scan_waveforms(2, room, &mut |beam, shot, codes| {
        shots.fire(beam, shot, codes).map_err(|_| io::ErrorKind::Other.into())
    })
}

#[test]
fn scans_over_a_bad_line_are_whole_or_reported() {
    let model = model(12);
    let front_end = model.front_end();
    for (rate, at_least) in [(0.01, 29), (0.03, 25), (0.1, 5)] {
        let sensor = PcSensor::new(front_end.clone(), PATTERN, model.hardware);
        let line = Faulty::new(InProcess(sensor), 31);
        let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 8 };
        let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
        let mut whole = 0;
        for (case, (bins, shots)) in [(800, 1), (2_400, 2), (300, 4)].into_iter().enumerate() {
            let wanted = settings(bins, shots);
            let expected = at_the_sensor(&model, &wanted);
            for _ in 0..10 {
                client.transport_mut().rates = Rates::NONE;
                // Delayed messages arrive during the first.
                let configured = client.configure(&wanted);
                configured.or_else(|_| client.configure(&wanted)).unwrap();
                client.transport_mut().rates = Rates::all(rate);
                match feed(&mut client, &model) {
                    Ok(scan) => {
                        whole += 1;
                        assert_eq!(scan, expected, "at rate {rate}, case {case}");
                    }
                    Err(ClientError::Silent { .. }) => {}
                    Err(other) => panic!("at rate {rate}: {other}"),
                }
            }
        }
        let harmed = client.transport_mut().harmed;
        println!("rate {rate}: {whole} of 30 scans whole, {harmed} messages harmed");
        assert!(whole >= at_least, "at rate {rate} {whole} of 30 were whole");
        assert!(harmed > 10, "at rate {rate} only {harmed} messages were harmed");
    }
}

/// A sensor with a request per frame.
struct Asked {
    sensor: PcSensor<echoloop_frontend::WaveformFrontEnd>,
    sequence: u16,
}

impl Asked {
    /// A sensor after its hello, with these settings.
    fn new(settings: &Settings) -> Self {
        let model = model(12);
        let sensor = PcSensor::new(model.front_end(), PATTERN, model.hardware);
        let mut asked = Self { sensor, sequence: 0 };
        asked.ask(&Command::Hello(Greeting::OURS));
        let Report::Staged { hash } = asked.ask(&Command::Stage(*settings)) else { panic!() };
        asked.ask(&Command::Commit { hash, base_generation: 0, confirm_within: 0 });
        asked
    }

    fn ask(&mut self, command: &Command<'_>) -> Report {
        self.sequence += 1;
        let mut frame = [0; MAX_FRAME];
        self.sensor.send(encode(self.sequence, command, &mut frame).unwrap());
        let (mut decoder, mut chunk) = (Decoder::new(), [0; 8192]);
        let length = self.sensor.receive(&mut chunk);
        for &byte in &chunk[..length] {
            if let Some(frame) = decoder.push(byte) {
                return decode(frame.unwrap()).unwrap().1;
            }
        }
        panic!("no answer to {command:?}")
    }

    /// Sends a part of scan `frame`: some codes of a small ramp.
    fn part(&mut self, frame: u32, from: Place, codes: usize) -> Report {
        let row: Vec<u16> = (0..codes).map(|n| 200 + (n % 7) as u16).collect();
        let mut packed = vec![0; codes.div_ceil(2) * 3];
        let length = pack(&row, 12, &mut packed).unwrap();
        self.ask(&Command::Waveforms { frame, from, packed: &packed[..length] })
    }
}

fn place(beam: u32, shot: u16, sample: u16) -> Place {
    Place { beam, shot, sample }
}

fn awaited(beam: u32, shot: u16, sample: u16) -> Report {
    Report::Nack(Nack::Awaited { place: place(beam, shot, sample) })
}

/// First beam and number of beams of a report.
fn beams(report: &Report) -> (u32, usize) {
    match report {
        Report::Beams { first, beams, .. } => (*first, beams.len()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_part_out_of_order_is_answered_with_the_awaited_place() {
    let wanted = settings(400, 2);
    let mut sensor = Asked::new(&wanted);
    assert_eq!(sensor.part(1, place(3, 1, 17), 100), awaited(3, 0, 0), "nothing has begun");
    assert_eq!(beams(&sensor.part(1, place(3, 0, 0), 500)), (3, 0));
    assert_eq!(sensor.part(1, place(3, 1, 101), 100), awaited(3, 1, 100), "a gap");
    assert_eq!(sensor.part(2, place(3, 1, 100), 100), awaited(3, 0, 0), "another scan");
    assert_eq!(beams(&sensor.part(1, place(3, 1, 100), 1_000)), (3, 1), "the gap did no harm");
    assert_eq!(sensor.part(1, place(3, 1, 100), 1_000), awaited(4, 1, 300), "a repeated part");
    assert_eq!(beams(&sensor.part(1, place(4, 0, 0), 800)), (4, 1), "a restarted beam");
    sensor.ask(&Command::ReadBeams { frame: 1, first: 0, count: 1 });
    assert_eq!(sensor.part(1, place(5, 1, 0), 1), awaited(5, 0, 0), "its memory was reused");
}

#[test]
fn a_part_beyond_the_scan_changes_nothing() {
    let wanted = settings(200, 1);
    let mut sensor = Asked::new(&wanted);
    let none = Report::Nack(Nack::NoSuchBeams { beams: 70 });
    assert_eq!(sensor.part(1, place(70, 0, 0), 1), none);
    assert_eq!(sensor.part(1, place(u32::MAX, 0, 0), 200), none);
    assert_eq!(beams(&sensor.part(1, place(68, 0, 0), 300)), (68, 1));
    assert_eq!(sensor.part(1, place(69, 0, 100), 101), none);
    assert_eq!(beams(&sensor.part(1, place(69, 0, 100), 100)), (69, 1));
    assert_eq!(sensor.part(1, place(70, 0, 0), 1), none);
}

#[test]
fn settings_do_not_change_during_a_scan_of_waveforms() {
    let mut sensor = Asked::new(&settings(400, 1));
    sensor.part(1, place(0, 0, 0), 500);
    let other = settings(300, 1);
    let Report::Staged { hash } = sensor.ask(&Command::Stage(other)) else { panic!() };
    sensor.ask(&Command::Commit { hash, base_generation: 1, confirm_within: 0 });
    assert_eq!(beams(&sensor.part(1, place(1, 0, 100), 300)), (1, 1), "still 400 samples");
    assert_eq!(sensor.part(2, place(1, 0, 100), 1), awaited(1, 0, 0), "a new scan, new settings");
    assert_eq!(beams(&sensor.part(2, place(1, 0, 0), 600)), (1, 2), "of 300 samples");
}

#[test]
fn a_trial_counts_the_echoes_of_waveforms_over_the_link() {
    let model = model(12);
    let sensor = PcSensor::new(model.front_end(), PATTERN, model.hardware);
    let line = InProcess(sensor);
    let mut client = Client::connect_from(line, RetryPolicy::default(), 0).unwrap();
    let wanted = Settings { gain_cdb: 100, ..Settings::default() };
    client.configure_on_trial(&wanted, 3).unwrap();
    feed(&mut client, &model).unwrap();
    client.confirm().unwrap();
    assert_eq!(client.read_settings().unwrap(), wanted, "echoes and a confirmation");
    let blind = Settings { power_uw: 10, noise_floor_ppm: 200_000, ..wanted };
    client.configure_on_trial(&blind, 100).unwrap();
    let scan = feed(&mut client, &model).unwrap();
    let seen = scan.iter().flatten().count();
    client.read_counters().unwrap();
    assert_eq!((seen, client.read_settings().unwrap()), (0, wanted), "a scan without an echo");
}

#[test]
fn a_sensor_with_too_little_room_is_refused_with_both_numbers() {
    let model = model(12);
    let sensor = PcSensor::new(model.front_end(), PATTERN, model.hardware);
    let mut client = Client::connect_from(InProcess(sensor), RetryPolicy::default(), 0).unwrap();
    assert_eq!(client.read_room().unwrap(), Room { codes: MAX_CODES as u32, frames: 4 });
    let small = Room { codes: 799, frames: 1 };
    let error = client.scan_waveforms(1, small, &mut |_, _, _| Ok(())).unwrap_err();
    assert!(matches!(error, ClientError::Room { room: 799, needed: 800 }), "{error}");
    let text = error.to_string();
    assert!(text.contains("799") && text.contains("800"), "{text}");
}

#[test]
fn one_frame_at_a_time_gives_the_same_echoes() {
    let model = model(12);
    let sensor = PcSensor::new(model.front_end(), PATTERN, model.hardware);
    let shared = Rc::new(RefCell::new(InProcess(sensor)));
    let line = Shared(Rc::clone(&shared));
    let mut client = Client::connect_from(line, RetryPolicy::default(), 0).unwrap();
    let mut shots = Shots::new(model.front_end(), PATTERN, model.hardware);
    shots.front_end_mut().look_at(scene(), 11);
    shots.begin(&Settings::default(), 2).unwrap();
    let room = Room { codes: MAX_CODES as u32, frames: 1 };
    let scan = client.scan_waveforms(2, room, &mut |beam, shot, codes| {
        shots.fire(beam, shot, codes).map_err(|_| io::ErrorKind::Other.into())
    });
    assert_eq!(scan.unwrap(), at_the_sensor(&model, &Settings::default()));
}

#[test]
fn a_fed_sensor_works_over_any_line() {
    let (model, scene) = (model(12), scene());
    let line: Line = Box::new(InProcess(PcSensor::new(model.front_end(), PATTERN, model.hardware)));
    let mut sensor = Sensor::fed(line, &model, RetryPolicy::default()).unwrap();
    sensor.configure(&Settings::default()).unwrap();
    let scan = sensor.scan(&view(&scene)).unwrap();
    assert_eq!(scan, at_the_sensor(&model, &Settings::default()));
    assert!(scan.iter().flatten().count() > 60);
}

/// A bus with nothing on it.
struct NoBus;

impl ErrorType for NoBus {
    type Error = ErrorKind;
}

impl SpiDevice for NoBus {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Other)
    }
}

/// Bytes in transit, in both directions.
#[derive(Clone, Default)]
struct Wire(Rc<RefCell<[VecDeque<u8>; 2]>>);

impl embedded_io::ErrorType for Wire {
    type Error = Infallible;
}

impl embedded_io::Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        Ok(io::Read::read(&mut self.0.borrow_mut()[0], buffer).unwrap())
    }
}

impl embedded_io::ReadReady for Wire {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.borrow()[0].is_empty())
    }
}

impl embedded_io::Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.0.borrow_mut()[1].extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A board with a processor, a line and a flash, and nothing else.
struct Bare {
    nothing: NoBus,
    wire: Wire,
    flash: RamNorFlash,
}

impl Board for Bare {
    type Spi = NoBus;
    type Link = Wire;
    type Store = RamNorFlash;

    fn hardware(&self) -> Hardware {
        Hardware::REFERENCE
    }

    fn pattern(&self) -> ScanPattern {
        PATTERN
    }

    fn emitter(&mut self) -> &mut NoBus {
        &mut self.nothing
    }

    fn adc(&mut self) -> &mut NoBus {
        &mut self.nothing
    }

    fn link(&mut self) -> &mut Wire {
        &mut self.wire
    }

    fn store(&mut self) -> &mut RamNorFlash {
        &mut self.flash
    }

    fn samples(&mut self, _: &mut [u16]) -> bool {
        false
    }
}

/// Line to the bare board, which runs when bytes are sent.
struct BareLine {
    app: Box<App<Bare>>,
    wire: Wire,
}

impl Transport for BareLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.wire.0.borrow_mut()[0].extend(bytes);
        self.app.poll().map_err(|_| io::ErrorKind::BrokenPipe.into())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> io::Result<usize> {
        io::Read::read(&mut self.wire.0.borrow_mut()[1], buffer)
    }
}

#[test]
fn a_board_without_a_front_end_finds_echoes_and_refuses_its_own_scans() {
    let (model, wire) = (model(12), Wire::default());
    let flash = RamNorFlash::default();
    let app = Box::new(App::new(Bare { nothing: NoBus, wire: wire.clone(), flash }));
    let line = BareLine { app, wire };
    let mut client = Client::connect_from(line, RetryPolicy::default(), 0).unwrap();
    let room = client.read_room().unwrap();
    assert_eq!(room, Room { codes: MAX_CODES as u32, frames: 1 }, "it has no ring of bytes");
    for settings in [settings(300, 4), Settings::default()] {
        client.configure(&settings).unwrap();
        assert_eq!(feed(&mut client, &model).unwrap(), at_the_sensor(&model, &settings));
        let own = client.scan(3).unwrap_err();
        assert!(matches!(own, ClientError::Nack(Nack::FrontEnd)), "{own}");
    }
}
