//! Sheets of the table: rows with the same columns, each figure beside its reference.
//!
//! Text, page and LaTeX are written from the same sheets.

use super::axes::name_of;
use super::cell::{Cell, tuned, tuned_by};
use super::table::{Row, Table};
use super::wording::{FIGURES, absent};
use echoloop_closed_loop::config::preset::{Preset, Strategy};
use echoloop_report::FigureCell;

/// Rows of a table that belong together.
pub struct Sheet<'a> {
    table: &'a Table,
    /// Kind of rows.
    pub part: Part,
    /// The rows; at least one.
    pub rows: Vec<&'a Row>,
}

/// Kind of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// A search and its start, beside the paper.
    Search(Preset, Option<Strategy>),
    /// Cases tuned by hand, beside the default.
    ByHand,
    /// Cells with one thing switched, beside the same without the switch.
    Switches,
}

impl Part {
    /// Heads of the columns that name a row.
    pub fn heads(self) -> &'static [&'static str] {
        match self {
            Self::Search(..) => &["method", "scene", "tuned"],
            Self::ByHand => &["case", "ranges", "method", "scene"],
            Self::Switches => &["switch", "ranges", "method", "scene", "tuned"],
        }
    }

    /// Heading of the reference figures.
    pub fn reference(self) -> &'static str {
        match self {
            Self::Search(..) => "paper",
            Self::ByHand => "default",
            Self::Switches => "without",
        }
    }
}

impl Table {
    /// The sheets that have rows: searches, cases tuned by hand, switches.
    pub fn sheets(&self) -> Vec<Sheet<'_>> {
        let searches = self.searches().into_iter().map(|(ranges, strategy)| {
            (Part::Search(ranges, strategy), self.of_search(ranges, strategy))
        });
        let by_hand = self.sorted(
            |cell| cell.by_hand.is_some(),
            |cell| (cell.ranges as usize, cell.scene, cell.by_hand),
        );
        let switches = self.sorted(
            |cell| cell.ablation.is_some(),
            |cell| {
                let Cell { ablation, ranges, strategy, protocol, method, scene, .. } = *cell;
                let search = (ranges as usize, strategy.map(|strategy| strategy as usize));
                (ablation, method, scene, search, protocol as usize)
            },
        );
        let others = [(Part::ByHand, by_hand), (Part::Switches, switches)].into_iter();
        let sheet = |(part, rows)| Sheet { table: self, part, rows };
        searches.chain(others).map(sheet).filter(|sheet| !sheet.rows.is_empty()).collect()
    }
}

impl<'a> Sheet<'a> {
    /// Names of a row, by [`Part::heads`].
    pub fn names(&self, row: &Row) -> Vec<String> {
        let cell = &row.cell;
        let (ranges, method) = (name_of(cell.ranges), cell.method.title().to_owned());
        let scene = name_of(cell.scene);
        match self.part {
            Part::Search(..) => vec![method, scene, tuned(cell).into()],
            Part::ByHand => {
                vec![cell.by_hand.map(name_of).unwrap_or_default(), ranges, method, scene]
            }
            Part::Switches => {
                let switch = cell.ablation.map(name_of).unwrap_or_default();
                vec![switch, ranges, method, scene, tuned_by(cell)]
            }
        }
    }

    /// Our row that a row is compared with; none where the reference is the paper.
    pub fn other(&self, row: &Row) -> Option<&'a Row> {
        match self.part {
            Part::Search(..) => None,
            Part::ByHand => self.table.row(&row.cell.untuned()),
            Part::Switches => self.table.row(&row.cell.plain()),
        }
    }

    /// Each figure of [`FIGURES`] with its interval and its reference; for a row without figures,
    /// the reason.
    pub fn figures(&self, row: &Row) -> [FigureCell; 3] {
        let other = self.other(row).and_then(|other| other.figures.as_ref());
        FIGURES.each_ref().map(|figure| {
            let paper = row.paper.as_ref().map(|paper| figure.theirs(paper));
            let beside = match self.part {
                Part::Search(..) => paper,
                _ => other.map(|other| figure.value(other)),
            };
            let beside = beside.unwrap_or_default();
            match &row.figures {
                Some(own) => {
                    FigureCell { value: figure.value(own), within: figure.within(own), beside }
                }
                None => FigureCell {
                    value: absent(row).into(),
                    within: row.error.clone().unwrap_or_default(),
                    beside,
                },
            }
        })
    }
}
