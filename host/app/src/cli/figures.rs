//! Tables, clouds and the report of a run.

use super::exit::Failure;
use super::prepared::Prepared;
use crate::experiment::config::{RunConfig, TuneConfig};
use crate::experiment::cost::{CostKind, ScanCost};
use crate::experiment::evaluate::{Summary, median};
use crate::experiment::front::{Front, Mark};
use crate::experiment::objective::Registered;
use crate::experiment::params::{self, Axis, Parameters, Space, effective};
use crate::experiment::preset::ErrorMean;
use crate::experiment::run::{AFTER, BEFORE, REPORT, RunFolder, RunResult};
use crate::experiment::seed::{Purpose, derive};
use crate::experiment::tune::{Stage, TuneSearch, Tuned};
use crate::link::pattern::{described as beams_of, size};
use crate::report::{
    self, CloudLayer, Convergence, Correlation, Costs, EvaluationRow, EvaluationTable, FrontDot,
    PairClouds, PairError, ParameterTrace, PoseError, Report, RowKind,
};
use echoloop_dsp::ScanPattern;
use echoloop_registration::FgrMode;
use echoloop_registration::cloud::{Cloud, CloudFormat};

/// Default against tuned, and what was changed.
pub(super) fn print_table(config: &RunConfig, result: &RunResult, space: &Space) {
    let data = &config.data;
    println!(
        "\n{}: {} held-out pairs of other viewpoints of the same towns, {:.1} m apart; success \
         within {} m and {}°\n",
        result.method,
        result.tuned_summary.pairs,
        data.baseline_m,
        data.success_translation_m,
        data.success_rotation_deg
    );
    println!(
        "{:<10} {:>9} {:>12} {:>11} {:>12} {:>12} {:>8}",
        "", "recall", "mean e_t", "mean e_R", "median e_t", "median e_R", "points"
    );
    for (_, name, summary) in judged(result) {
        println!("{name:<10} {}", row(summary));
    }
    print_costs(&costs(result));
    result.front.iter().for_each(print_front);
    if space.axes().is_empty() {
        return;
    }
    println!("\n{:<34} {:>12} {:>12}  {:<14} range", "parameter", "default", "tuned", "unit");
    for axis in space.axes() {
        let [before, after] = [&result.default, &result.tuned]
            .map(|values| shown(axis.name, effective(values, axis.name)));
        println!("{:<34} {before:>12} {after:>12}  {:<14} {}", axis.name, axis.unit, range(axis));
    }
}

/// What a scan costs before and after, and what that comes to.
fn print_costs(costs: &Costs) {
    let line = |name: &str, cells: &[String]| {
        let cells: String = cells.iter().map(|cell| format!(" {cell:>24}")).collect();
        println!("{name:<10}{cells}");
    };
    println!();
    line("", &costs.heads);
    costs.rows.iter().for_each(|(name, cells)| line(name, cells));
    println!("{}", costs.verdict);
}

/// The points of a front, and what they come to.
fn print_front(front: &Front) {
    println!(
        "\nerror against {}: {} points, chosen on training pairs\n\n\
         {:<10} {:>12} {:>9} {:>18} {:>9} {:>12}  against default",
        front.cost.name(),
        front.points.len(),
        "",
        front.cost.name(),
        "error",
        "95 % interval",
        "recall",
        "median e_t"
    );
    println!("{}", mark_row("default", front, &front.default, ""));
    println!("{}", mark_row("tuned", front, &front.tuned, ""));
    for (i, point) in (1..).zip(&front.points) {
        let against = point.comparison.error();
        println!("{}", mark_row(&format!("point {i}"), front, &point.mark, against));
    }
    println!("\nThe cheapest point that errs no more than the default: {}.", front.verdict());
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

/// The front as the report draws it.
fn front_plot(front: &Front) -> report::Front {
    let dot = |mark: &Mark, against_default: &str| FrontDot {
        cost: front.cost.of(&mark.cost),
        cost_text: front.cost.text(front.cost.of(&mark.cost)),
        error: mark.error,
        interval: mark.interval,
        recall_pct: mark.recall_pct,
        median_translation_cm: 100.0 * mark.median_translation_m,
        against_default: against_default.into(),
    };
    let unit = match front.cost.unit() {
        "" => String::new(),
        unit => format!(", {unit}"),
    };
    report::Front {
        name: front.cost.name().into(),
        axis: format!("{}{unit}", front.cost.title()),
        verdict: format!(
            "The cheapest point that errs no more than the default: {}.",
            front.verdict()
        ),
        default: dot(&front.default, ""),
        tuned: dot(&front.tuned, ""),
        points: front.points.iter().map(|p| dot(&p.mark, p.comparison.error())).collect(),
    }
}

/// What scans of the held-out pairs cost.
fn costs(result: &RunResult) -> Costs {
    let summaries = [("default", &result.default_summary), ("tuned", &result.tuned_summary)];
    let known: Vec<(&str, &ScanCost)> = summaries
        .into_iter()
        .filter_map(|(name, summary)| Some((name, summary.cost.as_ref()?)))
        .collect();
    let [(_, before), (_, after)] = known[..] else { return Costs::default() };
    let cells = |cost| CostKind::ALL.map(|kind| kind.text(kind.of(cost))).to_vec();
    let said = result.comparison.at_cost(CostKind::Energy, before, after);
    let [low, high] = result.comparison.interval;
    let difference = result.comparison.difference;
    Costs {
        heads: CostKind::ALL.map(|kind| kind.title().to_owned()).to_vec(),
        rows: known.iter().map(|(name, cost)| ((*name).to_owned(), cells(cost))).collect(),
        verdict: format!(
            "Tuned: {said}. Its ‖T − T*‖_F is {difference:+.4} from the default's in the mean, \
             {low:+.4} to {high:+.4} with 95 %."
        ),
    }
}

/// What was judged, by name: the plain method, where ours is not that, the start, the choice.
pub(super) fn judged(result: &RunResult) -> impl Iterator<Item = (RowKind, String, &Summary)> {
    let plain = result.plain_summary.as_ref();
    let plain = plain.map(|plain| (RowKind::Reference, format!("plain {}", result.method), plain));
    plain.into_iter().chain([
        (RowKind::Default, "default".to_owned(), &result.default_summary),
        (RowKind::Tuned, "tuned".to_owned(), &result.tuned_summary),
    ])
}

/// A value as the table has it: a choice by name.
fn shown(name: &str, value: Option<f64>) -> String {
    let Some(value) = value else { return "–".into() };
    let choice = params::choices(name).get(value as usize);
    choice.map_or_else(|| format!("{value:.4}"), |&choice| choice.to_owned())
}

fn range(axis: &Axis) -> String {
    match params::choices(axis.name) {
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

/// Writes clouds and report into the run's folder.
pub(super) fn write_figures(run: &Finished<'_>) -> Result<(), Failure> {
    let shown = write_clouds(run)?;
    write_report(run, shown)
}

/// The held-out pair to show: the one the default parameters did worst on.
fn shown_pair(result: &RunResult) -> usize {
    let errors = &result.default_summary.errors;
    let worst = errors.iter().max_by(|a, b| a.frobenius.total_cmp(&b.frobenius));
    worst.map_or(0, |error| error.pair)
}

/// A run that has come to its end: what all figures are drawn from.
pub(super) struct Finished<'a> {
    pub(super) folder: &'a RunFolder,
    pub(super) prepared: &'a Prepared,
    pub(super) search: &'a TuneSearch<'a>,
    pub(super) tuned: &'a Tuned,
    pub(super) result: &'a RunResult,
}

/// The shown pair with default and with tuned parameters.
struct Shown {
    place: String,
    before: Registered,
    after: Registered,
}

/// Registers the shown pair both ways, and writes both as PLY.
fn write_clouds(run: &Finished<'_>) -> Result<Shown, Failure> {
    let Finished { folder, prepared, tuned, result, .. } = run;
    let index = shown_pair(result);
    let pair = &prepared.dataset.test[index];
    let noise = derive(prepared.config.seed, Purpose::TestNoise, index as u64);
    let register =
        |parameters: &Parameters| prepared.bench().register(parameters, index, pair, noise);
    let shown = Shown {
        place: pair.place.clone(),
        before: register(&prepared.start)?,
        after: register(&tuned.parameters)?,
    };
    folder.write(BEFORE, pair_bytes(&shown.before))?;
    folder.write(AFTER, pair_bytes(&shown.after))?;
    Ok(shown)
}

/// Both clouds in the first one's frame, as registered.
fn pair_bytes(registered: &Registered) -> Vec<u8> {
    let [first, _] = &registered.clouds;
    let mut points = first.points.clone();
    points.extend(laid_on(registered));
    CloudFormat::Ply.bytes(&Cloud::new(points), &[])
}

fn laid_on(registered: &Registered) -> impl Iterator<Item = nalgebra::Point3<f32>> + '_ {
    let pose = registered.first_from_second.cast::<f32>();
    registered.clouds[1].points.iter().map(move |p| pose * p)
}

/// Writes the report.
fn write_report(run: &Finished<'_>, shown: Shown) -> Result<(), Failure> {
    let Finished { folder, prepared, result, .. } = run;
    let config = &prepared.config;
    let data = &config.data;
    let success_within = PoseError {
        translation_m: data.success_translation_m,
        rotation_deg: data.success_rotation_deg,
    };
    let report = Report {
        title: format!("Echoloop: {} tuned for {}", config.tune.protocol.name(), result.scene),
        subtitle: format!(
            "{} registrations in {} generations",
            result.registrations, result.generations
        ),
        facts: facts(run),
        table: EvaluationTable {
            rows: judged(result)
                .map(|(kind, name, summary)| table_row(&name, kind, summary))
                .collect(),
            success_within,
        },
        costs: costs(result),
        front: result.front.as_ref().map(front_plot).unwrap_or_default(),
        convergence: convergence(config, run.tuned),
        parameters: traces(run),
        correlation: correlation(run),
        pair_errors: pair_errors(prepared, result),
        clouds: Some(pair_clouds(shown, result)),
        notes: notes(config),
    };
    let html = report.to_html().map_err(Failure::run)?;
    Ok(folder.write(REPORT, &html)?)
}

fn facts(run: &Finished<'_>) -> Vec<(String, String)> {
    let Finished { prepared, search, result, .. } = run;
    let config = &prepared.config;
    let pattern = prepared.dataset.beams.pattern();
    let beams = match pattern {
        ScanPattern::Grid(_) => size(pattern),
        _ => beams_of(pattern),
    };
    [
        ("Scene", format!("{}, {} triangles", result.scene, prepared.dataset.triangles)),
        ("Beams", beams),
        ("Protocol", result.protocol.clone()),
        ("Method", result.method.clone()),
        ("Strategy", config.tune.strategy.name().into()),
        ("Training pairs", config.data.train_pairs.to_string()),
        ("Held-out pairs", result.tuned_summary.pairs.to_string()),
        ("Distance of a pair", format!("{} m", config.data.baseline_m)),
        ("Searches", searches(&search.stages())),
        ("Seed", config.seed.to_string()),
        ("Chosen", result.origin.clone()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

/// The stages of a search, a line each.
fn searches(stages: &[Stage]) -> String {
    let told = stages.iter().map(|stage| {
        let Stage { name, generations, population, pairs, .. } = stage;
        format!("{name}: {generations} generations of {population} candidates on {pairs} pairs")
    });
    told.collect::<Vec<_>>().join("; ")
}

fn table_row(label: &str, kind: RowKind, summary: &Summary) -> EvaluationRow {
    EvaluationRow {
        label: label.into(),
        kind,
        pairs: Some(summary.pairs),
        recall_pct: summary.recall_pct,
        mean_translation_cm: summary.mean_translation_m.map_or(f64::NAN, |m| 100.0 * m),
        mean_rotation_deg: summary.mean_rotation_deg.unwrap_or(f64::NAN),
        median_translation_cm: 100.0 * summary.median_translation_m,
        median_rotation_deg: summary.median_rotation_deg,
    }
}

fn convergence(config: &RunConfig, tuned: &Tuned) -> Convergence {
    let mut series = Convergence {
        default_fitness: tuned.finalists.iter().find(|f| f.origin == "start").map(|f| f.fitness),
        fitness_name: fitness_name(&config.tune),
        ..Convergence::default()
    };
    for generation in &tuned.generations {
        let mut fitness: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
        fitness.sort_by(f64::total_cmp);
        let quantile = |q: f64| fitness[((fitness.len() - 1) as f64 * q).round() as usize];
        series.generation.push(generation.generation + 1);
        series.best.push(fitness[0]);
        series.lower_quartile.push(quantile(0.25));
        series.median.push(median(fitness.iter().copied()));
        series.upper_quartile.push(quantile(0.75));
        series.sigma.push(generation.sigma);
    }
    series
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

fn traces(run: &Finished<'_>) -> Vec<ParameterTrace> {
    let Finished { search, tuned, result, .. } = run;
    let value = |values: &params::Values, name: &str| effective(values, name).unwrap_or(f64::NAN);
    let axes = search.space.axes().iter().enumerate();
    axes.map(|(i, axis)| {
        let at = |offset: f64| -> Vec<f64> {
            tuned
                .generations
                .iter()
                .map(|g| axis.from_cube(g.mean[i] + offset * g.deviations[i]))
                .collect()
        };
        ParameterTrace {
            name: axis.name.into(),
            unit: axis.unit.into(),
            min: axis.min,
            max: axis.max,
            log: axis.scale == params::Scale::Log,
            choices: params::choices(axis.name),
            default: value(&result.default, axis.name),
            tuned: value(&result.tuned, axis.name),
            mean: at(0.0),
            low: at(-1.0),
            high: at(1.0),
        }
    })
    .collect()
}

fn correlation(run: &Finished<'_>) -> Option<Correlation> {
    let Finished { search, tuned, .. } = run;
    let short = |name: &str| name.rsplit('.').next().unwrap_or(name).to_owned();
    (!tuned.correlations.is_empty()).then(|| Correlation {
        names: search.space.axes().iter().map(|axis| short(axis.name)).collect(),
        matrix: tuned.correlations.clone(),
        covariance_learned: Some(tuned.covariance_learned),
    })
}

fn pair_errors(prepared: &Prepared, result: &RunResult) -> Vec<PairError> {
    let pose = |e: &crate::experiment::objective::PairError| PoseError {
        translation_m: e.translation_m,
        rotation_deg: e.rotation_deg,
    };
    let both = result.default_summary.errors.iter().zip(&result.tuned_summary.errors);
    both.map(|(before, after)| PairError {
        label: format!("{} pair {}", prepared.dataset.test[before.pair].place, before.pair),
        default: pose(before),
        tuned: pose(after),
    })
    .collect()
}

fn pair_clouds(shown: Shown, result: &RunResult) -> PairClouds {
    let layers = |registered: &Registered| {
        let target = registered.clouds[0].points.iter().map(|p| p.coords.into()).collect();
        let source = laid_on(registered).map(|p| p.coords.into()).collect();
        [target, source].map(|points| CloudLayer { points, intensity: Vec::new() })
    };
    let error = |r: &Registered| PoseError {
        translation_m: r.error.translation_m,
        rotation_deg: r.error.rotation_deg,
    };
    PairClouds {
        label: format!(
            "{} pair {}: the held-out pair the default did worst on",
            shown.place,
            shown_pair(result)
        ),
        before: layers(&shown.before),
        after: layers(&shown.after),
        before_error: error(&shown.before),
        after_error: error(&shown.after),
    }
}

fn notes(config: &RunConfig) -> Vec<String> {
    let mut notes = vec![
        "Every scan went through the sensor's firmware: settings and echoes as frames of its \
         link, echoes by its fixed-point detector."
            .to_owned(),
        "A registration that finds nothing counts as its initial guess, the identity.".to_owned(),
        "The held-out pairs are of other viewpoints of the same towns.".to_owned(),
    ];
    if config.registration.mode == FgrMode::Open3d {
        notes.push(
            "FGR as Open3D 0.20 runs it from Python with its defaults: without graduated \
             non-convexity, from a wrong start. It is the paper's baseline, not the published \
             method; that is mode annealed."
                .to_owned(),
        );
    }
    if config.tune.error_cap > 0.0 {
        notes.push(format!(
            "The search caps a pair's error at {} (the paper does not; tune.error_cap = 0 is its \
             way). The tables do not.",
            config.tune.error_cap
        ));
    }
    notes
}
