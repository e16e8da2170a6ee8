//! Timed work of the waveform path: synthesis of waveforms, detection, whole scans.

use std::hint::black_box;
use std::sync::Arc;

use echoloop_dsp::{Echoes, Grid, Hardware, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_frontend::{
    Analog, Exposure, Receiver, Return, SceneResponse, ShotBuffers, Trigger, WaveformFrontEnd,
    noise_key, synthesise, synthesise_baseline,
};
use echoloop_kernels::{process, process_baseline, process_compiled};
use echoloop_sensors::boards::pc::{PcSensor, analog_for};
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::transport::InProcess;

use crate::Result;

/// Samples of a waveform.
pub const SAMPLES: usize = 1024;

/// Number of waveforms processed in sequence.
pub const BATCH: usize = 256;

/// Settings with a number of samples over 119 m, and a pulse width.
pub fn settings(samples: usize, pulse_width_ps: i32) -> Settings {
    // 372 nJ per pulse, below the limit.
    let power_uw = (37_200_000 / pulse_width_ps).clamp(500, 6_000) * 10_000;
    Settings { bins: samples as i32, pulse_width_ps, power_uw, ..Settings::default() }
}

/// Returns of white walls 13 m apart: echoes from far beyond saturation to a hundredth of full
/// scale.
pub fn returns(beam: u32, count: usize) -> impl Iterator<Item = Return> {
    (0..count).map(move |i| {
        let range_m = 8.0 + f64::from(beam % 64) + 13.0 * i as f64;
        Return { range_m: range_m as f32, strength_per_m2: (0.1 / range_m.powi(2)) as f32 }
    })
}

/// A sensor on this PC that scans a grid of 128 rows with two returns per beam, and its beams.
///
/// # Errors
///
/// When it does not answer.
pub fn client(columns: u16) -> Result<(u32, Client<InProcess<WaveformFrontEnd>>)> {
    let pattern = ScanPattern::Grid(Grid { columns, rows: 128, ..Grid::default() });
    let beams = pattern.beams();
    let scene = SceneResponse {
        beams: (0..=beams).map(|beam| 2 * beam).collect(),
        returns: (0..beams).flat_map(|beam| returns(beam, 2)).collect(),
        ..SceneResponse::default()
    };
    let front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 1);
    let sensor = PcSensor::new(front_end, pattern, Hardware::REFERENCE);
    Ok((beams, Client::connect(InProcess(sensor), RetryPolicy::default())?))
}

/// A pipeline with its waveforms and memory.
pub struct Stage {
    pipeline: Pipeline,
    analog: Analog,
    receiver: Receiver,
    waveforms: Vec<Vec<u16>>,
    returns: Vec<Vec<Return>>,
    scratch: Scratch,
    buffers: ShotBuffers,
    codes: Vec<u16>,
}

impl Stage {
    /// Scene with two returns per beam.
    ///
    /// # Errors
    ///
    /// When the pipeline refuses the settings.
    pub fn new(settings: Settings) -> Result<Self> {
        Self::with_returns(settings, 2)
    }

    /// Scene with a number of returns per beam.
    ///
    /// # Errors
    ///
    /// When the pipeline refuses the settings.
    pub fn with_returns(settings: Settings, count: usize) -> Result<Self> {
        let pipeline = Pipeline::new(&settings, &Hardware::REFERENCE)
            .map_err(|refusal| format!("{refusal:?}"))?;
        let mut stage = Self {
            pipeline,
            analog: analog_for(&settings, &Hardware::REFERENCE),
            receiver: Receiver::default(),
            waveforms: Vec::new(),
            returns: (0..BATCH as u32).map(|beam| returns(beam, count).collect()).collect(),
            scratch: Scratch::new(),
            buffers: ShotBuffers::default(),
            codes: vec![0; settings.bins as usize],
        };
        for beam in 0..BATCH {
            stage.synthesise(synthesise, beam);
            stage.waveforms.push(stage.codes.clone());
        }
        Ok(stage)
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// State of the front end.
    pub fn analog(&self) -> Analog {
        self.analog
    }

    /// The waveforms, ADC codes.
    pub fn waveforms(&self) -> &[Vec<u16>] {
        &self.waveforms
    }

    /// Processes all waveforms once.
    ///
    /// # Errors
    ///
    /// When there is no stage of this name.
    pub fn run(&mut self, name: &str) -> Result<()> {
        match name {
            "pipeline v3" => self.process_all(process),
            "pipeline v3 as compiled" => self.process_all(process_compiled),
            "pipeline baseline" => self.process_all(process_baseline),
            "front end v3" => (0..BATCH).for_each(|beam| self.synthesise(synthesise, beam)),
            "front end baseline" => {
                (0..BATCH).for_each(|beam| self.synthesise(synthesise_baseline, beam))
            }
            _ => return Err(format!("no stage {name}").into()),
        }
        Ok(())
    }

    /// Range of the strongest echo in every waveform, m.
    pub fn ranges_m(&mut self) -> Vec<Option<f64>> {
        let Self { pipeline, waveforms, scratch, .. } = self;
        waveforms
            .iter()
            .map(|codes| process(pipeline, codes, scratch).first().map(|echo| echo.range_m()))
            .collect()
    }

    fn process_all(&mut self, build: fn(&Pipeline, &[u16], &mut Scratch) -> Echoes) {
        for codes in &self.waveforms {
            black_box(build(&self.pipeline, black_box(codes), &mut self.scratch));
        }
    }

    fn synthesise(&mut self, build: Synthesise, beam: usize) {
        let returns = self.returns.get(beam).map_or(&[][..], Vec::as_slice);
        let key = noise_key(1, Trigger { frame: 0, beam: beam as u32, shot: 0 });
        let (receiver, analog) = (&self.receiver, &self.analog);
        let exposure = Exposure { receiver, analog, returns, background: &[], key };
        build(&exposure, &mut self.buffers, black_box(&mut self.codes));
    }
}

type Synthesise = fn(&Exposure<'_>, &mut ShotBuffers, &mut [u16]);
