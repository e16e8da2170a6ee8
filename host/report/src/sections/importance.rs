//! What mattered, from the search's own candidates: importance with its uncertainty, and slices.

use plotters::element::PathElement;
use plotters::element::Rectangle;
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use crate::axis::Axis;
use super::{Bar, Importance, Slice};
use crate::format::{escape, file_name, fixed, with_unit};
use crate::plot::{Caption, Frame, Key, Px, Sample, at, chart, drawing, hint, legend, text};
use crate::theme::ink;

const SLICE: Px = [330.0, 230.0];

/// Width of the bars' part, and height of a bar's line.
const BARS: f64 = 420.0;
const LINE: f64 = 24.0;

const BAR_KEYS: [Key<'static>; 2] =
    [("bar", Sample::Area, "share of the variation"), ("whisker", Sample::Line, "95 % interval")];
const SLICE_KEYS: [Key<'static>; 4] = [
    ("mean", Sample::Line, "response surface"),
    ("spread", Sample::Area, "its 95 % band"),
    ("candidate", Sample::Dot, "candidates"),
    ("limit", Sample::Line, "chosen"),
];

/// What mattered, or why that cannot be said, and why the choice is where it is.
pub(crate) fn section(importance: &Importance) -> String {
    if importance.verdict.is_empty() && importance.chosen.is_empty() {
        return String::new();
    }
    let bars = match importance.bars.is_empty() {
        true => String::new(),
        false => format!("<figure>{}{}</figure>", bars(&importance.bars), legend(&BAR_KEYS)),
    };
    format!(
        "<section id=\"importance\"><h2>What mattered</h2><p class=\"lead\">{}</p>{bars}{}{}\
         </section>\n",
        escape(&importance.verdict),
        slices(&importance.slices),
        chosen(&importance.chosen)
    )
}

/// A bar a parameter with its whisker, most important first.
fn bars(bars: &[Bar]) -> String {
    let letters = bars.iter().map(|bar| bar.name.chars().count()).max().unwrap_or(0);
    let left = 14.0 + 7.2 * letters as f64;
    let size = [left + BARS + 60.0, LINE * bars.len() as f64 + 6.0];
    let ends = bars.iter().flat_map(|bar| [bar.value, bar.interval[1]]);
    let most = ends.filter(|end| end.is_finite()).fold(1e-9, f64::max);
    let across = |value: f64| left + BARS * value.clamp(0.0, most) / most;
    let label = format!("Importance of {} parameters, the most important first.", bars.len());
    let title = "Importance of the parameters, % of the variation";
    let caption = Caption { name: "importance", title, keys: &BAR_KEYS };
    drawing(&caption, size, &label, |canvas, hints| {
        for (line, bar) in bars.iter().enumerate() {
            let y = LINE * line as f64 + 4.0;
            let middle = y + 7.0;
            let [low, high] = bar.interval.map(across);
            let class = if bar.is_shown { "bar strong-bar" } else { "bar" };
            let corners = [at([left, y]), at([across(bar.value), y + 14.0])];
            canvas.draw(&Rectangle::new(corners, ink(class).filled()))?;
            for ends in [
                [[low, middle], [high, middle]],
                [[low, middle - 3.0], [low, middle + 3.0]],
                [[high, middle - 3.0], [high, middle + 3.0]],
            ] {
                canvas.draw(&PathElement::new(ends.map(at), ink("whisker")))?;
            }
            let name = text("name", HPos::Right, VPos::Center);
            canvas.draw_text(&bar.name, &name, at([left - 8.0, middle]))?;
            let value = text("tick", HPos::Left, VPos::Center);
            let end = high.max(across(bar.value)) + 8.0;
            canvas.draw_text(&share(bar.value), &value, at([end, middle]))?;
            let words = format!("{}: {}", bar.name, interval(bar));
            *hints += &hint(at([0.0, y - 4.0]), at([size[0], y + LINE - 4.0]), &words);
        }
        Ok(())
    })
}

fn share(value: f64) -> String {
    with_unit(&fixed(100.0 * value, 1), "%")
}

fn interval(bar: &Bar) -> String {
    let [low, high] = bar.interval.map(|end| fixed(100.0 * end, 1));
    format!("{}, 95 % interval {low} to {high}", share(bar.value))
}

fn slices(slices: &[Slice]) -> String {
    if slices.is_empty() {
        return String::new();
    }
    let plots: String = slices.iter().map(slice).collect();
    format!(
        "<p class=\"lead\">Slices through the chosen point: fitness as a multiple of what it is \
         there, lower is better, along each parameter whose importance is more than chance. \
         Candidates are carried along the surface to the chosen values of all other parameters. \
         Where there are few, the surface is a guess.</p>{}<div class=\"multiples\">{plots}</div>",
        legend(&SLICE_KEYS)
    )
}

fn slice(slice: &Slice) -> String {
    let dots = |i: usize| slice.dots.iter().map(move |dot| dot[i]);
    let xs = slice.at.iter().copied();
    let (low, high) =
        xs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let x = match slice.choices.is_empty() {
        true => Axis::between(low, high, slice.log),
        false => Axis::between(low - 0.5, high + 0.5, false).with_ticks(&slice.at),
    };
    let y = Axis::around(slice.ratio.iter().copied().chain(dots(1)).chain([1.0]));
    let name = format!("slice-{}", file_name(&slice.name));
    let title = format!("Slice along {}", slice.name);
    let label = format!("Fitness along {}, through the chosen point.", slice.name);
    let y_title = format!("fitness, chosen = 1{}", if y.is_log() { ", log axis" } else { "" });
    let x_title = x_title(slice);
    let caption = Caption { name: &name, title: &title, keys: &SLICE_KEYS };
    let frame = Frame { caption, size: SLICE, label: &label, y_title: &y_title, x_title: &x_title };
    let plot = chart(&frame, x, y, |chart| {
        let [low, high] = &slice.band;
        chart.band("spread", &slice.at, low, high)?;
        let (xs, ys): (Vec<f64>, Vec<f64>) = (dots(0).collect(), dots(1).collect());
        chart.dots("candidate", &xs, &ys, 2.0)?;
        chart.line("mean", &slice.at, &slice.ratio)?;
        chart.upright("limit", slice.chosen)
    });
    format!(
        "<figure class=\"trace\"><figcaption><b>{}</b></figcaption>{plot}</figure>",
        escape(&slice.name)
    )
}

/// Name and unit; of a choice what its numbers mean.
fn x_title(slice: &Slice) -> String {
    let short = slice.name.rsplit('.').next().unwrap_or(&slice.name);
    if slice.choices.is_empty() {
        let unit = if slice.unit.is_empty() { String::new() } else { format!(", {}", slice.unit) };
        return format!("{short}{unit}{}", if slice.log { ", log axis" } else { "" });
    }
    let names = slice.choices.iter().enumerate().map(|(i, name)| format!("{i} {name}"));
    names.collect::<Vec<_>>().join(", ")
}

/// Why the choice lies where it does.
fn chosen(sentences: &[String]) -> String {
    let Some((first, rest)) = sentences.split_first() else { return String::new() };
    let items: String = rest.iter().map(|text| format!("<li>{}</li>", escape(text))).collect();
    format!("<p class=\"chosen\">{}</p><ul class=\"notes\">{items}</ul>", escape(first))
}
