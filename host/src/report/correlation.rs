//! Which parameters the search moved together, with the caution this needs.

use super::data::Correlation;
use super::format::{escape, fixed};
use super::svg::{Px, Svg};

const CELL: f64 = 34.0;

/// Correlations weaker than this are drawn without their number.
const WORTH_A_NUMBER: f64 = 0.15;

/// The heat map and its caution, or nothing without one pair of parameters.
pub(super) fn section(correlation: Option<&Correlation>, generations: usize) -> String {
    let Some(c) = correlation.filter(|c| c.names.len() > 1) else {
        return String::new();
    };
    format!(
        "<section id=\"correlation\"><h2>What moved together</h2><div class=\"heat\">\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Heat map\">{}</div>\
         <div><p class=\"caution\"><strong>Read with caution.</strong> {}</p><p>{}</p>{}</div></div></section>\n",
        heat_map(c),
        caution(c, generations),
        strongest(c),
        scale()
    )
}

fn caution(c: &Correlation, generations: usize) -> String {
    let share = match c.learned.filter(|share| share.is_finite()) {
        Some(share) => format!(
            "this run can have replaced at most {}\u{a0}% of it",
            fixed(share * 100.0, 0)
        ),
        None => "a short run replaces only part of it".to_owned(),
    };
    format!(
        "These are correlations of the distribution the search samples from. It starts as a sphere, and in \
         {generations} generations it has barely learned: {share}. A cell tells where good candidates lay in this \
         one run, not how the parameters influence the error."
    )
}

/// The pair with the largest correlation, in words.
fn strongest(c: &Correlation) -> String {
    let best = pairs(c)
        .filter(|(_, _, r)| r.is_finite())
        .max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()));
    let Some((row, column, r)) = best else {
        return "No correlation is known.".to_owned();
    };
    format!(
        "The strongest is <b>{}</b> with <b>{}</b>, {}.",
        escape(&c.names[column]),
        escape(&c.names[row]),
        fixed(r, 2)
    )
}

/// The lower triangle: row, column, value.
fn pairs(c: &Correlation) -> impl Iterator<Item = (usize, usize, f64)> {
    (1..c.names.len())
        .flat_map(move |row| (0..row).map(move |column| (row, column, c.matrix[row][column])))
}

/// Where the triangle begins and how large the drawing is, so that every slanted name has room.
struct Layout {
    left: f64,
    top: f64,
    size: Px,
}

impl Layout {
    fn of(names: &[String]) -> Self {
        let wide = |name: &String| 7.2 * name.chars().count() as f64;
        let count = (names.len() - 1) as f64;
        let left = 12.0 + names.iter().skip(1).map(wide).fold(0.0, f64::max);
        let (mut top, mut right): (f64, f64) = (8.0, left + count * CELL);
        for (column, name) in names.iter().take(names.len() - 1).enumerate() {
            let (rise, along) = (0.71 * wide(name) + 12.0, column as f64 * CELL);
            top = top.max(rise - along);
            right = right.max(left + along + CELL / 2.0 + rise);
        }
        let size = [right, top + count * CELL + 4.0];
        Self { left, top, size }
    }
}

fn heat_map(c: &Correlation) -> String {
    let Layout { left, top, size } = Layout::of(&c.names);
    let label = format!(
        "Heat map of the correlations between {} parameters.",
        c.names.len()
    );
    let mut svg = Svg::new(size, &label);
    for (row, column, r) in pairs(c) {
        let corner = [left + column as f64 * CELL, top + (row - 1) as f64 * CELL];
        let hint = format!("{} · {}: {}", c.names[row], c.names[column], fixed(r, 2));
        cell(&mut svg, corner, r, &hint);
    }
    for (row, name) in c.names.iter().enumerate().skip(1) {
        svg.text(
            "name end",
            [left - 8.0, top + (row as f64 - 0.5) * CELL + 4.0],
            name,
        );
    }
    for (column, name) in c.names.iter().enumerate().take(c.names.len() - 1) {
        let along = column as f64 * CELL;
        svg.slanted_text("name", [left + along + CELL / 2.0, top + along - 5.0], name);
    }
    let style = format!("<svg style=\"width:{}px\" ", size[0].round());
    svg.finish().replacen("<svg ", &style, 1)
}

fn cell(svg: &mut Svg, [x, y]: Px, r: f64, hint: &str) {
    let strength = if r.is_finite() { r.abs().min(1.0) } else { 0.0 };
    let inner = CELL - 2.0;
    svg.hinted(hint, |svg| {
        svg.rect("cell", [x, y], [inner, inner], 1.0);
        if strength > 0.0 {
            let class = if r > 0.0 { "plus" } else { "minus" };
            svg.rect(class, [x, y], [inner, inner], strength);
        }
        if strength >= WORTH_A_NUMBER {
            let class = if strength > 0.6 {
                "value strong middle"
            } else {
                "value middle"
            };
            svg.text(class, [x + inner / 2.0, y + inner / 2.0 + 4.0], &short(r));
        }
    });
}

/// Two digits without the leading zero, as fits a cell.
fn short(r: f64) -> String {
    fixed(r, 2).replacen("0.", ".", 1)
}

/// The colour scale from −1 to 1.
fn scale() -> String {
    let mut svg = Svg::new([264.0, 44.0], "Colour scale from minus one to one");
    for k in -5..=5_i32 {
        let at = [f64::from(k + 5) * 24.0, 2.0];
        let class = if k > 0 { "plus" } else { "minus" };
        svg.rect("cell", at, [23.0, 18.0], 1.0);
        svg.rect(class, at, [23.0, 18.0], f64::from(k.abs()) / 5.0);
    }
    for (x, class, text) in [
        (0.0, "tick", "−1"),
        (131.5, "tick middle", "0"),
        (263.0, "tick end", "+1"),
    ] {
        svg.text(class, [x, 36.0], text);
    }
    svg.finish().replacen("<svg ", "<svg class=\"scale\" ", 1)
}
