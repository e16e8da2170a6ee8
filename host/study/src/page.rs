//! The table as a page.

use super::axes::name_of;
use super::cell::{Cell, tuned};
use super::figures::Figures;
use super::real::{RealRow, real_lines};
use super::sheet::{Part, Sheet};
use super::table::{Row, Table};
use super::wording::{self, FIGURES};
use echoloop_report::{FigureCell, FigureRow, FigureTable, TablesPage};

/// Page of a table and its figures.
pub fn page(table: &Table, figures: Figures) -> TablesPage {
    let mut tables: Vec<FigureTable> = table.sheets().iter().map(sheet).collect();
    if !table.real.is_empty() {
        tables.push(real(&table.real));
    }
    TablesPage {
        title: "Echoloop: the paper's Table 1".into(),
        subtitle: wording::subtitle(table),
        facts: facts(table),
        remarks: wording::remarks(table).into_iter().chain(figures.left_out).collect(),
        tables,
        plates: figures.plates,
    }
}

fn sheet(sheet: &Sheet<'_>) -> FigureTable {
    let (title, lead, first) = match sheet.part {
        Part::Search(ranges, strategy) => (
            wording::search(ranges, strategy),
            "Each figure with its 95 % interval, and the paper's below.",
            "Method, scene, what was tuned",
        ),
        Part::ByHand => (
            "Tuned by hand".into(),
            "The three cases of the paper's Fig. 1. Each figure with its 95 % interval, and that \
             of the default below, where it was run.",
            "Case, ranges, method, scene",
        ),
        Part::Switches => (
            "One thing switched".into(),
            "Each figure with its 95 % interval, and that of the same cell without the switch \
             below, where it was run.",
            "Switch, method, scene, what was tuned",
        ),
    };
    let heads = [first].into_iter().chain(FIGURES.iter().map(|figure| figure.title));
    FigureTable {
        title,
        lead: lead.into(),
        heads: heads.chain(["Registrations"]).map(str::to_owned).collect(),
        rows: sheet.rows.iter().map(|row| line(sheet, row)).collect(),
    }
}

fn line(sheet: &Sheet<'_>, row: &Row) -> FigureRow {
    let cell = &row.cell;
    let (method, scene) = (cell.method.title(), name_of(cell.scene));
    let name = match sheet.part {
        Part::Search(..) => format!("{method}, {scene}: {}", tuned(cell)),
        Part::ByHand => sheet.names(row).join(", "),
        Part::Switches => {
            let switch = cell.ablation.map(name_of).unwrap_or_default();
            format!("{switch}: {method}, {scene}, {}", tuned(cell))
        }
    };
    let figures = sheet.figures(row).into_iter().map(|figure| FigureCell {
        beside: match &*figure.beside {
            "" => String::new(),
            beside => format!("{} {beside}", sheet.part.reference()),
        },
        ..figure
    });
    let count = row.made.as_ref().map_or_else(String::new, |made| made.registrations.to_string());
    let count = FigureCell { value: count, ..FigureCell::default() };
    FigureRow { name, strong: cell.is_joint(), cells: figures.chain([count]).collect() }
}

/// Table of the settings on real clouds.
fn real(rows: &[RealRow]) -> FigureTable {
    let mut lines = real_lines(rows).into_iter();
    let heads = lines.next().map_or_else(Vec::new, |head| {
        [vec!["Method, settings".to_owned()], head[2..].to_vec()].concat()
    });
    let row = |(line, row): (Vec<String>, &RealRow)| FigureRow {
        name: format!("{}, {}", line[0], line[1]),
        strong: row.cell.as_ref().is_some_and(Cell::is_joint),
        cells: line[2..]
            .iter()
            .map(|value| FigureCell { value: value.clone(), ..FigureCell::default() })
            .collect(),
    };
    FigureTable {
        title: "Real clouds".into(),
        lead: "Settings of registration on pairs that nobody simulated: pairs found, means over \
               them, and each pair's translation error."
            .into(),
        heads,
        rows: lines.zip(rows).map(row).collect(),
    }
}

fn facts(table: &Table) -> Vec<(String, String)> {
    let plan = &table.plan;
    let build = plan.build.clone().unwrap_or_else(|| "unknown".into());
    [
        ("Seed", plan.seed.to_string()),
        ("Version", format!("{}, build {build}", plan.version)),
        ("Settings", plan.configuration.clone()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}
