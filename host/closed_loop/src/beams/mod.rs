//! What the host knows of a scan's beams: where each points, and when it is fired.

pub mod list;

use std::borrow::Cow;
use std::sync::Arc;

use echoloop_dsp::scan_pattern::exact_unit;
use echoloop_dsp::{ScanPattern, Spinning};
use nalgebra::Vector3;

use list::{BeamList, ListedBeam};

/// The beams of a scan pattern.
#[derive(Clone, Debug)]
pub struct Beams {
    pattern: ScanPattern,
    /// Of a table.
    list: Option<Arc<BeamList>>,
    /// Of a head's lasers, which is the how manieth from below.
    rings: Vec<u32>,
    /// Unit vectors, where every scan has the same.
    always: Option<Vec<Vector3<f32>>>,
    /// Of recorded scans, those of each viewpoint from 1.
    recorded: Option<Recorded>,
}

/// Unit vectors of each viewpoint.
type Recorded = Arc<Vec<Arc<Vec<Vector3<f32>>>>>;

impl Beams {
    /// Those of a pattern; none of a table, which a pattern has the name of only.
    pub fn new(pattern: ScanPattern) -> Self {
        Self::with(pattern, None)
    }

    /// Those of a list.
    pub fn of_list(list: Arc<BeamList>) -> Self {
        Self::with(ScanPattern::Table(list.name()), Some(list))
    }

    fn with(pattern: ScanPattern, list: Option<Arc<BeamList>>) -> Self {
        let rings = match pattern {
            ScanPattern::Spinning(Spinning { model, .. }) => ranks(model.lasers()),
            _ => Vec::new(),
        };
        let mut beams = Self { pattern, list, rings, always: None, recorded: None };
        if pattern.repeats() {
            beams.always = Some(beams.traced(0));
        }
        beams
    }

    /// As many beams that point elsewhere: where those of recorded scans did, of each viewpoint
    /// from 1.
    pub(super) fn recorded(self, of_viewpoints: Vec<Arc<Vec<Vector3<f32>>>>) -> Self {
        Self { recorded: Some(of_viewpoints.into()), ..self }
    }

    /// Their pattern, as the sensor has it.
    pub fn pattern(&self) -> &ScanPattern {
        &self.pattern
    }

    /// Unit vectors in the beams' order, sensor frame: x ahead, y left, z up; of the scan of a
    /// viewpoint, by its number. Scans are alike but for a rosette's, which goes on where that of
    /// the viewpoint before ended.
    pub fn directions(&self, viewpoint: u32) -> Cow<'_, [Vector3<f32>]> {
        let recorded = || self.recorded.as_ref()?.get((viewpoint as usize).checked_sub(1)?);
        if let Some(directions) = recorded() {
            return Cow::Borrowed(directions);
        }
        match &self.always {
            Some(directions) => Cow::Borrowed(directions),
            None => Cow::Owned(self.traced(viewpoint)),
        }
    }

    fn traced(&self, viewpoint: u32) -> Vec<Vector3<f32>> {
        let direction = |beam| match self.pattern {
            // The sensor's own, to the bit: what was measured with the paper's grid stays so.
            ScanPattern::Grid(_) => self.pattern.direction(viewpoint, beam),
            _ => self.exact_direction(viewpoint, beam).map(|exact| exact.cast()),
        };
        (0..self.pattern.beams()).filter_map(direction).collect()
    }

    /// The unit vector of a beam as its definition has it; what the sensor's own projection
    /// ([`ScanPattern::direction`]) is held to.
    pub fn exact_direction(&self, viewpoint: u32, beam: u32) -> Option<Vector3<f64>> {
        let exact = match self.pattern {
            ScanPattern::Table(_) => self.listed(beam).map(|listed| {
                let [azimuth, elevation] = [listed.azimuth_udeg, listed.elevation_udeg];
                exact_unit(f64::from(azimuth) / 1e6, f64::from(elevation) / 1e6)
            }),
            _ => self.pattern.exact_unit(viewpoint, beam),
        };
        exact.map(Vector3::from)
    }

    /// When a beam is fired, as a fraction of a scan of so many seconds.
    pub fn fraction(&self, beam: usize, duration_s: f64) -> f64 {
        match self.pattern {
            ScanPattern::Spinning(spinning) => {
                let [part, whole] = spinning.time(beam as u32);
                f64::from(part) / f64::from(whole)
            }
            ScanPattern::Table(_) => self.listed_time_s(beam as u32) / duration_s,
            _ => (beam as f64 + 0.5) / f64::from(self.pattern.beams().max(1)),
        }
    }

    /// When a beam is fired, s from the beginning of a scan that takes so long; 0: at once.
    pub fn time_s(&self, beam: u32, duration_s: f64) -> f64 {
        match self.pattern {
            ScanPattern::Spinning(_) => self.fraction(beam as usize, duration_s) * duration_s,
            ScanPattern::Table(_) if duration_s == 0.0 => 0.0,
            ScanPattern::Table(_) => self.listed_time_s(beam),
            _ => (f64::from(beam) + 0.5) * (duration_s / f64::from(self.pattern.beams().max(1))),
        }
    }

    fn listed_time_s(&self, beam: u32) -> f64 {
        self.listed(beam).map_or(0.0, |listed| listed.time_ns as f64 / 1e9)
    }

    fn listed(&self, beam: u32) -> Option<&ListedBeam> {
        self.list.as_ref()?.beams.get(beam as usize)
    }

    /// The row a beam stands in: of a grid or a head the how manieth from below, of a table its
    /// channel.
    pub fn ring(&self, beam: u32) -> u32 {
        match self.pattern {
            ScanPattern::Spinning(_) => {
                let [_, laser] = self.pattern.column_and_row(beam);
                self.rings.get(laser as usize).copied().unwrap_or(0)
            }
            ScanPattern::Table(_) => self.listed(beam).map_or(0, |listed| listed.channel.into()),
            _ => self.pattern.column_and_row(beam)[1],
        }
    }

    /// The how manieth of its row a beam is: along azimuth, or in time where that is no order.
    pub fn column(&self, beam: u32) -> u32 {
        match self.pattern {
            ScanPattern::Table(_) => {
                let shot = self.list.as_ref().and_then(|list| list.shots.get(beam as usize));
                shot.copied().unwrap_or(0)
            }
            _ => self.pattern.column_and_row(beam)[0],
        }
    }

    /// What shakes as one, by number: a column, where lasers fire together or soon after each
    /// other; a line of a raster.
    pub fn together(&self, beam: u32) -> u32 {
        match self.pattern {
            ScanPattern::Raster(_) => self.ring(beam),
            _ => self.column(beam),
        }
    }
}

/// Of each laser, how many lie lower.
fn ranks(lasers: &[[i32; 2]]) -> Vec<u32> {
    let lower = |of: &[i32; 2]| lasers.iter().filter(|laser| laser[0] < of[0]).count() as u32;
    lasers.iter().map(lower).collect()
}
