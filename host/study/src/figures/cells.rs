//! Data of the cells that figures are drawn from.

use super::super::cell::Cell;
use super::super::folder::Folder;
use super::super::folder_plan::FolderPlan;
use super::super::record::Record;
use super::super::selection::Selection;
use super::super::table::Table;
use super::missing::Missing;
use super::search::Search;
use echoloop_report::finished_runs::{FinishedRun, RunError};

/// Records of finished cells, and runs of their searches.
#[derive(Clone, Debug)]
pub struct Cells {
    /// Settings that the cells share.
    pub plan: FolderPlan,
    /// The searches.
    pub searches: Vec<Search>,
    /// Wording for cells that are missing.
    pub(super) missing: Missing,
    records: Vec<Record>,
    runs: Vec<(Cell, FinishedRun)>,
    /// Reason for each record and each run that cannot be used.
    pub(super) unread: Vec<String>,
}

impl Cells {
    /// Reads the cells of a table, and the cases tuned by hand that the folder has. A record that
    /// cannot be used is left out and reported.
    pub fn read(folder: &Folder, table: &Table) -> Self {
        let searches = table.searches().into_iter().map(|(ranges, strategy)| Search {
            ranges,
            strategy,
            cells: table.of_search(ranges, strategy).iter().map(|row| row.cell).collect(),
        });
        let searches: Vec<Search> = searches.collect();
        let of_table = table.rows.iter().map(|row| row.cell).filter(Cell::is_of_the_table);
        let all = of_table.chain(Selection::default().set_by_hand());
        let (mut records, mut unread) = (Vec::new(), Vec::new());
        for cell in all {
            match folder.record(&cell) {
                Ok(record) => records.extend(record),
                Err(error) => unread.push(format!("The cell {cell} cannot be used: {error}.")),
            }
        }
        let searched = records.iter().map(|record| record.cell).filter(Cell::is_searched);
        let mut runs = Vec::new();
        for cell in searched {
            match FinishedRun::read(&folder.run_of(&cell)) {
                Ok(run) => runs.push((cell, run)),
                // Removed: it is missing.
                Err(RunError::Unfinished { .. }) => {}
                Err(error) => unread.push(format!("The run of {cell} cannot be read: {error}.")),
            }
        }
        let missing = Missing::of(&folder.plan);
        Self { plan: folder.plan.clone(), searches, missing, records, runs, unread }
    }

    /// Record of a cell; none where it is not finished.
    pub fn record(&self, cell: &Cell) -> Option<&Record> {
        self.records.iter().find(|record| record.cell == *cell)
    }

    /// Cells without a record.
    pub(super) fn absent(&self, cells: &[Cell]) -> Vec<Cell> {
        cells.iter().filter(|cell| self.record(cell).is_none()).copied().collect()
    }

    /// Run of a cell's search, if its result is that of the record.
    pub fn run(&self, cell: &Cell) -> Option<&FinishedRun> {
        let record = self.record(cell)?;
        let (_, run) = self.runs.iter().find(|(of, _)| of == cell)?;
        (run.result.tuned == record.parameters).then_some(run)
    }

    /// Sentence with the number of cells drawn, the pairs of each and the seed.
    pub(super) fn sources(&self, cells: &[Cell]) -> String {
        let done: Vec<&Record> = cells.iter().filter_map(|cell| self.record(cell)).collect();
        let pairs = done.first().map_or(0, |record| record.summary.pairs);
        format!(
            "From {} of {} cells; {pairs} held-out pairs each, seed {}.",
            done.len(),
            cells.len(),
            self.plan.seed
        )
    }
}
