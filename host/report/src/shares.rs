//! Cumulative distributions of the error, with a curve for each tuned part.

use echoloop_closed_loop::config::preset::Protocol;
use plotters::series::LineSeries;

use super::axis::Axis;
use super::format::fixed;
use super::plot::{Caption, Frame, Key, Px, Sample, chart};
use super::sections::pairs::steps;
use super::theme::ink;

const SIZE: Px = [330.0, 230.0];

/// Legend of the curves, in the order of [`Protocol`]: distinct by colour and, without colour, by
/// dashes.
pub(super) const CURVES: [Key<'static>; 4] = [
    ("curve-default", Sample::Line, "default"),
    ("curve-lidar", Sample::Line, "LiDAR tuned"),
    ("curve-registration", Sample::Line, "registration tuned"),
    ("curve-tuned", Sample::Line, "both tuned"),
];

pub(super) const KEYS: [Key<'static>; 5] =
    [CURVES[0], CURVES[1], CURVES[2], CURVES[3], ("limit", Sample::Line, "bound of success")];

/// Panel of cumulative distributions.
#[derive(Clone, Debug)]
pub struct Shares {
    /// Name and unit of the error.
    pub axis: String,
    /// Ends of the logarithmic axis.
    pub span: [f64; 2],
    /// Greatest error of a success.
    pub bound: f64,
    /// Tuned part and error of every pair of the cells that are done.
    pub curves: Vec<(Protocol, Vec<f64>)>,
}

impl Shares {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        let x_title = format!("{}, log axis", self.axis);
        let frame = Frame {
            caption: *caption,
            size: SIZE,
            label: &self.label(caption.title),
            y_title: "% of all pairs",
            x_title: &x_title,
        };
        let [low, high] = self.span;
        chart(&frame, Axis::between(low, high, true), Axis::between(0.0, 100.0, false), |chart| {
            if self.curves.is_empty() {
                return chart.note("no cell of it is done");
            }
            chart.upright("limit", self.bound)?;
            // The one solid line first, so that dashed curves on top of it still show.
            let (full, dashed): (Vec<_>, Vec<_>) =
                self.curves.iter().partition(|(tuned, _)| *tuned == Protocol::Joint);
            full.into_iter().chain(dashed).try_for_each(|(tuned, errors)| {
                let (class, ..) = CURVES[*tuned as usize];
                chart.draw(LineSeries::new(steps(errors.clone()), ink(class)))
            })
        })
    }

    fn label(&self, title: &str) -> String {
        let texts = self.curves.iter().map(|(tuned, errors)| {
            let found = errors.iter().filter(|error| **error <= self.bound).count();
            let within = fixed(100.0 * found as f64 / errors.len() as f64, 1);
            format!("{}: {within} % within the bound", CURVES[*tuned as usize].2)
        });
        format!("{title}: {}.", texts.collect::<Vec<_>>().join(", "))
    }
}
