//! Cells of the table, and the configuration of each.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::axes::{Ablation, ByHand, PLAN, Scene, TableMethod, name_of};
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};
use echoloop_closed_loop::config::{LoadError, Override, RunConfig, load};

/// A cell of the table: method, scene, what is tuned, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// The one thing switched; none in the paper's table.
    pub ablation: Option<Ablation>,
    /// Case of settings tuned by hand; none elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_hand: Option<ByHand>,
    /// Ranges and defaults of registration.
    pub ranges: Preset,
    /// Search strategy; none where nothing is tuned.
    pub strategy: Option<Strategy>,
    /// Protocol: what is tuned.
    pub protocol: Protocol,
    /// The method.
    pub method: TableMethod,
    /// Kind of scene.
    pub scene: Scene,
}

/// Settings that all cells have in common.
#[derive(Clone, Debug, Default)]
pub struct Base {
    /// Changes of the default configuration.
    pub overrides: Vec<Override>,
}

/// Axes of the plan whose flags of the same name select cells.
const AXES: [&str; 5] = ["scene", "method", "ranges", "strategy", "protocol"];

impl Base {
    /// Evaluation as in the paper's Sec. 4.1, a search that minimises the error, then the changes.
    /// The strategy sets the number of training pairs, ten in the paper's.
    pub fn paper(changes: Vec<Override>) -> Self {
        let beams = Override::flag("scanner.pattern", "grid"); // ±90°, the paper's
        let pairs = Override::flag("data.test_pairs", 100_i64);
        let objective = Override::flag("tune.objective", "error");
        let refine = Override::flag("registration.refine", false); // the methods by themselves
        let own = [beams, pairs, objective, refine];
        Self { overrides: own.into_iter().chain(changes).collect() }
    }

    /// [`Self::paper`] without changes, or with those of [`Self::quick`].
    pub fn usual(quick: bool) -> Self {
        Self::paper(if quick { Self::quick() } else { Vec::new() })
    }

    /// Changes for the small table.
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

    /// A key set here that cells set themselves, and the axis whose flag to use instead.
    pub fn sets_an_axis(&self) -> Option<(&'static str, &'static str)> {
        let is_set = |key: &&str| self.overrides.iter().any(|set| set.path() == **key);
        AXES.into_iter().find_map(|axis| Some((PLAN.keys(axis).find(is_set)?, axis)))
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
        // The settings of a case depend on the ranges too.
        let by_hand = self.by_hand.map(|hand| hand.settings(self.ranges)).unwrap_or_default();
        for text in PLAN.settings(&self.values()).into_iter().chain(by_hand) {
            let setting = text.parse();
            overrides.push(setting.map_err(|message| LoadError::Override { text, message })?);
        }
        if let Some(ablation) = self.ablation {
            overrides.extend(ablation.beams(&base.config()?));
        }
        load(None, &overrides)
    }

    /// The cell's values along the plan's axes, which have the names of its fields.
    fn values(&self) -> echoloop_campaign::Cell {
        serde_json::to_value(self).and_then(serde_json::from_value).unwrap_or_default()
    }

    /// The untuned cell of a method in a scene.
    pub fn start(ranges: Preset, method: TableMethod, scene: Scene) -> Self {
        let (ablation, by_hand, strategy, protocol) = (None, None, None, Protocol::Default);
        Self { ablation, by_hand, ranges, strategy, protocol, method, scene }
    }

    /// The same cell, tuned by a search.
    pub fn searched(self, strategy: Strategy, protocol: Protocol) -> Self {
        Self { strategy: Some(strategy), protocol, ..self }
    }

    /// The untuned cell with the same start.
    pub fn untuned(&self) -> Self {
        Self { strategy: None, protocol: Protocol::Default, by_hand: None, ..*self }
    }

    /// True when something is searched.
    pub fn is_searched(&self) -> bool {
        self.protocol != Protocol::Default
    }

    /// The cells that joint tuning is compared with: nothing tuned, and each half alone.
    pub fn others(&self) -> [Self; 3] {
        let [lidar, registration] = self.halves();
        [self.untuned(), lidar, registration]
    }

    /// The same cell with one half tuned alone: the LiDAR, then registration.
    pub fn halves(&self) -> [Self; 2] {
        [Protocol::Lidar, Protocol::Registration].map(|protocol| Self { protocol, ..*self })
    }

    /// True when sensor and registration are tuned together.
    pub fn is_joint(&self) -> bool {
        self.protocol == Protocol::Joint
    }

    /// True for a cell of the paper's table: nothing switched, nothing set by hand.
    pub fn is_of_the_table(&self) -> bool {
        self.ablation.is_none() && self.by_hand.is_none()
    }

    /// Configuration of the training pairs, where they come from other towns or another kind of
    /// scene. `config` is the cell's own.
    pub fn trained_in(&self, config: &RunConfig) -> Option<RunConfig> {
        let switch = self.ablation.filter(|_| self.is_searched())?;
        switch.trained_in(config, self.scene)
    }

    /// The cell without its switch.
    pub fn plain(&self) -> Self {
        Self { ablation: None, ..*self }
    }

    /// Name of what was tuned: the protocol, or the case tuned by hand.
    pub fn tuned_name(&self) -> String {
        self.by_hand
            .map_or_else(|| name_of(self.protocol), |hand| format!("hand-{}", name_of(hand)))
    }

    /// Name of the cell's files: `outdoor-fast-joint-icp-structured`.
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

/// Name of the tuned parameters, for tables.
pub fn tuned(cell: &Cell) -> &'static str {
    match cell.protocol {
        Protocol::Default => "default",
        Protocol::Lidar => "LiDAR",
        Protocol::Registration => "registration",
        Protocol::Joint => "joint",
    }
}

/// Name of the tuned parameters, with the search where it is the paper's.
pub fn tuned_by(cell: &Cell) -> String {
    match (cell.by_hand, cell.strategy) {
        (Some(_), _) => "by hand".into(),
        (None, Some(Strategy::Paper)) => format!("{}, paper's search", tuned(cell)),
        (None, _) => tuned(cell).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::fixture::start;
    use super::*;
    use echoloop_closed_loop::config::{FgrMode, Method};

    #[test]
    fn a_cell_s_configuration_has_the_pairs_and_bounds_of_its_method() {
        let base = Base::default();
        let start = |method| Cell { ranges: Preset::Paper, ..start(method, "semi-structured") };
        let cell = start("fgr-open3d").searched(Strategy::Paper, Protocol::Lidar);
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
        let icp = Cell { method: start("icp").method, ..cell }.config(&base).unwrap();
        assert_eq!((icp.data.baseline_m, icp.data.success_translation_m), (2.0, 0.5));
        assert_eq!((config.data.train_pairs, icp.data.train_pairs), (10, 10));
        let fast = |method| {
            let cell =
                Cell { strategy: Some(Strategy::Fast), method: start(method).method, ..cell };
            cell.config(&base).unwrap().data.train_pairs
        };
        assert_eq!((fast("icp"), fast("mac")), (30, 100));
    }
}
