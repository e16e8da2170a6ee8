//! The timed work: synthesis of waveforms, and detection.

use std::hint::black_box;

use echoloop_dsp::{Echoes, Hardware, Pipeline, Scratch, Settings};
use echoloop_frontend::Return;
use echoloop_frontend::{Analog, Trigger};
use echoloop_frontend::{
    Exposure, Receiver, ShotBuffers, noise_key, synthesise, synthesise_baseline,
};
use echoloop_kernels::{process, process_baseline};
use echoloop_sensors::boards::pc::analog_for;

use crate::result::Result;

pub(crate) const SAMPLES: usize = 1024;

/// Number of waveforms processed in sequence.
pub(crate) const BATCH: usize = 256;

/// Settings with a number of samples over 119 m, and a pulse width.
pub(crate) fn settings(samples: usize, pulse_width_ps: i32) -> Settings {
    // 372 nJ per pulse, below the limit.
    let power_uw = (37_200_000 / pulse_width_ps).clamp(500, 6_000) * 10_000;
    Settings { bins: samples as i32, pulse_width_ps, power_uw, ..Settings::default() }
}

/// Returns of white walls 13 m apart: echoes from far beyond saturation to a hundredth of full
/// scale.
pub(crate) fn returns(beam: u32, count: usize) -> impl Iterator<Item = Return> {
    (0..count).map(move |i| {
        let range_m = 8.0 + f64::from(beam % 64) + 13.0 * i as f64;
        Return { range_m: range_m as f32, strength_per_m2: (0.1 / range_m.powi(2)) as f32 }
    })
}

/// A pipeline with its waveforms and memory.
pub(crate) struct Stage {
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
    pub(crate) fn new(settings: Settings) -> Result<Self> {
        Self::with_returns(settings, 2)
    }

    pub(crate) fn with_returns(settings: Settings, count: usize) -> Result<Self> {
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

    pub(crate) fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    pub(crate) fn analog(&self) -> Analog {
        self.analog
    }

    pub(crate) fn waveforms(&self) -> &[Vec<u16>] {
        &self.waveforms
    }

    /// Processes all waveforms once.
    pub(crate) fn run(&mut self, name: &str) -> Result<()> {
        match name {
            "pipeline v3" => self.process_all(process),
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
    pub(crate) fn ranges_m(&mut self) -> Vec<Option<f64>> {
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
