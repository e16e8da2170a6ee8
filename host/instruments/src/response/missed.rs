//! Echoes without a top of their own: on the flank of a stronger one, or lowered by its undershoot.

use super::curve::FLAT;
use super::explain::{Candidate, State, Work};
use super::fit::{Part, samples};

/// Distance from an echo, widths of the response, within which the residual is searched: farther
/// away an echo has its top.
const REACH: f64 = 4.0;

/// Least distance from an echo, over the mean of its width and the response's, in a recording of
/// flat targets and in one of deep ones, whose lobes may have any shape.
const APART: f64 = 0.8;
const APART_OF_DEEP: f64 = 1.8;

/// Greatest width, widths of the response, of an echo nearer than [`APART_OF_WIDE`]: the far side
/// of a skewed surface, as of a crown, leaves something wider.
const NARROW: f64 = 1.12;

/// Least distance of a wider echo from any other, over the mean of their widths.
const APART_OF_WIDE: f64 = 1.3;

/// Places of a record that are tried.
const TRIES: usize = 8;

/// An echo without a top.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Missed {
    /// Time and width in samples, height in codes.
    pub(crate) echo: Candidate,
    /// Height over its noise.
    pub(crate) snr: f64,
}

impl Work<'_> {
    /// Adds echoes where the residual, through a matched filter, is clear of noise and of the other
    /// echoes, and which stay by the test of a top. Returns them.
    pub(super) fn add_missed(&mut self) -> Vec<Missed> {
        let tops = self.states.len();
        let mut tried: Vec<f64> = Vec::new();
        for _ in 0..TRIES {
            let Some(part) = self.highest_left(&tried) else { break };
            tried.push(part.time);
            let (residual, states) = (self.residual.clone(), self.states.clone());
            let width = self.response.width();
            self.candidates.push(Candidate { time: part.time, height: part.height, width });
            self.states.push(State { part: Part::NONE, stays: false, grew: false });
            let index = self.states.len() - 1;
            self.put(index, part);
            self.decide(index);
            if !(self.states[index].stays && self.is_narrow_or_alone(index)) {
                (self.residual, self.states) = (residual, states);
                self.candidates.pop();
            }
        }
        let added = self.states[tops..].iter();
        let missed = |state: &State| Missed {
            echo: self.candidate(state.part),
            snr: state.part.height / self.height_noise,
        };
        added.map(missed).collect()
    }

    /// The highest place of the residual that may be an echo, and was not tried.
    fn highest_left(&self, tried: &[f64]) -> Option<Part> {
        let width = self.response.width();
        let taps = self.response.taps();
        let half = taps.len() / 2;
        let mut best: Option<Part> = None;
        for beside in self.staying() {
            let near = beside.time - REACH * width..beside.time + REACH * width;
            for n in samples(near, self.residual.len()) {
                let Some(piece) =
                    n.checked_sub(half).and_then(|from| self.residual.get(from..from + taps.len()))
                else {
                    continue;
                };
                let height = piece.iter().zip(&taps).map(|(x, tap)| x * tap).sum::<f64>()
                    / self.response.energy();
                if best.is_some_and(|best| best.height >= height) || height <= 0.0 {
                    continue;
                }
                let part = Part { height, time: n as f64, surface: FLAT };
                let is_new = tried.iter().all(|time| (time - part.time).abs() >= width / 2.0);
                if is_new && self.is_apart(&part) && self.is_clear(&part, &[]) {
                    best = Some(part);
                }
            }
        }
        best
    }

    fn staying(&self) -> impl Iterator<Item = Part> + '_ {
        self.states.iter().filter(|state| state.stays).map(|state| state.part)
    }

    fn is_apart(&self, part: &Part) -> bool {
        let least = if self.response.splits_lobes() { APART } else { APART_OF_DEEP };
        self.staying().all(|other| self.apart(part, &other) >= least)
    }

    /// True when an echo is narrow, or no other is near.
    fn is_narrow_or_alone(&self, index: usize) -> bool {
        let own = self.states[index].part;
        let width = self.response.family.width(own.surface);
        width <= NARROW * self.response.width()
            || self.others(index).all(|i| self.apart(&own, &self.states[i].part) >= APART_OF_WIDE)
    }

    /// Distance of two echoes over the mean of their widths.
    fn apart(&self, a: &Part, b: &Part) -> f64 {
        let width =
            |part: &Part| self.response.family.width(part.surface).max(self.response.width());
        (a.time - b.time).abs() / ((width(a) + width(b)) / 2.0)
    }
}
