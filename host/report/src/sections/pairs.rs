//! Errors of each held-out pair before and after tuning, and their distributions.

use echoloop_closed_loop::config::DataConfig;
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::succeeds;
use echoloop_closed_loop::run_folder::run::{Background, RunResult};
use echoloop_statistics::sign_test;
use plotters::element::{Circle, Cross, PathElement};
use plotters::series::LineSeries;
use plotters::style::Color;

use super::Report;
use crate::axis::Axis;
use crate::format::{file_name, fixed, with_unit};
use crate::plot::{Caption, Chart, Drawn, Frame, Key, Px, Sample, chart, fine, legend};
use crate::theme::ink;

const SLOPES: Px = [900.0, 300.0];
const CURVE: Px = [440.0, 270.0];

/// Least error of the axes, m or degrees; smaller ones are drawn there.
const FLOOR: f64 = 1e-4;

/// Errors of one held-out pair with the default and the tuned parameters; NaN where unknown.
type Both<'a> = [&'a PairError; 2];

/// Name of a pair: its place and index.
pub(super) fn label_of(background: &Background, pair: usize) -> String {
    let place = background.places.get(pair).map_or("", String::as_str);
    format!("{place} pair {pair}").trim_start().to_owned()
}

/// One of the two parts of a pose error.
struct Part {
    name: &'static str,
    unit: &'static str,
    read: fn(&PairError) -> f64,
    /// Greatest error of a success.
    bound: fn(&DataConfig) -> f64,
}

const TRANSLATION: Part = Part {
    name: "translation error",
    unit: "m",
    read: |error| error.translation_m,
    bound: |data| data.success_translation_m,
};
const ROTATION: Part = Part {
    name: "rotation error",
    unit: "°",
    read: |error| error.rotation_deg,
    bound: |data| data.success_rotation_deg,
};

/// The three plots; empty without pairs.
pub(super) fn section(report: &Report) -> String {
    let RunResult { default_summary, tuned_summary, .. } = &report.run.result;
    let pairs = default_summary.errors.iter().zip(&tuned_summary.errors);
    let pairs: Vec<Both<'_>> = pairs.map(|(default, tuned)| [default, tuned]).collect();
    if pairs.is_empty() {
        return String::new();
    }
    let data = &report.run.config.data;
    format!(
        "<section id=\"pairs\"><h2>Pair by pair</h2><p class=\"lead\">{}</p>\
         <figure><div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Errors by \
         pair\">{}</div>{}</figure>\
         <div class=\"pair\"><figure>{}</figure><figure>{}</figure></div>{}</section>\n",
        gains(&pairs, data),
        slopes(&pairs, report),
        legend(&SLOPE_KEYS),
        curve(&TRANSLATION, &pairs, data),
        curve(&ROTATION, &pairs, data),
        legend(&CURVE_KEYS)
    )
}

/// Numbers of pairs that tuning won and lost, with their significance.
fn gains(pairs: &[Both<'_>], data: &DataConfig) -> String {
    let count = |before: bool, after: bool| {
        pairs.iter().filter(|pair| pair.map(|e| succeeds(e, data)) == [before, after]).count()
    };
    let (won, lost) = (count(false, true), count(true, false));
    format!(
        "Of {} pairs, tuning won {won} that failed before and lost {lost} that had succeeded; {} \
         succeed under both, {} under neither. A fair coin would split the changed pairs at least \
         as unevenly with probability {} (McNemar’s exact test).",
        pairs.len(),
        count(true, true),
        count(false, false),
        fixed(sign_test(won, lost), 3)
    )
}

/// Plot with a stroke from the default to the tuned error of each pair, largest default first.
fn slopes(pairs: &[Both<'_>], report: &Report) -> String {
    let data = &report.run.config.data;
    let mut sorted = pairs.to_vec();
    sorted.sort_by(|[a, _], [b, _]| b.translation_m.total_cmp(&a.translation_m));
    let label =
        &format!("Translation error of {} pairs with default and tuned parameters.", pairs.len());
    let caption =
        Caption { name: "pairs", title: "Default and tuned, pair by pair", keys: &SLOPE_KEYS };
    let y_title = "translation error, m, log axis; ✕ at the top: nothing found";
    let x_title = "test pairs, largest default error first (hover for names)";
    let frame = Frame { caption, size: SLOPES, label, y_title, x_title };
    let x = Axis::between(0.5, sorted.len() as f64 + 0.5, false).with_ticks(&[]);
    chart(&frame, x, part_axis(&TRANSLATION, pairs, data), |chart| {
        chart.level("limit", data.success_translation_m)?;
        let radius = if sorted.len() > 60 { 2.8 } else { 4.5 };
        (1..).zip(&sorted).try_for_each(|(rank, &both)| {
            let x = f64::from(rank);
            slope(chart, both, x, data, radius)?;
            let label = label_of(&report.background, both[0].pair);
            chart.hint(x - 0.5, x + 0.5, &format!("{label}: {}", hint(both)));
            Ok(())
        })
    })
}

fn slope(
    chart: &mut Chart<'_, '_>,
    pair: Both<'_>,
    x: f64,
    data: &DataConfig,
    radius: f64,
) -> Drawn {
    let reach = |error: &PairError| match error.translation_m {
        error if error.is_finite() => error,
        _ => f64::INFINITY,
    };
    let [before, after] = pair.map(reach);
    let class = if after < before { "slope good" } else { "slope bad" };
    chart.draw([PathElement::new([(x, before), (x, after)], ink(class))])?;
    let [was, is] = pair.map(|error| succeeds(error, data));
    mark(chart, "dot-default", (x, before), was, radius)?;
    mark(chart, "dot-tuned", (x, after), is, radius)
}

/// Mark of an error: filled for a success, hollow for a failure, a cross where it is unknown.
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

fn hint(pair: Both<'_>) -> String {
    let [default, tuned] = pair.map(|e| {
        format!(
            "{}, {}",
            with_unit(&fixed(e.translation_m, 3), "m"),
            with_unit(&fixed(e.rotation_deg, 2), "°")
        )
    });
    format!("default {default}; tuned {tuned}")
}

/// Cumulative distribution of one part of the error, for both settings.
fn curve(part: &Part, pairs: &[Both<'_>], data: &DataConfig) -> String {
    let label =
        format!("Cumulative distribution of the {} with default and tuned parameters.", part.name);
    let x_title = format!("{}, {}, log axis", part.name, part.unit);
    let caption = Caption { name: &file_name(part.name), title: part.name, keys: &CURVE_KEYS };
    let y_title = "% of pairs with at most this error";
    let frame = Frame { caption, size: CURVE, label: &label, y_title, x_title: &x_title };
    let steps = |which: usize| steps(pairs.iter().map(|pair| (part.read)(pair[which])).collect());
    chart(&frame, part_axis(part, pairs, data), Axis::between(0.0, 100.0, false), |chart| {
        chart.upright("limit", (part.bound)(data))?;
        chart.draw(LineSeries::new(steps(0), ink("curve-default")))?;
        chart.draw(LineSeries::new(steps(1), ink("curve-tuned")))
    })
}

/// Outline of a cumulative distribution, percent; pairs with unknown errors count as infinite.
pub(crate) fn steps(mut errors: Vec<f64>) -> Vec<(f64, f64)> {
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

fn part_axis(part: &Part, pairs: &[Both<'_>], data: &DataConfig) -> Axis {
    let errors = pairs.iter().flat_map(|pair| pair.map(part.read));
    Axis::log_around(errors.chain([(part.bound)(data)]), FLOOR)
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
