//! The cells of the table, and what each is a run of.

use std::fmt;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::ablation::Ablation;
use super::axes::{Scene, TableMethod, name_of};
use crate::experiment::config::{LoadError, Override, RunConfig, load};
use crate::experiment::preset::{Preset, Protocol, Strategy};

/// One figure of the table: what was tuned, of which method, where, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// What is switched; nothing in the first table.
    pub ablation: Option<Ablation>,
    /// Ranges and defaults of registration.
    pub ranges: Preset,
    /// How it is searched; none where nothing is tuned.
    pub strategy: Option<Strategy>,
    /// What is tuned.
    pub protocol: Protocol,
    /// The method.
    pub method: TableMethod,
    /// Where.
    pub scene: Scene,
}

/// What all cells have in common.
#[derive(Clone, Debug, Default)]
pub struct Base {
    /// What is laid over the defaults.
    pub overrides: Vec<Override>,
}

/// Keys that the cells themselves set, and the flag that restricts each.
pub(super) const AXES: [(&str, &str); 6] = [
    ("scene.source", "--scene"),
    ("registration.method", "--method"),
    ("registration.mode", "--method"),
    ("registration.preset", "--ranges"),
    ("tune.strategy", "--strategy"),
    ("tune.protocol", "--protocol"),
];

impl Base {
    /// Judged as in the paper's Sec. 4.1, for the lowest error; later changes win. How many pairs
    /// are tuned on is the strategy's, of the paper's ten.
    pub fn paper(changes: Vec<Override>) -> Self {
        let pairs = Override::flag("data.test_pairs", 100_i64);
        let objective = Override::flag("tune.objective", "error");
        Self { overrides: [pairs, objective].into_iter().chain(changes).collect() }
    }

    /// The configuration that cells vary.
    ///
    /// # Errors
    ///
    /// [`LoadError`].
    pub fn config(&self) -> Result<RunConfig, LoadError> {
        load(None, &self.overrides)
    }

    /// A key that it sets though cells do, and the flag for it.
    pub fn sets_an_axis(&self) -> Option<(&'static str, &'static str)> {
        AXES.into_iter().find(|(key, _)| self.overrides.iter().any(|set| set.path() == *key))
    }
}

impl Cell {
    /// The configuration of the cell's run.
    ///
    /// # Errors
    ///
    /// [`LoadError`].
    pub fn config(&self, base: &Base) -> Result<RunConfig, LoadError> {
        let mut overrides = base.overrides.clone();
        overrides.extend(self.method.overrides());
        overrides.extend(
            [
                ("scene.source", name_of(self.scene)),
                ("registration.preset", name_of(self.ranges)),
                ("tune.protocol", name_of(self.protocol)),
            ]
            .map(|(key, name)| Override::flag(key, name)),
        );
        let strategy = self.strategy.map(name_of);
        overrides.extend(strategy.map(|name| Override::flag("tune.strategy", name)));
        if let Some(ablation) = self.ablation {
            overrides.extend(ablation.overrides(&base.config()?));
        }
        load(None, &overrides)
    }

    /// The cell of the same start where nothing is tuned.
    pub fn untuned(&self) -> Self {
        Self { strategy: None, protocol: Protocol::Default, ..*self }
    }

    /// The cell without its switch.
    pub fn plain(&self) -> Self {
        Self { ablation: None, ..*self }
    }

    /// What files of the cell are called: `outdoor-fast-joint-icp-structured`.
    pub fn file_name(&self) -> String {
        let parts = [
            self.ablation.map(name_of),
            Some(name_of(self.ranges)),
            self.strategy.map(name_of),
            Some(name_of(self.protocol)),
            Some(name_of(self.method)),
            Some(name_of(self.scene)),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join("-")
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { ablation, ranges, strategy, protocol, method, scene } = *self;
        let tuned = match protocol {
            Protocol::Default => "nothing tuned",
            Protocol::Lidar => "lidar tuned",
            Protocol::Registration => "registration tuned",
            Protocol::Joint => "both tuned",
        };
        write!(f, "{}, {}, {tuned}, {} ranges", method.title(), name_of(scene), name_of(ranges))?;
        strategy.map_or(Ok(()), |strategy| write!(f, ", {} strategy", name_of(strategy)))?;
        ablation.map_or(Ok(()), |ablation| write!(f, ", {}", name_of(ablation)))
    }
}

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
        let tuned: Vec<Protocol> =
            protocols.into_iter().filter(|protocol| *protocol != Protocol::Default).collect();
        for ablation in all {
            for strategy in chosen(&self.strategies) {
                self.fill(&mut cells, ablation, Some(strategy), &tuned);
            }
        }
        cells
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

    use super::*;
    use crate::experiment::config::{FgrMode, Method};

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
    fn a_cell_is_a_run_of_its_method_s_pairs_and_bounds() {
        let base = Base::default();
        let cell = Cell {
            ablation: None,
            ranges: Preset::Paper,
            strategy: Some(Strategy::Paper),
            protocol: Protocol::Lidar,
            method: TableMethod::FgrOpen3d,
            scene: Scene::SemiStructured,
        };
        let config = cell.config(&base).unwrap();
        assert_eq!(config.registration.method, Method::Fgr);
        assert_eq!(config.registration.mode, FgrMode::Open3d);
        assert_eq!((config.data.baseline_m, config.data.success_rotation_deg), (5.0, 5.0));
        assert_eq!(config.data.train_baseline_factor, 1.0);
        assert_eq!(config.scene.source, "semi-structured");
        assert_eq!(
            (config.tune.strategy, config.tune.protocol),
            (Strategy::Paper, Protocol::Lidar)
        );
        let icp = Cell { method: TableMethod::Icp, ..cell }.config(&base).unwrap();
        assert_eq!((icp.data.baseline_m, icp.data.success_translation_m), (2.0, 0.5));
        assert_eq!((config.data.train_pairs, icp.data.train_pairs), (10, 10));
        let fast = |method| {
            let cell = Cell { strategy: Some(Strategy::Fast), method, ..cell };
            cell.config(&base).unwrap().data.train_pairs
        };
        assert_eq!((fast(TableMethod::Icp), fast(TableMethod::Mac)), (30, 100));
    }

    #[test]
    fn every_ablation_gives_a_configuration_and_changes_it_or_where_it_is_trained() {
        let base = Base::default();
        let plain = Cell {
            ablation: None,
            ranges: Preset::Outdoor,
            strategy: Some(Strategy::Fast),
            protocol: Protocol::Joint,
            method: TableMethod::Icp,
            scene: Scene::Unstructured,
        };
        let usual = plain.config(&base).unwrap();
        for &ablation in Ablation::value_variants() {
            let cell = Cell { ablation: Some(ablation), ..plain };
            let config = cell.config(&base).unwrap();
            let trained_in = ablation.trained_in(&config, cell.scene);
            assert!(config != usual || trained_in.is_some(), "{ablation:?} switches nothing");
            assert_eq!(cell.plain(), plain);
        }
        let other = Ablation::OtherKind.trained_in(&usual, plain.scene).unwrap();
        assert_eq!(other.scene.source, "structured");
    }
}
