//! Use of the budget's limits, with the default and tuned.

use echoloop_closed_loop::budget::Row;
use echoloop_closed_loop::parameters::Values;

use super::Report;
use crate::format::{significant, with_unit};
use crate::plot::{Caption, Key, LEFT, Px, RIGHT, Sample, drawing, legend};

const LIMIT: [f64; 2] = [150.0, 450.0];
const WIDTH: f64 = 720.0;
const LINE: f64 = 34.0;

const KEYS: [Key<'static>; 2] =
    [("bar", Sample::Area, "default"), ("bar strong-bar", Sample::Area, "tuned")];

/// A limit and what is used of it: by the default, then tuned.
struct Limit {
    name: &'static str,
    unit: &'static str,
    /// Use and limit of each: class 1 allows a denser scan less.
    used: [[f64; 2]; 2],
}

/// The limits with a bar for each set of parameters; nothing without a limit.
pub(super) fn section(report: &Report) -> String {
    let limits = limits(report).unwrap_or_default();
    if limits.is_empty() {
        return String::new();
    }
    format!(
        "<section id=\"budget\"><h2>Within the budget</h2><p class=\"lead\">A full bar is all that \
         the budget has.</p>{}{}</section>\n",
        legend(&KEYS),
        svg(&limits)
    )
}

/// `None` for an aim that the pattern refuses.
fn limits(report: &Report) -> Option<Vec<Limit>> {
    let config = &report.run.config;
    let budget = config.budget;
    let rows = |values: &Values| Some(config.usage(values)?.rows(&budget));
    let result = &report.run.result;
    let [before, after] = [rows(&result.default)?, rows(&result.tuned)?];
    let limit = |(before, after): (Row, Row)| {
        let used = [[before.used, before.limit?], [after.used, after.limit?]];
        Some(Limit { name: before.name, unit: before.unit, used })
    };
    Some(before.into_iter().zip(after).filter_map(limit).collect())
}

fn svg(limits: &[Limit]) -> String {
    let size: Px = [WIDTH, LINE * limits.len() as f64 + 6.0];
    let [left, right] = LIMIT;
    let caption = Caption { name: "budget", title: "Share of the budget", keys: &KEYS };
    let text = |limit: &Limit| {
        let [_, [used, most]] = limit.used;
        let most = with_unit(&significant(most), limit.unit);
        format!("{} of {most}", significant(used))
    };
    let told = limits.iter().map(|limit| format!("{}: {}", limit.name, text(limit)));
    let label = format!("Tuned: {}.", told.collect::<Vec<_>>().join("; "));
    drawing(&caption, size, &label, |canvas| {
        for (line, limit) in limits.iter().enumerate() {
            let top = LINE * line as f64 + 6.0;
            let middle = top + 11.0;
            canvas.text(limit.name, "tick", LEFT, [left - 8.0, middle])?;
            canvas.block("bar-back", [[left, top], [right, top + 22.0]])?;
            for (i, class) in ["bar", "bar strong-bar"].into_iter().enumerate() {
                let [used, most] = limit.used[i];
                let end = left + (right - left) * (used / most).clamp(0.0, 1.0);
                let upper = top + 11.0 * i as f64;
                canvas.block(class, [[left, upper + 1.0], [end, upper + 10.0]])?;
            }
            canvas.text(&text(limit), "tick", RIGHT, [right + 8.0, middle])?;
        }
        Ok(())
    })
}
