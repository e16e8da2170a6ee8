//! Sensor that scans a view: in process, in an emulated microcontroller, or on a serial line.
//!
//! The client is the same for all; the view is set in three ways. A simulated sensor is given the
//! scene. A board on a serial line is asked for the scan of a numbered viewpoint, and the turntable
//! reads the number from the emitter's FRAME register. Any sensor may be fed waveforms that a front
//! end makes here: [`Sensor::fed`].

mod board_log;
mod configured;
mod pool;
mod qemu;
mod spec;

use std::fmt::Display;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

use crate::boards::pc::{PcSensor, hardware_for};
use crate::boards::shots::Shots;
use echoloop_dsp::{Echoes, Hardware, ScanPattern, Settings};
use echoloop_frontend::SceneResponse;
use echoloop_link::{Noise, Room};
use echoloop_parameters::choice;
use thiserror::Error;

use crate::client::{Client, ClientError, RetryPolicy};
use crate::transport::{InProcess, Serial, Transport};
use echoloop_frontend::{FrontEnd, Receiver, WaveformFrontEnd};

pub use board_log::{BoardLog, LogSource, LogSourceError};
pub use pool::Sensors;
pub use qemu::{QemuOptions, end_emulators};
pub use spec::{FrontEndAt, Port, SensorSpec, SpecError};

/// Line to a sensor of any kind.
pub type Line = Box<dyn Transport + Send>;

/// Front end that is shared with the sensor that uses it.
pub type SharedFrontEnd = Arc<Mutex<WaveformFrontEnd>>;

/// Failure to open a sensor, or of an open one.
#[derive(Debug, Error)]
pub enum SensorError {
    /// The sensor cannot be opened.
    #[error("{sensor}: {reason}")]
    Open {
        /// Sensor, as in `--sensor`.
        sensor: String,
        /// Reason.
        reason: String,
    },
    /// A command failed.
    #[error("{sensor}: {source}")]
    Client {
        /// Sensor, as in `--sensor`.
        sensor: String,
        /// Error of the client.
        source: ClientError,
    },
}

impl SensorError {
    /// Error of a sensor that cannot be opened.
    pub fn open(sensor: impl Display, reason: impl Display) -> Self {
        Self::Open { sensor: sensor.to_string(), reason: reason.to_string() }
    }

    /// Error of a failed command, for `map_err`.
    pub fn client(sensor: impl Display) -> impl FnOnce(ClientError) -> Self {
        move |source| Self::Client { sensor: sensor.to_string(), source }
    }

    /// As the error of a sensor that was open before: one that cannot be opened again is lost.
    fn again(self) -> Self {
        match self {
            Self::Open { sensor, reason } => {
                Self::Client { sensor, source: io::Error::other(reason).into() }
            }
            lost => lost,
        }
    }
}

choice! {
    /// Detector of a sensor in process.
    pub enum Detector by default Firmware {
        /// Detector of the firmware.
        Firmware = "firmware",
        /// [`echoloop_sim::ideal`] in its place.
        Ideal = "ideal",
    }
}

impl Detector {
    /// Sensor with this detector.
    pub fn of<F: FrontEnd>(self, sensor: PcSensor<F>) -> PcSensor<F> {
        match self {
            Self::Firmware => sensor,
            Self::Ideal => sensor.with_ideal_detector(),
        }
    }
}

/// Model of a simulated sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Receiver: optics, photodiode, converter.
    pub receiver: Receiver,
    /// Scan pattern.
    pub pattern: ScanPattern,
    /// Hardware.
    pub hardware: Hardware,
    /// Detector, of a sensor in process.
    pub detector: Detector,
}

impl Model {
    /// Reference sensor with this receiver and this pattern.
    pub fn new(receiver: Receiver, pattern: ScanPattern) -> Self {
        let hardware = hardware_for(&receiver);
        Self { receiver, pattern, hardware, detector: Detector::default() }
    }

    /// Front end before an empty scene.
    pub fn front_end(&self) -> WaveformFrontEnd {
        WaveformFrontEnd::new(
            self.receiver.clone(),
            Arc::new(SceneResponse::empty(self.pattern.beams())),
            0,
        )
    }
}

/// View to scan.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Response of the scene.
    pub scene: &'a Arc<SceneResponse>,
    /// Seed of the noise of a simulated front end, together with the scan's number. A board on a
    /// serial line is sent both.
    pub noise_seed: u64,
    /// Number of the scan where the scene is given: the first or the second of a pair.
    pub scan: u32,
    /// Number of the viewpoint, for a board on a turntable.
    pub viewpoint: u32,
}

/// Way to set the view of a sensor.
enum ViewControl {
    /// The simulated front end is given the scene.
    Simulated(SharedFrontEnd),
    /// The scan is asked for by the number of the viewpoint.
    Numbered,
    /// The sensor is fed waveforms that are made here.
    Fed(Box<Shots<WaveformFrontEnd>>, Room),
}

/// Sensor and its view.
pub struct Sensor {
    /// Client of the sensor.
    pub client: Client<Line>,
    view_control: ViewControl,
}

impl Sensor {
    /// Sensor in this process.
    pub fn in_process(model: &Model) -> Result<Self, ClientError> {
        let front_end = Arc::new(Mutex::new(model.front_end()));
        let sensor = PcSensor::new(Arc::clone(&front_end), model.pattern, model.hardware);
        let sensor = model.detector.of(sensor);
        Self::simulated(Box::new(InProcess(sensor)), front_end, RetryPolicy::default())
    }

    /// As [`Sensor::in_process`], fed waveforms over its link.
    pub fn in_process_fed(model: &Model) -> Result<Self, ClientError> {
        let sensor = PcSensor::new(model.front_end(), model.pattern, model.hardware);
        let sensor = model.detector.of(sensor);
        Self::fed(Box::new(InProcess(sensor)), model, RetryPolicy::default())
    }

    /// Sensor behind a line, with a front end simulated here.
    pub fn simulated(
        line: Line,
        front_end: SharedFrontEnd,
        retry_policy: RetryPolicy,
    ) -> Result<Self, ClientError> {
        Ok(Self {
            client: Client::connect(line, retry_policy)?,
            view_control: ViewControl::Simulated(front_end),
        })
    }

    /// Sensor behind a line, on a turntable of its own.
    pub fn numbered(line: Line, retry_policy: RetryPolicy) -> Result<Self, ClientError> {
        Ok(Self {
            client: Client::connect(line, retry_policy)?,
            view_control: ViewControl::Numbered,
        })
    }

    /// Sensor behind a line, fed waveforms over it: it has no front end, or its own is not used.
    pub fn fed(line: Line, model: &Model, retry_policy: RetryPolicy) -> Result<Self, ClientError> {
        let mut client = Client::connect(line, retry_policy)?;
        let room = client.read_room()?;
        let shots = Shots::new(model.front_end(), model.pattern, model.hardware);
        Ok(Self { client, view_control: ViewControl::Fed(Box::new(shots), room) })
    }

    /// Board on a serial port; fed waveforms over it where there is a model to make them by.
    ///
    /// # Errors
    ///
    /// [`SensorError::Open`] with the port and the reason.
    pub fn serial(port: &Port, fed_by: Option<&Model>) -> Result<Self, SensorError> {
        let name = SensorSpec::Serial(port.clone());
        let line = Serial::open(&port.path, port.baud)
            .map_err(|reason| SensorError::open(&name, reason))?;
        let (line, retry_policy) = (Box::new(line), Serial::retry_policy(port.baud));
        match fed_by {
            None => Self::numbered(line, retry_policy),
            Some(model) => Self::fed(line, model, retry_policy),
        }
        .map_err(SensorError::client(&name))
    }

    /// Room for waveforms of a fed sensor; `None` of others.
    pub fn room(&self) -> Option<Room> {
        match &self.view_control {
            ViewControl::Fed(_, room) => Some(*room),
            _ => None,
        }
    }

    /// Sets the view and scans it.
    pub fn scan(&mut self, view: &View<'_>) -> Result<Vec<Echoes>, ClientError> {
        let Self { client, view_control } = self;
        match view_control {
            ViewControl::Simulated(front_end) => {
                let mut front_end = front_end.lock().unwrap_or_else(PoisonError::into_inner);
                front_end.look_at(Arc::clone(view.scene), view.noise_seed);
                drop(front_end); // unlocked: the sensor locks it for each shot
                client.scan(view.scan)
            }
            ViewControl::Numbered => {
                let noise = Noise { scan: view.scan, seed: view.noise_seed };
                client.scan_with(view.viewpoint, noise)
            }
            ViewControl::Fed(shots, room) => {
                shots.front_end_mut().look_at(Arc::clone(view.scene), view.noise_seed);
                scan_fed(client, shots, *room, view.scan)
            }
        }
    }

    /// Commits settings, and returns their hash.
    pub fn configure(&mut self, settings: &Settings) -> Result<u32, ClientError> {
        self.client.configure(settings)
    }
}

/// Scan of waveforms that a front end here makes by the sensor's settings.
fn scan_fed(
    client: &mut Client<Line>,
    shots: &mut Shots<WaveformFrontEnd>,
    room: Room,
    scan: u32,
) -> Result<Vec<Echoes>, ClientError> {
    let failed = |error| io::Error::other(format!("the front end here: {error:?}"));
    shots.begin(&client.settings()?, scan).map_err(failed)?;
    let mut shoot = |beam, shot, codes: &mut [u16]| shots.fire(beam, shot, codes).map_err(failed);
    client.scan_waveforms(scan, room, &mut shoot)
}
