//! A sensor with the reference receiver in front of a wall.

use std::f64::consts::PI;

use echoloop_dsp::{Echo, Echoes, Pipeline, Scratch, Settings};
use echoloop_frontend::{
    Analog, Exposure, Receiver, Return, ShotBuffers, Trigger, noise_key, synthesise,
};
use echoloop_sensors::boards::pc::{analog_for, hardware_for};

/// c/2, mm per ns.
pub const MM_PER_NS: f64 = 149.896_229;

/// Return of a wall square to the beam.
pub fn wall(albedo: f64, range_m: f64) -> Return {
    Return { range_m: range_m as f32, strength_per_m2: (albedo / PI / range_m / range_m) as f32 }
}

/// A sensor with the reference receiver.
#[derive(Debug)]
pub struct Sensor {
    /// Its receiver.
    pub receiver: Receiver,
    /// Its settings.
    pub settings: Settings,
    /// Its analog settings, as the registers have them.
    pub analog: Analog,
    /// Its detector.
    pub pipeline: Pipeline,
    /// Codes of the last waveform.
    pub codes: Vec<u16>,
    scratch: Scratch,
    buffers: ShotBuffers,
}

impl Sensor {
    /// A sensor with these settings.
    ///
    /// # Panics
    ///
    /// When the settings are refused.
    pub fn new(settings: Settings) -> Self {
        let receiver = Receiver::default();
        let hardware = hardware_for(&receiver);
        let pipeline = Pipeline::new(&settings, &hardware).expect("accepted settings");
        Self {
            receiver,
            settings,
            analog: Analog { pre_trigger: 0, ..analog_for(&settings, &hardware) },
            pipeline,
            codes: vec![0; settings.bins as usize],
            scratch: Scratch::new(),
            buffers: ShotBuffers::default(),
        }
    }

    /// Records the waveform of a wall.
    pub fn expose(&mut self, wall: Return, beam: u32) {
        let exposure = Exposure {
            receiver: &self.receiver,
            analog: &self.analog,
            returns: &[wall],
            background: &[],
            key: noise_key(5, Trigger { frame: 0, beam, shot: 0 }),
        };
        synthesise(&exposure, &mut self.buffers, &mut self.codes);
    }

    /// Detects the echoes of the last waveform.
    pub fn echoes(&mut self) -> Echoes {
        echoloop_kernels::process(&self.pipeline, &self.codes, &mut self.scratch)
    }

    /// First echo of one shot at a wall, and its range error, mm.
    pub fn see(&mut self, albedo: f64, range_m: f64, beam: u32) -> Option<(Echo, f64)> {
        let wall = wall(albedo, range_m);
        self.expose(wall, beam);
        self.first(wall)
    }

    /// As [`Self::see`], with the number of shots of the settings.
    pub fn see_with_all_shots(
        &mut self,
        albedo: f64,
        range_m: f64,
        beam: u32,
    ) -> Option<(Echo, f64)> {
        let wall = wall(albedo, range_m);
        self.expose_all_shots(wall, beam);
        self.first(wall)
    }

    /// Records the sum of the waveforms of all shots.
    pub fn expose_all_shots(&mut self, wall: Return, beam: u32) {
        let period_fs = self.pipeline.config().sample_period_fs;
        let delay_ns = self.analog.delay_ns;
        for shot in 0..self.settings.shots as u32 {
            let later_ns = f64::from(self.settings.offset_fs(shot, period_fs)) / 1e6;
            self.analog.delay_ns = delay_ns + later_ns;
            self.expose(wall, 16 * beam + shot);
            self.scratch.shots().add(shot, &self.codes);
        }
        self.analog.delay_ns = delay_ns;
        self.scratch.shots().read(self.pipeline.config().sum_shift, &mut self.codes);
    }

    fn first(&mut self, wall: Return) -> Option<(Echo, f64)> {
        let echo = *self.echoes().first()?;
        Some((echo, (echo.range_m() - f64::from(wall.range_m)) * 1e3))
    }

    /// As [`Self::see`], `count` times at one sub-sample phase near a range.
    pub fn at_phase(
        &mut self,
        albedo: f64,
        range_m: f64,
        phase: f64,
        count: u32,
    ) -> Vec<(Echo, f64)> {
        let range_m = self.at(range_m, phase);
        (0..count).filter_map(|beam| self.see(albedo, range_m, beam)).collect()
    }

    /// Range with the given sub-sample phase near `range_m`, m.
    pub fn at(&self, range_m: f64, phase: f64) -> f64 {
        let step_m = MM_PER_NS * self.analog.sample_period_ns / 1e3;
        let first_m = f64::from(hardware_for(&self.receiver).range_min_mm) / 1e3;
        first_m + (((range_m - first_m) / step_m).floor() + phase) * step_m
    }
}
