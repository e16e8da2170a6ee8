//! The table as a page.

use super::axes::name_of;
use super::cell::{Cell, tuned};
use super::figures::Figures;
use super::real::{RealRow, real_lines};
use super::table::{Row, Table};
use super::wording::{self, FIGURES};
use echoloop_report::{FigureCell, FigureRow, FigureTable, TablesPage};

/// The page of a table and its figures.
pub fn page(table: &Table, figures: Figures) -> TablesPage {
    let searches = table.searches().into_iter().map(|(ranges, strategy)| FigureTable {
        title: wording::search(ranges, strategy),
        lead: "Each figure with its 95 % interval, and the paper's below.".into(),
        heads: heads("Method, scene, what was tuned"),
        rows: table.of_search(ranges, strategy).into_iter().map(row).collect(),
    });
    let mut tables: Vec<FigureTable> = searches.filter(|table| !table.rows.is_empty()).collect();
    let by_hand: Vec<FigureRow> =
        table.of_by_hand().into_iter().map(|of| hand_set(table, of)).collect();
    if !by_hand.is_empty() {
        tables.push(FigureTable {
            title: "Tuned by hand".into(),
            lead: "The three cases of the paper's Fig. 1. Each figure with its 95 % interval, and \
                   that of the default below, where it was run."
                .into(),
            heads: heads("Case, ranges, method, scene"),
            rows: by_hand,
        });
    }
    let ablations: Vec<FigureRow> =
        table.of_ablations().into_iter().map(|of| ablation(table, of)).collect();
    if !ablations.is_empty() {
        tables.push(FigureTable {
            title: "One thing switched".into(),
            lead: "Each figure with its 95 % interval, and that of the same cell without the \
                   switch below, where it was run."
                .into(),
            heads: heads("Switch, method, scene, what was tuned"),
            rows: ablations,
        });
    }
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

/// What was tuned, on real clouds.
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

fn heads(first: &str) -> Vec<String> {
    let named = FIGURES.iter().map(|figure| figure.title.to_owned());
    [first.to_owned()].into_iter().chain(named).chain(["Registrations".into()]).collect()
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

fn row(row: &Row) -> FigureRow {
    let cell = &row.cell;
    let name = format!("{}, {}: {}", cell.method.title(), name_of(cell.scene), tuned(cell));
    let paper = |i: usize| {
        let theirs = row.paper.as_ref().map(|paper| FIGURES[i].theirs(paper));
        theirs.map_or_else(String::new, |theirs| format!("paper {theirs}"))
    };
    FigureRow { name, strong: cell.is_joint(), cells: cells(row, &paper) }
}

fn hand_set(table: &Table, row: &Row) -> FigureRow {
    let cell = &row.cell;
    let names = [
        cell.by_hand.map(name_of).unwrap_or_default(),
        name_of(cell.ranges),
        cell.method.title().to_owned(),
        name_of(cell.scene),
    ];
    let start = table.row(&cell.untuned()).and_then(|row| row.figures);
    let default = |i: usize| {
        start.map_or_else(String::new, |start| format!("default {}", FIGURES[i].value(&start)))
    };
    FigureRow { name: names.join(", "), strong: false, cells: cells(row, &default) }
}

fn ablation(table: &Table, row: &Row) -> FigureRow {
    let cell = &row.cell;
    let switch = cell.ablation.map(name_of).unwrap_or_default();
    let name =
        format!("{switch}: {}, {}, {}", cell.method.title(), name_of(cell.scene), tuned(cell));
    let plain = table.row(&cell.plain()).and_then(|row| row.figures);
    let without = |i: usize| {
        plain.map_or_else(String::new, |plain| format!("without {}", FIGURES[i].value(&plain)))
    };
    FigureRow { name, strong: cell.is_joint(), cells: cells(row, &without) }
}

fn cells(row: &Row, beside: &dyn Fn(usize) -> String) -> Vec<FigureCell> {
    let figure = |i: usize| match &row.figures {
        Some(figures) => FigureCell {
            value: FIGURES[i].value(figures),
            within: FIGURES[i].within(figures),
            beside: beside(i),
        },
        None => FigureCell {
            value: wording::absent(row).into(),
            within: row.error.clone().unwrap_or_default(),
            beside: beside(i),
        },
    };
    let count = row.made.as_ref().map_or_else(String::new, |made| made.registrations.to_string());
    let count = FigureCell { value: count, ..FigureCell::default() };
    (0..FIGURES.len()).map(figure).chain([count]).collect()
}
