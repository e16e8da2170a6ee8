//! A front of error against a cost.

use crate::axis::Axis;
use super::cost::figure_cell;
use super::{Front, FrontDot};
use crate::format::{escape, fixed, significant};
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [880.0, 360.0];

/// No cost of a scan is less, in J, s, bits or instructions.
const LEAST_COST: f64 = 1e-12;

const KEYS: [Key<'static>; 3] = [
    ("held-out", Sample::Dot, "point of the front"),
    ("dot-default", Sample::Dot, "default parameters"),
    ("dot-tuned", Sample::Dot, "what the run tuned"),
];

/// The plot and its table, or nothing without points.
pub(crate) fn section(front: &Front) -> String {
    if front.points.is_empty() {
        return String::new();
    }
    format!(
        "<section id=\"front\"><h2>Error against {}</h2><p class=\"lead\">{} Points were chosen on \
         training pairs; all figures are of the held-out pairs. Bars are 95\u{a0}% intervals of \
         the error. Whether it differs from the default's is said by the pairs' own differences, \
         which are surer than two bars beside each other.</p><figure>{}{}</figure>{}</section>\n",
        escape(&front.name),
        escape(&front.verdict),
        plot(front),
        legend(&KEYS),
        table(front)
    )
}

fn all(front: &Front) -> impl Iterator<Item = &FrontDot> {
    front.points.iter().chain([&front.default, &front.tuned])
}

fn plot(front: &Front) -> String {
    let costs = all(front).map(|dot| dot.cost);
    let x = Axis::log_around(costs, LEAST_COST);
    let ends = all(front).flat_map(|dot| [dot.error, dot.interval[0], dot.interval[1]]);
    let y = Axis::around(ends);
    let y_title = format!("error, mean ‖T − T*‖_F{}", if y.is_log() { ", log axis" } else { "" });
    let label = label(front);
    let x_title = &format!("{}, log axis", front.axis);
    let title = format!("Error against {}", front.name);
    let caption = Caption { name: "front", title: &title, keys: &KEYS };
    let frame = Frame { caption, size: SIZE, label: &label, y_title: &y_title, x_title };
    chart(&frame, x, y, |chart| {
        for dot in all(front) {
            chart.line("whisker", &[dot.cost; 2], &dot.interval)?;
        }
        let of = |read: fn(&FrontDot) -> f64| front.points.iter().map(read).collect::<Vec<_>>();
        chart.dots("held-out", &of(|dot| dot.cost), &of(|dot| dot.error), 4.0)?;
        for (class, dot) in [("dot-default", &front.default), ("dot-tuned", &front.tuned)] {
            chart.dots(class, &[dot.cost], &[dot.error], 5.0)?;
        }
        Ok(())
    })
}

fn label(front: &Front) -> String {
    let (first, last) = (front.points.first(), front.points.last());
    let end = |dot: Option<&FrontDot>| {
        dot.map_or_else(String::new, |dot| {
            format!("{} at {}", significant(dot.error), dot.cost_text)
        })
    };
    format!(
        "Plot of {} points of error against {}: from {} to {}.",
        front.points.len(),
        front.name,
        end(first),
        end(last)
    )
}

fn table(front: &Front) -> String {
    let names =
        [front.axis.as_str(), "Error", "95 % interval", "Recall", "Median e_t", "Against default"];
    let heads: String =
        names.iter().map(|head| format!("<th scope=\"col\">{}</th>", escape(head))).collect();
    let row = |name: &str, dot: &FrontDot| row(name, &names, dot);
    let named = [("default", &front.default), ("tuned", &front.tuned)];
    let named = named.into_iter().map(|(name, dot)| row(name, dot));
    let points = (1..).zip(&front.points).map(|(i, dot)| row(&format!("point {i}"), dot));
    let rows: String = named.chain(points).collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Front\"><table \
         class=\"figures\"><thead><tr><th scope=\"col\">Parameters</th>{heads}</tr></thead>\
         <tbody>{rows}</tbody></table></div>"
    )
}

fn row(name: &str, heads: &[&str; 6], dot: &FrontDot) -> String {
    let [low, high] = dot.interval.map(significant);
    let cells = [
        dot.cost_text.clone(),
        significant(dot.error),
        format!("{low} to {high}"),
        format!("{}\u{a0}%", fixed(dot.recall_pct, 1)),
        format!("{}\u{a0}cm", fixed(dot.median_translation_cm, 2)),
        dot.against_default.clone(),
    ];
    let cells: String =
        heads.iter().zip(&cells).map(|(head, cell)| figure_cell(head, cell)).collect();
    format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", escape(name))
}
