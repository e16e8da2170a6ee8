//! How long the rest will take, from how long like cells took.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use echoloop_closed_loop::config::preset::Protocol;

/// How long cells took, by their files' names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Times(BTreeMap<String, Took>);

/// How long a cell took, as far as it was watched: a search that went on counts from there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Took {
    /// Which cell.
    pub cell: Cell,
    /// Seconds of the clock.
    pub seconds: f64,
    /// Registrations made in that time.
    pub registrations: usize,
}

impl Times {
    /// Adds what a cell took.
    pub fn add(&mut self, took: Took) {
        self.0.insert(took.cell.file_name(), took);
    }

    /// Seconds of all cells together.
    pub fn seconds(&self) -> f64 {
        self.0.values().map(|took| took.seconds).sum()
    }

    /// How long cells will take that have so many registrations each: as long a registration as of
    /// the cells most like it. None as long as nothing like one of them was measured.
    pub fn of(&self, cells: &[(Cell, usize)]) -> Option<Duration> {
        let each = cells.iter().map(|(cell, count)| Some(self.rate(cell)? * *count as f64));
        let seconds = each.sum::<Option<f64>>()?;
        Duration::try_from_secs_f64(seconds).ok()
    }

    /// Seconds a registration.
    fn rate(&self, cell: &Cell) -> Option<f64> {
        let plain = |other: &Cell| other.plain() == cell.plain();
        let search = |other: &Cell| {
            (other.method, other.ranges, other.protocol, other.strategy)
                == (cell.method, cell.ranges, cell.protocol, cell.strategy)
        };
        let start = |other: &Cell| {
            (other.method, other.ranges, other.protocol)
                == (cell.method, cell.ranges, Protocol::Default)
        };
        let same = |other: &Cell| (other.method, other.ranges) == (cell.method, cell.ranges);
        let alike: [&dyn Fn(&Cell) -> bool; 6] =
            [&|other| other == cell, &plain, &search, &start, &same, &|other| {
                other.method == cell.method
            }];
        alike.iter().find_map(|is_like| self.mean(is_like))
    }

    fn mean(&self, is_like: &dyn Fn(&Cell) -> bool) -> Option<f64> {
        let like = || self.0.values().filter(|took| is_like(&took.cell));
        let registrations: usize = like().map(|took| took.registrations).sum();
        let seconds: f64 = like().map(|took| took.seconds).sum();
        (registrations > 0).then(|| seconds / registrations as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::super::axes::{Scene, TableMethod};
    use super::*;
    use echoloop_closed_loop::config::preset::{Preset, Strategy};

    #[test]
    fn a_search_is_estimated_by_its_like_and_before_that_by_its_start() {
        let start = |scene| Cell {
            ablation: None,
            by_hand: None,
            ranges: Preset::Outdoor,
            strategy: None,
            protocol: Protocol::Default,
            method: TableMethod::Mac,
            scene,
        };
        let joint = |scene| Cell {
            strategy: Some(Strategy::Fast),
            protocol: Protocol::Joint,
            ..start(scene)
        };
        let mut times = Times::default();
        let left = [(joint(Scene::Structured), 100), (joint(Scene::Unstructured), 200)];
        assert_eq!(times.of(&left), None);
        times.add(Took { cell: start(Scene::Structured), seconds: 5.0, registrations: 50 });
        assert_eq!(times.of(&left), Some(Duration::from_secs(30)));
        times.add(Took { cell: joint(Scene::Structured), seconds: 2.0, registrations: 100 });
        assert_eq!(times.of(&left), Some(Duration::from_secs(6)));
        let other = [(Cell { method: TableMethod::Icp, ..joint(Scene::Structured) }, 1)];
        assert_eq!(times.of(&other), None);
        assert_eq!(times.seconds(), 7.0);
    }
}
