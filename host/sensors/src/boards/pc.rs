//! Sensor's application in process: virtual SPI devices, a virtual sample buffer, a flash in
//! memory, a link of bytes.
//!
//! The application is the one that runs on a microcontroller. It writes the registers of emitter
//! and converter through `embedded-hal`, and the front end sees these registers alone.

use std::collections::VecDeque;

use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_frontend::{Analog, FrontEnd, Receiver, ScanNoise, Trigger};
use echoloop_link::{MAX_FRAME, Session};
use echoloop_sensor::afe::{self, adc, emitter};
use echoloop_sensor::mailbox::{self, Registers};
use echoloop_sensor::{App, Board};
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

use crate::boards::nor_flash::RamNorFlash;
use echoloop_sim::ideal::{IdealDetector, Shots};

/// Scan, beam and shot in the registers of the laser driver.
pub fn read_trigger(emitter: &impl Fn(u8) -> u32) -> Trigger {
    Trigger {
        frame: emitter(emitter::FRAME),
        beam: emitter(emitter::FIRE),
        shot: emitter(emitter::SHOT),
    }
}

/// Scan and seed of the noise in the registers of the laser driver, if set.
pub fn read_noise(emitter: &impl Fn(u8) -> u32) -> Option<ScanNoise> {
    let scan = emitter(emitter::NOISE_SCAN);
    let [low, high] = [emitter::NOISE_SEED_LOW, emitter::NOISE_SEED_HIGH].map(emitter);
    (scan > 0).then_some(ScanNoise { scan, seed: u64::from(high) << 32 | u64::from(low) })
}

/// Analog settings in the registers of laser driver and converter.
pub fn read_analog(emitter: &impl Fn(u8) -> u32, adc: &impl Fn(u8) -> u32) -> Analog {
    Analog {
        power_w: f64::from(emitter(emitter::POWER)) / 1e6,
        pulse_width_ns: f64::from(emitter(emitter::PULSE_WIDTH)) / 1e3,
        gain_db: f64::from(adc(adc::GAIN) as i32) / 100.0,
        sample_period_ns: f64::from(adc(adc::SAMPLE_PERIOD)) / 1e6,
        delay_ns: f64::from(adc(adc::DELAY)) / 1e6,
        pre_trigger: adc(adc::PRE_TRIGGER) as usize,
        black_level: f64::from(adc(adc::BLACK_LEVEL)) / 1e6,
        gain_slope_db_ns: f64::from(adc(adc::GAIN_SLOPE)) / 1e6,
        gain_full_ns: f64::from(adc(adc::GAIN_FULL)) / 1e6,
        overlap_m: f64::from(emitter(emitter::OVERLAP)) / 1e3,
    }
}

/// Analog settings in the registers of a sensor with these settings.
pub fn analog_for(settings: &Settings, hardware: &Hardware) -> Analog {
    let period_fs = sample_period_fs(settings.bins as u32, hardware);
    Analog {
        power_w: f64::from(settings.power_uw) / 1e6,
        pulse_width_ns: f64::from(settings.pulse_width_ps) / 1e3,
        gain_db: f64::from(settings.gain_cdb) / 100.0,
        sample_period_ns: f64::from(period_fs) / 1e6,
        delay_ns: f64::from(afe::delay_fs(settings, hardware)) / 1e6,
        pre_trigger: settings.pre_trigger_samples() as usize,
        black_level: f64::from(settings.black_level_ppm) / 1e6,
        gain_slope_db_ns: f64::from(afe::gain_slope(settings)) / 1e6,
        gain_full_ns: f64::from(afe::gain_full_fs(settings)) / 1e6,
        overlap_m: f64::from(settings.overlap_mm) / 1e3,
    }
}

/// Hardware of a sensor with this receiver; the rest is that of the reference sensor.
pub fn hardware_for(receiver: &Receiver) -> Hardware {
    Hardware {
        adc_bits: receiver.adc_bits,
        unit_echo_milli: (receiver.unit_echo() * 1e3).round() as u32, // `as` saturates
        shot_noise_ppm: (receiver.shot_noise() * 1e6).round() as u32,
        ..Hardware::REFERENCE
    }
}

/// SPI device of 32-bit registers.
#[derive(Clone, Debug)]
pub struct VirtualSpi {
    registers: [u32; mailbox::REGISTERS],
    /// Register that fires a shot when written.
    fire: Option<u8>,
    fired: bool,
}

impl VirtualSpi {
    fn new(id: u32, fire: Option<u8>) -> Self {
        let mut registers = [0; mailbox::REGISTERS];
        registers[0] = id;
        Self { registers, fire, fired: false }
    }
}

impl Registers for VirtualSpi {
    fn get(&self, register: u8) -> u32 {
        self.registers.get(usize::from(register)).copied().unwrap_or(0)
    }

    fn set(&mut self, register: u8, value: u32) {
        if let Some(slot) = self.registers.get_mut(usize::from(register)) {
            *slot = value;
            self.fired |= self.fire == Some(register);
        }
    }
}

impl ErrorType for VirtualSpi {
    type Error = ErrorKind;
}

impl SpiDevice for VirtualSpi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        mailbox::serve(self, operations)
    }
}

/// Bytes in flight in both directions.
#[derive(Clone, Debug, Default)]
pub struct Pipe {
    to_sensor: VecDeque<u8>,
    to_host: VecDeque<u8>,
}

impl embedded_io::ErrorType for Pipe {
    type Error = core::convert::Infallible;
}

impl embedded_io::Read for Pipe {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        Ok(take(&mut self.to_sensor, buffer))
    }
}

impl embedded_io::ReadReady for Pipe {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.to_sensor.is_empty())
    }
}

impl embedded_io::Write for Pipe {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        self.to_host.extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

fn take(queue: &mut VecDeque<u8>, buffer: &mut [u8]) -> usize {
    let (first, second) = queue.as_slices();
    let (head, tail) = buffer.split_at_mut(first.len().min(buffer.len()));
    let rest = second.len().min(tail.len());
    head.copy_from_slice(&first[..head.len()]);
    tail[..rest].copy_from_slice(&second[..rest]);
    let length = head.len() + rest;
    queue.drain(..length);
    length
}

/// Frames that the link of the board in process holds while it works.
const LINK_FRAMES: usize = 3;

/// Board in process.
pub struct PcBoard<F> {
    hardware: Hardware,
    pattern: ScanPattern,
    emitter: VirtualSpi,
    adc: VirtualSpi,
    link: Pipe,
    store: RamNorFlash,
    front_end: F,
    clock: Option<Clock>,
    ideal: Option<Ideal>,
}

/// Ideal detector in place of the program's; `None` inside before the first settings.
#[derive(Default)]
struct Ideal(Option<IdealDetector>);

impl Ideal {
    /// Makes the detector anew when the settings have changed.
    fn follow(&mut self, settings: &Settings, hardware: &Hardware) {
        if self.0.as_ref().is_none_or(|detector| detector.settings() != settings) {
            self.0 = IdealDetector::new(settings, hardware);
        }
    }

    /// Echoes of the shots summed in `scratch`, or of the one shot in `codes`.
    fn detect(&self, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        let Some(detector) = &self.0 else { return Echoes::new() };
        let settings = detector.settings();
        if settings.shots == 1 {
            return detector.process(&Shots::one(codes));
        }
        let phases = settings.phases() as usize;
        let lanes = scratch.shots();
        let sum = |phase: usize, n: usize| -> u32 {
            let lanes = lanes.lanes(n);
            lanes.iter().skip(phase).step_by(phases).map(|&lane| u32::from(lane)).sum()
        };
        let sums = |phase: usize| (0..codes.len()).map(|n| sum(phase, n)).collect();
        detector.process(&Shots { sums: (0..phases).map(sums).collect() })
    }
}

/// Microseconds since some moment.
type Clock = Box<dyn FnMut() -> u32 + Send>;

impl<F: FrontEnd> PcBoard<F> {
    /// Board before its first start. `hardware.adc_bits` is taken from the front end.
    pub(crate) fn new(
        front_end: F,
        pattern: ScanPattern,
        hardware: Hardware,
        store: RamNorFlash,
    ) -> Self {
        Self {
            hardware: Hardware { adc_bits: front_end.adc_bits(), ..hardware },
            pattern,
            emitter: VirtualSpi::new(emitter::ID_VALUE, Some(emitter::FIRE)),
            adc: VirtualSpi::new(adc::ID_VALUE, None),
            link: Pipe::default(),
            store,
            front_end,
            clock: None,
            ideal: None,
        }
    }

    pub(crate) fn front_end_mut(&mut self) -> &mut F {
        &mut self.front_end
    }

    fn analog(&self) -> Analog {
        read_analog(&|register| self.emitter.get(register), &|register| self.adc.get(register))
    }
}

impl<F: FrontEnd> Board for PcBoard<F> {
    type Spi = VirtualSpi;
    type Link = Pipe;
    type Store = RamNorFlash;

    fn hardware(&self) -> Hardware {
        self.hardware
    }

    fn pattern(&self) -> ScanPattern {
        self.pattern
    }

    fn emitter(&mut self) -> &mut VirtualSpi {
        &mut self.emitter
    }

    fn adc(&mut self) -> &mut VirtualSpi {
        &mut self.adc
    }

    fn link(&mut self) -> &mut Pipe {
        &mut self.link
    }

    fn store(&mut self) -> &mut RamNorFlash {
        &mut self.store
    }

    /// The pipe has no limit; this is the size that the board states.
    fn link_buffer(&self) -> usize {
        LINK_FRAMES * MAX_FRAME
    }

    fn now_us(&mut self) -> Option<u32> {
        self.clock.as_mut().map(|clock| clock())
    }

    fn samples(&mut self, codes: &mut [u16]) -> bool {
        let fired = std::mem::take(&mut self.emitter.fired);
        let analog = self.analog();
        if !fired
            || (self.adc.get(adc::SAMPLES) as usize).saturating_add(analog.pre_trigger)
                != codes.len()
        {
            return false;
        }
        let registers = |register| self.emitter.get(register);
        let trigger = read_trigger(&registers);
        self.front_end.name_noise(read_noise(&registers));
        self.front_end.steer(registers(emitter::CELL));
        self.front_end.capture(&analog, trigger, codes);
        true
    }

    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        match &self.ideal {
            None => echoloop_kernels::process(pipeline, codes, scratch),
            Some(ideal) => ideal.detect(codes, scratch),
        }
    }
}

/// Sensor in process: bytes in, bytes out.
pub struct PcSensor<F> {
    app: Box<App<PcBoard<F>>>,
}

impl<F: FrontEnd> PcSensor<F> {
    /// Starts a sensor with an erased flash. `hardware.adc_bits` is taken from the front end.
    pub fn new(front_end: F, pattern: ScanPattern, hardware: Hardware) -> Self {
        Self::with_store(front_end, pattern, hardware, RamNorFlash::default())
    }

    /// Starts a sensor with the flash of an earlier run.
    pub fn with_store(
        front_end: F,
        pattern: ScanPattern,
        hardware: Hardware,
        store: RamNorFlash,
    ) -> Self {
        let board = PcBoard::new(front_end, pattern, hardware, store);
        Self { app: Box::new(App::new(board)) }
    }

    /// Replaces the program's detector by the [`IdealDetector`], which no sensor could run.
    pub fn with_ideal_detector(mut self) -> Self {
        self.app.board_mut().ideal = Some(Ideal::default());
        self
    }

    /// Front end, to give it another scene.
    pub fn front_end_mut(&mut self) -> &mut F {
        self.app.board_mut().front_end_mut()
    }

    /// Sets a clock of microseconds, by which the sensor times its scans. Without it there is none.
    pub fn set_clock(&mut self, clock: impl FnMut() -> u32 + Send + 'static) {
        self.app.board_mut().clock = Some(Box::new(clock));
    }

    /// Flash, to keep for the next start or to cut its power.
    pub fn store_mut(&mut self) -> &mut RamNorFlash {
        &mut self.app.board_mut().store
    }

    /// State of the session, which the line does not show.
    pub fn session(&self) -> &Session {
        self.app.session()
    }

    /// Sends bytes to the sensor and lets it answer.
    pub fn send(&mut self, bytes: &[u8]) {
        if self.app.board_mut().ideal.is_none() {
            return self.take(bytes);
        }
        // Settings come in one frame, the scan they are for in a later one.
        for frame in bytes.split_inclusive(|&byte| byte == 0) {
            let settings = *self.app.session().settings();
            let board = self.app.board_mut();
            if let Some(ideal) = &mut board.ideal {
                ideal.follow(&settings, &board.hardware);
            }
            self.take(frame);
        }
    }

    fn take(&mut self, bytes: &[u8]) {
        self.app.board_mut().link.to_sensor.extend(bytes);
        let _ = self.app.poll(); // a pipe in memory is never lost
    }

    /// Takes bytes that the sensor has sent.
    pub fn receive(&mut self, buffer: &mut [u8]) -> usize {
        take(&mut self.app.board_mut().link.to_host, buffer)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use echoloop_frontend::{SceneResponse, WaveformFrontEnd};

    use super::*;

    #[test]
    fn the_reference_sensor_has_the_reference_receiver() {
        assert_eq!(hardware_for(&Receiver::default()), Hardware::REFERENCE);
    }

    #[test]
    fn settings_hold_what_their_registers_do() {
        let settings = Settings {
            power_uw: 12_340_000,
            gain_cdb: -321,
            bins: 1_111,
            ambient: 1,
            black_level_ppm: 9_876,
            gain_slope_mdb_m: 543,
            gain_range_mm: 23_456,
            overlap_mm: 2_345,
            ..Settings::default()
        };
        let nothing =
            WaveformFrontEnd::new(Receiver::default(), Arc::new(SceneResponse::empty(1)), 1);
        let mut sensor = PcSensor::new(nothing, ScanPattern::default(), Hardware::REFERENCE);
        let board = sensor.app.board_mut();
        afe::apply(&settings, board).unwrap();
        assert_eq!(board.analog(), analog_for(&settings, &Hardware::REFERENCE));
    }
}
