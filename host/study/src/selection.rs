//! Selection of cells, in the order in which they are run.

use clap::{Args, ValueEnum};

use super::axes::{Ablation, ByHand, Scene, TableMethod};
use super::cell::Cell;
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};

/// Values selected along each axis of the table; none selects all. Also flags of a command.
#[derive(Clone, Debug, Default, Args)]
pub struct Selection {
    /// Only these methods.
    #[arg(long, value_delimiter = ',')]
    pub method: Vec<TableMethod>,
    /// Only these kinds of country.
    #[arg(long, value_delimiter = ',')]
    pub scene: Vec<Scene>,
    /// Only these protocols: what is tuned.
    #[arg(long, value_delimiter = ',')]
    pub protocol: Vec<Protocol>,
    /// Only these ranges and defaults of registration.
    #[arg(long, value_delimiter = ',')]
    pub ranges: Vec<Preset>,
    /// Only these ways to search.
    #[arg(long, value_delimiter = ',')]
    pub strategy: Vec<Strategy>,
    /// Switch one thing, or one after the other, for a second table; by default with our search and
    /// ranges for outdoors.
    #[arg(long, value_delimiter = ',')]
    pub ablation: Vec<Ablation>,
    /// Also three cases tuned by hand, as in the paper's Fig. 1, of ICP.
    #[arg(long, conflicts_with = "ablation")]
    pub by_hand: bool,
}

impl Selection {
    /// Cells in the order they are run: first untuned ones, as their times predict the others';
    /// then searches, ours with ranges for outdoors before the paper's.
    pub fn cells(&self) -> Vec<Cell> {
        let ablations: Vec<Option<Ablation>> = match &*self.ablation {
            [] => vec![None],
            some => some.iter().copied().map(Some).collect(),
        };
        let (untuned, tuned): (Vec<Protocol>, Vec<Protocol>) =
            chosen(&self.protocol).into_iter().partition(|protocol| *protocol == Protocol::Default);
        let mut cells = Vec::new();
        for &ablation in &ablations {
            cells.extend(self.product(ablation, None, &untuned));
        }
        if self.by_hand {
            cells.extend(self.set_by_hand());
        }
        for ablation in ablations {
            for strategy in chosen(&self.strategy) {
                cells.extend(self.product(ablation, Some(strategy), &tuned));
            }
        }
        cells
    }

    /// The cases tuned by hand, with the ranges and scenes selected.
    pub fn set_by_hand(&self) -> Vec<Cell> {
        let of_method = Self { method: vec![ByHand::METHOD], ..self.clone() };
        let starts = of_method.product(None, None, &[Protocol::Default]);
        let all = ByHand::value_variants();
        let by_hand = |cell| all.iter().map(move |&hand| Cell { by_hand: Some(hand), ..cell });
        starts.into_iter().flat_map(by_hand).collect()
    }

    /// A cell for each range, scene, method and protocol.
    fn product(
        &self,
        ablation: Option<Ablation>,
        strategy: Option<Strategy>,
        protocols: &[Protocol],
    ) -> Vec<Cell> {
        let mut cells = Vec::new();
        for ranges in chosen(&self.ranges) {
            for scene in chosen(&self.scene) {
                for method in chosen(&self.method) {
                    let start = Cell { ablation, strategy, ..Cell::start(ranges, method, scene) };
                    cells.extend(protocols.iter().map(|&protocol| Cell { protocol, ..start }));
                }
            }
        }
        cells
    }
}

/// The values selected, or all, each once.
fn chosen<T: ValueEnum + Clone + PartialEq>(some: &[T]) -> Vec<T> {
    let is_wanted = |value: &&T| some.is_empty() || some.contains(value);
    T::value_variants().iter().filter(is_wanted).cloned().collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::cell::Base;
    use super::*;
    use echoloop_closed_loop::parameters::Parameters;

    #[test]
    fn the_whole_table_has_each_cell_once_and_an_untuned_one_a_method_scene_and_range() {
        let cells = Selection::default().cells();
        let names: BTreeSet<String> = cells.iter().map(Cell::file_name).collect();
        assert_eq!((cells.len(), names.len()), (168, 168)); // 24 starts, 3 · 2 · 24 searches
        let untuned = cells.iter().take_while(|cell| cell.protocol == Protocol::Default).count();
        assert_eq!(untuned, 24);
        assert!(cells[24..].iter().all(|cell| cell.strategy.is_some()));
    }

    #[test]
    fn every_case_tuned_by_hand_has_valid_settings_of_its_own_in_both_ranges() {
        let base = Base::paper(Vec::new());
        let selection = Selection { by_hand: true, ..Selection::default() };
        let cells: Vec<Cell> =
            selection.cells().into_iter().filter(|cell| cell.by_hand.is_some()).collect();
        assert_eq!(cells.len(), 18); // 3 cases, 3 kinds, 2 ranges
        let mut seen = Vec::new();
        for cell in cells {
            let config = cell.config(&base).unwrap();
            let start = Parameters::start(&config, &config.device()).unwrap();
            let untuned = cell.untuned();
            assert!(untuned.is_of_the_table() && !cell.is_of_the_table());
            let usual = untuned.config(&base).unwrap();
            let usual = Parameters::start(&usual, &usual.device()).unwrap();
            assert!(start != usual && !seen.contains(&(start, cell.scene)), "{cell}");
            seen.push((start, cell.scene));
        }
    }
}
