//! The cells of the table, and what each is a run of.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::ablation::Ablation;
use super::axes::{Scene, TableMethod, name_of};
use super::by_hand::ByHand;
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};
use echoloop_closed_loop::config::{LoadError, Override, RunConfig, load};

/// One figure of the table: what was tuned, of which method, where, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// What is switched; nothing in the first table.
    pub ablation: Option<Ablation>,
    /// By which hand it is set, where nothing is searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_hand: Option<ByHand>,
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

    /// As [`Self::paper`] without changes, or for the small table.
    pub fn usual(quick: bool) -> Self {
        Self::paper(if quick { Self::quick() } else { Vec::new() })
    }

    /// What makes the small table small.
    pub fn quick() -> Vec<Override> {
        [("data.train_pairs", 6_i64), ("data.test_pairs", 20), ("tune.generations", 2)]
            .map(|(key, count)| Override::flag(key, count))
            .to_vec()
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
        overrides.extend(self.by_hand.iter().flat_map(|hand| hand.overrides(self.ranges)));
        if let Some(ablation) = self.ablation {
            overrides.extend(ablation.overrides(&base.config()?));
        }
        load(None, &overrides)
    }

    /// The cell of the same start where nothing is tuned.
    pub fn untuned(&self) -> Self {
        Self { strategy: None, protocol: Protocol::Default, by_hand: None, ..*self }
    }

    /// Whether something is searched.
    pub fn is_searched(&self) -> bool {
        self.protocol != Protocol::Default
    }

    /// The cells that joint tuning is held to: nothing tuned, and each half alone.
    pub fn others(&self) -> [Self; 3] {
        let [lidar, registration] = self.halves();
        [self.untuned(), lidar, registration]
    }

    /// The same with each half tuned alone: the LiDAR, then registration.
    pub fn halves(&self) -> [Self; 2] {
        [Protocol::Lidar, Protocol::Registration].map(|protocol| Self { protocol, ..*self })
    }

    /// Whether sensor and registration are tuned together.
    pub fn is_joint(&self) -> bool {
        self.protocol == Protocol::Joint
    }

    /// Whether it is one of the paper's table: nothing switched, nothing set by hand.
    pub fn is_of_the_table(&self) -> bool {
        self.ablation.is_none() && self.by_hand.is_none()
    }

    /// Where its search is trained, when that is not where it is judged: a configuration whose
    /// training pairs are taken. `config` is the cell's own.
    pub fn trained_in(&self, config: &RunConfig) -> Option<RunConfig> {
        let switch = self.ablation.filter(|_| self.is_searched())?;
        switch.trained_in(config, self.scene)
    }

    /// The cell without its switch.
    pub fn plain(&self) -> Self {
        Self { ablation: None, ..*self }
    }

    /// What was tuned: the protocol's name, or the hand's.
    pub fn tuned_name(&self) -> String {
        self.by_hand
            .map_or_else(|| name_of(self.protocol), |hand| format!("hand-{}", name_of(hand)))
    }

    /// What files of the cell are called: `outdoor-fast-joint-icp-structured`.
    pub fn file_name(&self) -> String {
        let parts = [
            self.ablation.map(name_of),
            Some(name_of(self.ranges)),
            self.strategy.map(name_of),
            Some(self.tuned_name()),
            Some(name_of(self.method)),
            Some(name_of(self.scene)),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join("-")
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { ablation, by_hand, ranges, strategy, protocol, method, scene } = *self;
        let tuned = match (by_hand, protocol) {
            (Some(hand), _) => format!("tuned by hand ({})", name_of(hand)),
            (None, Protocol::Default) => "nothing tuned".into(),
            (None, Protocol::Lidar) => "lidar tuned".into(),
            (None, Protocol::Registration) => "registration tuned".into(),
            (None, Protocol::Joint) => "both tuned".into(),
        };
        write!(f, "{}, {}, {tuned}, {} ranges", method.title(), name_of(scene), name_of(ranges))?;
        strategy.map_or(Ok(()), |strategy| write!(f, ", {} strategy", name_of(strategy)))?;
        ablation.map_or(Ok(()), |ablation| write!(f, ", {}", name_of(ablation)))
    }
}

/// What was tuned, as a row's name.
pub fn tuned(cell: &Cell) -> &'static str {
    match cell.protocol {
        Protocol::Default => "default",
        Protocol::Lidar => "LiDAR",
        Protocol::Registration => "registration",
        Protocol::Joint => "joint",
    }
}

/// What was tuned, and by which search where that is not ours.
pub fn tuned_by(cell: &Cell) -> String {
    match (cell.by_hand, cell.strategy) {
        (Some(_), _) => "by hand".into(),
        (None, Some(Strategy::Paper)) => format!("{}, paper's search", tuned(cell)),
        (None, _) => tuned(cell).into(),
    }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;
    use echoloop_closed_loop::config::{FgrMode, Method};

    #[test]
    fn a_cell_is_a_run_of_its_method_s_pairs_and_bounds() {
        let base = Base::default();
        let cell = Cell {
            ablation: None,
            by_hand: None,
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
            by_hand: None,
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
            let trained_in = cell.trained_in(&config);
            assert!(config != usual || trained_in.is_some(), "{ablation:?} switches nothing");
            assert_eq!(cell.untuned().trained_in(&config), None, "it has no search");
            assert_eq!(cell.plain(), plain);
        }
        let other = Cell { ablation: Some(Ablation::OtherKind), ..plain };
        assert_eq!(other.trained_in(&usual).unwrap().scene.source, "structured");
    }
}
