//! Which parameters the search moved together, with the caution this needs.

use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, VPos};

use super::Correlation;
use crate::format::{escape, fixed};
use crate::plot::{Canvas, Caption, Drawn, Key, Px, Sample, at, drawing, hint, text};
use crate::theme::ink;

const CELL: f64 = 34.0;

/// Correlations weaker than this are drawn without their number.
const WORTH_A_NUMBER: f64 = 0.15;

/// Of a correlation that is more than chance, the faintest colour.
const FAINTEST: f64 = 0.2;

/// The heat map and its caution, or nothing without one pair of parameters.
pub(crate) fn section(correlation: Option<&Correlation>, generations: usize) -> String {
    let Some(c) = correlation.filter(|c| c.names.len() > 1) else {
        return String::new();
    };
    format!(
        "<section id=\"correlation\"><h2>What moved together</h2><div class=\"heat\">\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Heat map\">{}</div>\
         <div><p class=\"caution\"><strong>Read with caution.</strong> \
         {}</p><p>{}</p>{}</div></div></section>\n",
        heat_map(c),
        caution(c, generations),
        strongest(c),
        scale()
    )
}

fn caution(c: &Correlation, generations: usize) -> String {
    let share = match c.covariance_learned.filter(|share| share.is_finite()) {
        Some(share) => {
            format!("this run can have replaced at most {}\u{a0}% of it", fixed(share * 100.0, 0))
        }
        None => "a short run replaces only part of it".to_owned(),
    };
    format!(
        "These are correlations of the distribution the search samples from. It starts as a \
         sphere, and in {generations} generations it has barely learned: {share}. A cell tells \
         where good candidates lay in this one run, not how the parameters influence the error."
    )
}

/// The pair with the largest correlation, in words.
fn strongest(c: &Correlation) -> String {
    let best =
        pairs(c).filter(|(_, _, r)| r.is_finite()).max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()));
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
    fn new(names: &[String]) -> Self {
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
    let title = "What moved together in the search: correlations";
    triangle(c, &Caption { name: "correlations", title, keys: &[] }, None)
}

/// Which parameters a search moved together, with what chance alone would show greyed.
#[derive(Clone, Debug)]
pub struct Moved {
    /// The correlations.
    pub correlation: Correlation,
    /// How many of the first parameters are the sensor's.
    pub of_sensor: usize,
    /// Correlations no stronger than this are greyed.
    pub chance: f64,
}

pub(super) const MOVED_KEYS: [Key<'static>; 3] = [
    ("plus", Sample::Area, "positive"),
    ("minus", Sample::Area, "negative"),
    ("unlearned", Sample::Area, "not told from chance"),
];

impl Moved {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        triangle(&self.correlation, caption, Some(self))
    }

    /// Correlations that are not greyed, of all that there are.
    pub fn learned(&self) -> [usize; 2] {
        let all = pairs(&self.correlation);
        let (mut learned, mut count) = (0, 0);
        for (_, _, r) in all {
            learned += usize::from(self.is_learned(r));
            count += 1;
        }
        [learned, count]
    }

    fn is_learned(&self, r: f64) -> bool {
        r.abs() > self.chance
    }

    /// Lines between the sensor's parameters and registration's.
    fn divide(&self, canvas: &Canvas<'_>, corner: &dyn Fn(usize, usize) -> Px) -> Drawn {
        let (sensor, all) = (self.of_sensor, self.correlation.names.len());
        if sensor == 0 || sensor >= all {
            return Ok(());
        }
        let shifted = |[x, y]: Px| at([x - 1.0, y - 1.0]);
        let across = [corner(0, sensor - 1), corner(sensor, sensor - 1)].map(shifted);
        let down = [corner(sensor, sensor - 1), corner(sensor, all - 1)].map(shifted);
        canvas.draw(&PathElement::new(across, ink("limit")))?;
        canvas.draw(&PathElement::new(down, ink("limit")))
    }
}

/// The lower triangle with names beside and above.
fn triangle(c: &Correlation, caption: &Caption<'_>, moved: Option<&Moved>) -> String {
    let Layout { left, top, size } = Layout::new(&c.names);
    let label = format!("Heat map of the correlations between {} parameters.", c.names.len());
    let corner = |column: usize, row: usize| [left + column as f64 * CELL, top + row as f64 * CELL];
    let svg = drawing(caption, size, &label, |canvas, hints| {
        for (row, column, r) in pairs(c) {
            let [x, y] = corner(column, row - 1);
            let is_learned = moved.is_none_or(|moved| moved.is_learned(r));
            match (is_learned, moved) {
                (true, None) => cell(canvas, [x, y], r, 0.0)?,
                (true, Some(_)) => cell(canvas, [x, y], r, FAINTEST)?,
                (false, _) => grey(canvas, [x, y])?,
            }
            let chance = if is_learned { "" } else { ", not told from chance" };
            let words = format!("{} · {}: {}{chance}", c.names[row], c.names[column], fixed(r, 2));
            *hints += &hint(at([x, y]), at([x + CELL, y + CELL]), &words);
        }
        moved.map_or(Ok(()), |moved| moved.divide(canvas, &corner))?;
        let beside = text("name", HPos::Right, VPos::Center);
        let above = text("name", HPos::Left, VPos::Center).transform(FontTransform::Rotate270);
        for (k, name) in c.names.iter().enumerate() {
            let [x, y] = corner(k, k);
            if k > 0 {
                canvas.draw_text(name, &beside, at([left - 8.0, y - CELL / 2.0]))?;
            }
            if k + 1 < c.names.len() {
                canvas.draw_text(name, &above, at([x + CELL / 2.0, y - 5.0]))?;
            }
        }
        Ok(())
    });
    // plotters knows only right angles; names that climb at half of one are easier to read.
    let style = format!("<svg style=\"width:{}px\" ", size[0].round());
    svg.replacen("<svg ", &style, 1).replace("rotate(270,", "rotate(-45,")
}

fn square([x, y]: Px) -> [(i32, i32); 2] {
    [at([x, y]), at([x + CELL - 2.0, y + CELL - 2.0])]
}

fn grey(canvas: &Canvas<'_>, place: Px) -> Drawn {
    canvas.draw(&Rectangle::new(square(place), ink("unlearned").filled()))
}

/// A correlation's cell, no fainter than `least`, so that it is told from a grey one.
fn cell(canvas: &Canvas<'_>, [x, y]: Px, r: f64, least: f64) -> Drawn {
    let strength = if r.is_finite() { r.abs().clamp(least, 1.0) } else { 0.0 };
    let inner = CELL - 2.0;
    let square = square([x, y]);
    canvas.draw(&Rectangle::new(square, ink("cell").filled()))?;
    let colour =
        ink(if r > 0.0 { "plus" } else { "minus" }).mix((strength * 100.0).round() / 100.0);
    canvas.draw(&Rectangle::new(square, colour.filled()))?;
    if strength < WORTH_A_NUMBER {
        return Ok(());
    }
    let class = if strength > 0.6 { "value strong" } else { "value" };
    canvas.draw_text(
        &short(r),
        &text(class, HPos::Center, VPos::Center),
        at([x + inner / 2.0, y + inner / 2.0]),
    )
}

/// Two digits without the leading zero, as fits a cell.
fn short(r: f64) -> String {
    fixed(r, 2).replacen("0.", ".", 1)
}

/// The colour scale from −1 to 1.
fn scale() -> &'static str {
    "<div class=\"scale\" role=\"img\" aria-label=\"Colour scale from minus one to \
     one\"><i></i><span>−1</span>\
     <span>0</span><span>+1</span></div>"
}
