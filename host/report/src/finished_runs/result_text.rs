//! Result of a run as text: default against tuned, costs, front, parameters.

use std::array::from_fn;
use std::fmt::Write as _;

use crate::Costs;
use crate::columns::COLUMNS;
use crate::format::choice;
use crate::sections::{costs, judged};
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::front::{Front, Mark};
use echoloop_closed_loop::parameters::{Axis, Space, choices, effective};
use echoloop_closed_loop::run_folder::run::RunResult;

/// The tables that `tune` ends with.
pub fn result_text(config: &RunConfig, result: &RunResult, space: &Space) -> String {
    let data = &config.data;
    let mut text = format!(
        "\n{}: {} held-out pairs of other viewpoints of the same towns, {:.1} m apart; success \
         within {} m and {}°\n\n",
        result.method,
        result.tuned_summary.pairs,
        data.baseline_m,
        data.success_translation_m,
        data.success_rotation_deg
    );
    text += &summary_line("", COLUMNS.each_ref().map(|column| column.symbol.into()), "points");
    for (_, name, summary) in judged(result) {
        let points = format!("{:.0}", summary.mean_points);
        text += &summary_line(&name, figures(summary), &points);
    }
    text += &costs_text(&costs(result, config.tune.told_cost()));
    if let Some(check) = &result.check {
        let _ = writeln!(text, "\nThe check: {check}.");
    }
    if let Some(front) = &result.front {
        text += &front_text(front);
    }
    if !space.axes().is_empty() {
        let _ = writeln!(text, "\n{}", parameters(result, space));
    }
    text
}

/// Every axis before and after, in the digits of the result.
fn parameters(result: &RunResult, space: &Space) -> String {
    let rows: Vec<[String; 2]> = (space.axes().iter())
        .map(|axis| {
            [&result.default, &result.tuned]
                .map(|values| printable(axis.name, effective(values, axis.name)))
        })
        .collect();
    let wide = rows.iter().flatten().map(|cell| cell.chars().count()).max().unwrap_or(0).max(12);
    let line = |name: &str, [before, after]: [&str; 2], unit: &str, range: &str| {
        format!("{name:<34} {before:>wide$} {after:>wide$}  {unit:<14} {range}")
    };
    let head = line("parameter", ["default", "tuned"], "unit", "range");
    let lines = space.axes().iter().zip(&rows).map(|(axis, cells)| {
        line(axis.name, cells.each_ref().map(String::as_str), axis.unit, &range(axis))
    });
    std::iter::once(head).chain(lines).collect::<Vec<_>>().join("\n")
}

/// Costs of a scan before and after, and the verdict; blank lines for unknown costs.
fn costs_text(costs: &Costs) -> String {
    let line = |name: &str, cells: &[&str]| {
        let cells: String = cells.iter().map(|cell| format!(" {cell:>24}")).collect();
        format!("{name:<10}{cells}\n")
    };
    let heads = CostKind::ALL.map(CostKind::title);
    let head = line("", if costs.rows.is_empty() { &[] } else { &heads });
    let row =
        |(name, cells): &(String, [String; 4])| line(name, &cells.each_ref().map(String::as_str));
    let rows: String = costs.rows.iter().map(row).collect();
    format!("\n{head}{rows}{}\n", costs.verdict)
}

/// Points of a front, and the verdict.
fn front_text(front: &Front) -> String {
    let (name, points) = (front.cost.name(), front.points.len());
    let heads = [name, "error", "95 % interval", "recall", "median e_t"].map(str::to_owned);
    let row = |name: &str, mark: &Mark, against: &str| {
        let [low, high] = mark.interval;
        let cells = [
            front.cost.text(front.cost.of(&mark.cost)),
            format!("{:.4}", mark.error),
            format!("{low:.4} to {high:.4}"),
            format!("{:.1} %", mark.recall_pct),
            format!("{:.2} cm", 100.0 * mark.median_translation_m),
        ];
        mark_line(name, cells, against)
    };
    let ends = [("default", &front.default), ("tuned", &front.tuned)];
    let ends = ends.into_iter().map(|(name, mark)| row(name, mark, ""));
    let numbered = (1..)
        .zip(&front.points)
        .map(|(i, point)| row(&format!("point {i}"), &point.mark, point.comparison.error()));
    format!(
        "\nerror against {name}: {points} points, chosen on training pairs\n\n{}{}\n\
         The cheapest point that errs no more than the default: {}.\n",
        mark_line("", heads, "against default"),
        ends.chain(numbered).collect::<String>(),
        front.verdict()
    )
}

fn mark_line(name: &str, [cost, error, interval, recall, e_t]: [String; 5], last: &str) -> String {
    let line =
        format!("{name:<10} {cost:>12} {error:>9} {interval:>18} {recall:>9} {e_t:>12}  {last}");
    line.trim_end().to_owned() + "\n"
}

/// A value: a choice by name, a number so that it reads back as itself.
fn printable(name: &str, value: Option<f64>) -> String {
    let Some(value) = value else { return "–".into() };
    choice(name, value).map_or_else(|| value.to_string(), str::to_owned)
}

fn range(axis: &Axis) -> String {
    match choices(axis.name) {
        [] => format!("{} to {}", axis.min, axis.max),
        names => names.join(", "),
    }
}

fn summary_line(name: &str, [recall, e_t, e_r, m_t, m_r]: [String; 5], points: &str) -> String {
    format!("{name:<10} {recall:>9} {e_t:>12} {e_r:>11} {m_t:>12} {m_r:>12} {points:>8}\n")
}

fn figures(summary: &Summary) -> [String; 5] {
    let values = [
        summary.recall_pct,
        summary.mean_translation_m.unwrap_or(f64::NAN),
        summary.mean_rotation_deg.unwrap_or(f64::NAN),
        summary.median_translation_m,
        summary.median_rotation_deg,
    ];
    from_fn(|k| COLUMNS[k].number(values[k]))
}
