//! Echoes fitted to a piece of a record, each with its height, time and surface.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use super::curve::{FLAT, Family};

/// Echoes that are fitted together at most: one, and its neighbour on either side.
const MOST: usize = 3;

/// Parameters of as many echoes.
const PARAMETERS: usize = 3 * MOST;

/// Steps of a fit at most.
const STEPS: usize = 14;

/// Least gain of a step, as a share of what is left, that another one follows.
const GAIN: f64 = 1e-4;

type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Vector = SVector<f64, PARAMETERS>;

/// An echo as the response has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    /// Codes.
    pub(super) height: f64,
    /// Of its top, samples.
    pub(super) time: f64,
    /// Number of its surface, see [`Family`].
    pub(super) surface: f64,
}

impl Part {
    /// None.
    pub(super) const NONE: Self = Self { height: 0.0, time: 0.0, surface: FLAT };

    /// Its value at a sample.
    pub(super) fn at(&self, family: &Family, sample: usize) -> f64 {
        self.height * family.at(sample as f64 - self.time, self.surface).value
    }

    /// Adds it, or with a negative sign takes it away.
    pub(super) fn add(&self, family: &Family, sign: f64, x: &mut [f64]) {
        let (before, after) = family.reach(self.surface);
        let range = samples(self.time + before..self.time + after, x.len());
        for (n, x) in range.clone().zip(&mut x[range]) {
            *x += sign * self.at(family, n);
        }
    }
}

/// The samples of a range of time, of so many.
pub(super) fn samples(range: Range<f64>, count: usize) -> Range<usize> {
    let end = (range.end.max(-1.0).floor() as isize + 1).clamp(0, count as isize) as usize;
    (range.start.max(0.0).ceil() as usize).min(end)..end
}

/// What is fitted to.
pub(super) struct Fit<'a> {
    pub(super) family: &'a Family,
    /// Samples without ambient and without all echoes that are not fitted.
    pub(super) x: &'a [f64],
    pub(super) range: Range<usize>,
    /// How far a time may go from where it begins, samples.
    pub(super) leash: f64,
}

impl Fit<'_> {
    /// Levenberg–Marquardt on at most [`MOST`] echoes; gives the sum of squares that is left.
    pub(super) fn run(&self, parts: &mut [Part]) -> f64 {
        let begun: Vec<f64> = parts.iter().map(|part| part.time).collect();
        let (mut left, mut damping) = (self.left(parts), 1e-3);
        for _ in 0..STEPS {
            let Some(next) = self.step(parts, &begun, damping) else { break };
            let next = &next[..parts.len()];
            let after = self.left(next);
            if after < left {
                let is_still = left - after < GAIN * left;
                parts.copy_from_slice(next);
                (left, damping) = (after, (0.2 * damping).max(1e-6));
                if is_still {
                    break;
                }
            } else if damping > 1e4 {
                break;
            } else {
                damping *= 8.0;
            }
        }
        left
    }

    fn left(&self, parts: &[Part]) -> f64 {
        let model = |n| parts.iter().map(|part| part.at(self.family, n)).sum::<f64>();
        self.range.clone().map(|n| (self.x[n] - model(n)).powi(2)).sum()
    }

    /// The parts after a damped step.
    fn step(&self, parts: &[Part], begun: &[f64], damping: f64) -> Option<[Part; MOST]> {
        let (mut normal, right) = self.normal(parts);
        for i in 0..PARAMETERS {
            let diagonal = normal[(i, i)];
            normal[(i, i)] = if diagonal > 0.0 { diagonal * (1.0 + damping) } else { 1.0 };
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let step = normal.cholesky()?.solve(&right);
        let mut next = [Part::NONE; MOST];
        for (i, next) in next.iter_mut().enumerate().take(parts.len()) {
            *next =
                self.moved(&parts[i], begun[i], [step[3 * i], step[3 * i + 1], step[3 * i + 2]]);
        }
        Some(next)
    }

    /// A third of a width and four surfaces in a step at most.
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

    /// Normal equations, the lower triangle.
    fn normal(&self, parts: &[Part]) -> (Normal, Vector) {
        let (mut normal, mut right) = (Normal::zeros(), Vector::zeros());
        let mut row = [0.0; PARAMETERS];
        for n in self.range.clone() {
            let mut left = self.x[n];
            for (part, row) in parts.iter().zip(row.chunks_exact_mut(3)) {
                let at = self.family.at(n as f64 - part.time, part.surface);
                left -= part.height * at.value;
                row.copy_from_slice(&[at.value, -part.height * at.slope, part.height * at.growth]);
            }
            for i in 0..3 * parts.len() {
                right[i] += row[i] * left;
                for j in 0..=i {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
        (normal, right)
    }
}
