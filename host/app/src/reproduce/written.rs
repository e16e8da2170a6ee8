//! The table as text and CSV.

use std::fmt::Write as _;

use super::super::exit::Failure;
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};
use echoloop_report::aligned;
use echoloop_study::{
    Cell, FIGURES, Paired, RealRow, Row, Table, absent, name_of, real_lines, remarks, search,
    subtitle, tuned, tuned_by,
};

/// To read: a table for each range and search, then what has to be known.
pub(super) fn text(table: &Table) -> String {
    let mut text = format!("The paper's Table 1: {}\n", subtitle(table));
    for (ranges, strategy) in table.searches() {
        let rows = table.of_search(ranges, strategy);
        let mut lines = vec![heads(&["method", "scene", "tuned"], "paper")];
        lines.extend(rows.iter().map(|row| line(row)));
        let _ = write!(text, "\n{}\n\n{}", sentence(ranges, strategy), aligned(&lines));
    }
    let by_hand = table.of_by_hand();
    if !by_hand.is_empty() {
        let mut lines = vec![heads(&["case", "ranges", "method", "scene"], "default")];
        lines.extend(by_hand.iter().map(|row| by_hand_line(table, row)));
        let _ = write!(text, "\nTuned by hand, as in the paper's Fig. 1\n\n{}", aligned(&lines));
    }
    let ablations = table.of_ablations();
    if !ablations.is_empty() {
        let mut lines = vec![heads(&["switch", "ranges", "method", "scene", "tuned"], "without")];
        lines.extend(ablations.iter().map(|row| ablation_line(table, row)));
        let _ = write!(text, "\nOne thing switched\n\n{}", aligned(&lines));
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

fn sentence(ranges: Preset, strategy: Option<Strategy>) -> String {
    let text = search(ranges, strategy);
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

fn heads(names: &[&str], beside: &str) -> Vec<String> {
    let figures = FIGURES.iter().flat_map(|figure| [figure.title, beside]);
    names.iter().copied().chain(figures).map(str::to_owned).collect()
}

fn line(row: &Row) -> Vec<String> {
    let cell = &row.cell;
    let names = [cell.method.title().into(), name_of(cell.scene), tuned(cell).into()];
    let theirs = |i: usize| row.paper.as_ref().map(|paper| FIGURES[i].theirs(paper));
    names.into_iter().chain(figures(row, &theirs)).collect()
}

fn by_hand_line(table: &Table, row: &Row) -> Vec<String> {
    let cell = &row.cell;
    let case = cell.by_hand.map(name_of).unwrap_or_default();
    let names = [case, name_of(cell.ranges), cell.method.title().into(), name_of(cell.scene)];
    let start = table.row(&cell.untuned()).and_then(|row| row.figures);
    let default = |i: usize| start.as_ref().map(|start| FIGURES[i].value(start));
    names.into_iter().chain(figures(row, &default)).collect()
}

fn ablation_line(table: &Table, row: &Row) -> Vec<String> {
    let cell = &row.cell;
    let switch = cell.ablation.map(name_of).unwrap_or_default();
    let (method, scene) = (cell.method.title().into(), name_of(cell.scene));
    let names = [switch, name_of(cell.ranges), method, scene, tuned_by(cell)];
    let plain = table.row(&cell.plain()).and_then(|row| row.figures);
    let without = |i: usize| plain.as_ref().map(|plain| FIGURES[i].value(plain));
    names.into_iter().chain(figures(row, &without)).collect()
}

/// Each figure with its interval, and what stands beside it.
fn figures(row: &Row, beside: &dyn Fn(usize) -> Option<String>) -> Vec<String> {
    let own = |i: usize| match &row.figures {
        Some(figures) => match FIGURES[i].within(figures) {
            within if within.is_empty() => FIGURES[i].value(figures),
            within => format!("{} ({within})", FIGURES[i].value(figures)),
        },
        None => absent(row).to_owned(),
    };
    let both = |i: usize| [own(i), beside(i).unwrap_or_else(|| "–".into())];
    (0..FIGURES.len()).flat_map(both).collect()
}

/// A line a cell, then one for each method and its settings on real clouds; what is unknown is an
/// empty field.
pub(super) fn csv(table: &Table) -> Result<String, Failure> {
    let mut lines = csv::Writer::from_writer(Vec::new());
    let names = ["ablation", "ranges", "strategy", "tuned", "method", "scene", "seed", "pairs"];
    let mut head: Vec<String> = names.map(str::to_owned).to_vec();
    for figure in &FIGURES {
        head.extend(["", "_low", "_high", "_paper"].map(|end| format!("{}{end}", figure.key)));
    }
    let rest = ["registrations", "scans", "configuration", "error", "clouds", "version", "build"];
    head.extend(rest.map(str::to_owned));
    // Joint tuning beside registration alone, on the same pairs.
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

/// Empty where it is none.
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
    let is_asked = |p: &&Paired| p.cell == *cell && p.other.protocol == Protocol::Registration;
    let Some(paired) = table.paired.iter().find(is_asked) else { return Default::default() };
    let ratio = paired.translation_ratio.map(|ratio| {
        let [low, high] = ratio.interval;
        [ratio.value, low, high].map(number)
    });
    let [ratio, low, high] = ratio.unwrap_or_default();
    let [both, gained, lost] = [paired.both, paired.gained, paired.lost].map(|n| n.to_string());
    [ratio, low, high, both, gained, lost]
}

/// Ranges, search, what was tuned and where are those of the cell that gave the settings; what was
/// chosen from the clouds has none of them.
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
