//! Which cells are wanted, in the order in which they are run.

use clap::ValueEnum;

use super::ablation::Ablation;
use super::axes::{Scene, TableMethod};
use super::by_hand::ByHand;
use super::cell::Cell;
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};

/// Which cells are wanted; of an axis without any all.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Methods.
    pub methods: Vec<TableMethod>,
    /// Kinds of country.
    pub scenes: Vec<Scene>,
    /// What is tuned.
    pub protocols: Vec<Protocol>,
    /// Ranges of registration.
    pub ranges: Vec<Preset>,
    /// How it is searched.
    pub strategies: Vec<Strategy>,
    /// Switches; none: the table itself.
    pub ablations: Vec<Ablation>,
    /// Those set by hand as well, of their method.
    pub by_hand: bool,
}

impl Asked {
    /// The cells in the order they are run: first those where nothing is tuned, which say how long
    /// the others will take; then searches, ours with ranges for outdoors before the paper's.
    pub fn cells(&self) -> Vec<Cell> {
        let mut all = vec![None];
        if !self.ablations.is_empty() {
            all = self.ablations.iter().copied().map(Some).collect();
        }
        let protocols = chosen(&self.protocols);
        let mut cells = Vec::new();
        for ablation in all.iter().copied().filter(|_| protocols.contains(&Protocol::Default)) {
            self.fill(&mut cells, ablation, None, &[Protocol::Default]);
        }
        cells.extend(self.by_hand.then(|| self.set_by_hand()).into_iter().flatten());
        let tuned: Vec<Protocol> =
            protocols.into_iter().filter(|protocol| *protocol != Protocol::Default).collect();
        for ablation in all {
            for strategy in chosen(&self.strategies) {
                self.fill(&mut cells, ablation, Some(strategy), &tuned);
            }
        }
        cells
    }

    /// The cells set by hand, of the ranges and kinds asked for.
    pub fn set_by_hand(&self) -> Vec<Cell> {
        let start = |(ranges, scene)| Cell {
            ablation: None,
            by_hand: None,
            ranges,
            strategy: None,
            protocol: Protocol::Default,
            method: ByHand::METHOD,
            scene,
        };
        let scenes = chosen(&self.scenes);
        let ranges = chosen(&self.ranges).into_iter();
        let places = ranges.flat_map(|ranges| scenes.iter().map(move |&scene| (ranges, scene)));
        let by = |cell: Cell| ByHand::ALL.map(|hand| Cell { by_hand: Some(hand), ..cell });
        places.map(start).flat_map(by).collect()
    }

    fn fill(
        &self,
        cells: &mut Vec<Cell>,
        ablation: Option<Ablation>,
        strategy: Option<Strategy>,
        protocols: &[Protocol],
    ) {
        for ranges in chosen(&self.ranges) {
            for scene in chosen(&self.scenes) {
                for method in chosen(&self.methods) {
                    let cell = |&protocol: &Protocol| Cell {
                        ablation,
                        by_hand: None,
                        ranges,
                        strategy,
                        protocol,
                        method,
                        scene,
                    };
                    cells.extend(protocols.iter().map(cell));
                }
            }
        }
    }
}

/// The values asked for, or all, each once.
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
    fn the_whole_table_has_each_cell_once_and_nothing_tuned_once_a_method_kind_and_range() {
        let cells = Asked::default().cells();
        let names: BTreeSet<String> = cells.iter().map(Cell::file_name).collect();
        assert_eq!((cells.len(), names.len()), (168, 168)); // 24 starts, 3 · 2 · 24 searches
        let untuned = cells.iter().take_while(|cell| cell.protocol == Protocol::Default).count();
        assert_eq!(untuned, 24);
        assert!(cells[24..].iter().all(|cell| cell.strategy.is_some()));
    }

    #[test]
    fn every_case_set_by_hand_starts_in_both_ranges_and_is_no_other_case() {
        let base = Base::default();
        let asked = Asked { by_hand: true, ..Asked::default() };
        let cells: Vec<Cell> =
            asked.cells().into_iter().filter(|cell| cell.by_hand.is_some()).collect();
        assert_eq!(cells.len(), 18); // 3 cases, 3 kinds, 2 ranges
        let mut seen = Vec::new();
        for cell in cells {
            let config = cell.config(&base).unwrap();
            let start = Parameters::start(&config, &config.hardware()).unwrap();
            let untuned = cell.untuned();
            assert!(untuned.is_of_the_table() && !cell.is_of_the_table());
            let usual = untuned.config(&base).unwrap();
            let usual = Parameters::start(&usual, &usual.hardware()).unwrap();
            assert!(start != usual && !seen.contains(&(start, cell.scene)), "{cell}");
            seen.push((start, cell.scene));
        }
    }
}
