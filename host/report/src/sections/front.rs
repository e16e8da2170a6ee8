//! A front of error against a cost.

use echoloop_closed_loop::front::{Front, FrontPoint, Mark};

use crate::axis::Axis;
use crate::format::{escape, fixed, significant};
use crate::page::{self, figure_cell};
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [880.0, 360.0];

/// Lower bound of the cost axis, in J, s, bits or instructions: no scan costs less.
const MIN_COST: f64 = 1e-12;

const KEYS: [Key<'static>; 3] = [
    ("held-out", Sample::Dot, "point of the front"),
    ("dot-default", Sample::Dot, "default parameters"),
    ("dot-tuned", Sample::Dot, "what the run tuned"),
];

/// The plot and its table; empty without points.
pub(super) fn section(front: Option<&Front>) -> String {
    let Some(front) = front.filter(|front| !front.points.is_empty()) else {
        return String::new();
    };
    format!(
        "<section id=\"front\"><h2>Error against {}</h2><p class=\"lead\">The cheapest point that \
         errs no more than the default: {}. Points were chosen on \
         training pairs; all figures are of the held-out pairs. Bars are 95\u{a0}% intervals of \
         the error. Whether it differs from the default's is said by the pairs' own differences, \
         which are surer than two bars beside each other.</p><figure>{}{}</figure>{}</section>\n",
        escape(front.cost.name()),
        escape(&front.verdict()),
        plot(front),
        legend(&KEYS),
        table(front)
    )
}

/// All points of the plot, with the default and the tuned parameters.
fn marks(front: &Front) -> impl Iterator<Item = &Mark> {
    front.points.iter().map(|point| &point.mark).chain([&front.default, &front.tuned])
}

/// Title of the cost axis, with its unit.
fn cost_title(front: &Front) -> String {
    match front.cost.unit() {
        "" => front.cost.title().to_owned(),
        unit => format!("{}, {unit}", front.cost.title()),
    }
}

fn cost_text(front: &Front, mark: &Mark) -> String {
    front.cost.text(front.cost.of(&mark.cost))
}

fn plot(front: &Front) -> String {
    let cost = |mark: &Mark| front.cost.of(&mark.cost);
    let x = Axis::log_around(marks(front).map(cost), MIN_COST);
    let ends = marks(front).flat_map(|mark| [mark.error, mark.interval[0], mark.interval[1]]);
    let y = Axis::around(ends);
    let y_title = format!("error, mean ‖T − T*‖_F{}", if y.is_log() { ", log axis" } else { "" });
    let label = label(front);
    let x_title = &format!("{}, log axis", cost_title(front));
    let title = format!("Error against {}", front.cost.name());
    let caption = Caption { name: "front", title: &title, keys: &KEYS };
    let frame = Frame { caption, size: SIZE, label: &label, y_title: &y_title, x_title };
    chart(&frame, x, y, |chart| {
        for mark in marks(front) {
            chart.line("whisker", &[cost(mark); 2], &mark.interval)?;
        }
        let points = front.points.iter().map(|point| (cost(&point.mark), point.mark.error));
        let (costs, errors): (Vec<f64>, Vec<f64>) = points.unzip();
        chart.dots("held-out", &costs, &errors, 4.0)?;
        for (class, mark) in [("dot-default", &front.default), ("dot-tuned", &front.tuned)] {
            chart.dots(class, &[cost(mark)], &[mark.error], 5.0)?;
        }
        Ok(())
    })
}

fn label(front: &Front) -> String {
    let end = |point: Option<&FrontPoint>| {
        point.map_or_else(String::new, |FrontPoint { mark, .. }| {
            format!("{} at {}", significant(mark.error), cost_text(front, mark))
        })
    };
    format!(
        "Plot of {} points of error against {}: from {} to {}.",
        front.points.len(),
        front.cost.name(),
        end(front.points.first()),
        end(front.points.last())
    )
}

fn table(front: &Front) -> String {
    let cost = cost_title(front);
    let names = [&cost, "Error", "95 % interval", "Recall", "Median e_t", "Against default"];
    let row = |name: &str, mark: &Mark, against: &str| {
        let [low, high] = mark.interval.map(significant);
        let cells = [
            cost_text(front, mark),
            significant(mark.error),
            format!("{low} to {high}"),
            format!("{}\u{a0}%", fixed(mark.recall_pct, 1)),
            format!("{}\u{a0}cm", fixed(100.0 * mark.median_translation_m, 2)),
            against.to_owned(),
        ];
        page::row(name, names.iter().zip(&cells).map(|(head, cell)| figure_cell(head, cell)))
    };
    let named = [("default", &front.default), ("tuned", &front.tuned)];
    let named = named.into_iter().map(|(name, mark)| row(name, mark, ""));
    let points = (1..).zip(&front.points).map(|(i, FrontPoint { mark, comparison, .. })| {
        row(&format!("point {i}"), mark, comparison.error())
    });
    let heads = ["Parameters"].into_iter().chain(names).map(escape);
    page::table("figures", "Front", heads, &named.chain(points).collect::<String>())
}
