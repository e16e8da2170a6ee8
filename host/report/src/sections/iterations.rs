//! Iterations of registration against its error, pair by pair.

use echoloop_closed_loop::evaluation::summary::Summary;

use super::Report;
use crate::axis::Axis;
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [440.0, 270.0];

const KEYS: [Key<'static>; 2] =
    [("dot-default", Sample::Dot, "default"), ("dot-tuned", Sample::Dot, "tuned")];

/// The plot; empty without pairs.
pub(super) fn section(report: &Report) -> String {
    let of = |summary: &Summary| -> (Vec<f64>, Vec<f64>) {
        summary.errors.iter().map(|e| (e.iterations as f64, e.frobenius)).unzip()
    };
    let result = &report.run.result;
    let sets =
        [("dot-default", of(&result.default_summary)), ("dot-tuned", of(&result.tuned_summary))];
    if sets.iter().all(|(_, (iterations, _))| iterations.is_empty()) {
        return String::new();
    }
    let all = |part: fn(&(Vec<f64>, Vec<f64>)) -> &Vec<f64>| {
        Axis::around(sets.iter().flat_map(move |(_, set)| part(set)).copied())
    };
    let caption = Caption { name: "iterations", title: "Iterations and error", keys: &KEYS };
    let label = "Errors of the held-out pairs over the iterations of their registration.";
    let (y_title, x_title) = ("‖T − T*‖_F", "iterations");
    let frame = Frame { caption, size: SIZE, label, y_title, x_title };
    let plot = chart(&frame, all(|set| &set.0), all(|set| &set.1), |chart| {
        sets.iter().try_for_each(|(class, (xs, ys))| chart.dots(class, xs, ys, 3.5))
    });
    format!(
        "<section id=\"iterations\"><h2>Iterations and error</h2><figure>{plot}{}</figure>\
         </section>\n",
        legend(&KEYS)
    )
}
