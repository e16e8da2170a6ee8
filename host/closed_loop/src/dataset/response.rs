//! Light that a scene returns to the beams of a viewpoint, whatever their aim.

use std::collections::HashMap;
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use echoloop_dsp::Grid;
use echoloop_frontend::{OtherLight, Return, SceneResponse};

use super::View;
use crate::beams::Beams;

/// Response of a scene to the beams of a viewpoint.
#[derive(Clone, Debug)]
pub enum Response {
    /// To beams that are the same with all settings.
    Fixed(Arc<SceneResponse>),
    /// To beams that the settings aim.
    Steered(Arc<Raster>),
}

impl Response {
    /// Response to these beams.
    ///
    /// Fixed responses have beams of their own and return those.
    pub fn to(&self, beams: &Beams) -> Arc<SceneResponse> {
        match self {
            Self::Fixed(response) => Arc::clone(response),
            Self::Steered(raster) => Arc::new(raster.to(beams)),
        }
    }

    /// Response to a beam that is steered to a cell of the raster; to all of `beams` where they are
    /// not steered. A moving sensor sees each aim from places of its own; it has that of `beams`.
    pub fn to_cell(&self, beams: &Beams, cell: u32) -> Arc<SceneResponse> {
        match self {
            Self::Steered(raster) if !raster.view.moves() => Arc::new(raster.to_cells(vec![cell])),
            _ => self.to(beams),
        }
    }
}

/// Dense response of a viewpoint: that of every cell of a mount's raster. A cell is traced when a
/// beam points to it for the first time, and kept for all later aims.
///
/// Beams point to cells and nowhere between them ([`echoloop_dsp::Steered`]), so the response to an
/// aim is the one that tracing it would give, to the bit.
pub struct Raster {
    view: View,
    raster: Grid,
    traced: Mutex<Traced>,
}

/// Returns of the cells traced so far.
#[derive(Default)]
struct Traced {
    cells: HashMap<u32, Cell>,
    returns: Vec<Return>,
}

/// What a beam to one cell sees: a span of the returns, and another LiDAR.
struct Cell {
    returns: Range<u32>,
    other: Option<OtherLight>,
}

impl Raster {
    pub(super) fn new(view: View, raster: Grid) -> Self {
        Self { view, raster, traced: Mutex::default() }
    }

    fn to(&self, beams: &Beams) -> SceneResponse {
        // From a moving sensor each aim sees a cell at another time, and so from another place.
        if self.view.moves() {
            return self.view.response(beams);
        }
        self.to_cells(beams.cells())
    }

    fn to_cells(&self, cells: Vec<u32>) -> SceneResponse {
        let missing = match self.locked().of(&cells) {
            Ok(response) => return SceneResponse { cells, ..response },
            Err(missing) => missing,
        };
        // Not locked meanwhile: a thread that waits for rays may take up another pair's work. Two
        // threads may trace the same cell, to the same returns.
        let traced = self.look(&missing);
        let mut all = self.locked();
        all.add(&missing, &traced);
        let response = all.of(&cells).unwrap_or_default();
        SceneResponse { cells, ..response }
    }

    /// Response to beams that point to these cells.
    fn look(&self, cells: &[u32]) -> SceneResponse {
        // As [`Beams::directions`] has them.
        let exact = |cell: u32| self.raster.exact_direction([cell >> 16, cell & 0xffff]);
        let direction = |&cell: &u32| exact(cell).map(|part| part as f32);
        self.view.along(&cells.iter().map(direction).collect::<Vec<_>>())
    }

    /// Number of cells traced so far.
    pub fn cells(&self) -> usize {
        self.locked().cells.len()
    }

    fn locked(&self) -> MutexGuard<'_, Traced> {
        self.traced.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Raster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Raster").field("cells", &self.cells()).finish_non_exhaustive()
    }
}

impl Traced {
    fn add(&mut self, cells: &[u32], response: &SceneResponse) {
        for (beam, &cell) in cells.iter().enumerate() {
            let Self { cells, returns } = self;
            cells.entry(cell).or_insert_with(|| {
                let start = returns.len() as u32; // 810,000 cells of 25 returns at most
                returns.extend(response.of(beam));
                let other = response.other.get(beam).copied();
                Cell { returns: start..returns.len() as u32, other }
            });
        }
    }

    /// Response to beams that point to these cells; those that are missing, if any is.
    fn of(&self, cells: &[u32]) -> Result<SceneResponse, Vec<u32>> {
        let known: Vec<Option<&Cell>> = cells.iter().map(|cell| self.cells.get(cell)).collect();
        if known.iter().any(Option::is_none) {
            let missing = cells.iter().zip(&known).filter(|(_, known)| known.is_none());
            return Err(missing.map(|(cell, _)| *cell).collect());
        }
        let mut response = SceneResponse { beams: vec![0], ..SceneResponse::default() };
        for Cell { returns, other } in known.into_iter().flatten() {
            response.returns.extend(&self.returns[returns.start as usize..returns.end as usize]);
            response.beams.push(response.returns.len() as u32);
            response.other.extend(other);
        }
        Ok(response)
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{ParameterId, Settings};
    use echoloop_sensors::serve::Views;

    use super::super::{Dataset, configured};
    use super::*;

    fn aim(set: &[(ParameterId, i32)]) -> Settings {
        let mut settings = Settings::default();
        set.iter().for_each(|&(id, value)| settings.set(id, Some(value)));
        settings
    }

    #[test]
    fn every_aim_sees_what_tracing_it_alone_would_show() {
        let small = ["scanner.pattern=steered", "scanner.columns=40", "scanner.rows=16"];
        let pairs = ["data.train_pairs=1", "data.test_pairs=1", "data.check_pairs=0"];
        let other = ["scene.interference=flash", "scene.retroreflectors=bright"];
        let config = configured(&[&small[..], &pairs[..], &other[..]].concat());
        let dataset = Dataset::build(&config, &|_, _| ()).unwrap();
        let Response::Steered(raster) = &dataset.train[0].first else { panic!("steered") };
        let mut traced = 0;
        for settings in [
            aim(&[]),
            aim(&[(ParameterId::AzimuthSpan, 6_000), (ParameterId::Tilt, -700)]),
            aim(&[(ParameterId::AzimuthFovea, 500), (ParameterId::Rows, 31)]),
            aim(&[]),
        ] {
            let beams = dataset.beams.aimed(&settings).unwrap();
            let alone = raster.view.response(&beams);
            assert!(*dataset.train[0].first.to(&beams) == alone, "{settings:?}");
            assert_eq!(alone.len(), beams.directions(1).len());
            assert!(alone.returns.len() > alone.len() / 3, "sees something");
            assert!(alone.other.iter().any(|light| light.irradiance_w_m2 > 0.0), "is lit");
            traced += alone.len();
        }
        // The first aim again costs nothing.
        assert!(raster.cells() <= traced - 40 * 16, "{} of {traced}", raster.cells());
    }

    #[test]
    fn what_is_served_is_traced_when_a_beam_asks_for_it() {
        let small = ["scanner.pattern=steered", "scanner.columns=12", "scanner.rows=6"];
        let pairs = ["data.train_pairs=1", "data.test_pairs=1", "data.check_pairs=0"];
        let config = configured(&[&small[..], &pairs[..]].concat());
        let dataset = Dataset::build(&config, &|_, _| ()).unwrap();
        let settings = aim(&[(ParameterId::AzimuthSpan, 9_000), (ParameterId::Tilt, 1_500)]);
        let beams = dataset.beams.aimed(&settings).unwrap();
        let own = dataset.train[0].first.to(&beams);
        for (beam, cell) in beams.cells().into_iter().enumerate() {
            let served = dataset.view(1, cell).unwrap();
            assert_eq!(served.at(beam, cell), own.at(beam, cell), "{cell:#x}");
        }
        assert!(dataset.view(0, 0).is_none() && dataset.view(5, 0).is_none());
    }

    #[test]
    fn a_moving_sensor_sees_each_aim_from_its_own_path() {
        let small = ["scanner.pattern=steered", "scanner.columns=20", "scanner.rows=8"];
        let motion = ["motion.duration_s=0.1", "motion.linear_m_s=[10,0,0]"];
        let pairs = ["data.train_pairs=1", "data.test_pairs=1", "data.check_pairs=0"];
        let config = configured(&[&small[..], &motion[..], &pairs[..]].concat());
        let dataset = Dataset::build(&config, &|_, _| ()).unwrap();
        let Response::Steered(raster) = &dataset.train[0].first else { panic!("steered") };
        let look = |frame_us| {
            let settings = aim(&[(ParameterId::FrameTime, frame_us)]);
            dataset.train[0].first.to(&dataset.beams.aimed(&settings).unwrap())
        };
        assert_eq!(raster.cells(), 0);
        assert_ne!(look(50_000).returns, look(200_000).returns, "a longer scan goes further");
    }
}
