//! Result of a run as text: default against tuned, costs, front, parameters.

use std::fmt::Write as _;

use crate::Costs;
use crate::sections::{costs, judged};
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::front::{Front, Mark};
use echoloop_closed_loop::parameters::{self, Axis, Space, effective};
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
    let _ = writeln!(
        text,
        "{:<10} {:>9} {:>12} {:>11} {:>12} {:>12} {:>8}",
        "", "recall", "mean e_t", "mean e_R", "median e_t", "median e_R", "points"
    );
    for (_, name, summary) in judged(result) {
        let _ = writeln!(text, "{name:<10} {}", row(summary));
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
                .map(|values| shown(axis.name, effective(values, axis.name)))
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

/// Costs of a scan before and after, and the verdict.
fn costs_text(costs: &Costs) -> String {
    let line = |name: &str, cells: &[String]| {
        let cells: String = cells.iter().map(|cell| format!(" {cell:>24}")).collect();
        format!("{name:<10}{cells}\n")
    };
    let rows: String = costs.rows.iter().map(|(name, cells)| line(name, cells)).collect();
    format!("\n{}{rows}{}\n", line("", &costs.heads), costs.verdict)
}

/// Points of a front, and the verdict.
fn front_text(front: &Front) -> String {
    let mut text = format!(
        "\nerror against {}: {} points, chosen on training pairs\n\n\
         {:<10} {:>12} {:>9} {:>18} {:>9} {:>12}  against default\n",
        front.cost.name(),
        front.points.len(),
        "",
        front.cost.name(),
        "error",
        "95 % interval",
        "recall",
        "median e_t"
    );
    let ends = [("default", &front.default), ("tuned", &front.tuned)];
    for (name, mark) in ends {
        let _ = writeln!(text, "{}", mark_row(name, front, mark, ""));
    }
    for (i, point) in (1..).zip(&front.points) {
        let against = point.comparison.error();
        let row = mark_row(&format!("point {i}"), front, &point.mark, against);
        let _ = writeln!(text, "{row}");
    }
    text + &format!(
        "\nThe cheapest point that errs no more than the default: {}.\n",
        front.verdict()
    )
}

fn mark_row(name: &str, front: &Front, mark: &Mark, against: &str) -> String {
    let [low, high] = mark.interval;
    format!(
        "{name:<10} {:>12} {:>9.4} {:>18} {:>7.1} % {:>9.2} cm  {against}",
        front.cost.text(front.cost.of(&mark.cost)),
        mark.error,
        format!("{low:.4} to {high:.4}"),
        mark.recall_pct,
        100.0 * mark.median_translation_m
    )
    .trim_end()
    .to_owned()
}

/// A value: a choice by name, a number so that it reads back as itself.
fn shown(name: &str, value: Option<f64>) -> String {
    let Some(value) = value else { return "–".into() };
    let choice = parameters::choices(name).get(value as usize);
    choice.map_or_else(|| value.to_string(), |&choice| choice.to_owned())
}

fn range(axis: &Axis) -> String {
    match parameters::choices(axis.name) {
        [] => format!("{} to {}", axis.min, axis.max),
        names => names.join(", "),
    }
}

fn row(summary: &Summary) -> String {
    let centimetres =
        |m: Option<f64>| m.map_or_else(|| "–".into(), |m| format!("{:.2} cm", 100.0 * m));
    let degrees = |d: Option<f64>| d.map_or_else(|| "–".into(), |d| format!("{d:.3}°"));
    format!(
        "{:>7.1} % {:>12} {:>11} {:>12} {:>12} {:>8.0}",
        summary.recall_pct,
        centimetres(summary.mean_translation_m),
        degrees(summary.mean_rotation_deg),
        centimetres(Some(summary.median_translation_m)),
        degrees(Some(summary.median_rotation_deg)),
        summary.mean_points
    )
}
