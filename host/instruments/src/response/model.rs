//! An instrument's response, with noise, width, tail and later tops.

use rayon::prelude::*;

use super::curve::{Curve, Family};
use super::estimate::{Estimate, LOBE};
use super::strong::Strong;
use crate::codes::Codes;
use crate::finder::EchoFinder;
use crate::finder::colour::Colour;
use crate::noise::Noise;
use crate::rows::{Rows, evenly_spaced, without_padding};

/// Least spread of a response, over its height: no instrument repeats itself to better than 0.4 %,
/// nor, more than [`NEAR`] widths from its top, to better than 0.1 %.
const LEAST_SPREAD: f64 = 0.004;
const LEAST_SPREAD_AFAR: f64 = 0.001;
const NEAR: f64 = 3.0;

/// An instrument's record of a short echo: level by lag from the top, and the spread of single
/// echoes around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    pub(super) family: Family,
    /// Spread at each point of the response's curve, over its height.
    spread: Vec<f64>,
    /// Number of echoes that it is the mean of; `None` when it was given.
    pub echoes: Option<usize>,
    /// Tops after the strong echoes that may be the instrument's or second targets': nothing in the
    /// recording tells. They are not in the response.
    pub doubtful: Vec<Later>,
    /// Share of the strong echoes that are as narrow as the response; 1 when it was given.
    pub(super) narrow: f64,
    /// Noise of the recording; `None` when too little of it is at rest.
    pub noise: Option<Noise>,
    /// Σ h² over the middle of the lobe.
    energy: f64,
}

/// A recording that does not show its instrument's response.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoResponse {
    /// Too few echoes show it.
    #[error(
        "{found} of {looked} rows have a strongest echo that stands alone, whole and 20 times over \
         the noise; {least} are needed to tell the instrument's response"
    )]
    TooFew {
        /// Rows with such an echo.
        found: usize,
        /// Rows searched.
        looked: usize,
        /// Least number of rows with such an echo.
        least: usize,
    },
    /// The echoes are too different to have a response in common.
    #[error(
        "single echoes differ by {:.0} % of their height within the lobe, as counts of photons do: \
         their mean is not the instrument's response",
        100.0 * spread
    )]
    Different {
        /// Mean spread of single echoes within half a width of the top, over their height.
        spread: f64,
    },
}

/// Greatest spread of single echoes on the lobe, over their height: of instruments that digitise a
/// current it is below 0.03 (0.08 where few echoes tell it), of counts of a few tens of photons
/// above 0.1.
const GREATEST_SPREAD: f64 = 0.1;

/// A top or a valley of a response after its main lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Later {
    /// Samples after the top.
    pub lag: f64,
    /// Level over the top's height.
    pub level: f64,
}

impl Response {
    /// Estimates the response from a recording's strong echoes, at least `least`, and the emitted
    /// pulses, if they were recorded; see [`LEAST_ECHOES`].
    ///
    /// [`LEAST_ECHOES`]: super::LEAST_ECHOES
    ///
    /// # Errors
    ///
    /// [`NoResponse`] when the recording has too few.
    pub fn of_rows(
        rows: &Rows,
        least: usize,
        pulses: Option<&Rows>,
        noise: Option<Noise>,
    ) -> Result<Self, NoResponse> {
        let pulses = pulses.map(|pulses| strong(pulses.len(), |row| pulses.codes(row), None));
        let pulses = pulses.unwrap_or_default();
        Self::of_codes(rows.len(), least, |row| rows.codes(row), &pulses, noise)
    }

    /// As [`Response::of_rows`], from waveforms in memory.
    pub fn of_waveforms(rows: &[Vec<f64>], least: usize) -> Result<Self, NoResponse> {
        let codes = |row: usize| Codes::from_samples(without_padding(&rows[row]));
        Self::of_codes(rows.len(), least, codes, &[], Noise::of_waveforms(rows))
    }

    fn of_codes(
        rows: usize,
        least: usize,
        codes: impl Fn(usize) -> Codes + Sync,
        pulses: &[Strong],
        noise: Option<Noise>,
    ) -> Result<Self, NoResponse> {
        let records = strong(rows, codes, noise.as_ref().and_then(|noise| noise.colour));
        let too_few = || NoResponse::TooFew {
            found: records.len(),
            looked: evenly_spaced(rows).len(),
            least,
        };
        let Estimate { curve, spread, echoes, doubtful, narrow } =
            Estimate::of(&records, least, pulses).ok_or_else(too_few)?;
        let echoes = Some(echoes);
        let response = Self { echoes, doubtful, noise, narrow, ..Self::new(curve, spread) };
        match response.lobe_spread() {
            spread if spread > GREATEST_SPREAD => Err(NoResponse::Different { spread }),
            _ => Ok(response),
        }
    }

    /// A response of given level and spread.
    pub(super) fn new(curve: Curve, spread: Vec<f64>) -> Self {
        let mut response = Self {
            family: Family::new(curve),
            spread,
            echoes: None,
            doubtful: Vec::new(),
            narrow: 1.0,
            noise: None,
            energy: 1.0,
        };
        response.energy = response.taps().iter().map(|tap| tap * tap).sum();
        response
    }

    /// Sets the noise to that of a recording.
    #[must_use]
    pub fn with_noise(self, noise: Option<Noise>) -> Self {
        Self { noise, ..self }
    }

    /// Levels within 0.6 widths of the top, a sample apart.
    pub(super) fn taps(&self) -> Vec<f64> {
        let curve = self.family.response();
        let half = (0.6 * curve.width).floor() as i32;
        (-half..=half).map(|n| curve.at(n.into()).0).collect()
    }

    /// Mean spread of single echoes within half a width of the top.
    fn lobe_spread(&self) -> f64 {
        let reach = self.width() / 2.0;
        let lobe = self.points().filter(|(lag, ..)| lag.abs() <= reach);
        let (sum, count) = lobe.fold((0.0, 0.0), |(sum, n), (_, _, s)| (sum + s, n + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Full width at half maximum, samples.
    pub fn width(&self) -> f64 {
        self.family.response().width
    }

    /// Each point: lag in samples, level and spread over the top's height.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let curve = self.family.response();
        let level = |(point, &level)| (curve.time(point), level, self.spread_at(curve.time(point)));
        curve.values.iter().enumerate().map(level)
    }

    /// Spread of single echoes at a lag, samples, over their height.
    pub(super) fn spread_at(&self, lag: f64) -> f64 {
        let curve = self.family.response();
        let point = (lag / curve.step + curve.zero as f64).round();
        let known = (point >= 0.0).then(|| self.spread.get(point as usize)).flatten();
        let is_near = lag.abs() <= NEAR * curve.width;
        let least = if is_near { LEAST_SPREAD } else { LEAST_SPREAD_AFAR };
        known.map_or(0.0, |spread| spread.max(least))
    }

    /// Noise of a sample and of an echo's height in a record with sample noise `sigma`, all in
    /// codes of `unit`. The recording's noise counts where it is greater.
    pub(super) fn noise_in(&self, sigma: f64, unit: f64) -> (f64, f64) {
        let sigma = self.noise.as_ref().map_or(sigma, |noise| sigma.max(noise.sigma / unit));
        let gain = self.noise.as_ref().map(|noise| noise.gain(&self.taps()) / self.energy);
        (sigma, sigma * gain.unwrap_or(1.0 / self.energy.sqrt()))
    }

    /// Σ h² over the middle of the lobe.
    pub(super) fn energy(&self) -> f64 {
        self.energy
    }

    /// Share of the light that comes after the main lobe.
    pub fn tail(&self) -> f64 {
        let late = |lag: f64| lag > LOBE * self.width();
        let all: f64 = self.points().map(|(_, level, _)| level).sum();
        self.points().filter(|p| late(p.0)).map(|p| p.1).sum::<f64>() / all
    }

    /// True when an echo (time, height) may repeat one before it, as its doubtful tops do: within a
    /// third of a width of one's lag, and within a half of its level.
    pub(crate) fn may_repeat(&self, before: (f64, f64), echo: (f64, f64)) -> bool {
        self.doubtful.iter().any(|top| {
            let is_there = (echo.0 - before.0 - top.lag).abs() <= self.width() / 3.0;
            is_there && (echo.1 / before.1 / top.level - 1.0).abs() <= 0.5
        })
    }

    /// Tops and valleys after the main lobe that stand out by at least 1 % of its top: the six
    /// highest or deepest, by lag.
    pub fn later(&self) -> Vec<Later> {
        let lobe = LOBE * self.width();
        let tail: Vec<Later> = self
            .points()
            .filter(|(lag, ..)| *lag > lobe)
            .map(|(lag, level, _)| Later { lag, level })
            .collect();
        let mut found = turns(&tail);
        found.sort_by(|a, b| b.level.abs().total_cmp(&a.level.abs()));
        found.truncate(6);
        found.sort_by(|a, b| a.lag.total_cmp(&b.lag));
        found
    }
}

/// Least height of a top of the response over the valleys beside it.
const LEAST_TURN: f64 = 0.01;

/// Tops and valleys of a curve after a rise or fall of at least [`LEAST_TURN`], but for valleys
/// near zero, which are the tail itself.
pub(super) fn turns(curve: &[Later]) -> Vec<Later> {
    let mut found = all_turns(curve);
    found.retain(|turn| turn.level.abs() >= LEAST_TURN);
    found
}

/// Tops and valleys of a curve after a rise or fall of at least [`LEAST_TURN`], in turn.
pub(super) fn all_turns(curve: &[Later]) -> Vec<Later> {
    let Some(mut extreme) = curve.first().copied() else { return Vec::new() };
    // The curve comes down from the lobe, so the first turn is a valley.
    let (mut found, mut rising) = (Vec::new(), false);
    for &at in curve {
        let onward = if rising { at.level - extreme.level } else { extreme.level - at.level };
        if onward >= 0.0 {
            extreme = at;
        } else if onward < -LEAST_TURN {
            found.push(extreme);
            (extreme, rising) = (at, !rising);
        }
    }
    found
}

/// Share of the strong echoes that hide a clear top above which all may be of the same two targets.
/// A response is estimated from echoes as narrow as the narrowest tenth, which fewer leave.
const SAME_TARGETS: f64 = 0.9;

/// Records with a strong lone echo, from some of the rows. A lobe of two targets is one wide echo,
/// which no response is estimated from, unless it is as wide in almost every record.
fn strong(
    rows: usize,
    codes: impl Fn(usize) -> Codes + Sync,
    colour: Option<Colour>,
) -> Vec<Strong> {
    let found = |best_fit: bool| -> Vec<Strong> {
        let finder = || Box::new(EchoFinder::new());
        let look = |finder: &mut Box<EchoFinder>, row| {
            Strong::of_record(finder, &codes(row), colour, best_fit)
        };
        let looked = evenly_spaced(rows).into_par_iter().map_init(finder, look);
        looked.collect::<Vec<_>>().into_iter().flatten().collect()
    };
    let records = found(true);
    let hiding = records.iter().filter(|strong| strong.hides_top).count();
    if hiding as f64 > SAME_TARGETS * records.len() as f64 { found(false) } else { records }
}
