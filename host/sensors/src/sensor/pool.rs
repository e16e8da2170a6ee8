//! Pool of sensors.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::board_log::BoardLog;
use super::qemu::open_qemu;
use super::{FrontEndAt, Model, QemuOptions, Sensor, SensorError, SensorSpec};
use crate::client::{ClientError, Identity};

type Open = dyn Fn() -> Result<Sensor, SensorError> + Send + Sync;

/// Pool of sensors. Simulated ones are opened as needed, one for each thread that uses one; of a
/// board on a serial line there is one, and other threads wait.
pub struct Sensors {
    name: String,
    kind: String,
    open: Box<Open>,
    limit: usize,
    state: Mutex<State>,
    freed: Condvar,
    _log: Option<BoardLog>,
}

#[derive(Default)]
struct State {
    idle: Vec<Sensor>,
    /// Number of sensors idle, in use or being opened.
    count: usize,
    /// True when a sensor has been open before.
    opened: bool,
}

impl Sensors {
    /// Pool of the sensors that `--sensor` and `--front-end` name.
    pub fn new(spec: &SensorSpec, at: FrontEndAt, model: Model, qemu: QemuOptions) -> Self {
        let (name, spec) = (spec.to_string(), spec.clone());
        let limit = if matches!(spec, SensorSpec::Serial(_)) { 1 } else { usize::MAX };
        let kind = match (&spec, at) {
            (SensorSpec::Serial(_), FrontEndAt::Sensor) => "serial".to_owned(),
            (SensorSpec::Serial(_), FrontEndAt::Host) => "serial with waveforms".to_owned(),
            _ => name.clone(),
        };
        let pool = Self::opened_by(name, limit, move || match (&spec, at) {
            (SensorSpec::InProcess, FrontEndAt::Sensor) => {
                Sensor::in_process(&model).map_err(SensorError::client(&spec))
            }
            (SensorSpec::InProcess, FrontEndAt::Host) => {
                Sensor::in_process_fed(&model).map_err(SensorError::client(&spec))
            }
            (SensorSpec::Qemu(board), _) => open_qemu(&model, at, board, &qemu),
            (SensorSpec::Serial(port), FrontEndAt::Sensor) => Sensor::serial(port, None),
            (SensorSpec::Serial(port), FrontEndAt::Host) => Sensor::serial(port, Some(&model)),
        });
        Self { kind, ..pool }
    }

    /// Pool of sensors in this process.
    pub fn in_process(model: Model) -> Self {
        Self::new(&SensorSpec::InProcess, FrontEndAt::Sensor, model, QemuOptions::default())
    }

    /// Pool of at most `limit` sensors, each opened by `open`.
    pub fn opened_by(
        name: impl Into<String>,
        limit: usize,
        open: impl Fn() -> Result<Sensor, SensorError> + Send + Sync + 'static,
    ) -> Self {
        let (open, limit) = (Box::new(open), limit.max(1));
        let (state, freed) = (Mutex::default(), Condvar::new());
        let name = name.into();
        Self { kind: name.clone(), name, open, limit, state, freed, _log: None }
    }

    /// The same pool with a log that is written while the pool lives.
    pub fn with_log(self, log: BoardLog) -> Self {
        Self { _log: Some(log), ..self }
    }

    /// Name of the sensors, as in `--sensor`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Kind and firmware of the sensors, whatever port they are on, as in `serial, echoloop-sensor
    /// 0.1.0`. Opens the first; the kind alone where that fails.
    pub fn kind(&self) -> String {
        let identity = self.identity();
        identity.map_or_else(|_| self.kind.clone(), |of| format!("{}, {}", self.kind, of.build))
    }

    /// Identity of the sensors; opens the first.
    pub fn identity(&self) -> Result<Identity, SensorError> {
        self.with(|sensor| Ok(sensor.client.identity().clone()))
    }

    /// Takes a sensor, or waits for one, calls `work` with it, and gives it back. A sensor that
    /// failed is closed instead, and the next call opens another. `work` must not wait for other
    /// threads: it may have the only sensor.
    ///
    /// # Errors
    ///
    /// [`SensorError`] when no sensor can be opened, or from `work`.
    pub fn with<T>(
        &self,
        work: impl FnOnce(&mut Sensor) -> Result<T, ClientError>,
    ) -> Result<T, SensorError> {
        let mut seat = self.take()?;
        let done = work(&mut seat.sensor).map_err(SensorError::client(&self.name))?;
        seat.give_back();
        Ok(done)
    }

    fn take(&self) -> Result<Seat<'_>, SensorError> {
        let full = |state: &mut State| state.idle.is_empty() && state.count >= self.limit;
        let mut state =
            self.freed.wait_while(self.state(), full).unwrap_or_else(PoisonError::into_inner);
        if let Some(sensor) = state.idle.pop() {
            return Ok(Seat { sensor, place: Place(self) });
        }
        state.count += 1;
        let opened = state.opened;
        drop(state); // unlocked: opening takes long
        let place = Place(self);
        let sensor = (self.open)().map_err(|error| if opened { error.again() } else { error })?;
        self.state().opened = true;
        Ok(Seat { sensor, place })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Sensor in use. Its place is freed when it is dropped, even by a panic; the sensor is closed
/// first, because a port has to be closed before it can be opened again.
struct Seat<'a> {
    sensor: Sensor,
    place: Place<'a>,
}

impl Seat<'_> {
    fn give_back(self) {
        let Self { sensor, place } = self;
        let sensors = place.0;
        std::mem::forget(place); // the idle sensor keeps the place
        sensors.state().idle.push(sensor);
        sensors.freed.notify_one();
    }
}

/// Place of one sensor in the limit.
struct Place<'a>(&'a Sensors);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.state().count -= 1;
        self.0.freed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use echoloop_dsp::ScanPattern;
    use echoloop_frontend::Receiver;

    use super::*;

    /// Pool of at most `limit` sensors, and a count of those opened.
    fn counted(limit: usize) -> (Sensors, Arc<AtomicUsize>) {
        let (model, opened) = (
            Model::new(Receiver::default(), ScanPattern::default()),
            Arc::new(AtomicUsize::new(0)),
        );
        let count = Arc::clone(&opened);
        let open = move || match count.fetch_add(1, Ordering::SeqCst) {
            9 => Err(SensorError::open("test", "unplugged")),
            _ => Sensor::in_process(&model).map_err(SensorError::client("test")),
        };
        (Sensors::opened_by("test", limit, open), opened)
    }

    fn fail(sensors: &Sensors) -> String {
        let lost = || Err::<(), _>(ClientError::Line(io::Error::other("gone")));
        sensors.with(|_| lost()).unwrap_err().to_string()
    }

    #[test]
    fn one_sensor_serves_many_threads_and_is_opened_once() {
        let (sensors, opened) = counted(1);
        let inside = AtomicUsize::new(0);
        let work = || {
            for _ in 0..20 {
                let alone = |_: &mut Sensor| {
                    assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                    inside.fetch_sub(1, Ordering::SeqCst);
                    Ok(())
                };
                sensors.with(alone).unwrap();
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(work))));
        assert_eq!(opened.load(Ordering::SeqCst), 1);
    }

    #[test]
    fn a_sensor_that_failed_is_replaced() {
        let (sensors, opened) = counted(1);
        sensors.identity().unwrap();
        assert_eq!(fail(&sensors), "test: the link is lost: gone");
        sensors.identity().unwrap();
        assert_eq!(opened.load(Ordering::SeqCst), 2);
    }

    #[test]
    fn a_sensor_that_cannot_be_opened_again_is_reported_as_lost() {
        let (sensors, _) = counted(1);
        (0..9).for_each(|_| drop(fail(&sensors)));
        let error = sensors.identity().unwrap_err();
        assert!(
            matches!(error, SensorError::Client { source: ClientError::Line(_), .. }),
            "{error}"
        );
        assert_eq!(error.to_string(), "test: the link is lost: unplugged");
        sensors.identity().unwrap();
    }

    #[test]
    fn a_user_that_panics_frees_its_place() {
        let (sensors, _) = counted(1);
        let sensors = Arc::new(sensors);
        let other = Arc::clone(&sensors);
        std::thread::spawn(move || other.with(|_| -> Result<(), _> { panic!("on purpose") }))
            .join()
            .unwrap_err();
        sensors.identity().unwrap();
    }
}
