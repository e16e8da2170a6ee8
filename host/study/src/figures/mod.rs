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
use missing::Missing;

/// Figures, and those that could not be drawn.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// In the paper's order.
    pub plates: Vec<Plate>,
    /// For each figure left out, the reason and the command that runs its cells.
    pub left_out: Vec<String>,
}

impl Figures {
    /// Adds a figure, or the reason why there is none.
    fn add(&mut self, figure: Result<Plate, String>) {
        match figure {
            Ok(plate) => self.plates.push(plate),
            Err(why) => self.left_out.push(why),
        }
    }
}

/// All figures of a table, with the pairs that were scanned again.
pub fn figures(cells: &Cells, seen: &Seen) -> Figures {
    let mut all = Figures { left_out: cells.unread.clone(), ..Figures::default() };
    let missing = Missing::of(&cells.plan);
    for search in cells.searches() {
        let figure = by_hand::plate(cells, &search, &missing);
        figure.into_iter().for_each(|figure| all.add(figure));
        interactions::plates(cells, &search, &missing).into_iter().for_each(|of| all.add(of));
        all.add(errors::plate(cells, &search, &missing));
        overlays::plates(cells, &search, seen, &missing).into_iter().for_each(|of| all.add(of));
        parameters::plates(cells, &search, &missing).into_iter().for_each(|of| all.add(of));
    }
    all
}
