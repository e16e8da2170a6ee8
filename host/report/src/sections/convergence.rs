//! Fitness and step size by generation.

use echoloop_closed_loop::config::TuneConfig;
use echoloop_closed_loop::config::preset::ErrorMean;
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::search::Origin;
use echoloop_statistics::median;

use super::optional_length;
use crate::ReportError;
use crate::axis::Axis;
use crate::finished_runs::FinishedRun;
use crate::format::significant;
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [520.0, 310.0];
const SIGMA_SIZE: Px = [360.0, 310.0];

const SIGMA_KEYS: [Key<'static>; 1] = [("sigma", Sample::Line, "step size σ of the search")];

/// Fitness (lower is better) and step size by generation. Each series is as long as `generation`,
/// or empty.
#[derive(Clone, Debug, Default)]
pub struct Convergence {
    /// Numbers of the generations, rising.
    pub generation: Vec<u32>,
    /// Best candidate of the generation.
    pub best: Vec<f64>,
    /// Lower quartile of the population.
    pub lower_quartile: Vec<f64>,
    /// Median of the population.
    pub median: Vec<f64>,
    /// Upper quartile of the population.
    pub upper_quartile: Vec<f64>,
    /// Fitness at the distribution's mean; not finite where it was not evaluated.
    pub mean_point: Vec<f64>,
    /// Fitness on held-out pairs that steer nothing; not finite where it was not evaluated.
    pub held_out: Vec<f64>,
    /// Step size σ of the search, in widths of the unit cube.
    pub sigma: Vec<f64>,
    /// Fitness of the default parameters on the training pairs.
    pub default_fitness: Option<f64>,
    /// Definition and unit of the fitness, such as "mean ‖T − T*‖ over 10 training pairs".
    pub fitness_name: String,
}

impl Convergence {
    /// The generations of a finished run.
    pub(super) fn of_run(run: &FinishedRun, generations: &[Generation]) -> Self {
        let finalists = &run.result.finalists;
        let start = finalists.iter().find(|f| Origin::read(&f.origin) == Some(Origin::Start));
        let mut series = Self {
            default_fitness: start.map(|finalist| finalist.fitness),
            fitness_name: fitness_name(&run.config.tune),
            ..Self::default()
        };
        for generation in generations {
            let mut fitness: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
            fitness.sort_by(f64::total_cmp);
            let quantile = |q: f64| {
                let at = (fitness.len().saturating_sub(1) as f64 * q).round() as usize;
                fitness.get(at).copied().unwrap_or(f64::NAN)
            };
            series.generation.push(generation.generation.saturating_add(1));
            series.best.push(quantile(0.0));
            series.lower_quartile.push(quantile(0.25));
            series.median.push(median(fitness.iter().copied()));
            series.upper_quartile.push(quantile(0.75));
            series.sigma.push(generation.sigma);
        }
        series
    }

    pub(super) fn check(&self) -> Result<(), ReportError> {
        let series = [
            ("best fitness", &self.best),
            ("lower quartile", &self.lower_quartile),
            ("median fitness", &self.median),
            ("upper quartile", &self.upper_quartile),
            ("fitness at the mean", &self.mean_point),
            ("held-out fitness", &self.held_out),
            ("sigma", &self.sigma),
        ];
        series.iter().try_for_each(|(name, values)| {
            optional_length(name, values.len(), self.generation.len(), "generations")
        })
    }
}

fn fitness_name(tune: &TuneConfig) -> String {
    let mean = match tune.error_mean {
        ErrorMean::Arithmetic => "mean",
        ErrorMean::Geometric => "geometric mean",
    };
    match tune.error_cap {
        cap if cap > 0.0 => format!("{mean} ‖T − T*‖_F, capped at {cap}"),
        _ => format!("{mean} ‖T − T*‖_F"),
    }
}

/// Both plots with their legend; empty without generations.
pub(super) fn section(convergence: &Convergence) -> String {
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

/// Axis that all plots by generation share.
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

/// Plot of the step size; empty where it is unknown throughout.
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
