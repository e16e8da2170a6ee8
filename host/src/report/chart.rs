//! A frame with two axes, and lines, bands and marks in it.

use super::axis::Axis;
use super::svg::{Px, Svg};

/// Space around the frame for labels.
#[derive(Clone, Copy)]
pub(super) struct Margins {
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) top: f64,
    pub(super) bottom: f64,
}

impl Margins {
    /// The axis along the bottom of a drawing of this size.
    pub(super) fn across(&self, size: Px) -> [f64; 2] {
        [self.left, size[0] - self.right]
    }

    /// The axis up its left side.
    pub(super) fn up(&self, size: Px) -> [f64; 2] {
        [size[1] - self.bottom, self.top]
    }
}

/// A chart under way.
pub(super) struct Chart {
    pub(super) svg: Svg,
    pub(super) x: Axis,
    pub(super) y: Axis,
}

impl Chart {
    pub(super) fn new(svg: Svg, x: Axis, y: Axis) -> Self {
        Self { svg, x, y }
    }

    /// Horizontal grid lines with labels and the axis' title above them.
    pub(super) fn with_y_grid(mut self, title: &str) -> Self {
        let [left, right] = self.x.ends();
        for (value, label) in self.y.ticks() {
            let y = self.y.at(value);
            self.svg.line("grid", [left, y], [right, y]);
            self.svg.text("tick end", [left - 7.0, y + 4.0], &label);
        }
        let top = self.y.ends()[1];
        self.svg.text("axis", [4.0, top - 12.0], title);
        self
    }

    /// Marks along the bottom with labels and the axis' title below.
    pub(super) fn with_x_ticks(mut self, title: &str) -> Self {
        let [bottom, _] = self.y.ends();
        let [left, right] = self.x.ends();
        self.svg.line("frame", [left, bottom], [right, bottom]);
        for (value, label) in self.x.ticks() {
            let x = self.x.at(value);
            self.svg.line("frame", [x, bottom], [x, bottom + 4.0]);
            self.svg.text("tick middle", [x, bottom + 17.0], &label);
        }
        let middle = (left + right) / 2.0;
        self.svg.text("axis middle", [middle, bottom + 34.0], title);
        self
    }

    fn px(&self, (x, y): (f64, f64)) -> Px {
        [self.x.at(x), self.y.at(y)]
    }

    /// A line through the finite values; it breaks at others, and a value alone becomes a dot.
    pub(super) fn line(&mut self, class: &str, xs: &[f64], ys: &[f64]) {
        let points: Vec<_> = xs.iter().copied().zip(ys.iter().copied()).collect();
        for run in points.split(|(_, y)| !y.is_finite()) {
            let run: Vec<Px> = run.iter().map(|p| self.px(*p)).collect();
            match run.as_slice() {
                [] => {}
                [alone] => self.svg.dot(&format!("{class} lone"), *alone, 2.5),
                run => self.svg.path(class, run, false),
            }
        }
    }

    /// The area between two series where both are finite.
    pub(super) fn band(&mut self, class: &str, xs: &[f64], low: &[f64], high: &[f64]) {
        let points: Vec<_> = xs
            .iter()
            .zip(low)
            .zip(high)
            .map(|((x, l), h)| (*x, *l, *h))
            .collect();
        for run in points.split(|(_, l, h)| !(l.is_finite() && h.is_finite())) {
            if run.len() < 2 {
                continue;
            }
            let under = run.iter().map(|(x, l, _)| self.px((*x, *l)));
            let over = run.iter().rev().map(|(x, _, h)| self.px((*x, *h)));
            let outline: Vec<Px> = under.chain(over).collect();
            self.svg.path(class, &outline, true);
        }
    }

    /// A dot at each finite value.
    pub(super) fn dots(&mut self, class: &str, xs: &[f64], ys: &[f64], radius: f64) {
        for (x, y) in xs.iter().zip(ys).filter(|(_, y)| y.is_finite()) {
            self.svg.dot(class, self.px((*x, *y)), radius);
        }
    }

    /// A line from left to right at `y`, if that is a number.
    pub(super) fn level(&mut self, class: &str, y: f64) {
        if !y.is_finite() {
            return;
        }
        let [left, right] = self.x.ends();
        let y = self.y.at(y);
        self.svg.line(class, [left, y], [right, y]);
    }

    /// A line from bottom to top at `x`, if that is a number.
    pub(super) fn upright(&mut self, class: &str, x: f64) {
        if !x.is_finite() {
            return;
        }
        let [bottom, top] = self.y.ends();
        let x = self.x.at(x);
        self.svg.line(class, [x, bottom], [x, top]);
    }
}

/// One key of a legend: the class of its sample, the sample's shape, what it means.
pub(super) type Key<'a> = (&'a str, Sample, &'a str);

/// How a key is drawn.
#[derive(Clone, Copy)]
pub(super) enum Sample {
    Line,
    Area,
    Dot,
}

/// A legend as a list, in the page's text size whatever the plot's scale.
pub(super) fn legend(keys: &[Key<'_>]) -> String {
    let items: String = keys
        .iter()
        .map(|(class, sample, text)| key(class, *sample, text))
        .collect();
    format!("<ul class=\"legend\">{items}</ul>")
}

fn key(class: &str, sample: Sample, text: &str) -> String {
    let shape = match sample {
        Sample::Line => format!("<path class=\"{class}\" d=\"M1 6L23 6\"/>"),
        Sample::Area => format!("<path class=\"{class}\" d=\"M1 1L23 1L23 11L1 11Z\"/>"),
        Sample::Dot => format!("<circle class=\"{class}\" cx=\"12\" cy=\"6\" r=\"4\"/>"),
    };
    format!("<li><svg viewBox=\"0 0 24 12\" aria-hidden=\"true\">{shape}</svg>{text}</li>")
}
