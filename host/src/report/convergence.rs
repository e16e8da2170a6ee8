//! Fitness and step size by generation.

use super::axis::Axis;
use super::chart::{Chart, Key, Margins, Sample, legend};
use super::data::Convergence;
use super::format::significant;
use super::svg::{Px, Svg};

const SIZE: Px = [520.0, 310.0];
const SIGMA_SIZE: Px = [360.0, 310.0];
const MARGINS: Margins = Margins {
    left: 48.0,
    right: 12.0,
    top: 34.0,
    bottom: 46.0,
};

/// Both plots with their legend, or nothing without generations.
pub(super) fn section(convergence: &Convergence) -> String {
    if convergence.generation.is_empty() {
        return String::new();
    }
    let xs = generations(convergence);
    format!(
        "<section id=\"convergence\"><h2>Convergence</h2>\
         <p class=\"lead\">Lower is better. Each generation samples new candidates, so its best is the luckiest of a \
         noisy draw; the median and the mean point say where the search stands.</p>\
         <div class=\"pair wide-first\"><figure>{}{}</figure>{}</div></section>\n",
        fitness(convergence, &xs),
        legend(&keys(convergence)),
        sigma(convergence, &xs),
    )
}

pub(super) fn generations(convergence: &Convergence) -> Vec<f64> {
    convergence
        .generation
        .iter()
        .copied()
        .map(f64::from)
        .collect()
}

/// The axis all plots by generation share.
pub(super) fn generation_axis(xs: &[f64], ends: [f64; 2]) -> Axis {
    let first = xs.first().copied().unwrap_or(0.0);
    let last = xs.last().copied().unwrap_or(1.0);
    Axis::between(first, last, false, ends)
}

fn fitness(c: &Convergence, xs: &[f64]) -> String {
    let series = [
        &c.best,
        &c.lower_quartile,
        &c.median,
        &c.upper_quartile,
        &c.mean_point,
        &c.held_out,
    ];
    let values = series
        .into_iter()
        .flatten()
        .copied()
        .chain(c.default_fitness);
    let x = generation_axis(xs, MARGINS.across(SIZE));
    let y = Axis::around(values, MARGINS.up(SIZE));
    let mut chart = Chart::new(Svg::new(SIZE, &fitness_label(c)), x, y)
        .with_y_grid(&fitness_title(c, y.is_log()))
        .with_x_ticks("generation");
    chart.band("band", xs, &c.lower_quartile, &c.upper_quartile);
    chart.level("default", c.default_fitness.unwrap_or(f64::NAN));
    chart.line("median", xs, &c.median);
    chart.line("best", xs, &c.best);
    chart.line("mean-point", xs, &c.mean_point);
    chart.dots("held-out", xs, &c.held_out, 3.5);
    chart.svg.finish()
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
        (
            significant(first),
            significant(finite.next_back().unwrap_or(first)),
        )
    };
    let (best, median) = (ends(&c.best), ends(&c.median));
    format!(
        "Line plot of fitness over {} generations: the best goes from {} to {}, the median from {} to {}.",
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
        (
            has(&c.mean_point),
            ("mean-point", Sample::Line, "mean point of the search"),
        ),
        (
            has(&c.held_out),
            ("held-out", Sample::Dot, "held-out pairs"),
        ),
        (
            c.default_fitness.is_some_and(f64::is_finite),
            ("default", Sample::Line, "default parameters"),
        ),
    ];
    all.into_iter()
        .filter(|(shown, _)| *shown)
        .map(|(_, key)| key)
        .collect()
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
    let x = generation_axis(xs, MARGINS.across(SIGMA_SIZE));
    let y = Axis::log_around(c.sigma.iter().copied(), 1e-9, MARGINS.up(SIGMA_SIZE));
    let mut chart = Chart::new(Svg::new(SIGMA_SIZE, &label), x, y)
        .with_y_grid("σ, widths of the unit cube, log axis")
        .with_x_ticks("generation");
    chart.line("sigma", xs, &c.sigma);
    let key = [("sigma", Sample::Line, "step size σ of the search")];
    format!("<figure>{}{}</figure>", chart.svg.finish(), legend(&key))
}
