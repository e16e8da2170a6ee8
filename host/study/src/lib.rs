//! The paper's Table 1: its cells, the folder that keeps them, the table and its page.
//!
//! 1. [`Asked::cells`] says which cells there are; [`Cell::config`] what a cell is a run of.
//! 2. [`Folder`] keeps a [`Record`] for each cell that is done, and says where its search goes on.
//! 3. [`Table::new`] puts records beside the paper's numbers, with intervals and verdicts.
//! 4. [`figures()`] draws the paper's figures from the same records, and from the runs of searches.
//! 5. [`page`] is both to look at.
//! 6. [`judge_real`] takes what was tuned to clouds that nobody simulated.
//!
//! Nothing here scans: the command line runs the cells.

mod ablation;
mod axes;
mod by_hand;
mod cell;
mod estimate;
mod figures;
mod folder;
mod page;
mod paired;
mod paper;
mod plan;
mod real;
mod record;
mod selection;
mod table;
mod wording;

pub use ablation::Ablation;
pub use axes::{Scene, TableMethod, name_of};
pub use by_hand::ByHand;
pub use cell::{Base, Cell, tuned, tuned_by};
pub use estimate::{Times, Took};
pub use figures::{Cells, Figures, LaidOn, Search, Seen, SeenPair, figures, shown_pair};
pub use folder::{Folder, FolderError};
pub use page::page;
pub use paired::Paired;
pub use paper::{PaperFigures, paper};
pub use plan::Plan;
pub use plan::configuration;
pub use real::{RealError, RealPair, RealRow, judge_real, read_real_pairs, real_lines};
pub use record::{Record, TrainedIn};
pub use selection::Asked;
pub use table::{Made, Row, Table, Verdict};
pub use wording::{FIGURES, Figure, absent, remarks, search, subtitle};
