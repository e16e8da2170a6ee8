//! Chosen values of a parameter within its range, with a lane for each kind of country.

use echoloop_closed_loop::config::preset::Protocol;
use echoloop_closed_loop::parameters::{Scale, choices};
use echoloop_closed_loop::run_folder::run::AxisRecord;

use super::axis::Axis;
use super::format::{choice, significant, with_unit};
use super::plot::{Canvas, Caption, Drawn, Key, LEFT, Sample, drawing};
use super::ruler::Ruler;
use super::shares::CURVES;

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
    /// The parameter.
    pub axis: AxisRecord,
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
    /// Tuned part and chosen value.
    pub marks: Vec<(Protocol, f64)>,
}

impl ChosenLane {
    fn draw(&self, canvas: &Canvas<'_>, ruler: &Ruler, y: f64) -> Drawn {
        canvas.text(&self.name, "tick", LEFT, [NAMES - 12.0, y])?;
        canvas.line("grid", [[NAMES, y], [NAMES + TRACK, y]])?;
        for &(tuned, value) in self.marks.iter().filter(|(_, value)| value.is_finite()) {
            let (class, radius) = match tuned {
                Protocol::Default => ("dot-default", 6.2),
                Protocol::Lidar => ("ring-lidar", 6.2),
                Protocol::Registration => ("ring-registration", 6.2),
                Protocol::Joint => ("dot-tuned", 3.8),
            };
            canvas.dot(class, [ruler.across(value), y], radius)?;
        }
        Ok(())
    }
}

impl ChosenRange {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        let height = 4.0 + LANE * self.lanes.len() as f64;
        let size = [NAMES + TRACK + RIGHT, height + 22.0];
        let lanes: Vec<String> = self.lanes.iter().map(|lane| self.lane_text(lane)).collect();
        let label = format!("{}: {}.", caption.title, lanes.join("; "));
        let ruler = Ruler { axis: self.ticked_axis(), left: NAMES, width: TRACK };
        drawing(caption, size, &label, |canvas| {
            ruler.labels(canvas, height, &self.labels(&ruler))?;
            let x = ruler.across(self.start);
            canvas.line("default", [[x, 1.0], [x, height]])?;
            for (number, lane) in self.lanes.iter().enumerate() {
                let y = 4.0 + LANE * number as f64;
                lane.draw(canvas, &ruler, y + 0.5 * LANE)?;
                canvas.hint([[0.0, y], [size[0], y + LANE]], &self.lane_text(lane));
            }
            Ok(())
        })
    }

    /// True when the axis, of search and panel, is logarithmic.
    pub fn is_log(axis: &AxisRecord) -> bool {
        matches!(axis.scale, Scale::Log | Scale::PowerOfTwo)
    }

    /// The axis with a mark at each value where those are few.
    fn ticked_axis(&self) -> Axis {
        let AxisRecord { name, scale, min, max, .. } = &self.axis;
        let axis = Axis::between(*min, *max, Self::is_log(&self.axis));
        match choices(name).len() {
            0 if *scale != Scale::PowerOfTwo => axis,
            0 => {
                let powers = std::iter::successors(Some(*min), |value| Some(2.0 * value));
                let powers = powers.take_while(|value| value <= max).take(32);
                axis.with_ticks(&powers.collect::<Vec<f64>>())
            }
            count => {
                let all: Vec<f64> = (0..count).map(|k| k as f64).collect();
                Axis::between(-0.5, count as f64 - 0.5, false).with_ticks(&all)
            }
        }
    }

    /// The ends of the range, then round numbers between them; for a choice, its names.
    fn labels(&self, ruler: &Ruler) -> Vec<(f64, String)> {
        let AxisRecord { name, min, max, .. } = &self.axis;
        let ends = [min, max].map(|&end| (end, significant(end)));
        let ends = ends.into_iter().filter(|_| choices(name).is_empty());
        let inner = ruler.ticks().into_iter().map(|tick| {
            let text = choice(name, tick).map_or_else(|| ruler.number(tick), str::to_owned);
            (tick, text)
        });
        ends.chain(inner).collect()
    }

    fn lane_text(&self, lane: &ChosenLane) -> String {
        let AxisRecord { name, unit, .. } = &self.axis;
        let text = |value: f64| match choice(name, value) {
            Some(choice) => choice.to_owned(),
            None => with_unit(&significant(value), unit),
        };
        let marks = lane.marks.iter();
        let marks = marks.map(|&(tuned, of)| format!("{} {}", CURVES[tuned as usize].2, text(of)));
        let marks = marks.collect::<Vec<_>>().join(", ");
        format!("{}: start {}, {marks}", lane.name, text(self.start))
    }
}
