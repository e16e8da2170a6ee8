//! A finished run as the page that tells it.

use super::chosen::explained;
use super::folder::{FinishedRun, Known, RunError};
use super::importance::{Importance, Share, Slice};
use crate::{
    Bar, CloudLayer, Convergence, Correlation, Costs, EvaluationRow, EvaluationTable, FrontDot,
    Identity, PairClouds, PairError, ParameterTrace, PoseError, Report, RowKind,
};
use echoloop_closed_loop::config::preset::ErrorMean;
use echoloop_closed_loop::config::{DataConfig, FgrMode, TuneConfig};
use echoloop_closed_loop::cost::{CostKind, ScanCost};
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};
use echoloop_closed_loop::evaluation::objective;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::front::{Front, Mark};
use echoloop_closed_loop::parameters::{self, effective};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::{AxisRecord, Background, RunResult, StageRecord};
use echoloop_closed_loop::search::Origin;
use echoloop_registration::cloud::Cloud;
use echoloop_statistics::median;

/// The page of a run, from its folder alone.
///
/// # Errors
///
/// [`RunError`] names the file.
pub fn page(run: &FinishedRun) -> Result<Report, RunError> {
    let (_, generations) = run.journal()?;
    let (background, result, config) = (run.background()?, &run.result, &run.config);
    let data = &config.data;
    let success_within = PoseError {
        translation_m: data.success_translation_m,
        rotation_deg: data.success_rotation_deg,
    };
    Ok(Report {
        title: format!("Echoloop: {} tuned for {}", result.protocol, result.scene),
        subtitle: format!(
            "{} registrations in {} generations",
            result.registrations, result.generations
        ),
        facts: facts(run, background),
        identity: identity(run),
        table: EvaluationTable {
            rows: judged(result)
                .map(|(kind, name, summary)| table_row(&name, kind, summary, result, data))
                .collect(),
            success_within,
        },
        costs: costs(result, config.tune.told_cost()),
        front: result.front.as_ref().map(front_plot).unwrap_or_default(),
        convergence: convergence(run, &generations),
        parameters: traces(background, result, &generations),
        importance: importance(background, result, &generations),
        correlation: correlation(background),
        pair_errors: pair_errors(background, result),
        clouds: Some(pair_clouds(run, background)?),
        notes: notes(config),
    })
}

/// Who made the run, when, how, and with which configuration.
fn identity(run: &FinishedRun) -> Identity {
    let session = |session: &echoloop_closed_loop::run_folder::provenance::Session| {
        let build = session.build.clone().unwrap_or_else(|| "unknown".into());
        [session.begun.clone(), session.version.clone(), build, session.command.clone()]
    };
    Identity {
        sessions: run.about.sessions.iter().map(session).collect(),
        configuration: run.config_text.clone(),
    }
}

fn facts(run: &FinishedRun, background: &Background) -> Vec<(String, String)> {
    let (config, result) = (&run.config, &run.result);
    let usual = [
        ("Scene", format!("{}, {} triangles", result.scene, background.triangles)),
        ("Beams", background.beams.clone()),
        ("Protocol", result.protocol.clone()),
        ("Method", result.method.clone()),
        ("Strategy", config.tune.strategy.name().into()),
        ("Training pairs", config.data.train_pairs.to_string()),
        ("Held-out pairs", result.tuned_summary.pairs.to_string()),
        ("Distance of a pair", format!("{} m", config.data.baseline_m)),
        ("Searches", searches(&background.stages)),
        ("Seed", config.seed.to_string()),
        ("Chosen", result.origin.clone()),
    ];
    let check = result.check.map(|check| ("Checked", check.to_string()));
    usual.into_iter().chain(check).map(|(name, value)| (name.to_owned(), value)).collect()
}

/// The stages of a search, one after the other.
fn searches(stages: &[StageRecord]) -> String {
    let told = stages.iter().map(|stage| {
        let StageRecord { name, generations, population, pairs } = stage;
        format!("{name}: {generations} generations of {population} candidates on {pairs} pairs")
    });
    told.collect::<Vec<_>>().join("; ")
}

fn table_row(
    label: &str,
    kind: RowKind,
    summary: &Summary,
    result: &RunResult,
    data: &DataConfig,
) -> EvaluationRow {
    let is_tuned = kind == RowKind::Tuned;
    let gain = is_tuned.then(|| Figures::between(&result.default_summary, summary, data));
    evaluation_row(label, kind, summary.pairs, Figures::of(summary, data), gain)
}

/// A row of figures in the page's units.
pub(super) fn evaluation_row(
    label: &str,
    kind: RowKind,
    pairs: usize,
    figures: Figures<Estimate>,
    gain: Option<Figures<Difference>>,
) -> EvaluationRow {
    let interval = |estimate: Estimate, scale: f64| estimate.interval.map(|end| scale * end);
    let difference = |found: Difference, scale: f64| crate::Difference {
        value: scale * found.estimate.value,
        interval: interval(found.estimate, scale),
        is_shown: found.is_shown,
    };
    let [recall_pct, mean_translation_cm, mean_rotation_deg, median_translation_cm, last] =
        shown_as(figures, |estimate, scale| scale * estimate.value);
    EvaluationRow {
        label: label.into(),
        kind,
        pairs: Some(pairs),
        recall_pct,
        mean_translation_cm,
        mean_rotation_deg,
        median_translation_cm,
        median_rotation_deg: last,
        intervals: shown_as(figures, interval),
        gain: gain.map(|gain| shown_as(gain, difference)),
    }
}

/// Figures in the order and the units of a row: percent, centimetres, degrees.
fn shown_as<T, U>(figures: Figures<T>, scaled: impl Fn(T, f64) -> U) -> [U; 5] {
    [
        scaled(figures.recall_pct, 1.0),
        scaled(figures.mean_translation_m, 100.0),
        scaled(figures.mean_rotation_deg, 1.0),
        scaled(figures.median_translation_m, 100.0),
        scaled(figures.median_rotation_deg, 1.0),
    ]
}

fn convergence(run: &FinishedRun, generations: &[Generation]) -> Convergence {
    let mut series = Convergence {
        default_fitness: run
            .result
            .finalists
            .iter()
            .find(|f| Origin::read(&f.origin) == Some(Origin::Start))
            .map(|f| f.fitness),
        fitness_name: fitness_name(&run.config.tune),
        ..Convergence::default()
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

fn traces(
    background: &Background,
    result: &RunResult,
    generations: &[Generation],
) -> Vec<ParameterTrace> {
    let value =
        |values: &parameters::Values, name: &str| effective(values, name).unwrap_or(f64::NAN);
    let axes = background.axes.iter().enumerate();
    axes.map(|(i, record)| {
        let axis = record.axis();
        let at = |offset: f64| -> Vec<f64> {
            let point = |g: &Generation| Some(g.mean.get(i)? + offset * g.deviations.get(i)?);
            let values = generations.iter().map(|g| point(g).map(|u| axis.from_cube(u)));
            values.map(|value| value.unwrap_or(f64::NAN)).collect()
        };
        ParameterTrace {
            name: record.name.clone(),
            unit: record.unit.clone(),
            min: axis.min,
            max: axis.max,
            log: axis.scale == parameters::Scale::Log,
            choices: parameters::choices(&record.name),
            default: value(&result.default, &record.name),
            tuned: value(&result.tuned, &record.name),
            mean: at(0.0),
            low: at(-1.0),
            high: at(1.0),
        }
    })
    .collect()
}

/// What the candidates say of the parameters, and of the choice.
fn importance(
    background: &Background,
    result: &RunResult,
    generations: &[Generation],
) -> crate::Importance {
    let axes = &background.axes;
    let chosen = explained(result, axes, generations);
    if axes.is_empty() {
        return crate::Importance::default();
    }
    match Importance::of(generations, axes, &result.tuned) {
        Importance::Silent(verdict) => {
            crate::Importance { verdict, chosen, ..crate::Importance::default() }
        }
        Importance::Told { of, predicted, axes: shares, slices } => crate::Importance {
            verdict: verdict(of, &predicted, axes.len() - shares.len()),
            bars: shares.iter().map(|(axis, share)| bar(&axes[*axis], share)).collect(),
            slices: slices.into_iter().map(|slice| drawn_slice(slice, axes, result)).collect(),
            chosen,
        },
    }
}

fn verdict([candidates, generations]: [usize; 2], predicted: &Share, left_out: usize) -> String {
    let [low, high] = predicted.interval.map(|end| 100.0 * end);
    let left_out = match left_out {
        0 => String::new(),
        1 => " One parameter moved in too few generations to be told.".to_owned(),
        count => format!(" {count} parameters moved in too few generations to be told."),
    };
    format!(
        "A response surface of second order, fitted to all {candidates} candidates within their \
         {generations} generations, predicts {:.0}\u{a0}% (95\u{a0}% interval {low:.0} to \
         {high:.0}) of how ln fitness varies among candidates that it has not seen. Importance is \
         the parameter’s share of that variation: half of what the squared error of those \
         predictions grows by when its values are dealt anew among the candidates of a generation \
         (Breiman 2001; Wei, Lu and Song 2015), with a bootstrap over generations. Blue: more than \
         chance. It holds where the search looked, not for the whole range.{left_out}",
        100.0 * predicted.value
    )
}

fn bar(axis: &AxisRecord, share: &Share) -> Bar {
    let Share { value, interval } = *share;
    Bar { name: axis.name.clone(), value, interval, is_shown: interval[0] > 0.0 }
}

fn drawn_slice(slice: Slice, axes: &[AxisRecord], result: &RunResult) -> crate::Slice {
    let record = &axes[slice.axis];
    crate::Slice {
        name: record.name.clone(),
        unit: record.unit.clone(),
        log: record.scale == parameters::Scale::Log,
        choices: parameters::choices(&record.name),
        at: slice.at,
        ratio: slice.ratio,
        band: slice.band,
        dots: slice.dots,
        chosen: effective(&result.tuned, &record.name).unwrap_or(f64::NAN),
    }
}

fn correlation(background: &Background) -> Option<Correlation> {
    let short = |name: &String| name.rsplit('.').next().unwrap_or(name).to_owned();
    (!background.correlations.is_empty()).then(|| Correlation {
        names: background.correlated.iter().map(short).collect(),
        matrix: background.correlations.clone(),
        covariance_learned: Some(background.covariance_learned),
    })
}

/// A pair's name: where it stands, and its number.
fn label(background: &Background, pair: usize) -> String {
    let place = background.places.get(pair).map_or("", String::as_str);
    format!("{place} pair {pair}").trim_start().to_owned()
}

fn pose_error(error: &objective::PairError) -> PoseError {
    PoseError { translation_m: error.translation_m, rotation_deg: error.rotation_deg }
}

fn pair_errors(background: &Background, result: &RunResult) -> Vec<PairError> {
    let both = result.default_summary.errors.iter().zip(&result.tuned_summary.errors);
    both.map(|(before, after)| PairError {
        label: label(background, before.pair),
        default: pose_error(before),
        tuned: pose_error(after),
    })
    .collect()
}

fn pair_clouds(run: &FinishedRun, background: &Background) -> Result<PairClouds, RunError> {
    let shown = run.result.shown_pair();
    let layer = |cloud: Cloud| CloudLayer {
        points: cloud.points.iter().map(|p| p.coords.into()).collect(),
        intensity: Vec::new(),
    };
    let error = |summary: &Summary| {
        let found = summary.errors.iter().find(|error| error.pair == shown);
        found.map(pose_error).unwrap_or_default()
    };
    let [before, after] = run.clouds()?.map(|clouds| clouds.map(layer));
    Ok(PairClouds {
        label: format!("{}: the held-out pair the default did worst on", label(background, shown)),
        before,
        after,
        before_error: error(&run.result.default_summary),
        after_error: error(&run.result.tuned_summary),
    })
}

/// The front as the report draws it.
fn front_plot(front: &Front) -> crate::Front {
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
    crate::Front {
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

/// What scans of the held-out pairs cost, and what one of these costs comes to.
pub fn costs(result: &RunResult, told: CostKind) -> Costs {
    let summaries = [("default", &result.default_summary), ("tuned", &result.tuned_summary)];
    let known: Vec<(&str, &ScanCost)> = summaries
        .into_iter()
        .filter_map(|(name, summary)| Some((name, summary.cost.as_ref()?)))
        .collect();
    let [(_, before), (_, after)] = known[..] else { return Costs::default() };
    let cells = |cost| CostKind::ALL.map(|kind| kind.text(kind.of(cost))).to_vec();
    let said = result.comparison.at_cost(told, before, after);
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
pub fn judged(result: &RunResult) -> impl Iterator<Item = (RowKind, String, &Summary)> {
    let plain = result.plain_summary.as_ref();
    let plain = plain.map(|plain| (RowKind::Reference, format!("plain {}", result.method), plain));
    plain.into_iter().chain([
        (RowKind::Default, "default".to_owned(), &result.default_summary),
        (RowKind::Tuned, "tuned".to_owned(), &result.tuned_summary),
    ])
}

fn notes(config: &Known) -> Vec<String> {
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
