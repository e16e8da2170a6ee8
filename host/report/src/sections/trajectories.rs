//! Each parameter's way from default to tuned, in its own unit and within its bounds.

use crate::axis::Axis;
use super::convergence::{generation_axis, generations};
use super::{ParameterTrace, Report};
use crate::format::{escape, file_name, significant, with_unit};
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [240.0, 132.0];

const KEYS: [Key<'static>; 4] = [
    ("mean", Sample::Line, "mean of the search"),
    ("spread", Sample::Area, "± one standard deviation"),
    ("default", Sample::Line, "default"),
    ("tuned", Sample::Dot, "tuned"),
];

/// The small multiples and the same figures as a table, or nothing without parameters.
pub(crate) fn section(report: &Report) -> String {
    if report.parameters.is_empty() {
        return String::new();
    }
    let xs = generations(&report.convergence);
    let plots: String = report.parameters.iter().map(|p| plot(p, &xs)).collect();
    format!(
        "<section id=\"parameters\"><h2>Parameters</h2>\
         <p class=\"lead\">Each plot spans the parameter’s bounds, bottom to top. A band that \
         stays wide means the parameter hardly matters to the fitness, or that the search was too \
         short to tell; a value at a bound asks for a wider range.</p>\
         {}<div class=\"multiples\">{plots}</div>{}</section>\n",
        legend(&KEYS),
        table(&report.parameters)
    )
}

fn plot(p: &ParameterTrace, xs: &[f64]) -> String {
    let is_outside = p.default < p.min || p.default > p.max;
    let tags: String = [(p.log, "log"), (is_outside, "default out of bounds")]
        .iter()
        .filter(|(shown, _)| *shown)
        .map(|(_, text)| format!(" <small class=\"tag\">{text}</small>"))
        .collect();
    format!(
        "<figure \
         class=\"trace\"><figcaption><b>{}</b>{tags}<span>{}</span></figcaption>{}</figure>",
        escape(&p.name),
        escape(&change(p)),
        drawing(p, xs)
    )
}

fn change(p: &ParameterTrace) -> String {
    let tuned = with_unit(&value(p, p.tuned), &p.unit);
    format!("{} → {tuned}", value(p, p.default))
}

/// A value, a choice by name.
fn value(p: &ParameterTrace, value: f64) -> String {
    let choice = p.choices.get(value as usize).filter(|_| value.is_finite());
    choice.map_or_else(|| significant(value), |&choice| choice.to_owned())
}

fn drawing(p: &ParameterTrace, xs: &[f64]) -> String {
    let label = format!("{} by generation, {}, bounds {}", p.name, change(p), bounds(p));
    let name = format!("parameter-{}", file_name(&p.name));
    let title = match p.unit.as_str() {
        "" => p.name.clone(),
        unit => format!("{}, {unit}", p.name),
    };
    let caption = Caption { name: &name, title: &title, keys: &KEYS };
    let frame = Frame { caption, size: SIZE, label: &label, y_title: "", x_title: "" };
    let y = Axis::between(p.min, p.max, p.log).with_ticks(&[p.min, p.max]);
    let ends: Vec<f64> = xs.first().into_iter().chain(xs.last()).copied().collect();
    chart(&frame, generation_axis(xs).with_ticks(&ends), y, |chart| {
        chart.band("spread", xs, &p.low, &p.high)?;
        chart.level("default", p.default)?;
        chart.line("mean", xs, &p.mean)?;
        chart.dots("tuned", &[f64::INFINITY], &[p.tuned], 4.0)
    })
}

fn bounds(p: &ParameterTrace) -> String {
    with_unit(&format!("{} to {}", value(p, p.min), value(p, p.max)), &p.unit)
}

fn table(parameters: &[ParameterTrace]) -> String {
    let rows: String = parameters
        .iter()
        .map(|p| {
            format!(
                "<tr><th \
                 scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                escape(&p.name),
                escape(&value(p, p.default)),
                escape(&value(p, p.tuned)),
                escape(&value(p, p.min)),
                escape(&value(p, p.max)),
                escape(&p.unit),
            )
        })
        .collect();
    format!(
        "<details><summary>The same as a table</summary><div class=\"scroll\" tabindex=\"0\" \
         role=\"region\" \
         aria-label=\"Parameter values\"><table class=\"plain\"><thead><tr><th \
         scope=\"col\">parameter</th>\
         <th scope=\"col\">default</th><th scope=\"col\">tuned</th><th scope=\"col\">lowest</th>\
         <th scope=\"col\">highest</th><th \
         scope=\"col\">unit</th></tr></thead><tbody>{rows}</tbody></table></div>\
         </details>"
    )
}
