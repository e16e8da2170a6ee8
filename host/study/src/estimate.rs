//! Estimate of the time left, from the durations of similar cells.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use echoloop_closed_loop::config::preset::Protocol;

/// Durations of cells, by their files' names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Times(BTreeMap<String, Took>);

/// Duration of a cell; for a resumed search, since it was resumed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Took {
    /// The cell.
    pub cell: Cell,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Registrations made in that time.
    pub registrations: usize,
}

impl Times {
    /// Adds the duration of a cell.
    pub fn add(&mut self, took: Took) {
        self.0.insert(took.cell.file_name(), took);
    }

    /// Sum over all cells, s.
    pub fn seconds(&self) -> f64 {
        self.0.values().map(|took| took.seconds).sum()
    }

    /// Time that cells with these numbers of registrations will take, at the time a registration of
    /// the most similar cells measured. None while a cell has no similar one.
    pub fn of(&self, cells: &[(Cell, usize)]) -> Option<Duration> {
        let each = cells.iter().map(|(cell, count)| Some(self.rate(cell)? * *count as f64));
        let seconds = each.sum::<Option<f64>>()?;
        Duration::try_from_secs_f64(seconds).ok()
    }

    /// Seconds a registration, of the most similar cells.
    fn rate(&self, cell: &Cell) -> Option<f64> {
        let similarities = |other: &Cell| {
            let same = (other.method, other.ranges) == (cell.method, cell.ranges);
            let search = (other.protocol, other.strategy) == (cell.protocol, cell.strategy);
            [
                other == cell,
                other.plain() == cell.plain(),
                same && search,
                same && other.protocol == Protocol::Default,
                same,
                other.method == cell.method,
            ]
        };
        (0..6).find_map(|rank| self.mean(&|other| similarities(other)[rank]))
    }

    fn mean(&self, is_similar: &dyn Fn(&Cell) -> bool) -> Option<f64> {
        let similar = || self.0.values().filter(|took| is_similar(&took.cell));
        let registrations: usize = similar().map(|took| took.registrations).sum();
        let seconds: f64 = similar().map(|took| took.seconds).sum();
        (registrations > 0).then(|| seconds / registrations as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::super::axes::ByHand;
    use super::super::record::fixture::start;
    use super::*;
    use echoloop_closed_loop::config::preset::Strategy;

    #[test]
    fn a_search_is_estimated_by_its_like_and_before_that_by_its_start() {
        let start = |scene| start("mac", scene);
        let joint = |scene| start(scene).searched(Strategy::Fast, Protocol::Joint);
        let mut times = Times::default();
        let left = [(joint("structured"), 100), (joint("unstructured"), 200)];
        assert_eq!(times.of(&left), None);
        times.add(Took { cell: start("structured"), seconds: 5.0, registrations: 50 });
        assert_eq!(times.of(&left), Some(Duration::from_secs(30)));
        times.add(Took { cell: joint("structured"), seconds: 2.0, registrations: 100 });
        assert_eq!(times.of(&left), Some(Duration::from_secs(6)));
        let other = [(Cell { method: ByHand::METHOD, ..joint("structured") }, 1)];
        assert_eq!(times.of(&other), None);
        assert_eq!(times.seconds(), 7.0);
    }
}
