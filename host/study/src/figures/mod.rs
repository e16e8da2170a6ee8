//! The paper's figures, from the cells of a folder.
//!
//! 1. [`Cells::read`] reads the records of finished cells and the runs of their searches.
//! 2. Each figure is a file here. It takes its data from [`Cells`]; of missing data it names the
//!    command that makes it.
//! 3. [`figures()`] puts them in the paper's order, for each search in the table.
//!
//! Nothing here scans: clouds come from `echoloop reproduce`, which has a sensor.

mod by_hand;
mod cells;
mod chance;
mod errors;
mod interactions;
mod missing;
mod overlays;
mod parameters;
mod search;

pub use cells::Cells;
pub use overlays::{LaidOn, Seen, SeenPair, shown_pair};
pub use search::Search;

use echoloop_report::Plate;

/// Figures, and those that could not be drawn.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// In the paper's order.
    pub plates: Vec<Plate>,
    /// For each figure left out, the reason and the command that runs its cells.
    pub left_out: Vec<String>,
}

/// Figures of a kind; for one left out, the reason and the command that runs its cells.
type Drawn = Vec<Result<Plate, String>>;

/// All figures of a table, with the pairs that were scanned again.
pub fn figures(cells: &Cells, seen: &Seen) -> Figures {
    let mut all = Figures { left_out: cells.unread.clone(), ..Figures::default() };
    for search in &cells.searches {
        let drawn = [
            by_hand::plates(cells, search),
            interactions::plates(cells, search),
            errors::plates(cells, search),
            overlays::plates(cells, search, seen),
            parameters::plates(cells, search),
        ];
        for figure in drawn.into_iter().flatten() {
            match figure {
                Ok(plate) => all.plates.push(plate),
                Err(why) => all.left_out.push(why),
            }
        }
    }
    all
}
