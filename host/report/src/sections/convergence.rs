//! Fitness and step size by generation.

use echoloop_closed_loop::config::TuneConfig;
use echoloop_closed_loop::config::preset::ErrorMean;
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::search::Origin;
use echoloop_statistics::median;

use super::Report;
use crate::axis::Axis;
use crate::finished_runs::FinishedRun;
use crate::format::significant;
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [520.0, 310.0];
const SIGMA_SIZE: Px = [360.0, 310.0];

const SIGMA_KEYS: [Key<'static>; 1] = [("sigma", Sample::Line, "step size σ of the search")];

/// Fitness of each generation's candidates; lower is better.
struct Fitness {
    best: Vec<f64>,
    lower_quartile: Vec<f64>,
    median: Vec<f64>,
    upper_quartile: Vec<f64>,
    /// Fitness of the default parameters on the training pairs, if known.
    default: f64,
}

impl Fitness {
    fn of(report: &Report) -> Self {
        let sorted = report.generations.iter().map(|generation| {
            let mut fitness: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
            fitness.sort_by(f64::total_cmp);
            fitness
        });
        let sorted: Vec<Vec<f64>> = sorted.collect();
        let quantile = |q: f64| -> Vec<f64> {
            let at = |count: usize| (count.saturating_sub(1) as f64 * q).round() as usize;
            let each = sorted.iter().map(|fitness| fitness.get(at(fitness.len())).copied());
            each.map(|fitness| fitness.unwrap_or(f64::NAN)).collect()
        };
        let mut finalists = report.run.result.finalists.iter();
        let start = finalists.find(|f| Origin::read(&f.origin) == Some(Origin::Start));
        Self {
            best: quantile(0.0),
            lower_quartile: quantile(0.25),
            median: sorted.iter().map(|fitness| median(fitness.iter().copied())).collect(),
            upper_quartile: quantile(0.75),
            default: start.map_or(f64::NAN, |start| start.fitness),
        }
    }
}

/// Both plots with their legend; empty without generations.
pub(super) fn section(report: &Report) -> String {
    if report.generations.is_empty() {
        return String::new();
    }
    let xs = numbers(&report.generations);
    let fitness = Fitness::of(report);
    format!(
        "<section id=\"convergence\"><h2>Convergence</h2>\
         <p class=\"lead\">Lower is better. Each generation samples new candidates, so its best is \
         the luckiest of a noisy draw; the median and the mean point say where the search \
         stands.</p>\
         <div class=\"pair wide-first\"><figure>{}{}</figure>{}</div></section>\n",
        fitness_plot(&report.run, &fitness, &xs),
        legend(&keys(&fitness)),
        sigma(&report.generations, &xs),
    )
}

/// Numbers of the generations, from 1.
pub(super) fn numbers(generations: &[Generation]) -> Vec<f64> {
    generations.iter().map(|g| f64::from(g.generation.saturating_add(1))).collect()
}

/// Axis that all plots by generation share.
pub(super) fn generation_axis(xs: &[f64]) -> Axis {
    Axis::between(xs.first().copied().unwrap_or(0.0), xs.last().copied().unwrap_or(1.0), false)
}

fn fitness_plot(run: &FinishedRun, fitness: &Fitness, xs: &[f64]) -> String {
    let Fitness { best, lower_quartile, median, upper_quartile, default } = fitness;
    let series = [best, lower_quartile, median, upper_quartile];
    let y = Axis::around(series.into_iter().flatten().copied().chain([*default]));
    let log = if y.is_log() { ", log axis" } else { "" };
    let y_title = &format!("{}{log}", fitness_name(&run.config.tune));
    let caption = Caption { name: "fitness", title: "Convergence", keys: &keys(fitness) };
    let (label, x_title) = (&fitness_label(fitness), "generation");
    let frame = Frame { caption, size: SIZE, label, y_title, x_title };
    chart(&frame, generation_axis(xs), y, |chart| {
        chart.band("band", xs, lower_quartile, upper_quartile)?;
        chart.level("default", *default)?;
        chart.line("median", xs, median)?;
        chart.line("best", xs, best)
    })
}

fn fitness_name(tune: &TuneConfig) -> String {
    let mean = match tune.error_mean {
        ErrorMean::Arithmetic => "mean",
        ErrorMean::Geometric => "geometric mean",
        ErrorMean::SquareRoot => "mean by square roots",
    };
    match tune.error_cap {
        cap if cap > 0.0 => format!("{mean} ‖T − T*‖_F, capped at {cap}"),
        _ => format!("{mean} ‖T − T*‖_F"),
    }
}

fn fitness_label(fitness: &Fitness) -> String {
    let ends = |values: &[f64]| {
        let mut finite = values.iter().copied().filter(|v| v.is_finite());
        let first = finite.next().unwrap_or(f64::NAN);
        let last = finite.next_back().unwrap_or(first);
        format!("{} to {}", significant(first), significant(last))
    };
    format!(
        "Line plot of fitness over {} generations: the best goes from {}, the median from {}.",
        fitness.best.len(),
        ends(&fitness.best),
        ends(&fitness.median)
    )
}

fn keys(fitness: &Fitness) -> Vec<Key<'static>> {
    let has = |values: &[f64]| values.iter().any(|v| v.is_finite());
    let has_band = has(&fitness.lower_quartile) && has(&fitness.upper_quartile);
    let all: [(bool, Key<'static>); 4] = [
        (has(&fitness.best), ("best", Sample::Line, "best candidate")),
        (has(&fitness.median), ("median", Sample::Line, "median candidate")),
        (has_band, ("band", Sample::Area, "middle half of the candidates")),
        (fitness.default.is_finite(), ("default", Sample::Line, "default parameters")),
    ];
    all.into_iter().filter(|(shown, _)| *shown).map(|(_, key)| key).collect()
}

/// Plot of the step size; empty where it is unknown throughout.
fn sigma(generations: &[Generation], xs: &[f64]) -> String {
    let sigma: Vec<f64> = generations.iter().map(|generation| generation.sigma).collect();
    if !sigma.iter().any(|s| s.is_finite()) {
        return String::new();
    }
    let end = |sigma: Option<&f64>| sigma.map_or_else(String::new, |&sigma| significant(sigma));
    let label = &format!(
        "Line plot of the step size from {} to {} widths of the unit cube.",
        end(sigma.first()),
        end(sigma.last())
    );
    let y_title = "σ, widths of the unit cube, log axis";
    let caption = Caption { name: "step-size", title: "Step size", keys: &SIGMA_KEYS };
    let frame = Frame { caption, size: SIGMA_SIZE, label, y_title, x_title: "generation" };
    let y = Axis::log_around(sigma.iter().copied(), 1e-9);
    let plot = chart(&frame, generation_axis(xs), y, |chart| chart.line("sigma", xs, &sigma));
    format!("<figure>{plot}{}</figure>", legend(&SIGMA_KEYS))
}
