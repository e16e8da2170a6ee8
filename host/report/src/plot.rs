//! Drawings by plotters: a canvas in the style sheet's colours, and charts with two axes on it.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io;

use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::format::escape;
use super::theme::{ink, themed};

/// Drawing units per pixel at natural size: plotters takes whole units only.
pub(super) const FINE: f64 = 10.0;

/// A point on the drawing, y down.
pub(super) type Px = [f64; 2];
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<io::Error>>;

/// Pixels as whole drawing units.
pub(super) fn fine(pixels: f64) -> i32 {
    (pixels * FINE).round() as i32
}

pub(super) fn at([x, y]: Px) -> (i32, i32) {
    (fine(x), fine(y))
}

/// Place of a text relative to its point.
pub(super) type Anchor = (HPos, VPos);
pub(super) const LEFT: Anchor = (HPos::Right, VPos::Center);
pub(super) const RIGHT: Anchor = (HPos::Left, VPos::Center);
pub(super) const ABOVE: Anchor = (HPos::Center, VPos::Bottom);
pub(super) const BELOW: Anchor = (HPos::Center, VPos::Top);
pub(super) const MIDDLE: Anchor = (HPos::Center, VPos::Center);

/// A drawing under construction.
pub(super) struct Canvas<'a> {
    pub(super) area: DrawingArea<SVGBackend<'a>, Shift>,
    /// SVG that lies on top.
    pub(super) top: String,
}

impl Canvas<'_> {
    pub(super) fn line(&self, class: &str, ends: [Px; 2]) -> Drawn {
        self.area.draw(&PathElement::new(ends.map(at), ink(class)))
    }

    /// A horizontal line between `ends`, with a stroke of `half` up and down at each end.
    pub(super) fn whisker(&self, class: &str, ends: [f64; 2], y: f64, half: f64) -> Drawn {
        self.line(class, ends.map(|x| [x, y]))?;
        ends.into_iter().try_for_each(|x| self.line(class, [[x, y - half], [x, y + half]]))
    }

    pub(super) fn block(&self, class: &str, corners: [Px; 2]) -> Drawn {
        self.area.draw(&Rectangle::new(corners.map(at), ink(class).filled()))
    }

    pub(super) fn dot(&self, class: &str, place: Px, radius: f64) -> Drawn {
        self.area.draw(&Circle::new(at(place), fine(radius), ink(class).filled()))
    }

    pub(super) fn text(&self, words: &str, class: &str, anchor: Anchor, place: Px) -> Drawn {
        self.area.draw_text(words, &style(class, anchor), at(place))
    }

    /// Adds a tooltip to an area.
    pub(super) fn hint(&mut self, corners: [Px; 2], words: &str) {
        self.top += &hint(corners.map(at), words);
    }
}

/// Name, title and legend of a chart that can stand alone. Without a name it is part of a page
/// only.
#[derive(Clone, Copy, Default)]
pub(super) struct Caption<'a> {
    /// Letters, digits and dashes.
    pub(super) name: &'a str,
    pub(super) title: &'a str,
    pub(super) keys: &'a [Key<'a>],
}

/// An SVG element of this size; a screen reader reads `label`.
pub(super) fn drawing(
    caption: &Caption<'_>,
    size: Px,
    label: &str,
    draw: impl FnOnce(&mut Canvas<'_>) -> Drawn,
) -> String {
    let (width, height) = at(size);
    let mut svg = String::new();
    let top = {
        let backend = SVGBackend::with_string(&mut svg, (width as u32, height as u32));
        let mut canvas = Canvas { area: backend.into_drawing_area(), top: String::new() };
        let drawn = draw(&mut canvas).and_then(|()| canvas.area.present());
        drawn.expect("a string takes every drawing");
        canvas.top
    };
    let (tag, own) = own_caption(caption, size);
    let content = themed(&svg).replace("</svg>", &(top + &own));
    format!(
        "<svg role=\"img\" aria-label=\"{}\"{tag} viewBox=\"0 0 {width} {height}\">{content}</svg>",
        escape(label)
    )
}

/// Height of a line of a caption, pixels.
const LINE: f64 = 20.0;

/// Room around a chart that stands alone, pixels.
const MARGIN: f64 = 10.0;

/// Greatest mean width of a caption's letters, pixels.
const LETTER: f64 = 6.8;

/// Attributes of a named chart, and its title and legend as SVG. Those show only where the chart
/// stands alone; on a page they are text beside it.
fn own_caption(caption: &Caption<'_>, [width, height]: Px) -> (String, String) {
    if caption.name.is_empty() {
        return Default::default();
    }
    let width = width.max(240.0);
    let (above, title) = (MARGIN + LINE, own_text([4.0, -8.0], "own-title", caption.title));
    let (keys, below) = own_legend(caption.keys, width, height + LINE);
    let [left, top, wide, high] =
        [-MARGIN, -above, width + 2.0 * MARGIN, above + height + below + MARGIN].map(fine);
    (
        format!(" data-figure=\"{}\" data-box=\"{left} {top} {wide} {high}\"", caption.name),
        format!("<g class=\"alone\">{title}{keys}</g>"),
    )
}

pub(super) fn own_text([x, y]: Px, class: &str, text: &str) -> String {
    let (x, y) = at([x, y]);
    format!("<text class=\"{class}\" x=\"{x}\" y=\"{y}\">{}</text>", escape(text))
}

/// A legend as SVG in lines from `y` down, and its height.
pub(super) fn own_legend(keys: &[Key<'_>], width: f64, y: f64) -> (String, f64) {
    let (mut x, mut line, mut drawn) = (4.0, 0.0, String::new());
    for (class, sample, text) in keys {
        let wide = 30.0 + LETTER * text.chars().count() as f64 + 14.0;
        if x > 4.0 && x + wide > width {
            (x, line) = (4.0, line + 1.0);
        }
        let base = y + LINE * line;
        drawn += &shape(class, *sample, [x, base - 10.0], FINE);
        drawn += &own_text([x + 30.0, base], "tick", text);
        x += wide;
    }
    let height = if keys.is_empty() { 0.0 } else { LINE * (line + 1.0) + 4.0 };
    (drawn, height)
}

/// Style of text of a class. The style sheet sets font and size.
pub(super) fn style(class: &str, (h, v): Anchor) -> TextStyle<'static> {
    TextStyle {
        color: ink(class).to_backend_color(),
        pos: Pos::new(h, v),
        ..TextStyle::from(("sans-serif", 124.0).into_font())
    }
}

/// An area with a tooltip.
fn hint([(left, top), (right, bottom)]: [(i32, i32); 2], hint: &str) -> String {
    let (width, height) = (right - left, bottom - top);
    let area = format!("x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"");
    format!("<rect class=\"hint-area\" {area}><title>{}</title></rect>", escape(hint))
}

/// Caption, size and titles of a chart.
pub(super) struct Frame<'a> {
    pub(super) caption: Caption<'a>,
    pub(super) size: Px,
    /// Text for a screen reader.
    pub(super) label: &'a str,
    /// Title above the left axis; an empty one takes no room.
    pub(super) y_title: &'a str,
    /// Title under the bottom axis; an empty one takes no room.
    pub(super) x_title: &'a str,
}

/// A chart while data are drawn on it.
pub(super) struct Chart<'a, 'b> {
    chart: ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>,
    top: &'a mut String,
}

/// A chart with its grid; `draw` adds the data.
pub(super) fn chart(
    frame: &Frame<'_>,
    x: Axis,
    y: Axis,
    draw: impl FnOnce(&mut Chart<'_, '_>) -> Drawn,
) -> String {
    drawing(&frame.caption, frame.size, frame.label, |canvas| {
        let room = |title: &str, with, without| fine(if title.is_empty() { without } else { with });
        canvas.text(frame.y_title, "axis", (HPos::Left, VPos::Bottom), [4.0, 23.0])?;
        let mut chart = ChartBuilder::on(&canvas.area)
            .margin_top(room(frame.y_title, 34.0, 8.0))
            .margin_right(fine(13.0))
            .x_label_area_size(room(frame.x_title, 41.0, 20.0))
            .y_label_area_size(fine(48.0))
            .build_cartesian_2d(x, y)?;
        let tick = style("tick", (HPos::Left, VPos::Top));
        // Two meshes, since plotters styles both axes of one alike.
        let mut levels = chart.configure_mesh();
        levels
            .disable_x_mesh()
            .disable_x_axis()
            .bold_line_style(ink("grid"))
            .light_line_style(TRANSPARENT);
        levels.axis_style(TRANSPARENT).y_label_style(tick.clone());
        levels.set_tick_mark_size(LabelAreaPosition::Left, fine(3.5)).draw()?;
        let mut foot = chart.configure_mesh();
        foot.disable_mesh().disable_y_axis().axis_style(ink("frame")).x_label_style(tick);
        foot.x_desc(frame.x_title).axis_desc_style(style("axis", ABOVE));
        foot.set_tick_mark_size(LabelAreaPosition::Bottom, fine(4.0)).draw()?;
        draw(&mut Chart { chart, top: &mut canvas.top })
    })
}

impl<'b> Chart<'_, 'b> {
    /// Adds elements of plotters.
    pub(super) fn draw<E>(&mut self, elements: impl IntoIterator<Item = E>) -> Drawn
    where
        E: Drawable<SVGBackend<'b>>,
        for<'e> &'e E: PointCollection<'e, (f64, f64)>,
    {
        self.chart.draw_series(elements).map(|_| ())
    }

    /// A line through the finite values. It breaks at others; a lone value becomes a dot.
    pub(super) fn line(&mut self, class: &str, xs: &[f64], ys: &[f64]) -> Drawn {
        let points: Vec<_> = xs.iter().copied().zip(ys.iter().copied()).collect();
        for run in points.split(|(_, y)| !y.is_finite()) {
            match run {
                [alone] => self.draw([Circle::new(*alone, fine(2.5), ink(class).filled())])?,
                run => self.draw(LineSeries::new(run.iter().copied(), ink(class)))?,
            }
        }
        Ok(())
    }

    /// The area between two series where both are finite.
    pub(super) fn band(&mut self, class: &str, xs: &[f64], low: &[f64], high: &[f64]) -> Drawn {
        let points: Vec<_> = xs.iter().zip(low).zip(high).map(|((x, l), h)| (*x, *l, *h)).collect();
        for run in
            points.split(|(_, l, h)| !(l.is_finite() && h.is_finite())).filter(|run| run.len() > 1)
        {
            let under = run.iter().map(|(x, l, _)| (*x, *l));
            let over = run.iter().rev().map(|(x, _, h)| (*x, *h));
            self.draw([Polygon::new(under.chain(over).collect::<Vec<_>>(), ink(class))])?;
        }
        Ok(())
    }

    /// A dot at each finite value.
    pub(super) fn dots(&mut self, class: &str, xs: &[f64], ys: &[f64], radius: f64) -> Drawn {
        let points = xs.iter().copied().zip(ys.iter().copied()).filter(|(_, y)| y.is_finite());
        self.draw(PointSeries::<_, _, Circle<_, _>, _>::new(
            points,
            fine(radius),
            ink(class).filled(),
        ))
    }

    /// A line from left to right at `y`, if that is finite.
    pub(super) fn level(&mut self, class: &str, y: f64) -> Drawn {
        self.across(class, y, [f64::NEG_INFINITY, f64::INFINITY].map(|x| (x, y)))
    }

    /// A line from bottom to top at `x`, if that is finite.
    pub(super) fn upright(&mut self, class: &str, x: f64) -> Drawn {
        self.across(class, x, [f64::NEG_INFINITY, f64::INFINITY].map(|y| (x, y)))
    }

    fn across(&mut self, class: &str, value: f64, ends: [(f64, f64); 2]) -> Drawn {
        self.draw(value.is_finite().then(|| PathElement::new(ends, ink(class))))
    }

    /// A text in the middle of the plot.
    pub(super) fn note(&mut self, words: &str) -> Drawn {
        let (x, y) = self.chart.plotting_area().get_base_pixel();
        let (width, height) = self.chart.plotting_area().dim_in_pixel();
        let (x, y) = (x + width as i32 / 2, y + height as i32 / 2);
        let place = format!("text-anchor=\"middle\" x=\"{x}\" y=\"{y}\"");
        *self.top += &format!("<text class=\"tick\" {place}>{}</text>", escape(words));
        Ok(())
    }

    /// Adds a tooltip between `left` and `right`.
    pub(super) fn hint(&mut self, left: f64, right: f64, text: &str) {
        let corners = [(left, f64::INFINITY), (right, f64::NEG_INFINITY)]
            .map(|c| self.chart.backend_coord(&c));
        *self.top += &hint(corners, text);
    }
}

/// One key of a legend: class and shape of its sample, and its meaning.
pub(super) type Key<'a> = (&'a str, Sample, &'a str);

/// Shape of a key's sample.
#[derive(Clone, Copy)]
pub(super) enum Sample {
    Line,
    Area,
    Dot,
}

/// Places as one path: each a stroke of a tenth of a pixel, whose round ends make it a dot. Of the
/// places in a square of `grain` pixels the first is drawn; `seen` has the squares taken before.
pub(super) fn dots_path(
    class: &str,
    places: impl Iterator<Item = Px>,
    grain: f64,
    seen: &mut BTreeSet<[i32; 2]>,
) -> String {
    let mut path = String::new();
    for place in places {
        if seen.insert(place.map(|side| (side / grain).floor() as i32)) {
            let (x, y) = at(place);
            let _ = write!(path, "M{x} {y}h1");
        }
    }
    format!("<path class=\"{class}\" d=\"{path}\"/>")
}

/// A legend as a list, in the page's text size at any scale of the plot.
pub(super) fn legend(keys: &[Key<'_>]) -> String {
    let item = |(class, sample, text): &Key<'_>| {
        let shape = shape(class, *sample, [0.0; 2], 1.0);
        format!("<li><svg viewBox=\"0 0 24 12\" aria-hidden=\"true\">{shape}</svg>{text}</li>")
    };
    format!("<ul class=\"legend\">{}</ul>", keys.iter().map(item).collect::<String>())
}

/// Sample of a key, 24 by 12 pixels from its upper left corner, `scale` units a pixel.
fn shape(class: &str, sample: Sample, [x, y]: Px, scale: f64) -> String {
    let to = |right: f64, down: f64| [scale * (x + right), scale * (y + down)].map(f64::round);
    let path = |corners: &[[f64; 2]], end: &str| {
        let corners: Vec<String> = corners.iter().map(|[x, y]| format!("{x} {y}")).collect();
        format!("<path class=\"{class}\" d=\"M{}{end}\"/>", corners.join("L"))
    };
    match sample {
        Sample::Line => path(&[to(1.0, 6.0), to(23.0, 6.0)], ""),
        Sample::Area => path(&[to(1.0, 1.0), to(23.0, 1.0), to(23.0, 11.0), to(1.0, 11.0)], "Z"),
        Sample::Dot => {
            let ([x, y], radius) = (to(12.0, 6.0), 4.0 * scale);
            format!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>")
        }
    }
}
