//! Random recording instruments, and records with known echoes.
//!
//! ```text
//! pulse     Gaussian ⊛ exponential                                 skewed
//! response  pulse + tail + damped cosine + later bumps              random levels and phase
//! echo      A · response ⊛ surface               slope or crowns: Gaussian, box or skewed
//! record    ambient + drift + Σ echo + correlated noise, clipped and rounded to codes
//! ```
//!
//! Every parameter comes from the seed. Times are samples.

use echoloop_random::{Generator, derive};
use nalgebra::{DMatrix, DVector};

/// Kind of instrument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Short pulses, 8 or 12 bits, records cut near the echoes; one echo in four is wide.
    Airborne,
    /// As airborne, with two echoes in three wide: slopes and crowns.
    Slopes,
    /// Long smooth pulses in records of a thousand samples: ground below broad layers.
    Spaceborne,
}

/// All kinds with their names.
pub const KINDS: [(&str, Kind); 3] =
    [("airborne", Kind::Airborne), ("slopes", Kind::Slopes), ("spaceborne", Kind::Spaceborne)];

/// A random instrument.
#[derive(Clone, Debug)]
pub struct Instrument {
    seed: u64,
    kind: Kind,
    /// Full width at half maximum of the pulse's Gaussian.
    width: f64,
    /// Ratio of the pulse's exponential time constant to its width.
    skew: f64,
    tail: (f64, f64),
    ring: Ring,
    /// Delay of each bump, and its level relative to the pulse's.
    pub after: Vec<(f64, f64)>,
    ambient: f64,
    most: f64,
    /// Noise of a sample.
    pub sigma: f64,
    /// σ of the Gaussian that correlates the noise; 0: white noise.
    correlation: f64,
    drift: f64,
    response: Curve,
}

#[derive(Clone, Copy, Debug)]
struct Ring {
    level: f64,
    period: f64,
    decay: f64,
    phase: f64,
}

/// Truth of an echo.
#[derive(Clone, Copy, Debug)]
pub struct TrueEcho {
    /// Time of its top.
    pub time: f64,
    /// Full width at half maximum.
    pub width: f64,
    /// SNR after the matched filter that knows the shape of every echo, but of the others neither
    /// height nor place.
    pub snr: f64,
    /// Prominence of its top in the record without noise, over the noise; 0: it has none.
    pub prominence: f64,
}

/// A waveform and its echoes.
#[derive(Clone, Debug)]
pub struct Record {
    /// Codes.
    pub samples: Vec<f64>,
    /// Echoes by time.
    pub echoes: Vec<TrueEcho>,
}

/// Function of time with [`FINE`] values a sample; time 0 is at index `zero`.
#[derive(Clone, Debug)]
struct Curve {
    values: Vec<f64>,
    zero: f64,
}

/// Values of a [`Curve`] per sample.
const FINE: f64 = 8.0;

/// Ratio of a Gaussian's σ to its full width at half maximum.
const SIGMA: f64 = 0.424_66;

impl Curve {
    fn of(reach: (f64, f64), value: impl Fn(f64) -> f64) -> Self {
        let count = ((reach.0 + reach.1) * FINE) as usize;
        let values = (0..count).map(|i| value(i as f64 / FINE - reach.0)).collect();
        Self { values, zero: reach.0 * FINE }
    }

    fn at(&self, time: f64) -> f64 {
        let place = time * FINE + self.zero;
        let index = place.floor();
        if index < 0.0 || index as usize + 1 >= self.values.len() {
            return 0.0;
        }
        let (a, b) = (self.values[index as usize], self.values[index as usize + 1]);
        a + (b - a) * (place - index)
    }

    /// The curve spread by a surface.
    fn on(&self, surface: Surface) -> Self {
        if surface.sigma <= 0.0 {
            return self.clone();
        }
        let half = (6.0 * surface.sigma * FINE) as usize;
        let at = |i: usize| surface.share((i as f64 - half as f64) / (surface.sigma * FINE));
        let taps: Vec<f64> = (0..=2 * half).map(at).collect();
        let sum: f64 = taps.iter().sum();
        let mut values = vec![0.0; self.values.len() + 2 * half];
        for (i, v) in self.values.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            for (out, tap) in values[i..].iter_mut().zip(&taps) {
                *out += v * tap / sum;
            }
        }
        Self { values, zero: self.zero + half as f64 }
    }

    /// The curve scaled and moved to a top of 1 at time 0, and its full width at half maximum.
    fn normal(mut self) -> (Self, f64) {
        let top = (0..self.values.len())
            .max_by(|&a, &b| self.values[a].total_cmp(&self.values[b]))
            .unwrap_or_default();
        let height = self.values[top];
        self.values.iter_mut().for_each(|v| *v /= height);
        self.zero = top as f64;
        let after = self.values[top..].iter().take_while(|v| **v > 0.5).count();
        let before = self.values[..top].iter().rev().take_while(|v| **v > 0.5).count();
        (self, (after + before) as f64 / FINE)
    }
}

/// Spread of a target in depth.
#[derive(Clone, Copy, Debug)]
struct Surface {
    /// σ of its depths, samples; 0: a wall.
    sigma: f64,
    shape: Shape,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Gaussian,
    /// Slope under a uniform beam.
    Box,
    /// Tree crowns, denser above than below.
    Skewed,
}

impl Surface {
    /// Share of the surface at a depth in σ, not normalised.
    fn share(&self, depth: f64) -> f64 {
        match self.shape {
            Shape::Gaussian => (-0.5 * depth * depth).exp(),
            Shape::Box => f64::from(u8::from(depth.abs() <= 3f64.sqrt())),
            // Gamma distribution of order 4 and σ 1, with its mode at 0.
            Shape::Skewed => {
                let t = 2.0 * depth + 3.0;
                if t > 0.0 { t.powi(3) * (-t).exp() } else { 0.0 }
            }
        }
    }
}

/// An echo to record.
#[derive(Clone, Copy, Debug)]
struct Placed {
    time: f64,
    height: f64,
    surface: Surface,
}

impl Instrument {
    /// Draws the instrument of a seed.
    pub fn drawn(kind: Kind, seed: u64) -> Self {
        let g = &mut Generator::new(derive(seed, 77, kind as u64), 0);
        let spaceborne = kind == Kind::Spaceborne;
        let width = if spaceborne { g.range(11.0, 18.0) } else { g.range(3.5, 8.0) };
        let skew = if g.chance(0.6) { g.range(0.1, 0.6) } else { 0.0 };
        let tail =
            if g.chance(0.5) { (g.range(0.01, 0.08), g.range(1.5, 5.0)) } else { (0.0, 1.0) };
        let ring = Ring {
            level: if g.chance(0.5) {
                g.range(0.01, if spaceborne { 0.04 } else { 0.1 })
            } else {
                0.0
            },
            period: g.range(1.2, 3.5) * width,
            decay: g.range(1.0, 4.0) * width,
            phase: g.range(0.0, std::f64::consts::TAU),
        };
        let bumps = if g.chance(0.7) { 1 + g.index(2) } else { 0 };
        let most_after = if spaceborne { 0.04 } else { 0.13 };
        let after =
            (0..bumps).map(|_| (g.range(1.6, 7.0) * width, g.range(0.02, most_after))).collect();
        let eight_bits = !spaceborne && g.chance(0.5);
        let (ambient, most, sigma) = match (spaceborne, eight_bits) {
            (true, _) => (g.range(190.0, 260.0), 4095.0, g.range(2.0, 5.0)),
            (_, true) => (g.range(4.0, 20.0), 255.0, g.range(0.2, 1.2)),
            _ => (g.range(50.0, 300.0), 4095.0, g.range(2.0, 9.0)),
        };
        let correlation = if g.chance(0.5) { g.range(0.4, 0.12 * width) } else { 0.0 };
        let drift = if g.chance(0.4) { g.range(0.5, 3.0) } else { 0.0 } * sigma;
        let mut made = Self {
            seed,
            kind,
            width,
            skew,
            tail,
            ring,
            after,
            ambient,
            most,
            sigma,
            correlation,
            drift,
            response: Curve { values: Vec::new(), zero: 0.0 },
        };
        made.response = made.drawn_response();
        made
    }

    fn drawn_response(&self) -> Curve {
        let w = self.width;
        let gaussian = |t: f64| (-0.5 * (t / (SIGMA * w)).powi(2)).exp();
        let plain = Curve::of((3.0 * w, 3.0 * w), gaussian);
        let (pulse, _) = plain.skewed(self.skew * w).normal();
        let ring = self.ring;
        let late = |t: f64| {
            // Begins with the falling flank of the pulse.
            let begin = 1.0 / (1.0 + (-(t - 0.9 * w) / (0.15 * w)).exp());
            let turn = std::f64::consts::TAU * (t - 0.9 * w) / ring.period + ring.phase;
            let ringing = ring.level * turn.cos() * (-(t - 0.9 * w).max(0.0) / ring.decay).exp();
            let tail = self.tail.0 * (-(t - 0.9 * w).max(0.0) / (self.tail.1 * w)).exp();
            begin * (ringing + tail)
        };
        let bumps = |t: f64| self.after.iter().map(|&(d, a)| a * pulse.at(t - d)).sum::<f64>();
        Curve::of((3.0 * w, 30.0 * w), |t| pulse.at(t) + late(t) + bumps(t)).normal().0
    }

    /// Full width at half maximum of the response.
    pub fn response_width(&self) -> f64 {
        self.response.clone().normal().1
    }

    /// Level of the response at a lag after its top, relative to the top.
    pub fn level(&self, lag: f64) -> f64 {
        self.response.at(lag)
    }

    /// Draws record number `n`.
    pub fn record(&self, n: u64) -> Record {
        let g = &mut Generator::new(derive(self.seed, 78 + self.kind as u64, n), 0);
        let placed = self.placed(g);
        let last = placed[placed.len() - 1].time;
        let end = match self.kind {
            Kind::Spaceborne => g.range(700.0, 1300.0).max(last + 200.0),
            _ => last + g.range(4.0, 10.0) * self.width,
        };
        let mut values = self.noise(g, end as usize);
        let drift = (g.spread(self.drift), g.range(0.0, 6.0), g.range(1.0, 3.0));
        let length = values.len() as f64;
        for (i, v) in values.iter_mut().enumerate() {
            let turn = (i as f64 / length * drift.2 + drift.1).sin();
            *v += self.ambient + drift.0 * turn;
        }
        let curves: Vec<(Curve, f64)> =
            placed.iter().map(|placed| self.response.on(placed.surface).normal()).collect();
        for (Placed { time, height, .. }, (curve, _)) in placed.iter().zip(&curves) {
            for (i, v) in values.iter_mut().enumerate() {
                *v += height * curve.at(i as f64 - time);
            }
        }
        let without_noise = without_noise(&placed, &curves, values.len());
        let echo = |i: usize| {
            let (time, width) = (placed[i].time, curves[i].1);
            let snr = self.snr(&placed, &curves, i, values.len());
            let reach = (PER_SAMPLE * time, PER_SAMPLE * tolerance(width));
            let prominence = prominence_near(&without_noise, reach) / self.sigma;
            TrueEcho { time, width, snr, prominence }
        };
        let echoes = (0..placed.len()).map(echo).collect();
        let samples = values.iter().map(|v| v.round().clamp(0.0, self.most)).collect();
        Record { samples, echoes }
    }

    /// SNR of an echo after the matched filter, in the noise of the record.
    ///
    /// ```text
    /// C     covariance of the noise, rounding to codes included:  σ²·e^(−k²/4c²) + δ_k/12
    /// h     A·response on the surface, within 1.2 widths
    /// N     the ambient, and the other echoes' responses with their derivatives
    /// snr²  = h⊥ᵀ·C⁻¹·h⊥,   h⊥ = h without its part in N
    /// ```
    fn snr(&self, placed: &[Placed], curves: &[(Curve, f64)], i: usize, samples: usize) -> f64 {
        let reach = 1.2 * curves[i].1;
        let first = (placed[i].time - reach).max(0.0) as usize;
        let times: Vec<f64> = (first..samples)
            .map(|n| n as f64)
            .take_while(|n| *n <= placed[i].time + reach)
            .collect();
        let covariance = DMatrix::from_fn(times.len(), times.len(), |a, b| {
            let lag = times[a] - times[b];
            let own = if a == b { self.sigma.powi(2) + 1.0 / 12.0 } else { 0.0 };
            match self.correlation {
                c if a != b && c > 0.0 => self.sigma.powi(2) * (-lag * lag / (4.0 * c * c)).exp(),
                _ => own,
            }
        });
        let whitening = covariance.cholesky().expect("a covariance").l();
        let white = |value: &dyn Fn(f64) -> f64| {
            let values = DVector::from_iterator(times.len(), times.iter().map(|t| value(*t)));
            whitening.solve_lower_triangular(&values).expect("a triangle")
        };
        let mut others = vec![white(&|_| 1.0)];
        for j in (0..placed.len()).filter(|j| *j != i) {
            let at = |t: f64| curves[j].0.at(t - placed[j].time);
            others.push(white(&at));
            others.push(white(&|t| at(t + 0.5) - at(t - 0.5)));
        }
        let mut echo = white(&|t| placed[i].height * curves[i].0.at(t - placed[i].time));
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for other in others {
            let rest = basis.iter().fold(other.clone(), |rest, b| &rest - b * b.dot(&rest));
            // One that does not reach here.
            if rest.norm() > 1e-6 * other.norm().max(1e-3) {
                basis.push(rest.normalize());
            }
        }
        for b in &basis {
            echo -= b * b.dot(&echo);
        }
        echo.norm()
    }

    /// Draws echoes by time, far enough apart to have separate tops.
    fn placed(&self, g: &mut Generator) -> Vec<Placed> {
        let spaceborne = self.kind == Kind::Spaceborne;
        let count = match (g.unit(), spaceborne) {
            (u, false) => 1 + usize::from(u > 0.6) + usize::from(u > 0.85) + usize::from(u > 0.95),
            (u, true) => 1 + (5.0 * u * u + 0.5) as usize,
        };
        let wide = match self.kind {
            Kind::Airborne => 0.25,
            Kind::Slopes => 0.67,
            Kind::Spaceborne => 0.75,
        };
        let room = self.most - self.ambient;
        let top = match self.kind {
            Kind::Spaceborne => room.min(900.0),
            _ => 0.9 * room,
        };
        let strongest = top * (-g.range(0.0, 2.0)).exp();
        let least = (12.0 * self.sigma / strongest).clamp(if spaceborne { 0.03 } else { 0.1 }, 0.9);
        let chosen = g.index(count);
        let mut time = g.range(2.5, 5.0) * self.width;
        if spaceborne {
            time += g.range(100.0, 300.0);
        }
        let mut before = 0.0;
        (0..count)
            .map(|i| {
                let share = if i == chosen { 1.0 } else { least.powf(g.unit()) };
                let sigma = if g.chance(wide) { self.width * g.range(0.2, 1.0) } else { 0.0 };
                let shape = g.pick(&[Shape::Gaussian, Shape::Box, Shape::Skewed]);
                let full = self.width.hypot(sigma / SIGMA) * (1.0 + self.skew);
                if i > 0 {
                    time += (before + full) / 2.0 * (1.3 + 2.0 * g.unit().powi(2));
                }
                before = full;
                Placed { time, height: strongest * share, surface: Surface { sigma, shape } }
            })
            .collect()
    }

    fn noise(&self, g: &mut Generator, samples: usize) -> Vec<f64> {
        let half = (4.0 * self.correlation).ceil() as usize;
        let white = g.normals(samples + 2 * half);
        let tap = |k: usize| match half {
            0 => 1.0,
            _ => (-0.5 * ((k as f64 - half as f64) / self.correlation).powi(2)).exp(),
        };
        let taps: Vec<f64> = (0..=2 * half).map(tap).collect();
        let gain = taps.iter().map(|t| t * t).sum::<f64>().sqrt();
        white
            .windows(taps.len())
            .map(|w| self.sigma * w.iter().zip(&taps).map(|(w, t)| w * t).sum::<f64>() / gain)
            .collect()
    }
}

impl Curve {
    /// The curve behind an exponential of a time constant, samples.
    fn skewed(&self, constant: f64) -> Self {
        if constant <= 0.0 {
            return self.clone();
        }
        let decay = (-1.0 / (constant * FINE)).exp();
        let mut level = 0.0;
        let more = (8.0 * constant * FINE) as usize;
        let values = self.values.iter().copied().chain(std::iter::repeat_n(0.0, more));
        let values = values.map(|v| {
            level = level * decay + v * (1.0 - decay);
            level
        });
        Self { values: values.collect(), zero: self.zero }
    }
}

/// Baseline method: local maxima of the smoothed record.
#[derive(Clone, Copy, Debug)]
pub struct LocalMaxima {
    /// σ of the Gaussian smoothing, samples.
    pub smoothing: f64,
    /// Least height and least prominence, relative to the record's range.
    pub share: f64,
}

impl LocalMaxima {
    /// Times of the maxima; a plateau counts once, at its middle.
    pub fn find(&self, samples: &[f64]) -> Vec<f64> {
        let y = self.smoothed(samples);
        let least = y.iter().copied().fold(f64::INFINITY, f64::min);
        let range = y.iter().copied().fold(0.0, f64::max) - least;
        let mut found = Vec::new();
        let mut i = 1;
        while i + 1 < y.len() {
            let first = i;
            while i + 1 < y.len() && y[i + 1] == y[first] {
                i += 1;
            }
            let is_top = y[first - 1] < y[first] && i + 1 < y.len() && y[i + 1] < y[first];
            let high = y[first] - least >= self.share * range;
            if is_top && high && prominence(&y, first, i) >= self.share * range {
                found.push((first + i) as f64 / 2.0);
            }
            i += 1;
        }
        found
    }

    fn smoothed(&self, samples: &[f64]) -> Vec<f64> {
        if self.smoothing <= 0.0 {
            return samples.to_vec();
        }
        let half = (4.0 * self.smoothing).ceil() as isize;
        let tap = |k: isize| (-0.5 * (k as f64 / self.smoothing).powi(2)).exp();
        let sum: f64 = (-half..=half).map(tap).sum();
        let last = samples.len() as isize - 1;
        let at = |i: isize| samples[i.clamp(0, last) as usize];
        let value = |i: isize| (-half..=half).map(|k| tap(k) * at(i + k)).sum::<f64>() / sum;
        (0..=last).map(value).collect()
    }
}

/// Values per sample of a record without noise.
const PER_SAMPLE: f64 = 4.0;

/// Sum of all echoes, [`PER_SAMPLE`] values a sample.
fn without_noise(placed: &[Placed], curves: &[(Curve, f64)], samples: usize) -> Vec<f64> {
    let each = || placed.iter().zip(curves);
    let at = |t: f64| each().map(|(echo, curve)| echo.height * curve.0.at(t - echo.time)).sum();
    (0..samples * PER_SAMPLE as usize).map(|k| at(k as f64 / PER_SAMPLE)).collect()
}

/// Greatest prominence of a top within a reach of an index.
fn prominence_near(y: &[f64], (index, reach): (f64, f64)) -> f64 {
    let last = y.len().saturating_sub(1);
    let near = (index - reach).max(1.0) as usize..last.min((index + reach) as usize + 1);
    let tops = near.filter(|&k| y[k - 1] <= y[k] && y[k] > y[k + 1]);
    tops.map(|k| prominence(y, k, k)).fold(0.0, f64::max)
}

/// Prominence of a top: least descent on the way to a higher value.
fn prominence(y: &[f64], first: usize, last: usize) -> f64 {
    let top = y[first];
    let lowest =
        |side: &mut dyn Iterator<Item = f64>| side.take_while(|v| *v <= top).fold(top, f64::min);
    let left = lowest(&mut y[..first].iter().rev().copied());
    let right = lowest(&mut y[last + 1..].iter().copied());
    top - left.max(right)
}

/// Least SNR of an echo that counts.
pub const VISIBLE: f64 = 5.0;

/// Least prominence without noise of an echo that stands out of the others, over the noise.
pub const PROMINENT: f64 = 3.0;

/// Detections in some records, counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// True echoes that a matched filter could see.
    pub echoes: usize,
    /// True echoes that it could not.
    pub unseen: usize,
    /// Of those it could, found within two samples or three tenths of their width.
    pub found: usize,
    /// Of those it could see, with a top of their own.
    pub prominent: usize,
    /// Of those with a top of their own, found.
    pub prominent_found: usize,
    /// Detections without a true echo.
    pub extra: usize,
    /// Records.
    pub records: usize,
    /// Records with one true echo.
    pub singles: usize,
    /// Records with one true echo and one detection.
    pub kept: usize,
}

impl Score {
    /// Adds a record.
    pub fn add(&mut self, truth: &[TrueEcho], times: &[f64]) {
        let found = paired(truth, times);
        let is_visible = |echo: &TrueEcho| echo.snr >= VISIBLE;
        let visible = truth.iter().filter(|echo| is_visible(echo)).count();
        self.echoes += visible;
        self.unseen += truth.len() - visible;
        self.found +=
            truth.iter().zip(&found).filter(|(e, found)| is_visible(e) && **found).count();
        let is_prominent = |echo: &TrueEcho| is_visible(echo) && echo.prominence >= PROMINENT;
        self.prominent += truth.iter().filter(|echo| is_prominent(echo)).count();
        self.prominent_found +=
            truth.iter().zip(&found).filter(|(e, found)| is_prominent(e) && **found).count();
        self.extra += times.len() - found.iter().filter(|found| **found).count();
        self.records += 1;
        if truth.len() == 1 {
            self.singles += 1;
            self.kept += usize::from(times.len() == 1);
        }
    }

    /// Share of the visible echoes found.
    pub fn recall(&self) -> f64 {
        self.found as f64 / self.echoes as f64
    }

    /// Share of the visible echoes with a top of their own that are found.
    pub fn prominent_recall(&self) -> f64 {
        self.prominent_found as f64 / self.prominent as f64
    }

    /// Extra echoes per record.
    pub fn extras(&self) -> f64 {
        self.extra as f64 / self.records as f64
    }

    /// Share of single echoes that stay single.
    pub fn single(&self) -> f64 {
        self.kept as f64 / self.singles as f64
    }
}

/// Greatest distance of a detection from an echo of this width that it finds, samples.
fn tolerance(width: f64) -> f64 {
    (0.3 * width).max(2.0)
}

/// True for each echo that pairs with a detection, the nearest pairs first.
fn paired(truth: &[TrueEcho], times: &[f64]) -> Vec<bool> {
    let mut pairs = Vec::new();
    for (i, echo) in truth.iter().enumerate() {
        for (j, time) in times.iter().enumerate() {
            let apart = (time - echo.time).abs();
            if apart <= tolerance(echo.width) {
                pairs.push((apart, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut met, mut used) = (vec![false; truth.len()], vec![false; times.len()]);
    for (_, i, j) in pairs {
        if !met[i] && !used[j] {
            (met[i], used[j]) = (true, true);
        }
    }
    met
}
