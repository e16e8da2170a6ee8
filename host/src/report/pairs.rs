//! Each test pair before and after, and the distributions of both.

use std::f64::consts::LN_2;

use super::axis::Axis;
use super::chart::{Chart, Margins, Sample, legend};
use super::data::{PairError, PoseError, Report};
use super::format::{fixed, with_unit};
use super::svg::{Px, Svg};

const SLOPES: Px = [900.0, 300.0];
const CURVE: Px = [440.0, 270.0];
const MARGINS: Margins = Margins {
    left: 48.0,
    right: 14.0,
    top: 34.0,
    bottom: 46.0,
};

/// Errors below this are drawn here: a tenth of a millimetre, a ten-thousandth of a degree.
const FLOOR: f64 = 1e-4;

/// One of the two parts of a pose error.
struct Part {
    name: &'static str,
    unit: &'static str,
    read: fn(&PoseError) -> f64,
}

const TRANSLATION: Part = Part {
    name: "translation error",
    unit: "m",
    read: |error| error.translation_m,
};
const ROTATION: Part = Part {
    name: "rotation error",
    unit: "°",
    read: |error| error.rotation_deg,
};

/// The three plots, or nothing without pairs.
pub(super) fn section(report: &Report) -> String {
    let pairs = &report.pair_errors;
    if pairs.is_empty() {
        return String::new();
    }
    let within = &report.table.success_within;
    format!(
        "<section id=\"pairs\"><h2>Pair by pair</h2><p class=\"lead\">{}</p>\
         <figure><div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Errors by pair\">{}</div>{}</figure>\
         <div class=\"pair\"><figure>{}</figure><figure>{}</figure></div>{}</section>\n",
        gains(pairs, within),
        slopes(pairs, within),
        slope_legend(),
        curve(&TRANSLATION, pairs, within),
        curve(&ROTATION, pairs, within),
        curve_legend()
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
        "Of {} pairs, tuning won {won} that failed before and lost {lost} that had succeeded; {} succeed under both, \
         {} under neither. A fair coin would split the changed pairs at least as unevenly with probability {} \
         (McNemar’s exact test).",
        pairs.len(),
        count(true, true),
        count(false, false),
        fixed(coin(won, lost), 3)
    )
}

/// Probability that `a + b` throws of a fair coin fall at least as unevenly as `a` to `b`.
fn coin(a: usize, b: usize) -> f64 {
    let factorial = |n: usize| libm::lgamma(n as f64 + 1.0);
    let n = a + b;
    let share = |k| factorial(n) - factorial(k) - factorial(n - k) - n as f64 * LN_2;
    let sum: f64 = (0..=a.min(b)).map(|k| libm::exp(share(k))).sum();
    (2.0 * sum).min(1.0)
}

/// A stroke for each pair from its default to its tuned error, worst default first.
fn slopes(pairs: &[PairError], within: &PoseError) -> String {
    let mut sorted: Vec<&PairError> = pairs.iter().collect();
    sorted.sort_by(|a, b| b.default.translation_m.total_cmp(&a.default.translation_m));
    let bounds = [MARGINS.left + 8.0, SLOPES[0] - MARGINS.right];
    let x = Axis::between(0.5, sorted.len() as f64 + 0.5, false, bounds);
    let y = part_axis(&TRANSLATION, pairs, within, MARGINS.up(SLOPES));
    let label = format!(
        "Translation error of {} pairs with default and tuned parameters.",
        pairs.len()
    );
    let mut chart = Chart::new(Svg::new(SLOPES, &label), x, y)
        .with_y_grid("translation error, m, log axis; ✕ at the top: nothing found");
    chart.level("limit", within.translation_m);
    for (rank, pair) in sorted.iter().enumerate() {
        slope(&mut chart, pair, rank as f64 + 1.0, within, sorted.len());
    }
    let [bottom, _] = y.ends();
    let middle = f64::midpoint(bounds[0], bounds[1]);
    let title = "test pairs, largest default error first (hover for names)";
    chart
        .svg
        .text("axis middle", [middle, bottom + 24.0], title);
    chart.svg.finish()
}

fn slope(chart: &mut Chart, pair: &PairError, rank: f64, within: &PoseError, count: usize) {
    let x = chart.x.at(rank);
    let [before, after] = [&pair.default, &pair.tuned].map(|e| [x, chart.y.at(e.translation_m)]);
    let radius = if count > 60 { 2.8 } else { 4.5 };
    let class = if after[1] > before[1] {
        "slope good"
    } else {
        "slope bad"
    };
    chart.svg.hinted(&hint(pair), |svg| {
        svg.line(class, before, after);
        mark(svg, "dot-default", before, &pair.default, within, radius);
        mark(svg, "dot-tuned", after, &pair.tuned, within, radius);
    });
}

/// Filled when the pair succeeds, hollow when it does not, a cross when nothing was found.
fn mark(svg: &mut Svg, class: &str, at: Px, error: &PoseError, within: &PoseError, radius: f64) {
    if !error.translation_m.is_finite() {
        let [x, y] = at;
        let class = format!("{class} cross");
        svg.line(&class, [x - radius, y - radius], [x + radius, y + radius]);
        svg.line(&class, [x - radius, y + radius], [x + radius, y - radius]);
        return;
    }
    let hollow = if error.is_within(within) {
        ""
    } else {
        " hollow"
    };
    svg.dot(&format!("{class}{hollow}"), at, radius);
}

fn hint(pair: &PairError) -> String {
    let text = |e: &PoseError| {
        format!(
            "{}, {}",
            with_unit(&fixed(e.translation_m, 3), "m"),
            with_unit(&fixed(e.rotation_deg, 2), "°")
        )
    };
    format!(
        "{}: default {}; tuned {}",
        pair.label,
        text(&pair.default),
        text(&pair.tuned)
    )
}

/// Share of pairs whose error is at most x, for both settings.
fn curve(part: &Part, pairs: &[PairError], within: &PoseError) -> String {
    let x = part_axis(part, pairs, within, MARGINS.across(CURVE));
    let y = Axis::between(0.0, 100.0, false, MARGINS.up(CURVE));
    let label = format!(
        "Cumulative distribution of the {} with default and tuned parameters.",
        part.name
    );
    let mut chart = Chart::new(Svg::new(CURVE, &label), x, y)
        .with_y_grid("% of pairs with at most this error")
        .with_x_ticks(&format!("{}, {}, log axis", part.name, part.unit));
    chart.upright("limit", (part.read)(within));
    for (class, errors) in [
        (
            "curve-default",
            pairs.iter().map(|p| (part.read)(&p.default)).collect(),
        ),
        (
            "curve-tuned",
            pairs.iter().map(|p| (part.read)(&p.tuned)).collect(),
        ),
    ] {
        let steps = steps(&chart, errors);
        chart.svg.path(class, &steps, false);
    }
    chart.svg.finish()
}

/// The outline of the staircase; pairs without an error never arrive.
fn steps(chart: &Chart, mut errors: Vec<f64>) -> Vec<Px> {
    let count = errors.len() as f64;
    errors.retain(|e| e.is_finite());
    errors.sort_by(f64::total_cmp);
    let mut outline = vec![[chart.x.at(0.0), chart.y.at(0.0)]];
    for (i, error) in errors.iter().enumerate() {
        let x = chart.x.at(*error);
        outline.push([x, chart.y.at(100.0 * i as f64 / count)]);
        outline.push([x, chart.y.at(100.0 * (i + 1) as f64 / count)]);
    }
    let height = chart.y.at(100.0 * errors.len() as f64 / count);
    outline.push([chart.x.at(f64::INFINITY), height]);
    outline
}

fn part_axis(part: &Part, pairs: &[PairError], within: &PoseError, ends: [f64; 2]) -> Axis {
    let errors = pairs
        .iter()
        .flat_map(|p| [(part.read)(&p.default), (part.read)(&p.tuned)]);
    Axis::log_around(errors.chain([(part.read)(within)]), FLOOR, ends)
}

fn slope_legend() -> String {
    legend(&[
        ("dot-default", Sample::Dot, "default, success"),
        ("dot-default hollow", Sample::Dot, "default, failure"),
        ("dot-tuned", Sample::Dot, "tuned, success"),
        ("dot-tuned hollow", Sample::Dot, "tuned, failure"),
        ("slope good", Sample::Line, "smaller error"),
        ("slope bad", Sample::Line, "larger error"),
        ("limit", Sample::Line, "bound of success"),
    ])
}

fn curve_legend() -> String {
    legend(&[
        ("curve-default", Sample::Line, "default"),
        ("curve-tuned", Sample::Line, "tuned"),
        ("limit", Sample::Line, "bound of success"),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coin_is_fair() {
        for (a, b, p) in [
            (0, 0, 1.0),
            (3, 3, 1.0),
            (5, 0, 2.0 / 32.0),
            (1, 7, 18.0 / 256.0),
            (999, 999, 1.0),
        ] {
            assert!((coin(a, b) - p).abs() < 1e-9, "{a} to {b}");
        }
    }
}
