//! A sensor that can be made to look at a scene: in process, in an emulated microcontroller, or on
//! a serial line.
//!
//! The client is the same for all. What differs is how a sensor comes to look somewhere. A
//! simulated one is given the scene. What a board on a serial line sees is not ours to choose: it
//! is asked for the scan of a numbered viewpoint, and whoever turns it reads the number off the
//! emitter's FRAME register. Any sensor
//! may instead be given the waveforms that a front end makes here: [`Sensor::fed`].

mod board_log;
mod boards;
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
use echoloop_keys::Value;
use echoloop_link::{Noise, Room};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::client::{Client, ClientError, Identity, RetryPolicy};
use crate::transport::{InProcess, Serial, Transport};
use echoloop_frontend::{FrontEnd, Receiver, WaveformFrontEnd};

pub use board_log::{BoardLog, LogSource, LogSourceError};
pub use pool::Sensors;
pub use qemu::QemuOptions;
pub use qemu::end_emulators;
pub use spec::{FrontEndAt, Port, SensorSpec, SpecError};

/// A line to a sensor, whichever.
pub type Line = Box<dyn Transport + Send>;

/// A front end that can be reached while a sensor has it.
pub type SharedFrontEnd = Arc<Mutex<WaveformFrontEnd>>;

/// Why there is no sensor, or none any more.
#[derive(Debug, Error)]
pub enum SensorError {
    /// It cannot be had.
    #[error("{sensor}: {reason}")]
    Open {
        /// Which, as in `--sensor`.
        sensor: String,
        /// Why not.
        reason: String,
    },
    /// It did not do its part.
    #[error("{sensor}: {source}")]
    Client {
        /// Which, as in `--sensor`.
        sensor: String,
        /// What went wrong.
        source: ClientError,
    },
}

impl SensorError {
    /// It cannot be had.
    pub fn open(sensor: impl Display, reason: impl Display) -> Self {
        Self::Open { sensor: sensor.to_string(), reason: reason.to_string() }
    }

    /// It did not do its part.
    pub fn client(sensor: impl Display) -> impl FnOnce(ClientError) -> Self {
        move |source| Self::Client { sensor: sensor.to_string(), source }
    }

    /// Of a sensor that was there before: what cannot be had again is lost.
    fn again(self) -> Self {
        match self {
            Self::Open { sensor, reason } => {
                Self::Client { sensor, source: io::Error::other(reason).into() }
            }
            lost => lost,
        }
    }
}

/// Who finds the echoes of a sensor in process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detector {
    /// Its program.
    #[default]
    Firmware,
    /// [`echoloop_sim::ideal`], in the program's place.
    Ideal,
}

impl Value for Detector {}

impl Detector {
    /// A sensor whose echoes it finds.
    pub fn of<F: FrontEnd>(self, sensor: PcSensor<F>) -> PcSensor<F> {
        match self {
            Self::Firmware => sensor,
            Self::Ideal => sensor.with_ideal_detector(),
        }
    }
}

/// What a simulated sensor is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Optics, detector, converter.
    pub receiver: Receiver,
    /// Where its beams point.
    pub pattern: ScanPattern,
    /// What its hardware fixes.
    pub hardware: Hardware,
    /// Who finds its echoes, in process.
    pub detector: Detector,
}

impl Model {
    /// The reference sensor with this receiver and this pattern.
    pub fn new(receiver: Receiver, pattern: ScanPattern) -> Self {
        let hardware = hardware_for(&receiver);
        Self { receiver, pattern, hardware, detector: Detector::default() }
    }

    /// Its front end, which sees nothing yet.
    pub fn front_end(&self) -> WaveformFrontEnd {
        WaveformFrontEnd::new(
            self.receiver.clone(),
            Arc::new(SceneResponse::empty(self.pattern.beams())),
            0,
        )
    }
}

/// Something to look at.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// What is there to see.
    pub scene: &'a Arc<SceneResponse>,
    /// Decides the noise of a simulated front end, together with the scan's number. A sensor that
    /// somebody else turns is told both.
    pub noise_seed: u64,
    /// Number of the scan where the scene comes with the view: the first or the second of a pair.
    pub scan: u32,
    /// Number of the viewpoint, for a sensor that somebody else turns.
    pub viewpoint: u32,
}

/// Who decides what a sensor looks at.
enum ViewControl {
    /// Its front end is simulated and takes the scene.
    Simulated(SharedFrontEnd),
    /// It is asked for scans by the number of the viewpoint.
    Numbered,
    /// It gets waveforms that are made here.
    Fed(Box<Shots<WaveformFrontEnd>>, Room),
}

/// One sensor, and what it looks at.
pub struct Sensor {
    client: Client<Line>,
    view_control: ViewControl,
}

impl Sensor {
    /// A sensor in this process.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn in_process(model: &Model) -> Result<Self, ClientError> {
        let front_end = Arc::new(Mutex::new(model.front_end()));
        let sensor = PcSensor::new(Arc::clone(&front_end), model.pattern, model.hardware);
        let sensor = model.detector.of(sensor);
        Self::simulated(Box::new(InProcess(sensor)), front_end, RetryPolicy::default())
    }

    /// As [`Sensor::in_process`], and it gets its waveforms over its link.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn in_process_fed(model: &Model) -> Result<Self, ClientError> {
        let sensor = PcSensor::new(model.front_end(), model.pattern, model.hardware);
        let sensor = model.detector.of(sensor);
        Self::fed(Box::new(InProcess(sensor)), model, RetryPolicy::default())
    }

    /// A sensor behind a line whose front end is simulated here.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
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

    /// A sensor behind a line that somebody else turns.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn numbered(line: Line, retry_policy: RetryPolicy) -> Result<Self, ClientError> {
        Ok(Self {
            client: Client::connect(line, retry_policy)?,
            view_control: ViewControl::Numbered,
        })
    }

    /// A sensor behind a line that gets its waveforms over it: one that has no front end, or whose
    /// own is not used.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn fed(line: Line, model: &Model, retry_policy: RetryPolicy) -> Result<Self, ClientError> {
        let mut client = Client::connect(line, retry_policy)?;
        let room = client.read_room()?;
        let shots = Shots::new(model.front_end(), model.pattern, model.hardware);
        Ok(Self { client, view_control: ViewControl::Fed(Box::new(shots), room) })
    }

    /// A board on a serial port.
    ///
    /// # Errors
    ///
    /// [`SensorError::Open`] names the port and says why it cannot be opened.
    pub fn serial(port: &Port) -> Result<Self, SensorError> {
        Self::on_port(port, Self::numbered)
    }

    /// A board on a serial port that gets its waveforms over it.
    ///
    /// # Errors
    ///
    /// As [`Sensor::serial`].
    pub fn serial_fed(port: &Port, model: &Model) -> Result<Self, SensorError> {
        Self::on_port(port, |line, retry_policy| Self::fed(line, model, retry_policy))
    }

    fn on_port(
        port: &Port,
        connect: impl FnOnce(Line, RetryPolicy) -> Result<Self, ClientError>,
    ) -> Result<Self, SensorError> {
        let name = || SensorSpec::Serial(port.clone());
        let line = Serial::open(&port.path, port.baud)
            .map_err(|reason| SensorError::open(name(), reason))?;
        connect(Box::new(line), Serial::retry_policy(port.baud))
            .map_err(SensorError::client(name()))
    }

    /// What room it has for waveforms, where it gets them over its link.
    pub fn room(&self) -> Option<Room> {
        match &self.view_control {
            ViewControl::Fed(_, room) => Some(*room),
            _ => None,
        }
    }

    /// Turns to a view and scans it.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn scan(&mut self, view: &View<'_>) -> Result<Vec<Echoes>, ClientError> {
        let Self { client, view_control } = self;
        match view_control {
            ViewControl::Simulated(front_end) => {
                let mut front_end = front_end.lock().unwrap_or_else(PoisonError::into_inner);
                front_end.look_at(Arc::clone(view.scene), view.noise_seed);
                drop(front_end); // the sensor needs it
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

    /// Sets it; the hash its settings now go by.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn configure(&mut self, settings: &Settings) -> Result<u32, ClientError> {
        self.client.configure(settings)
    }

    /// What it says of itself.
    pub fn identity(&self) -> &Identity {
        self.client.identity()
    }

    /// The conversation with it.
    pub fn client(&mut self) -> &mut Client<Line> {
        &mut self.client
    }
}

/// Scans what a front end here sees, by the settings that the sensor has.
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
