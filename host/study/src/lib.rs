//! Campaigns of searches: the paper's Table 1 and its figures.
//!
//! 1. [`Selection::cells`] lists cells; [`Cell::config`] is the configuration of a cell's run.
//! 2. [`Folder`] keeps a [`Record`] of each finished cell, and the run folder of its search.
//! 3. [`Table::new`] puts records beside the paper's numbers, with intervals and verdicts.
//! 4. [`Table::sheets`] groups the rows; text, page and LaTeX are written from the sheets.
//! 5. [`figures()`] draws the paper's figures from the same records and from the searches' runs.
//! 6. [`judge_real`] evaluates the tuned settings on real clouds.
//!
//! Nothing here scans: `echoloop reproduce` runs the cells. `plan.toml` is their plan; how any
//! campaign is run: `echoloop_campaign`.

mod ablation;
mod axes;
mod cell;
mod estimate;
mod figures;
mod folder;
mod folder_plan;
mod page;
mod paired;
mod paper;
mod real;
mod record;
mod selection;
mod sheet;
mod table;
mod wording;

pub use axes::{Ablation, ByHand, Scene, TableMethod, Value, name_of};
pub use cell::{Base, Cell, tuned, tuned_by};
pub use estimate::{Times, Took};
pub use figures::{Cells, Figures, LaidOn, Search, Seen, SeenPair, figures, shown_pair};
pub use folder::{Folder, FolderError};
pub use folder_plan::{FolderPlan, configuration};
pub use page::page;
pub use paired::Paired;
pub use paper::{PaperFigures, paper};
pub use real::{RealError, RealPair, RealRow, judge_real, read_real_pairs, real_lines};
pub use record::{Record, TrainedIn};
pub use selection::Selection;
pub use sheet::{Part, Sheet};
pub use table::{Made, Row, Table, Verdict};
pub use wording::{FIGURES, Figure, absent, remarks, search, subtitle};
