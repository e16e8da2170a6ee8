//! Noise of a recording: its level and its colour, from the pieces without an echo.

use std::ops::Range;

use rayon::prelude::*;

use super::codes::Codes;
use super::finder::baseline::grouped_median;
use super::finder::colour::{Colour, LAGS};
use super::finder::{EchoFinder, FinderConfig, FoundEcho, samples};
use super::response::robust::median;
use super::response::{beginning, own_sigma};
use super::rows::{Rows, evenly_spaced, without_padding};

/// Least length of most records of a long recording.
const LONG: usize = 256;

/// Samples of a window that may be quiet, in a long and a short recording.
const WINDOW: usize = 24;
const SHORT_WINDOW: usize = 8;

/// End of the rest before the first echo of a record: widths of its strongest before that top.
const BEFORE: f64 = 1.5;

/// Share of the windows that the search for quiet ones begins with: those of least variance.
const BEGIN: usize = 20;

/// Greatest number of rounds of that search, and least growth of the variance for another.
const ROUNDS: usize = 30;
const GROWTH: f64 = 1.01;

/// Rounds in which the tops of coloured noise are told from echoes by what was measured before.
const AGAIN: usize = 2;

/// Greatest growth of σ in these rounds: of noise alone it is 1.17 at most.
const GROWN: f64 = 1.2;

/// Fewest quiet windows, and pairs of samples at a lag, that tell the noise.
const FEWEST_WINDOWS: usize = 8;
const FEWEST_PAIRS: u64 = 400;

/// Least and greatest ratio of σ to that of white noise with the same second differences, for the
/// noise to count as white.
const WHITE: Range<f64> = 0.9..1.1;

/// Least ratio of the records' usual σ̂ to that of the quiet pieces where these are of others: of a
/// channel with less noise.
const ANOTHER: f64 = 1.5;

/// Greatest ratio of D_k at the farthest quarter of the lags to that at the second: it still rises
/// where what looks quiet is the flank of an echo.
const SILL: f64 = 2.0;

/// Noise of the quiet pieces of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// σ of a sample, in the file's units.
    pub sigma: f64,
    /// Correlation of samples 0, 1, 2… apart; only the first, which is 1, where it is white.
    correlation: Vec<f64>,
    /// As the finder takes it; `None` where it is white.
    pub(crate) colour: Option<Colour>,
    /// σ of the records' own estimates over their median; `None` where the records' noise differs.
    spread: Option<f64>,
}

/// Greatest σ of the own estimates of records of n samples, over the noise, where all have one:
/// that much over √n. Of white noise it is 1.2, or 1.7 where n < 50.
const ALIKE: f64 = 2.0;
const ALIKE_OF_COLOURED: f64 = 4.0;

/// The same, of records of any length.
const ALIKE_OF_ANY: f64 = 0.4;

/// Greatest difference of a record's own estimate from the recording's noise, σ of the estimates.
const OWN: f64 = 3.0;

/// Sums of squared differences at each lag, and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Differences {
    sums: [f64; LAGS],
    counts: [u64; LAGS],
}

impl Noise {
    /// Noise of a file's rows; `None` where too little of them is quiet.
    pub fn of_rows(rows: &Rows) -> Option<Self> {
        Self::measured(rows.len(), |row| rows.codes(row))
    }

    /// As [`Noise::of_rows`], of waveforms in memory.
    pub fn of_waveforms(rows: &[Vec<f64>]) -> Option<Self> {
        Self::measured(rows.len(), |row| Codes::from_samples(without_padding(&rows[row])))
    }

    /// Measures some of `rows` rows, evenly spaced.
    ///
    /// ```text
    /// quiet  windows of L = 24 samples; where most records are shorter than 256, of 8, before the
    ///        first echo only, since hardly anything is at rest behind it. From the twentieth with
    ///        the least variance on, those within the 99.9th percentile of χ²_d/d times the mean
    ///        variance of the quiet ones, until no more come;  d = L/(1 + 2·Σ ρ_k²)
    /// D_k    = mean (x[n + k] − x[n])²/2 within quiet pieces
    /// σ²     = mean of D_k over the farther half of the lags
    /// ρ_k    = 1 − D_k/σ²                         0 beyond the last lag where it is significant
    /// ```
    ///
    /// D_k is the variogram: unlike the autocovariance it needs no mean, which drifts.
    ///
    /// In short recordings tops of coloured noise end the rest too early, as echoes do: they are
    /// told by what was measured, and it is measured again.
    pub(crate) fn measured(rows: usize, codes: impl Fn(usize) -> Codes + Sync) -> Option<Self> {
        let length = |&row: &usize| (row, codes(row).codes.len());
        let lengths: Vec<(usize, usize)> = evenly_spaced(rows).par_iter().map(length).collect();
        if is_long(&lengths) {
            return Self::measured_in(&lengths, &codes);
        }
        let measured = |noise: Option<&Self>| {
            Self::measured_in(&before_echoes(&lengths, &codes, noise), &codes)
        };
        let mut noise = measured(None)?;
        let most = GROWN * noise.sigma;
        for _ in 0..AGAIN {
            if !noise.is_coloured() {
                break;
            }
            // What grew more holds echoes that are weak beside another channel's noise.
            let better = measured(Some(&noise)).filter(|better| better.sigma < most);
            let Some(better) = better else { break };
            noise = better;
        }
        Some(noise)
    }

    /// As [`Noise::measured`], of rows and the end of the piece of each that may be quiet.
    fn measured_in(
        looked: &[(usize, usize)],
        codes: impl Fn(usize) -> Codes + Sync,
    ) -> Option<Self> {
        let window = if is_long(looked) { WINDOW } else { SHORT_WINDOW };
        let all = |&(row, end): &(usize, usize)| {
            let codes = codes(row);
            windows(&codes, end, window).map(|at| variance(&codes, at)).collect::<Vec<f64>>()
        };
        let mut variances: Vec<f64> = looked.par_iter().flat_map_iter(all).collect();
        variances.sort_by(f64::total_cmp);
        let differences = |limit: f64| {
            let row =
                |&(row, end): &(usize, usize)| Differences::of(&codes(row), end, window, limit);
            // Added in the order of the rows, so that the number of threads does not matter.
            let parts: Vec<Differences> = looked.par_iter().map(row).collect();
            parts.iter().fold(Differences::default(), |sum, part| sum.and(part))
        };
        let mut quiet = (variances.len() / BEGIN).max(FEWEST_WINDOWS);
        for _ in 0..ROUNDS {
            let order = variances.get(..quiet)?;
            let mean = order.iter().sum::<f64>() / quiet as f64;
            let freedom = differences(order[quiet - 1]).degrees_of_freedom(window);
            let limit = mean * highest_of(freedom);
            let more = variances.partition_point(|v| *v <= limit);
            let grown = variances[..more].iter().sum::<f64>() / more as f64;
            quiet = more.max(quiet);
            if grown <= GROWTH * mean {
                let white = own_sigmas(looked, |row| differing_sigma(&codes(row), None));
                let usual = is_long(looked).then(|| white[white.len() / 2]);
                let noise = Self::of_differences(&differences(limit), window, usual)?;
                let own = match noise.is_coloured() {
                    true => own_sigmas(looked, |row| noise.own_sigma(&codes(row))),
                    false => white,
                };
                let most = if noise.is_coloured() { ALIKE_OF_COLOURED } else { ALIKE };
                let length = |l: &(usize, usize)| codes(l.0).codes.len() as f64;
                let length = median(&mut looked.par_iter().map(length).collect::<Vec<_>>());
                let most = (most / length.sqrt()).min(ALIKE_OF_ANY);
                let spread = Some(spread(&own)).filter(|spread| *spread <= most);
                return Some(Self { spread, ..noise });
            }
        }
        None
    }

    /// `usual` is the σ̂ that the finder sees in a record of a long recording.
    fn of_differences(all: &Differences, window: usize, usual: Option<f64>) -> Option<Self> {
        let lags = all.counts[1..].iter().take_while(|n| **n >= FEWEST_PAIRS).count() + 1;
        if lags < 3 * window / 4 {
            return None;
        }
        let at = |k: usize| all.sums[k] / all.counts[k] as f64 / 2.0;
        let mean = |lags: Range<usize>| lags.clone().map(at).sum::<f64>() / lags.len() as f64;
        let variance = mean(lags / 2..lags);
        let nearer = lags / 4..lags / 2;
        if mean(3 * lags / 4..lags) > SILL * mean(nearer) {
            return None;
        }
        // 1/6 of the mean square of second differences: σ² of white noise.
        let white = (8.0 * at(1) - 2.0 * at(2)) / 6.0;
        if !(variance > 0.0 && white > 0.0) {
            return None;
        }
        let error = |k: usize| 3.0 / (all.counts[k] as f64).sqrt();
        let value = |k: usize| 1.0 - at(k) / variance;
        let last = (1..lags).rev().find(|&k| value(k).abs() > error(k)).unwrap_or(0);
        let correlation: Vec<f64> =
            (0..=last).map(|k| if k == 0 { 1.0 } else { value(k) }).collect();
        let usual = usual.filter(|usual| *usual < ANOTHER * white.sqrt());
        let ratio = variance.sqrt() / usual.unwrap_or(white.sqrt());
        let colour = (!WHITE.contains(&ratio)).then(|| Colour::new(ratio, &correlation));
        let correlation = if colour.is_some() { correlation } else { vec![1.0] };
        Some(Self { sigma: variance.sqrt(), correlation, colour, spread: None })
    }

    /// σ of a sum of samples with these weights, over σ of a sample.
    pub(crate) fn gain(&self, weights: &[f64]) -> f64 {
        let product = |k: usize| weights.iter().zip(&weights[k..]).map(|(a, b)| a * b).sum::<f64>();
        let white = product(0);
        let lags = 1..self.correlation.len().min(weights.len());
        let more: f64 = lags.map(|k| 2.0 * self.correlation[k] * product(k)).sum();
        (white + more).max(white / 4.0).sqrt()
    }

    /// False alarms per sample over e^(−snr²/2), after a filter of these taps: Rice's rate of
    /// upward crossings, of a sampled process.
    ///
    /// ```text
    /// rate = arccos(ρ_z)/(2π)·e^(−snr²/2)          ρ_z: correlation of neighbours after the filter
    /// ```
    pub(crate) fn crossings(&self, taps: &[f64]) -> f64 {
        let mut both = vec![0.0; taps.len() + 1];
        for (k, tap) in taps.iter().enumerate() {
            both[k] += tap;
            both[k + 1] += tap;
        }
        // Var(z[n] + z[n + 1]) = 2 σ_z² (1 + ρ_z).
        let [alone, together] = [taps, &both].map(|taps| self.gain(taps).powi(2));
        let neighbours = (together / (2.0 * alone) - 1.0).clamp(-1.0, 1.0);
        neighbours.acos() / std::f64::consts::TAU
    }

    /// White noise.
    pub(crate) fn white() -> Self {
        Self { sigma: 0.0, correlation: vec![1.0], colour: None, spread: None }
    }

    /// σ of the samples of a record, in the file's units, where all records have the same noise and
    /// the record does not tell that it differs.
    ///
    /// The own estimate of 60 samples is some 15 % off: through 5 σ that makes a hundred times as
    /// many false alarms as there should be.
    pub(crate) fn of_record(&self, codes: &Codes) -> Option<f64> {
        let most = OWN * self.spread? * self.sigma;
        if self.is_coloured() && self.sigma < codes.unit {
            return None; // steps of a code are no Gaussian noise
        }
        match self.own_sigma(codes) - self.sigma {
            less if less < -most => None,
            // More noise, or echoes: these raise what lies farther apart, and hardly neighbours.
            more if more > most => Some(self.sigma.max(differing_sigma(codes, self.colour))),
            _ => Some(self.sigma),
        }
    }

    /// σ of a record's samples as it alone tells it, in the file's units.
    ///
    /// ```text
    /// σ = median |x[n + k] − x[n]|/(0.6745·√(2 − 2·ρ_k))     coloured; the least k: ρ_k < ½
    /// ```
    ///
    /// Second differences of coloured noise are hardly more than a code, and their median a step.
    fn own_sigma(&self, codes: &Codes) -> f64 {
        if !self.is_coloured() {
            return differing_sigma(codes, None);
        }
        let all = &self.correlation;
        let lag = all.iter().position(|rho| *rho < 0.5).unwrap_or(all.len());
        let alike = all.get(lag).copied().unwrap_or_default();
        let piece = beginning(codes);
        let pairs = piece.iter().zip(piece.get(lag..).unwrap_or_default());
        let mut apart: Vec<u16> = pairs.map(|(&a, &b)| a.abs_diff(b)).collect();
        apart.sort_unstable();
        let median = codes.of_height(grouped_median(&apart, codes.shift)) * codes.unit;
        median / (0.6745 * (2.0 - 2.0 * alike).sqrt())
    }

    /// True when neighbouring samples are correlated.
    pub fn is_coloured(&self) -> bool {
        self.colour.is_some()
    }
}

/// The 99.9th percentile of χ²/d of d degrees of freedom, by Wilson and Hilferty's cube.
fn highest_of(freedom: f64) -> f64 {
    let part = 2.0 / (9.0 * freedom);
    (1.0 - part + 3.09 * part.sqrt()).powi(3)
}

/// Rows, and the end of the rest before the first echo of each, which the noise tells from a top.
fn before_echoes(
    lengths: &[(usize, usize)],
    codes: impl Fn(usize) -> Codes + Sync,
    noise: Option<&Noise>,
) -> Vec<(usize, usize)> {
    let rest = |finder: &mut Box<EchoFinder>, &(row, length): &(usize, usize)| {
        let codes = codes(row);
        // Coloured noise has clear tops, too.
        let colour = noise.and_then(|noise| noise.colour);
        let sigma = noise.map(|noise| codes.sigma_of(noise.sigma));
        let search =
            FinderConfig { best_fit: true, sigma, ..FinderConfig::of_record(&codes, colour) };
        let echoes = finder.echoes(&codes.codes, &search);
        let width = echoes.iter().max_by_key(|echo| echo.amplitude).map_or(0, |echo| echo.width);
        let rest = |echo: &FoundEcho| samples(echo.top) - BEFORE * samples(width);
        (row, echoes.first().map_or(length, |echo| rest(echo).max(0.0) as usize))
    };
    lengths.par_iter().map_init(|| Box::new(EchoFinder::new()), rest).collect()
}

/// Estimates of σ of the records, in order.
fn own_sigmas(looked: &[(usize, usize)], of: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
    let mut own: Vec<f64> = looked.par_iter().map(|&(row, _)| of(row)).collect();
    own.sort_by(f64::total_cmp);
    own
}

/// σ of a record by its second differences, as the finder sees it, in the file's units.
fn differing_sigma(codes: &Codes, colour: Option<Colour>) -> f64 {
    codes.of_sigma(own_sigma(codes, colour)) * codes.unit
}

/// σ of estimates in order over their median, by their lower half, as echoes only add.
fn spread(own: &[f64]) -> f64 {
    (1.0 - own[own.len() / 10] / own[own.len() / 2]) / 1.28
}

/// True when most of the records (row and length) are long.
fn is_long(records: &[(usize, usize)]) -> bool {
    2 * records.iter().filter(|record| record.1 >= LONG).count() > records.len()
}

/// Windows that may be quiet in a record up to `end`: without a gap and a clipped top.
fn windows(codes: &Codes, end: usize, length: usize) -> impl Iterator<Item = Range<usize>> {
    let last = end.min(codes.codes.len()).saturating_sub(length - 1);
    codes.undisturbed((0..last).step_by(length / 2).map(move |first| first..first + length))
}

/// Variance of a window, in the file's units, at least that of rounding to a code.
fn variance(codes: &Codes, at: Range<usize>) -> f64 {
    let values = || codes.codes[at.clone()].iter().map(|&code| f64::from(code));
    let mean = values().sum::<f64>() / at.len() as f64;
    let square = values().map(|v| (v - mean).powi(2)).sum::<f64>() / (at.len() - 1) as f64;
    square.max(1.0 / 12.0) * codes.unit * codes.unit
}

impl Differences {
    /// Of the windows of at most this variance.
    fn of(codes: &Codes, end: usize, window: usize, limit: f64) -> Self {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for at in windows(codes, end, window).filter(|at| variance(codes, at.clone()) <= limit) {
            match runs.last_mut() {
                Some(run) if run.end >= at.start => run.end = at.end,
                _ => runs.push(at),
            }
        }
        let mut all = Self::default();
        for run in runs {
            let piece = &codes.codes[run];
            for k in 1..LAGS.min(piece.len()) {
                let pairs = piece.iter().zip(&piece[k..]);
                let squares = pairs.map(|(&a, &b)| u64::from(a.abs_diff(b)).pow(2)).sum::<u64>();
                all.sums[k] += squares as f64 * codes.unit * codes.unit;
                all.counts[k] += (piece.len() - k) as u64;
            }
        }
        all
    }

    /// Number of independent samples in a window.
    fn degrees_of_freedom(&self, window: usize) -> f64 {
        let at = |k: usize| self.sums[k] / self.counts[k].max(1) as f64;
        let far = window / 2..window;
        let variance = far.clone().map(at).sum::<f64>() / far.len() as f64;
        let alike = |k: usize| (1.0 - at(k) / variance).clamp(-1.0, 1.0);
        let more = (1..window / 2).map(|k| alike(k).powi(2)).sum::<f64>();
        if variance > 0.0 { window as f64 / (1.0 + 2.0 * more) } else { window as f64 }
    }

    fn and(mut self, other: &Self) -> Self {
        for k in 0..LAGS {
            self.sums[k] += other.sums[k];
            self.counts[k] += other.counts[k];
        }
        self
    }
}
