//! Echoes in the lobe of another: two walls less than a width and a third apart have one top.

use super::curve::FLAT;
use super::explain::Work;
use super::fit::{Fit, Part};
use super::model::Response;

/// Greatest ratio of what the fit leaves to what noise and the response's spread make, for a lobe
/// to be explained.
const EXPLAINED: f64 = 2.0;

/// The same for two echoes to explain it.
const WELL: f64 = 1.3;

/// Least gain of the fit by a hidden echo, as a height over its noise.
const LEAST_GAIN: f64 = 5.5;

/// Least distance of two echoes in one lobe, widths of the response.
const APART: f64 = 0.8;

/// Greatest width of an echo in a lobe of two, widths of the response: what is wider may be one
/// surface of any shape.
const NARROW: f64 = 1.25;

/// Least share of narrow echoes in a recording of flat targets, in which a wide lobe is of two
/// echoes. Where most targets are deep, as crowns are, it may be of one.
const FLAT_TARGETS: f64 = 0.65;

/// Least height of a hidden echo over that of the other.
const LEAST: f64 = 0.1;

/// An echo that was split in two.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Split {
    /// Index of the candidate.
    pub(crate) index: usize,
    /// Time and width in samples, height in codes; of the candidate itself and of the hidden echo.
    pub(crate) parts: [super::Candidate; 2],
}

impl Response {
    /// True when most targets are flat.
    pub(super) fn splits_lobes(&self) -> bool {
        self.narrow >= FLAT_TARGETS
    }
}

impl Work<'_> {
    /// Splits the lobes of echoes that stay, the highest first.
    ///
    /// ```text
    /// one       the echo and the nearest that reaches it, fitted;  R₁ left
    /// two       the same and another narrow echo, from where the residual is highest, and from the
    ///           lobe in two halves;  R₂ left
    /// E         Σ σ² + Σ A²·spread²                       what noise and the response may leave
    /// split     R₁ > 2·E, R₂ ≤ 1.3·E, (R₁ − R₂)/Σ h² ≥ (5.5·σ_A)², both narrow, 0.8 widths apart
    /// ```
    ///
    /// One wide surface of any shape leaves more than E with two narrow echoes, too, as long as its
    /// shape can be told at all.
    pub(super) fn split_all(&mut self, tops: usize) -> Vec<Split> {
        if !self.response.splits_lobes() {
            return Vec::new();
        }
        let mut order: Vec<usize> = (0..tops).filter(|&i| self.states[i].stays).collect();
        order.sort_by(|&a, &b| self.states[b].part.height.total_cmp(&self.states[a].part.height));
        order.into_iter().filter_map(|index| self.split(index)).collect()
    }

    fn split(&mut self, index: usize) -> Option<Split> {
        let time = self.states[index].part.time;
        let apart = |&i: &usize| (self.states[i].part.time - time).abs();
        let beside =
            self.neighbours(index).into_iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
        let own = self.taken(index);
        let other = beside.map(|i| self.taken(i));
        let found = self.two(own, other);
        let (kept, other) = match &found {
            Some(parts) => (parts[0], parts.get(2).copied()),
            None => (own, other),
        };
        if let Some((i, part)) = beside.zip(other) {
            self.put(i, part);
        }
        self.put(index, kept);
        let [first, second] = [kept, found?[1]];
        second.add(&self.response.family, -1.0, &mut self.residual);
        Some(Split { index, parts: [self.candidate(first), self.candidate(second)] })
    }

    /// The echo, a hidden one, and the other; `None` where one explains the lobe as well as noise
    /// allows, or two do not.
    fn two(&self, own: Part, other: Option<Part>) -> Option<Vec<Part>> {
        let family = &self.response.family;
        let width = self.response.width();
        let mut one: Vec<Part> = [Some(own), other].into_iter().flatten().collect();
        let range = self.range(&[own]);
        let fit = |leash| Fit { family, x: &self.residual, range: range.clone(), leash };
        let left_by_one = fit(width).run(&mut one);
        if left_by_one <= EXPLAINED * self.expected(&one, range.clone()) {
            return None;
        }
        let half = family.width(own.surface).max(width) / 2.0;
        let at = |time: f64, share: f64| Part { height: share * own.height, time, surface: FLAT };
        let highest =
            range.clone().max_by(|&a, &b| self.left(&one, a).total_cmp(&self.left(&one, b)))?;
        let starts = [
            [one[0].narrow(), at(highest as f64, 0.3)],
            [at(own.time - half, 0.7), at(own.time + half, 0.7)],
            [at(own.time, 1.0), at(own.time + width, 0.3)],
            [at(own.time, 1.0), at(own.time - width, 0.3)],
        ];
        let fitted = starts.into_iter().map(|start| {
            let mut parts: Vec<Part> = start.into_iter().chain(other).collect();
            (fit(width).run(&mut parts), parts)
        });
        let (left_by_two, mut parts) = fitted.min_by(|a, b| a.0.total_cmp(&b.0))?;
        if parts[0].height < parts[1].height {
            parts.swap(0, 1);
        }
        let is_narrow = |part: &Part| family.width(part.surface) <= NARROW * width;
        let gain = ((left_by_one - left_by_two).max(0.0) / self.response.energy()).sqrt();
        let is_split = left_by_two <= WELL * self.expected(&parts, range)
            && gain >= LEAST_GAIN * self.height_noise
            && parts[..2].iter().all(is_narrow)
            && (parts[0].time - parts[1].time).abs() >= APART * width
            && parts[1].height >= LEAST * parts[0].height;
        is_split.then_some(parts)
    }

    /// What some parts leave at a sample.
    fn left(&self, parts: &[Part], sample: usize) -> f64 {
        let at = |part: &Part| part.at(&self.response.family, sample);
        self.residual[sample] - parts.iter().map(at).sum::<f64>()
    }

    /// E of some samples.
    fn expected(&self, parts: &[Part], range: std::ops::Range<usize>) -> f64 {
        let of_parts = |n: usize| {
            let part =
                |part: &Part| (part.height * self.response.spread_at(n as f64 - part.time)).powi(2);
            parts.iter().map(part).sum::<f64>()
        };
        range.map(|n| self.noise.powi(2) + of_parts(n)).sum()
    }
}
