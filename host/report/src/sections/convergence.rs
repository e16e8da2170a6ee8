//! Fitness and step size by generation.

use crate::axis::Axis;
use super::Convergence;
use crate::format::significant;
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [520.0, 310.0];
const SIGMA_SIZE: Px = [360.0, 310.0];

const SIGMA_KEYS: [Key<'static>; 1] = [("sigma", Sample::Line, "step size σ of the search")];

/// Both plots with their legend, or nothing without generations.
pub(crate) fn section(convergence: &Convergence) -> String {
    if convergence.generation.is_empty() {
        return String::new();
    }
    let xs = generations(convergence);
    format!(
        "<section id=\"convergence\"><h2>Convergence</h2>\
         <p class=\"lead\">Lower is better. Each generation samples new candidates, so its best is \
         the luckiest of a noisy draw; the median and the mean point say where the search \
         stands.</p>\
         <div class=\"pair wide-first\"><figure>{}{}</figure>{}</div></section>\n",
        fitness(convergence, &xs),
        legend(&keys(convergence)),
        sigma(convergence, &xs),
    )
}

pub(super) fn generations(convergence: &Convergence) -> Vec<f64> {
    convergence.generation.iter().copied().map(f64::from).collect()
}

/// The axis all plots by generation share.
pub(super) fn generation_axis(xs: &[f64]) -> Axis {
    Axis::between(xs.first().copied().unwrap_or(0.0), xs.last().copied().unwrap_or(1.0), false)
}

fn fitness(c: &Convergence, xs: &[f64]) -> String {
    let series =
        [&c.best, &c.lower_quartile, &c.median, &c.upper_quartile, &c.mean_point, &c.held_out];
    let y = Axis::around(series.into_iter().flatten().copied().chain(c.default_fitness));
    let (label, y_title) = (fitness_label(c), fitness_title(c, y.is_log()));
    let caption = Caption { name: "fitness", title: "Convergence", keys: &keys(c) };
    let x_title = "generation";
    let frame = Frame { caption, size: SIZE, label: &label, y_title: &y_title, x_title };
    chart(&frame, generation_axis(xs), y, |chart| {
        chart.band("band", xs, &c.lower_quartile, &c.upper_quartile)?;
        chart.level("default", c.default_fitness.unwrap_or(f64::NAN))?;
        chart.line("median", xs, &c.median)?;
        chart.line("best", xs, &c.best)?;
        chart.line("mean-point", xs, &c.mean_point)?;
        chart.dots("held-out", xs, &c.held_out, 3.5)
    })
}

fn fitness_title(c: &Convergence, log: bool) -> String {
    let name = match c.fitness_name.as_str() {
        "" => "fitness",
        name => name,
    };
    format!("{name}{}", if log { ", log axis" } else { "" })
}

fn fitness_label(c: &Convergence) -> String {
    let ends = |values: &[f64]| {
        let mut finite = values.iter().copied().filter(|v| v.is_finite());
        let first = finite.next().unwrap_or(f64::NAN);
        (significant(first), significant(finite.next_back().unwrap_or(first)))
    };
    let (best, median) = (ends(&c.best), ends(&c.median));
    format!(
        "Line plot of fitness over {} generations: the best goes from {} to {}, the median from {} \
         to {}.",
        c.generation.len(),
        best.0,
        best.1,
        median.0,
        median.1
    )
}

fn keys(c: &Convergence) -> Vec<Key<'static>> {
    let has = |values: &[f64]| values.iter().any(|v| v.is_finite());
    let all: [(bool, Key<'static>); 6] = [
        (has(&c.best), ("best", Sample::Line, "best candidate")),
        (has(&c.median), ("median", Sample::Line, "median candidate")),
        (
            has(&c.lower_quartile) && has(&c.upper_quartile),
            ("band", Sample::Area, "middle half of the candidates"),
        ),
        (has(&c.mean_point), ("mean-point", Sample::Line, "mean point of the search")),
        (has(&c.held_out), ("held-out", Sample::Dot, "held-out pairs")),
        (
            c.default_fitness.is_some_and(f64::is_finite),
            ("default", Sample::Line, "default parameters"),
        ),
    ];
    all.into_iter().filter(|(shown, _)| *shown).map(|(_, key)| key).collect()
}

/// The step size, unless it is unknown throughout.
fn sigma(c: &Convergence, xs: &[f64]) -> String {
    if !c.sigma.iter().any(|s| s.is_finite()) {
        return String::new();
    }
    let first = c.sigma.first().copied().unwrap_or(f64::NAN);
    let last = c.sigma.last().copied().unwrap_or(f64::NAN);
    let label = format!(
        "Line plot of the step size from {} to {} widths of the unit cube.",
        significant(first),
        significant(last)
    );
    let y_title = "σ, widths of the unit cube, log axis";
    let caption = Caption { name: "step-size", title: "Step size", keys: &SIGMA_KEYS };
    let frame = Frame { caption, size: SIGMA_SIZE, label: &label, y_title, x_title: "generation" };
    let y = Axis::log_around(c.sigma.iter().copied(), 1e-9);
    let plot = chart(&frame, generation_axis(xs), y, |chart| chart.line("sigma", xs, &c.sigma));
    format!("<figure>{plot}{}</figure>", legend(&SIGMA_KEYS))
}
