//! Other end of a serial line: a sensor that looks at viewpoint n for scan n, as on a turntable.

use std::io;
use std::sync::Arc;
use std::time::Instant;

use crate::boards::pc::PcSensor;
use echoloop_dsp::{Hardware, ScanPattern};
use echoloop_frontend::SceneResponse;
use echoloop_frontend::{Analog, FrontEnd, ScanNoise, Trigger};

use crate::sensor::Model;
use crate::transport::{LOOK_UP, Transport, send_until};
use echoloop_frontend::WaveformFrontEnd;

/// Bytes passed to the sensor at once, about one command for beams, so that `stop` is looked at
/// between commands.
const PIECE: usize = 16;

/// Responses of a scene to a sensor at numbered viewpoints, from 1.
pub trait Views: Send {
    /// Response of a viewpoint to a beam that is steered to `cell`, and maybe to others; to all of
    /// its beams where they are not steered. `None` where there is no such viewpoint.
    fn view(&self, number: u32, cell: u32) -> Option<Arc<SceneResponse>>;
}

impl Views for Vec<Arc<SceneResponse>> {
    fn view(&self, number: u32, _: u32) -> Option<Arc<SceneResponse>> {
        self.get((number as usize).checked_sub(1)?).cloned()
    }
}

/// Front end that looks at viewpoint n for scan n, n from 1, and at nothing for other numbers. Its
/// noise is that of the request. Without one it depends on seed, scan and beam only, so a viewpoint
/// looks the same to every candidate.
pub struct Viewpoints {
    front_end: WaveformFrontEnd,
    pattern: ScanPattern,
    hardware: Hardware,
    views: Box<dyn Views>,
    nothing: Arc<SceneResponse>,
    seed: u64,
    /// Noise of the request.
    noise: Option<ScanNoise>,
    /// Cell that the beam is steered to; 0 of a beam that is not.
    cell: u32,
    /// Viewpoint, seed and cell that the front end shows.
    showing: (u32, u64, u32),
}

impl Viewpoints {
    /// Front end with these viewpoints.
    pub fn new(model: &Model, views: impl Views + 'static, seed: u64) -> Self {
        let nothing = Arc::new(SceneResponse::empty(model.pattern.beams()));
        let Model { pattern, hardware, .. } = *model;
        let (views, front_end, showing) = (Box::new(views), model.front_end(), (0, seed, 0));
        let (noise, cell) = (None, 0);
        Self { front_end, pattern, hardware, views, nothing, seed, noise, cell, showing }
    }

    /// Sensor with this front end and this machine's clock.
    pub fn sensor(self) -> PcSensor<Self> {
        let (pattern, hardware) = (self.pattern, self.hardware);
        let mut sensor = PcSensor::new(self, pattern, hardware);
        let began = Instant::now();
        sensor.set_clock(move || began.elapsed().as_micros() as u32); // may wrap
        sensor
    }

    fn show(&mut self, number: u32, seed: u64) {
        let showing = (number, seed, self.cell);
        if self.showing == showing {
            return;
        }
        let view = self.views.view(number, self.cell).unwrap_or_else(|| Arc::clone(&self.nothing));
        self.front_end.look_at(view, seed);
        self.showing = showing;
    }
}

impl FrontEnd for Viewpoints {
    fn adc_bits(&self) -> u32 {
        self.front_end.adc_bits()
    }

    fn name_noise(&mut self, noise: Option<ScanNoise>) {
        self.noise = noise;
    }

    fn steer(&mut self, cell: u32) {
        self.cell = cell;
        self.front_end.steer(cell);
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        let own = ScanNoise { scan: trigger.frame, seed: self.seed };
        let ScanNoise { scan, seed } = self.noise.unwrap_or(own);
        self.show(trigger.frame, seed);
        self.front_end.capture(analog, Trigger { frame: scan, ..trigger }, codes);
    }
}

/// Serves a line until `stop` returns true.
///
/// # Errors
///
/// When the line is gone, or takes no byte for five seconds.
pub fn serve<F: FrontEnd>(
    line: &mut dyn Transport,
    sensor: &mut PcSensor<F>,
    stop: &dyn Fn() -> bool,
) -> io::Result<()> {
    let mut buffer = [0; 4096];
    while !stop() {
        let length = line.receive(&mut buffer, LOOK_UP)?;
        for piece in buffer[..length].chunks(PIECE) {
            sensor.send(piece);
            answer(line, sensor, stop)?;
        }
    }
    Ok(())
}

/// Sends all bytes that the sensor has answered.
fn answer<F: FrontEnd>(
    line: &mut dyn Transport,
    sensor: &mut PcSensor<F>,
    stop: &dyn Fn() -> bool,
) -> io::Result<()> {
    let mut buffer = [0; 4096];
    while !stop() {
        let length = sensor.receive(&mut buffer);
        if length == 0 {
            break;
        }
        send_until(line, &buffer[..length], stop)?;
    }
    Ok(())
}
