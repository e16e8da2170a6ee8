//! Chosen values of a parameter within its range, with a lane for each kind of country.

use plotters::element::{Circle, PathElement};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use super::axis::Axis;
use super::format::{significant, with_unit};
use super::plot::{Canvas, Caption, Drawn, Key, Sample, at, drawing, fine, hint, text};
use super::ruler::Ruler;
use super::series::Series;
use super::theme::ink;

const TRACK: f64 = 200.0;
const LANE: f64 = 21.0;
const NAMES: f64 = 112.0;
const RIGHT: f64 = 22.0;

pub(super) const KEYS: [Key<'static>; 4] = [
    ("default", Sample::Line, "start"),
    ("dot-tuned", Sample::Dot, "chosen, both tuned"),
    ("ring-registration", Sample::Dot, "registration alone"),
    ("ring-lidar", Sample::Dot, "LiDAR alone"),
];

/// Panel of one parameter.
#[derive(Clone, Debug)]
pub struct ChosenRange {
    /// Unit; empty when it has none.
    pub unit: String,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// True when its axis, of search and panel, is logarithmic.
    pub log: bool,
    /// Possible values, where those are few; else empty.
    pub steps: Vec<f64>,
    /// Names of its values, from 0, when it is a choice; else empty.
    pub choices: &'static [&'static str],
    /// Start of the searches.
    pub start: f64,
    /// Lanes, from the top.
    pub lanes: Vec<ChosenLane>,
}

/// Chosen values in one kind of country.
#[derive(Clone, Debug)]
pub struct ChosenLane {
    /// Name of the kind.
    pub name: String,
    /// Search and chosen value.
    pub marks: Vec<(Series, f64)>,
}

impl ChosenRange {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        let height = 4.0 + LANE * self.lanes.len() as f64;
        let size = [NAMES + TRACK + RIGHT, height + 22.0];
        let label = format!("{}: {}.", caption.title, self.text());
        let ruler = Ruler { axis: self.axis(), left: NAMES, width: TRACK };
        drawing(caption, size, &label, |canvas, hints| {
            ruler.labels(canvas, height, &self.labels(&ruler))?;
            let x = ruler.across(self.start);
            let start = [[x, 1.0], [x, height]].map(at);
            canvas.draw(&PathElement::new(start, ink("default")))?;
            for (number, lane) in self.lanes.iter().enumerate() {
                let y = 4.0 + LANE * number as f64;
                self.lane(canvas, &ruler, lane, y + 0.5 * LANE)?;
                let words = self.lane_text(lane);
                *hints += &hint(at([0.0, y]), at([size[0], y + LANE]), &words);
            }
            Ok(())
        })
    }

    fn axis(&self) -> Axis {
        match self.choices {
            [] if self.steps.is_empty() => Axis::between(self.min, self.max, self.log),
            [] => Axis::between(self.min, self.max, self.log).with_ticks(&self.steps),
            names => {
                let last = names.len() as f64 - 1.0;
                let all: Vec<f64> = (0..names.len()).map(|k| k as f64).collect();
                Axis::between(-0.5, last + 0.5, false).with_ticks(&all)
            }
        }
    }

    fn lane(&self, canvas: &Canvas<'_>, ruler: &Ruler, lane: &ChosenLane, y: f64) -> Drawn {
        let name = text("tick", HPos::Right, VPos::Center);
        canvas.draw_text(&lane.name, &name, at([NAMES - 12.0, y]))?;
        let track = [[NAMES, y], [NAMES + TRACK, y]].map(at);
        canvas.draw(&PathElement::new(track, ink("grid")))?;
        for &(series, value) in lane.marks.iter().filter(|(_, value)| value.is_finite()) {
            let radius = if series == Series::Joint { 3.8 } else { 6.2 };
            let place = at([ruler.across(value), y]);
            canvas.draw(&Circle::new(place, fine(radius), ink(series.mark()).filled()))?;
        }
        Ok(())
    }

    /// The ends of the range, then round numbers between them.
    fn labels(&self, ruler: &Ruler) -> Vec<(f64, String)> {
        let inner = ruler.ticks().into_iter().map(|tick| (tick, self.number(ruler, tick)));
        match self.choices {
            [] => {
                let ends = [self.min, self.max].map(|end| (end, significant(end)));
                ends.into_iter().chain(inner).collect()
            }
            _ => inner.collect(),
        }
    }

    fn number(&self, ruler: &Ruler, tick: f64) -> String {
        let choice = self.choices.get(tick as usize);
        choice.map_or_else(|| ruler.number(tick), |&name| name.to_owned())
    }

    fn text(&self) -> String {
        self.lanes.iter().map(|lane| self.lane_text(lane)).collect::<Vec<_>>().join("; ")
    }

    fn lane_text(&self, lane: &ChosenLane) -> String {
        let value = |value: f64| match self.choices.get(value as usize) {
            Some(name) if value.is_finite() => (*name).to_owned(),
            _ => with_unit(&significant(value), &self.unit),
        };
        let marks =
            lane.marks.iter().map(|&(series, of)| format!("{} {}", series.title(), value(of)));
        let marks = marks.collect::<Vec<_>>().join(", ");
        format!("{}: start {}, {marks}", lane.name, value(self.start))
    }
}
