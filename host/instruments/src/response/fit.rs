//! Echoes fitted to a piece of a record, each with its height, time and surface.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use super::curve::{FLAT, Family};

/// Greatest number of echoes fitted together: one, and its neighbour on either side.
const MOST: usize = 3;

/// Greatest number of steps of a fit.
const STEPS: usize = 14;

/// Least gain of a step, as a share of the residual, for another step.
const GAIN: f64 = 1e-4;

/// A fitted echo: the response on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    /// Height, codes.
    pub(super) height: f64,
    /// Time of its top, samples.
    pub(super) time: f64,
    /// Number of its surface, see [`Family`].
    pub(super) surface: f64,
}

impl Part {
    /// No echo.
    pub(super) const NONE: Self = Self { height: 0.0, time: 0.0, surface: FLAT };

    /// The echo on a flat surface, if on a rougher one.
    pub(super) fn narrow(self) -> Self {
        Self { surface: self.surface.min(FLAT), ..self }
    }

    /// Value at a sample, codes.
    pub(super) fn at(&self, family: &Family, sample: usize) -> f64 {
        self.height * family.shape(self.surface).at(sample as f64 - self.time).value
    }

    /// Adds `sign` times the echo to `x`.
    pub(super) fn add(&self, family: &Family, sign: f64, x: &mut [f64]) {
        let (before, after) = family.reach(self.surface);
        let range = samples(self.time + before..self.time + after, x.len());
        let shape = family.shape(self.surface);
        for (n, x) in range.clone().zip(&mut x[range]) {
            *x += sign * self.height * shape.at(n as f64 - self.time).value;
        }
    }
}

/// Samples within a range of time, of `count` samples.
pub(super) fn samples(range: Range<f64>, count: usize) -> Range<usize> {
    let end = (range.end.max(-1.0).floor() as isize + 1).clamp(0, count as isize) as usize;
    (range.start.max(0.0).ceil() as usize).min(end)..end
}

/// A piece of a record to fit echoes to.
pub(super) struct Fit<'a> {
    pub(super) family: &'a Family,
    /// Samples without ambient and without the echoes that are not fitted, codes.
    pub(super) x: &'a [f64],
    pub(super) range: Range<usize>,
    /// Greatest distance of a time from its start, samples.
    pub(super) leash: f64,
}

/// Normal equations of some parts.
struct Equations<const P: usize> {
    /// Sum of the squared residuals.
    residual: f64,
    normal: SMatrix<f64, P, P>,
    right: SVector<f64, P>,
}

impl Fit<'_> {
    /// Levenberg–Marquardt on at most [`MOST`] echoes. Returns the sum of the squared residuals.
    pub(super) fn run(&self, parts: &mut [Part]) -> f64 {
        match parts {
            [] => self.x[self.range.clone()].iter().map(|x| x * x).sum(),
            [a] => self.run_on::<1, 3>(std::array::from_mut(a)),
            [_, _] => self.run_some::<2, 6>(parts),
            _ => self.run_some::<MOST, { 3 * MOST }>(parts),
        }
    }

    fn run_some<const N: usize, const P: usize>(&self, parts: &mut [Part]) -> f64 {
        parts.first_chunk_mut().map_or(0.0, |parts| self.run_on::<N, P>(parts))
    }

    /// Fits N parts, which have P = 3 N parameters.
    fn run_on<const N: usize, const P: usize>(&self, parts: &mut [Part; N]) -> f64 {
        let begun = *parts;
        let (mut here, mut damping) = (self.equations::<N, P>(parts), 1e-3);
        for _ in 0..STEPS {
            let Some(next) = self.step(&here, parts, &begun, damping) else { break };
            let there = self.equations::<N, P>(&next);
            if there.residual < here.residual {
                let is_still = here.residual - there.residual < GAIN * here.residual;
                (*parts, here, damping) = (next, there, (0.2 * damping).max(1e-6));
                if is_still {
                    break;
                }
            } else if damping > 1e4 {
                break;
            } else {
                damping *= 8.0;
            }
        }
        here.residual
    }

    /// The parts after a damped step; `None` where the equations have no solution.
    fn step<const N: usize, const P: usize>(
        &self,
        at: &Equations<P>,
        parts: &[Part; N],
        begun: &[Part; N],
        damping: f64,
    ) -> Option<[Part; N]> {
        let mut normal = at.normal;
        for i in 0..P {
            let diagonal = normal[(i, i)];
            normal[(i, i)] = if diagonal > 0.0 { diagonal * (1.0 + damping) } else { 1.0 };
        }
        let step = normal.cholesky()?.solve(&at.right);
        let mut next = *parts;
        for (i, next) in next.iter_mut().enumerate() {
            let step = [step[3 * i], step[3 * i + 1], step[3 * i + 2]];
            *next = self.moved(&parts[i], begun[i].time, step);
        }
        Some(next)
    }

    /// A part after a step, of at most a third of a width and four surfaces.
    fn moved(&self, part: &Part, begun: f64, [height, time, surface]: [f64; 3]) -> Part {
        let reach = self.family.width(part.surface) / 3.0;
        let time = part.time + time.clamp(-reach, reach);
        let surface = part.surface + surface.clamp(-4.0, 4.0);
        Part {
            height: (part.height + height).max(0.0),
            time: time.clamp(begun - self.leash, begun + self.leash),
            surface: surface.clamp(0.0, self.family.widest()),
        }
    }

    fn equations<const N: usize, const P: usize>(&self, parts: &[Part; N]) -> Equations<P> {
        let shapes = parts.map(|part| self.family.shape(part.surface));
        let (mut sum, mut normal, mut right) = (0.0, [[0.0; P]; P], [0.0; P]);
        for n in self.range.clone() {
            let (mut left, mut row) = (self.x[n], [0.0; P]);
            for i in 0..N {
                let (part, at) = (&parts[i], shapes[i].at(n as f64 - parts[i].time));
                left -= part.height * at.value;
                row[3 * i] = at.value;
                row[3 * i + 1] = -part.height * at.slope;
                row[3 * i + 2] = part.height * at.growth;
            }
            sum += left * left;
            for i in 0..P {
                right[i] += row[i] * left;
                for j in 0..=i {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
        let normal = SMatrix::from_fn(|i, j| normal[i.max(j)][i.min(j)]);
        Equations { residual: sum, normal, right: right.into() }
    }
}
