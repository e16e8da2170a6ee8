//! The table: records beside the paper's numbers, with intervals, and verdicts on joint tuning.

use serde::Serialize;

use super::axes::distinct;
use super::cell::Cell;
use super::folder::{Folder, FolderError};
use super::folder_plan::FolderPlan;
use super::paired::{Paired, paired};
use super::paper::{PaperFigures, paper};
use super::real::RealRow;
use super::record::{Record, TrainedIn};
use echoloop_closed_loop::config::preset::{Preset, Strategy};
use echoloop_closed_loop::dataset::fingerprint::Content;
use echoloop_closed_loop::evaluation::gain::{Estimate, Figures};
use echoloop_closed_loop::parameters::{Values, written_values};

/// The table of a folder's cells. It has no times and no paths, so equal cells give equal tables.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Version of this format.
    pub format: u32,
    /// Settings that all cells share.
    pub plan: FolderPlan,
    /// The cells, in the order they are run.
    pub rows: Vec<Row>,
    /// Verdict on joint tuning, for each method, scene, range and strategy.
    pub joint: Vec<Verdict>,
    /// Joint tuning compared with each other protocol, on the pairs that both find.
    pub paired: Vec<Paired>,
    /// Tuned settings on real clouds; empty where none were given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub real: Vec<RealRow>,
}

/// A cell of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The cell.
    pub cell: Cell,
    /// The paper's figures; none of a cell that the paper does not have.
    pub paper: Option<PaperFigures>,
    /// Our figures with 95 % intervals; none of an unfinished cell.
    pub figures: Option<Figures<Estimate>>,
    /// Origin of the figures.
    pub made: Option<Made>,
    /// Reason of a failure.
    pub error: Option<String>,
}

/// Origin of a cell's figures.
#[derive(Clone, Debug, Serialize)]
pub struct Made {
    /// Checksum of its configuration.
    pub configuration: String,
    /// Scene and towns of the training pairs, where the held-out pairs are of others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trained_in: Option<TrainedIn>,
    /// Checksums of the scene, the front end and every scan.
    pub content: Content,
    /// Origin of the parameters.
    pub origin: String,
    /// Registrations of its search.
    pub registrations: usize,
    /// Held-out pairs.
    pub pairs: usize,
    /// The parameters.
    #[serde(serialize_with = "written_values")]
    pub parameters: Values,
}

/// Verdict on joint tuning against the other protocols of the same method, scene, range and
/// strategy: for each figure, true when joint tuning is best or its interval holds the best. `None`
/// where joint tuning or all others lack the figure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The cell of joint tuning.
    pub cell: Cell,
    /// Verdict on recall.
    pub recall: Option<bool>,
    /// Verdict on the mean translation error over successes.
    pub translation: Option<bool>,
    /// Verdict on the mean rotation error over successes.
    pub rotation: Option<bool>,
}

impl Verdict {
    /// True when the verdict is true for every figure that is known; none without recall.
    pub fn holds(&self) -> Option<bool> {
        let all = [self.recall, self.translation, self.rotation];
        self.recall.map(|_| all.into_iter().flatten().all(|holds| holds))
    }
}

impl Table {
    /// Table of some cells of a folder.
    ///
    /// # Errors
    ///
    /// [`FolderError`] when the reason of a failed cell cannot be read.
    pub fn new(folder: &Folder, cells: &[Cell]) -> Result<Self, FolderError> {
        // A record that cannot be used fails its own cell and no other.
        let records: Vec<Result<Option<Record>, FolderError>> =
            cells.iter().map(|cell| folder.record(cell)).collect();
        let paired = paired(&records.iter().flatten().flatten().collect::<Vec<_>>());
        let rows = cells.iter().zip(records).map(|(cell, record)| row(folder, cell, record));
        let rows = rows.collect::<Result<Vec<_>, _>>()?;
        let joint = cells.iter().filter(|cell| cell.is_joint());
        let joint = joint.map(|cell| verdict(cell, &rows)).collect();
        Ok(Self { format: 1, plan: folder.plan.clone(), rows, joint, paired, real: Vec::new() })
    }

    /// Row of a cell.
    pub fn row(&self, cell: &Cell) -> Option<&Row> {
        self.rows.iter().find(|row| row.cell == *cell)
    }

    /// Cells that failed, with the reason.
    pub fn failed(&self) -> impl Iterator<Item = (&Cell, &str)> {
        self.rows.iter().filter_map(|row| Some((&row.cell, row.error.as_deref()?)))
    }

    /// Number of cells neither finished nor failed.
    pub fn missing(&self) -> usize {
        self.rows.iter().filter(|row| row.figures.is_none() && row.error.is_none()).count()
    }

    /// Distinct ranges and strategies of the searches without an ablation.
    pub fn searches(&self) -> Vec<(Preset, Option<Strategy>)> {
        let plain = || self.rows.iter().map(|row| row.cell).filter(Cell::is_of_the_table);
        let has_searches = plain().any(|cell| cell.strategy.is_some());
        let searches = plain().filter(|cell| cell.strategy.is_some() || !has_searches);
        distinct(searches.map(|cell| (cell.ranges, cell.strategy)))
    }

    /// Rows of a search and its start, by method, then scene.
    pub fn of_search(&self, ranges: Preset, strategy: Option<Strategy>) -> Vec<&Row> {
        let is_of = |cell: &Cell| {
            let same = cell.strategy == strategy || cell.strategy.is_none();
            cell.is_of_the_table() && cell.ranges == ranges && same
        };
        let place = |cell: &Cell| (cell.method, cell.scene, cell.protocol as usize);
        self.sorted(is_of, place)
    }

    /// Rows of the cells that `is_of` selects, sorted by a key.
    pub(super) fn sorted<K: Ord>(
        &self,
        is_of: impl Fn(&Cell) -> bool,
        key: impl Fn(&Cell) -> K,
    ) -> Vec<&Row> {
        let mut rows: Vec<&Row> = self.rows.iter().filter(|row| is_of(&row.cell)).collect();
        rows.sort_by_key(|row| key(&row.cell));
        rows
    }
}

fn row(
    folder: &Folder,
    cell: &Cell,
    record: Result<Option<Record>, FolderError>,
) -> Result<Row, FolderError> {
    let (record, error) = match record {
        Ok(None) => (None, folder.failure(cell)?),
        Ok(record) => (record, None),
        Err(error) => (None, Some(error.to_string())),
    };
    Ok(Row {
        cell: *cell,
        paper: cell.is_of_the_table().then(|| paper(cell.protocol, cell.method, cell.scene)),
        figures: record.as_ref().map(|record| Figures::of(&record.summary, &record.data)),
        made: record.map(made),
        error,
    })
}

fn made(record: Record) -> Made {
    Made {
        configuration: record.configuration,
        trained_in: record.trained_in,
        content: record.content,
        origin: record.origin,
        registrations: record.registrations,
        pairs: record.summary.pairs,
        parameters: record.parameters,
    }
}

fn verdict(cell: &Cell, rows: &[Row]) -> Verdict {
    let figures = |cell: &Cell| rows.iter().find(|row| row.cell == *cell)?.figures;
    let others: Vec<Figures<Estimate>> = cell.others().iter().filter_map(figures).collect();
    let of = |read: fn(&Figures<Estimate>) -> Estimate, more_is_better: bool| {
        let own = read(&figures(cell)?);
        let values = others.iter().map(|other| read(other).value).filter(|v| v.is_finite());
        let best = values.reduce(if more_is_better { f64::max } else { f64::min })?;
        own.value.is_finite().then(|| is_best_or_holds(own, best, more_is_better))
    };
    Verdict {
        cell: *cell,
        recall: of(|figures| figures.recall_pct, true),
        translation: of(|figures| figures.mean_translation_m, false),
        rotation: of(|figures| figures.mean_rotation_deg, false),
    }
}

fn is_best_or_holds(own: Estimate, best: f64, more_is_better: bool) -> bool {
    let [low, high] = own.interval;
    match more_is_better {
        true => own.value >= best || high >= best,
        false => own.value <= best || low <= best,
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::fixture::{start, summary};
    use super::*;
    use echoloop_closed_loop::config::DataConfig;
    use echoloop_closed_loop::config::preset::Protocol;

    fn row(protocol: Protocol, errors_m: &[f64]) -> Row {
        let strategy = (protocol != Protocol::Default).then_some(Strategy::Fast);
        let cell = Cell { strategy, protocol, ..start("icp", "structured") };
        let figures =
            (!errors_m.is_empty()).then(|| Figures::of(&summary(errors_m), &DataConfig::default()));
        Row { cell, paper: None, figures, made: None, error: None }
    }

    /// Verdict on joint tuning against a start and registration alone.
    fn joint(start: &[f64], registration: &[f64], joint: &[f64]) -> Verdict {
        let rows = [
            row(Protocol::Default, start),
            row(Protocol::Registration, registration),
            row(Protocol::Joint, joint),
        ];
        verdict(&rows[2].cell, &rows)
    }

    #[test]
    fn joint_tuning_is_compared_with_the_best_of_the_others_in_each_figure() {
        let spread = |middle: f64| (0..40).map(|i| middle + 0.001 * f64::from(i % 5)).collect();
        let [low, high]: [Vec<f64>; 2] = [spread(0.01), spread(0.02)];
        assert_eq!(joint(&high, &high, &low).holds(), Some(true));
        let worse = joint(&high, &low, &high);
        assert_eq!((worse.recall, worse.translation), (Some(true), Some(false)));
        assert_eq!(worse.holds(), Some(false));
        let nearly: Vec<f64> = low.iter().map(|e| e + 0.0002).collect();
        assert_eq!(joint(&high, &low, &nearly).holds(), Some(true), "its interval holds the best");
        // 30 of 40 found against 40 of 40: Wilson's interval of 75 % ends below 90 %.
        let lost: Vec<f64> = [[9.0; 10].to_vec(), low[10..].to_vec()].concat();
        assert_eq!(joint(&low, &low, &lost).recall, Some(false));
        assert_eq!(joint(&[], &[], &low).holds(), None, "nothing to compare with");
        assert_eq!(joint(&low, &low, &[]).holds(), None, "not finished");
        let none = joint(&low, &low, &[9.0; 40]);
        assert_eq!((none.recall, none.translation), (Some(false), None));
    }
}
