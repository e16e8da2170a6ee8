//! The headline, its three figures and the table of default against tuned.

use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;

use super::data::{EvaluationRow, EvaluationTable, Report, RowKind};
use super::format::{escape, fixed, signed, significant, with_unit};
use super::plot::{at, drawing};
use super::theme::ink;

/// A column of figures: how to read it and which way is better.
struct Column {
    head: &'static str,
    over: &'static str,
    unit: &'static str,
    difference_unit: &'static str,
    decimals: usize,
    more_is_better: bool,
    read: fn(&EvaluationRow) -> f64,
}

const fn error(
    head: &'static str,
    over: &'static str,
    unit: &'static str,
    decimals: usize,
    read: fn(&EvaluationRow) -> f64,
) -> Column {
    Column { head, over, unit, difference_unit: unit, decimals, more_is_better: false, read }
}

const RECALL: Column = Column {
    head: "Recall",
    over: "pairs that succeed",
    unit: "%",
    difference_unit: "points",
    decimals: 1,
    more_is_better: true,
    read: |row| row.recall_pct,
};
const COLUMNS: [Column; 5] = [
    RECALL,
    error("Mean translation error", "over successes", "cm", 1, |row| row.mean_translation_cm),
    error("Mean rotation error", "over successes", "°", 2, |row| row.mean_rotation_deg),
    error("Median translation error", "over all pairs", "cm", 1, |row| row.median_translation_cm),
    error("Median rotation error", "over all pairs", "°", 2, |row| row.median_rotation_deg),
];

impl Column {
    fn value(&self, row: &EvaluationRow) -> String {
        with_unit(&fixed((self.read)(row), self.decimals), self.unit)
    }

    fn difference(&self, row: &EvaluationRow, base: &EvaluationRow) -> f64 {
        (self.read)(row) - (self.read)(base)
    }

    fn verdict(&self, difference: f64) -> &'static str {
        let rounds_to_zero = difference.abs() < 0.5 * 10f64.powi(-(self.decimals as i32));
        match difference {
            d if !d.is_finite() => "",
            _ if rounds_to_zero => "same",
            d if (d > 0.0) == self.more_is_better => "better",
            _ => "worse",
        }
    }
}

/// What was tuned and what came of it, in a sentence or two.
pub(super) fn headline(report: &Report) -> String {
    let parameters = match report.parameters.len() {
        0 => "Tuning".to_owned(),
        1 => "Tuning one parameter".to_owned(),
        count => format!("Tuning {count} parameters"),
    };
    let generations = match report.convergence.generation.len() {
        0 => String::new(),
        count => format!(" over {count} generations"),
    };
    let table = &report.table;
    let rows = table.first(RowKind::Default).zip(table.first(RowKind::Tuned));
    let Some((default, tuned)) = rows else {
        return format!("{parameters}{generations}: not yet evaluated against the defaults.");
    };
    format!("{parameters}{generations} {}{}.", recall_change(default, tuned), on_pairs(tuned))
}

fn recall_change(default: &EvaluationRow, tuned: &EvaluationRow) -> String {
    let (from, to) = (RECALL.value(default), RECALL.value(tuned));
    match RECALL.verdict(RECALL.difference(tuned, default)) {
        "better" => format!("raised recall from {from} to <em>{to}</em>"),
        "worse" => format!("lowered recall from {from} to <em>{to}</em>"),
        "same" => format!("left recall at <em>{to}</em>"),
        _ if !tuned.recall_pct.is_finite() => "gave no known recall".to_owned(),
        _ => format!("gave a recall of <em>{to}</em> (default {from})"),
    }
}

fn on_pairs(row: &EvaluationRow) -> String {
    row.pairs.map_or(String::new(), |pairs| format!(" on {pairs} test pairs"))
}

/// Recall and both medians, large, from default to tuned.
pub(super) fn tiles(table: &EvaluationTable) -> String {
    let rows = table.first(RowKind::Default).zip(table.first(RowKind::Tuned));
    let Some((default, tuned)) = rows else {
        return String::new();
    };
    let tiles: String = [&COLUMNS[0], &COLUMNS[3], &COLUMNS[4]]
        .iter()
        .map(|column| {
            format!(
                "<div class=\"tile\"><p class=\"what\">{}, {}</p><p class=\"big\"><s>{}</s> \
                 <b>{}</b></p>{}</div>",
                column.head,
                column.over,
                column.value(default),
                column.value(tuned),
                difference(column, tuned, default)
            )
        })
        .collect();
    format!("<div class=\"tiles\">{tiles}</div>\n")
}

/// The table with differences to the default row, or nothing without rows.
pub(super) fn section(table: &EvaluationTable) -> String {
    if table.rows.is_empty() {
        return String::new();
    }
    let heads: String = COLUMNS
        .iter()
        .map(|c| format!("<th scope=\"col\">{}<small>{}</small></th>", c.head, c.over))
        .collect();
    let default = table.first(RowKind::Default);
    let rows: String = table.rows.iter().map(|row| table_row(row, default)).collect();
    format!(
        "<section id=\"evaluation\"><h2>Default against tuned</h2><p class=\"lead\">{}</p>\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Evaluation\"><table \
         class=\"figures\">\
         <thead><tr><th \
         scope=\"col\">Parameters</th>{heads}</tr></thead><tbody>{rows}</tbody></table></div>\
         </section>\n",
        criterion(table)
    )
}

fn criterion(table: &EvaluationTable) -> String {
    let within = &table.success_within;
    let rule = match within.translation_m.is_finite() && within.rotation_deg.is_finite() {
        true => format!(
            "A pair succeeds when its pose is within {} and {} of the truth. ",
            with_unit(&significant(within.translation_m), "m"),
            with_unit(&significant(within.rotation_deg), "°")
        ),
        false => String::new(),
    };
    format!(
        "{rule}Means count successes only, so they can grow when harder pairs begin to succeed; \
         medians count every pair. The bar shows recall with its 95\u{a0}% interval for this \
         number of pairs."
    )
}

fn table_row(row: &EvaluationRow, default: Option<&EvaluationRow>) -> String {
    let (class, base) = match row.kind {
        RowKind::Default => ("row-default", None),
        RowKind::Tuned => ("row-tuned", default),
        RowKind::Reference => ("row-reference", None),
    };
    let cells: String = COLUMNS
        .iter()
        .enumerate()
        .map(|(i, column)| {
            let change = base.map_or(String::new(), |base| difference(column, row, base));
            let bar = if i == 0 { recall_bar(row) } else { String::new() };
            format!("<td><span class=\"value\">{}</span>{bar}{change}</td>", column.value(row))
        })
        .collect();
    let pairs = row.pairs.map_or(String::new(), |n| format!("<small>{n} pairs</small>"));
    format!(
        "<tr class=\"{class}\"><th scope=\"row\">{}{pairs}</th>{cells}</tr>",
        escape(&row.label)
    )
}

fn difference(column: &Column, row: &EvaluationRow, base: &EvaluationRow) -> String {
    let difference = column.difference(row, base);
    let verdict = column.verdict(difference);
    if verdict.is_empty() {
        return String::new();
    }
    let number = with_unit(&signed(difference, column.decimals), column.difference_unit);
    format!("<span class=\"change {verdict}\">{number} <i>{verdict}</i></span>")
}

fn recall_bar(row: &EvaluationRow) -> String {
    if !row.recall_pct.is_finite() {
        return String::new();
    }
    let recall = (row.recall_pct / 100.0).clamp(0.0, 1.0);
    let interval = row.pairs.filter(|pairs| *pairs > 0).map(|pairs| wilson(recall, pairs as f64));
    let across = |share: f64| 2.0 + 100.0 * share;
    drawing([104.0, 12.0], &bar_label(interval), |canvas, _| {
        let bar = |class, share| {
            Rectangle::new([at([2.0, 3.0]), at([across(share), 9.0])], ink(class).filled())
        };
        canvas.draw(&bar("bar-back", 1.0))?;
        canvas.draw(&bar("bar", recall))?;
        let Some(ends) = interval else { return Ok(()) };
        let [left, right] = [ends.0, ends.1].map(across);
        for ends in
            [[[left, 6.0], [right, 6.0]], [[left, 3.5], [left, 8.5]], [[right, 3.5], [right, 8.5]]]
        {
            canvas.draw(&PathElement::new(ends.map(at), ink("whisker")))?;
        }
        Ok(())
    })
}

fn bar_label(interval: Option<(f64, f64)>) -> String {
    interval.map_or("recall".to_owned(), |(low, high)| {
        format!("95 % interval {} to {} %", fixed(low * 100.0, 0), fixed(high * 100.0, 0))
    })
}

/// Wilson's 95 % interval for a share `p` of `n`: it stays within 0 and 1 also for few pairs.
fn wilson(p: f64, n: f64) -> (f64, f64) {
    const Z: f64 = 1.959_964;
    let scale = 1.0 + Z * Z / n;
    let centre = (p + Z * Z / (2.0 * n)) / scale;
    let half = Z / scale * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    ((centre - half).max(0.0), (centre + half).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval_matches_the_textbook() {
        let (low, high) = wilson(0.5, 10.0);
        assert!((low - 0.2366).abs() < 1e-4 && (high - 0.7634).abs() < 1e-4);
        assert_eq!(wilson(0.0, 20.0).0, 0.0);
        assert_eq!(wilson(1.0, 20.0).1, 1.0);
    }

    #[test]
    fn a_verdict_knows_which_way_is_better() {
        assert_eq!(COLUMNS[0].verdict(5.0), "better");
        assert_eq!(COLUMNS[1].verdict(5.0), "worse");
        assert_eq!(COLUMNS[2].verdict(-0.001), "same");
        assert_eq!(COLUMNS[2].verdict(f64::NAN), "");
    }
}
