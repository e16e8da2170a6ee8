//! A search of the table, and its cells.

use super::super::axes::{Scene, TableMethod, distinct, name_of};
use super::super::cell::Cell;
use super::super::wording;
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};

/// The cells of one range and strategy, with those where nothing is tuned.
#[derive(Clone, Debug)]
pub struct Search {
    /// Ranges of registration.
    pub ranges: Preset,
    /// Search strategy; none where nothing is searched.
    pub strategy: Option<Strategy>,
    /// Its cells.
    pub cells: Vec<Cell>,
}

impl Search {
    /// Name in files: `outdoor-fast`.
    pub(super) fn name(&self) -> String {
        let strategy = self.strategy.map(name_of);
        [Some(name_of(self.ranges)), strategy].into_iter().flatten().collect::<Vec<_>>().join("-")
    }

    /// The search in words.
    pub(super) fn in_words(&self) -> String {
        wording::search(self.ranges, self.strategy)
    }

    /// Methods of its cells, each once.
    pub(super) fn methods(&self) -> Vec<TableMethod> {
        distinct(self.cells.iter().map(|cell| cell.method))
    }

    /// Scenes of its cells, each once.
    pub(super) fn scenes(&self) -> Vec<Scene> {
        distinct(self.cells.iter().map(|cell| cell.scene))
    }

    /// Its cells of a method and scene.
    pub(super) fn of(
        &self,
        method: TableMethod,
        scene: Scene,
    ) -> impl Iterator<Item = &Cell> + use<'_> {
        self.cells.iter().filter(move |cell| (cell.method, cell.scene) == (method, scene))
    }

    /// Its cells of a method where both are tuned.
    pub(super) fn joint(&self, method: TableMethod) -> Vec<Cell> {
        let is_joint = |cell: &&Cell| (cell.method, cell.protocol) == (method, Protocol::Joint);
        self.cells.iter().filter(is_joint).copied().collect()
    }
}
