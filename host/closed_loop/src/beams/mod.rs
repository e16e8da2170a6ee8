//! Beams of a scan on the host: direction, firing time, row and column of each.
//!
//! A pattern knows its own beams ([`ScanPattern`]); a table's are in its [`BeamList`], and those of
//! recorded scans with the recording.

pub mod list;

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use echoloop_dsp::{Refusal, ScanPattern, Settings};
use nalgebra::Vector3;

use list::{BeamList, ListedBeam};

/// Beams of a scan pattern.
#[derive(Clone, Debug)]
pub struct Beams {
    pattern: ScanPattern,
    /// Beams of a table.
    list: Option<Arc<BeamList>>,
    /// Unit vectors, where every scan has the same.
    always: Option<Vec<Vector3<f32>>>,
    /// Unit vectors of recorded scans.
    recorded: Option<Recorded>,
}

/// Unit vectors of each viewpoint, from 1.
type Recorded = Arc<Vec<Arc<Vec<Vector3<f32>>>>>;

impl Beams {
    /// Beams of a pattern; no directions for a table, which the pattern knows by hash only.
    pub fn new(pattern: ScanPattern) -> Self {
        Self::with(pattern, None)
    }

    /// Beams of a list.
    pub fn of_list(list: Arc<BeamList>) -> Self {
        Self::with(ScanPattern::Table(list.name()), Some(list))
    }

    fn with(pattern: ScanPattern, list: Option<Arc<BeamList>>) -> Self {
        let mut beams = Self { pattern, list, always: None, recorded: None };
        if pattern.repeats() {
            beams.always = Some(beams.traced(0));
        }
        beams
    }

    /// As many beams with the directions of recorded scans, for each viewpoint from 1.
    pub(super) fn recorded(self, of_viewpoints: Vec<Arc<Vec<Vector3<f32>>>>) -> Self {
        Self { recorded: Some(of_viewpoints.into()), ..self }
    }

    /// Beams with the aim of these settings, of a pattern that is steered.
    ///
    /// # Errors
    ///
    /// [`Refusal`], as the sensor would answer.
    pub fn aimed(&self, settings: &Settings) -> Result<Cow<'_, Self>, Refusal> {
        match self.pattern.aimed(settings)? {
            same if same == self.pattern => Ok(Cow::Borrowed(self)),
            pattern => Ok(Cow::Owned(Self::new(pattern))),
        }
    }

    /// Cell that each beam is steered to, column · 2¹⁶ + row, rising; none where no beam is
    /// steered.
    pub fn cells(&self) -> Vec<u32> {
        let cell = |beam| self.pattern.cell(beam).map(|[column, row]| (column << 16) | row);
        (0..self.pattern.beams()).map_while(cell).collect()
    }

    /// Pattern as the sensor has it.
    pub fn pattern(&self) -> &ScanPattern {
        &self.pattern
    }

    /// Unit vectors of the scan of a viewpoint in the order of the beams, sensor frame: x ahead, y
    /// left, z up. Scans are alike except a rosette's, which begins where that of the viewpoint
    /// before ended.
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
            // The sensor's own f32: records with the paper's grid were made with these bits.
            ScanPattern::Grid(_) => self.pattern.direction(viewpoint, beam),
            _ => self.exact_direction(viewpoint, beam).map(|exact| exact.cast()),
        };
        (0..self.pattern.beams()).filter_map(direction).collect()
    }

    /// Unit vector of a beam in f64, which the sensor's own ([`ScanPattern::direction`]) is
    /// compared with.
    pub fn exact_direction(&self, viewpoint: u32, beam: u32) -> Option<Vector3<f64>> {
        let unit = match &self.list {
            Some(_) => self.listed(beam)?.exact_unit(),
            None => self.pattern.exact_unit(viewpoint, beam)?,
        };
        Some(unit.into())
    }

    /// Firing time of a beam as a fraction of a scan of `duration_s`.
    pub fn fraction(&self, beam: usize, duration_s: f64) -> f64 {
        let beam = beam as u32;
        if self.list.is_some() {
            return self.listed_time_s(beam) / duration_s;
        }
        match self.pattern.time(beam) {
            Some([part, whole]) => f64::from(part) / f64::from(whole),
            None => (f64::from(beam) + 0.5) / f64::from(self.pattern.beams().max(1)),
        }
    }

    /// Firing time of a beam from the beginning of a scan of `duration_s`, s; 0 for a scan of 0 s.
    pub fn time_s(&self, beam: u32, duration_s: f64) -> f64 {
        if self.list.is_some() {
            return if duration_s == 0.0 { 0.0 } else { self.listed_time_s(beam) };
        }
        match self.pattern.time(beam) {
            Some(_) => self.fraction(beam as usize, duration_s) * duration_s,
            // Not by the fraction, which rounds in another order: written clouds have these bits.
            None => (f64::from(beam) + 0.5) * (duration_s / f64::from(self.pattern.beams().max(1))),
        }
    }

    fn listed_time_s(&self, beam: u32) -> f64 {
        self.listed(beam).map_or(0.0, |listed| listed.time_ns as f64 / 1e9)
    }

    fn listed(&self, beam: u32) -> Option<&ListedBeam> {
        self.list.as_ref()?.beams.get(beam as usize)
    }

    /// Row of a beam, 0 the lowest; the channel of a table's beam.
    pub fn ring(&self, beam: u32) -> u32 {
        match &self.list {
            Some(_) => self.listed(beam).map_or(0, |listed| listed.channel.into()),
            None => self.pattern.column_and_row(beam)[1],
        }
    }

    /// Index of a beam within its row, from 0: along azimuth, or in time for a rosette or a table.
    pub fn column(&self, beam: u32) -> u32 {
        match &self.list {
            Some(list) => list.shots.get(beam as usize).copied().unwrap_or(0),
            None => self.pattern.column_and_row(beam)[0],
        }
    }

    /// First of the beams that are fired at the same moment as each; empty when each is fired by
    /// itself.
    pub fn fired_with(&self) -> Arc<[u32]> {
        let mut first = HashMap::new();
        let beams = 0..self.pattern.beams();
        let with = |beam| *first.entry(self.moment(beam)).or_insert(beam);
        let with: Vec<u32> = beams.map(with).collect();
        if first.len() == with.len() { Arc::default() } else { with.into() }
    }

    /// Number of the moment at which a beam is fired.
    fn moment(&self, beam: u32) -> u64 {
        match self.pattern {
            ScanPattern::Table(_) => self.listed(beam).map_or(0, |listed| listed.time_ns),
            ScanPattern::Spinning(spinning) => spinning.time(beam)[0].into(),
            _ => beam.into(), // one after the other
        }
    }

    /// Number of the group of beams that shakes as one: a column, or a line of a raster.
    pub fn together(&self, beam: u32) -> u32 {
        match self.list {
            Some(_) => self.column(beam),
            None => self.pattern.burst(beam),
        }
    }
}
