//! Each test pair before and after, and the distributions of both.

use plotters::element::{Circle, Cross, PathElement};
use plotters::series::LineSeries;
use plotters::style::Color;

use crate::axis::Axis;
use super::{PairError, PoseError, Report};
use crate::format::{file_name, fixed, with_unit};
use crate::plot::{Caption, Chart, Drawn, Frame, Key, Px, Sample, chart, fine, legend};
use crate::theme::ink;
use echoloop_statistics::coin;

const SLOPES: Px = [900.0, 300.0];
const CURVE: Px = [440.0, 270.0];

/// Errors below this are drawn here: a tenth of a millimetre, a ten-thousandth of a degree.
const FLOOR: f64 = 1e-4;

/// One of the two parts of a pose error.
struct Part {
    name: &'static str,
    unit: &'static str,
    read: fn(&PoseError) -> f64,
}

const TRANSLATION: Part =
    Part { name: "translation error", unit: "m", read: |error| error.translation_m };
const ROTATION: Part =
    Part { name: "rotation error", unit: "°", read: |error| error.rotation_deg };

/// The three plots, or nothing without pairs.
pub(crate) fn section(report: &Report) -> String {
    let pairs = &report.pair_errors;
    if pairs.is_empty() {
        return String::new();
    }
    let within = &report.table.success_within;
    format!(
        "<section id=\"pairs\"><h2>Pair by pair</h2><p class=\"lead\">{}</p>\
         <figure><div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Errors by \
         pair\">{}</div>{}</figure>\
         <div class=\"pair\"><figure>{}</figure><figure>{}</figure></div>{}</section>\n",
        gains(pairs, within),
        slopes(pairs, within),
        legend(&SLOPE_KEYS),
        curve(&TRANSLATION, pairs, within),
        curve(&ROTATION, pairs, within),
        legend(&CURVE_KEYS)
    )
}

/// How many pairs tuning won and lost, and whether that could be a coin's doing.
fn gains(pairs: &[PairError], within: &PoseError) -> String {
    let count = |before: bool, after: bool| {
        let same = |p: &&PairError| {
            p.default.is_within(within) == before && p.tuned.is_within(within) == after
        };
        pairs.iter().filter(same).count()
    };
    let (won, lost) = (count(false, true), count(true, false));
    format!(
        "Of {} pairs, tuning won {won} that failed before and lost {lost} that had succeeded; {} \
         succeed under both, {} under neither. A fair coin would split the changed pairs at least \
         as unevenly with probability {} (McNemar’s exact test).",
        pairs.len(),
        count(true, true),
        count(false, false),
        fixed(coin(won, lost), 3)
    )
}

/// A stroke for each pair from its default to its tuned error, worst default first.
fn slopes(pairs: &[PairError], within: &PoseError) -> String {
    let mut sorted: Vec<&PairError> = pairs.iter().collect();
    sorted.sort_by(|a, b| b.default.translation_m.total_cmp(&a.default.translation_m));
    let label =
        format!("Translation error of {} pairs with default and tuned parameters.", pairs.len());
    let caption =
        Caption { name: "pairs", title: "Default and tuned, pair by pair", keys: &SLOPE_KEYS };
    let frame = Frame {
        caption,
        size: SLOPES,
        label: &label,
        y_title: "translation error, m, log axis; ✕ at the top: nothing found",
        x_title: "test pairs, largest default error first (hover for names)",
    };
    let x = Axis::between(0.5, sorted.len() as f64 + 0.5, false).with_ticks(&[]);
    chart(&frame, x, part_axis(&TRANSLATION, pairs, within), |chart| {
        chart.level("limit", within.translation_m)?;
        let radius = if sorted.len() > 60 { 2.8 } else { 4.5 };
        sorted
            .iter()
            .enumerate()
            .try_for_each(|(rank, pair)| slope(chart, pair, rank as f64 + 1.0, within, radius))
    })
}

fn slope(
    chart: &mut Chart<'_, '_>,
    pair: &PairError,
    x: f64,
    within: &PoseError,
    radius: f64,
) -> Drawn {
    let reach = |error: &PoseError| {
        if error.translation_m.is_finite() { error.translation_m } else { f64::INFINITY }
    };
    let [before, after] = [&pair.default, &pair.tuned].map(reach);
    let class = if after < before { "slope good" } else { "slope bad" };
    chart.draw([PathElement::new([(x, before), (x, after)], ink(class))])?;
    let [was, is] = [&pair.default, &pair.tuned].map(|error| error.is_within(within));
    mark(chart, "dot-default", (x, before), was, radius)?;
    mark(chart, "dot-tuned", (x, after), is, radius)?;
    chart.hint(x - 0.5, x + 0.5, &hint(pair));
    Ok(())
}

/// Filled when the pair succeeds, hollow when it does not, a cross when nothing was found.
fn mark(
    chart: &mut Chart<'_, '_>,
    class: &str,
    at: (f64, f64),
    succeeds: bool,
    radius: f64,
) -> Drawn {
    if at.1.is_infinite() {
        return chart.draw([Cross::new(at, fine(radius), ink(class))]);
    }
    let class = if succeeds { class.to_owned() } else { format!("{class} hollow") };
    chart.draw([Circle::new(at, fine(radius), ink(&class).filled())])
}

fn hint(pair: &PairError) -> String {
    let text = |e: &PoseError| {
        format!(
            "{}, {}",
            with_unit(&fixed(e.translation_m, 3), "m"),
            with_unit(&fixed(e.rotation_deg, 2), "°")
        )
    };
    format!("{}: default {}; tuned {}", pair.label, text(&pair.default), text(&pair.tuned))
}

/// Share of pairs whose error is at most x, for both settings.
fn curve(part: &Part, pairs: &[PairError], within: &PoseError) -> String {
    let label =
        format!("Cumulative distribution of the {} with default and tuned parameters.", part.name);
    let x_title = format!("{}, {}, log axis", part.name, part.unit);
    let (name, keys) = (file_name(part.name), &CURVE_KEYS);
    let frame = Frame {
        caption: Caption { name: &name, title: part.name, keys },
        size: CURVE,
        label: &label,
        y_title: "% of pairs with at most this error",
        x_title: &x_title,
    };
    let curve = |read: fn(&PairError) -> &PoseError| {
        steps(pairs.iter().map(|pair| (part.read)(read(pair))).collect())
    };
    chart(&frame, part_axis(part, pairs, within), Axis::between(0.0, 100.0, false), |chart| {
        chart.upright("limit", (part.read)(within))?;
        chart.draw(LineSeries::new(curve(|pair| &pair.default), ink("curve-default")))?;
        chart.draw(LineSeries::new(curve(|pair| &pair.tuned), ink("curve-tuned")))
    })
}

/// The outline of the staircase; pairs without an error never arrive.
pub(super) fn steps(mut errors: Vec<f64>) -> Vec<(f64, f64)> {
    let share = 100.0 / errors.len() as f64;
    errors.retain(|e| e.is_finite());
    errors.sort_by(f64::total_cmp);
    let stairs = errors
        .iter()
        .enumerate()
        .flat_map(|(i, e)| [(*e, share * i as f64), (*e, share * (i + 1) as f64)]);
    [(0.0, 0.0)]
        .into_iter()
        .chain(stairs)
        .chain([(f64::INFINITY, share * errors.len() as f64)])
        .collect()
}

fn part_axis(part: &Part, pairs: &[PairError], within: &PoseError) -> Axis {
    let errors = pairs.iter().flat_map(|p| [(part.read)(&p.default), (part.read)(&p.tuned)]);
    Axis::log_around(errors.chain([(part.read)(within)]), FLOOR)
}

const SLOPE_KEYS: [Key<'static>; 7] = [
    ("dot-default", Sample::Dot, "default, success"),
    ("dot-default hollow", Sample::Dot, "default, failure"),
    ("dot-tuned", Sample::Dot, "tuned, success"),
    ("dot-tuned hollow", Sample::Dot, "tuned, failure"),
    ("slope good", Sample::Line, "smaller error"),
    ("slope bad", Sample::Line, "larger error"),
    ("limit", Sample::Line, "bound of success"),
];

const CURVE_KEYS: [Key<'static>; 3] = [
    ("curve-default", Sample::Line, "default"),
    ("curve-tuned", Sample::Line, "tuned"),
    ("limit", Sample::Line, "bound of success"),
];
