//! The table as text and as CSV.

use std::fmt::Write as _;

use super::super::exit::Failure;
use echoloop_closed_loop::config::preset::Protocol;
use echoloop_report::aligned;
use echoloop_study::{
    Cell, FIGURES, Paired, Part, RealRow, Row, Sheet, Table, name_of, real_lines, remarks, search,
    subtitle,
};

/// Text to read: a table for each sheet, then the remarks.
pub(super) fn text(table: &Table) -> String {
    let mut text = format!("The paper's Table 1: {}\n", subtitle(table));
    for sheet in table.sheets() {
        let figures = FIGURES.iter().flat_map(|figure| [figure.title, sheet.part.reference()]);
        let heads = sheet.part.heads().iter().copied().chain(figures).map(str::to_owned);
        let lines = sheet.rows.iter().map(|row| line(&sheet, row));
        let lines: Vec<Vec<String>> = [heads.collect()].into_iter().chain(lines).collect();
        let _ = write!(text, "\n{}\n\n{}", title(sheet.part), aligned(&lines));
    }
    if !table.real.is_empty() {
        let _ = write!(text, "\nReal clouds\n\n{}", aligned(&real_lines(&table.real)));
    }
    text.push('\n');
    for remark in remarks(table) {
        let _ = writeln!(text, "{remark}");
    }
    text
}

fn title(part: Part) -> String {
    match part {
        Part::Search(ranges, strategy) => {
            let text = search(ranges, strategy);
            let mut letters = text.chars();
            let first = letters.next().map(|first| first.to_uppercase().to_string());
            first.unwrap_or_default() + letters.as_str()
        }
        Part::ByHand => "Tuned by hand, as in the paper's Fig. 1".into(),
        Part::Switches => "One thing switched".into(),
    }
}

/// Names of a row, then each figure with its interval, and the figure beside it.
fn line(sheet: &Sheet<'_>, row: &Row) -> Vec<String> {
    let figures = sheet.figures(row).into_iter().flat_map(|figure| {
        let has_interval = row.figures.is_some() && !figure.within.is_empty();
        let own = match has_interval {
            true => format!("{} ({})", figure.value, figure.within),
            false => figure.value,
        };
        [own, if figure.beside.is_empty() { "–".into() } else { figure.beside }]
    });
    sheet.names(row).into_iter().chain(figures).collect()
}

/// CSV: a line for each cell, then one for each method and its settings on real clouds. Unknown
/// fields are empty.
pub(super) fn csv(table: &Table) -> Result<String, Failure> {
    let mut lines = csv::Writer::from_writer(Vec::new());
    let names = ["ablation", "ranges", "strategy", "tuned", "method", "scene", "seed", "pairs"];
    let mut head: Vec<String> = names.map(str::to_owned).to_vec();
    for figure in &FIGURES {
        head.extend(["", "_low", "_high", "_paper"].map(|end| format!("{}{end}", figure.key)));
    }
    let rest = ["registrations", "scans", "configuration", "error", "clouds", "version", "build"];
    head.extend(rest.map(str::to_owned));
    // Joint tuning compared with registration alone, on the same pairs.
    head.extend(["", "_low", "_high"].map(|end| format!("rte_ratio{end}")));
    head.extend(["both", "gained", "lost"].map(str::to_owned));
    lines.write_record(head).map_err(Failure::run)?;
    for row in &table.rows {
        lines.write_record(csv_line(table, row)).map_err(Failure::run)?;
    }
    for row in &table.real {
        lines.write_record(csv_real_line(table, row)).map_err(Failure::run)?;
    }
    let bytes = lines.into_inner().map_err(Failure::run)?;
    String::from_utf8(bytes).map_err(Failure::run)
}

/// A number; empty where it is not finite.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

fn csv_line(table: &Table, row: &Row) -> Vec<String> {
    let Cell { ablation, ranges, strategy, method, scene, .. } = row.cell;
    let made = row.made.as_ref();
    let mut line = vec![
        ablation.map(name_of).unwrap_or_default(),
        name_of(ranges),
        strategy.map(name_of).unwrap_or_default(),
        row.cell.tuned_name(),
        name_of(method),
        name_of(scene),
        table.plan.seed.to_string(),
        made.map_or_else(String::new, |made| made.pairs.to_string()),
    ];
    for figure in &FIGURES {
        let own = row.figures.as_ref().map_or([f64::NAN; 3], |figures| figure.numbers(figures));
        let theirs = row.paper.as_ref().map_or(f64::NAN, |paper| figure.paper(paper));
        line.extend(own.into_iter().chain([theirs]).map(number));
    }
    line.extend([
        made.map_or_else(String::new, |made| made.registrations.to_string()),
        made.map_or_else(String::new, |made| made.content.scans.clone()),
        made.map_or_else(String::new, |made| made.configuration.clone()),
        row.error.clone().unwrap_or_default(),
        "simulated".into(),
    ]);
    line.extend(csv_made_by(table));
    line.extend(csv_beside(table, &row.cell));
    line
}

fn csv_made_by(table: &Table) -> [String; 2] {
    [table.plan.version.clone(), table.plan.build.clone().unwrap_or_default()]
}

fn csv_beside(table: &Table, cell: &Cell) -> [String; 6] {
    let is_it = |p: &&Paired| p.cell == *cell && p.other.protocol == Protocol::Registration;
    let Some(paired) = table.paired.iter().find(is_it) else { return Default::default() };
    let ratio = paired.translation_ratio.map(|ratio| {
        let [low, high] = ratio.interval;
        [ratio.value, low, high].map(number)
    });
    let [ratio, low, high] = ratio.unwrap_or_default();
    let [both, gained, lost] = [paired.both, paired.gained, paired.lost].map(|n| n.to_string());
    [ratio, low, high, both, gained, lost]
}

/// Line of settings on real clouds. Ranges, search, protocol and scene are those of the cell that
/// tuned the settings; settings chosen from the clouds have none.
fn csv_real_line(table: &Table, row: &RealRow) -> Vec<String> {
    let cell = row.cell.as_ref();
    let mut line = vec![
        String::new(),
        cell.map(|cell| cell.ranges).or(row.default).map(name_of).unwrap_or_default(),
        cell.and_then(|cell| cell.strategy).map(name_of).unwrap_or_default(),
        match (cell, row.default) {
            (Some(cell), _) => cell.tuned_name(),
            (None, Some(_)) => name_of(Protocol::Default),
            (None, None) => "clouds".into(),
        },
        name_of(row.method),
        cell.map(|cell| name_of(cell.scene)).unwrap_or_default(),
        table.plan.seed.to_string(),
        row.pairs.len().to_string(),
    ];
    for figure in real_figures(row) {
        line.extend([number(figure), String::new(), String::new(), String::new()]);
    }
    let registrations = row.pairs.len().to_string();
    let rest = [registrations, String::new(), String::new(), String::new(), "real".into()];
    line.extend(rest.into_iter().chain(csv_made_by(table)));
    line.extend([const { String::new() }; 6]);
    line
}

/// Recall, RTE and RRE in the units of [`FIGURES`]; NaN where there is none.
pub(super) fn real_figures(row: &RealRow) -> [f64; 3] {
    let recall_pct = 100.0 * row.found as f64 / row.pairs.len() as f64;
    let rte_cm = row.mean_translation_m.map_or(f64::NAN, |mean_m| 100.0 * mean_m);
    [recall_pct, rte_cm, row.mean_rotation_deg.unwrap_or(f64::NAN)]
}
