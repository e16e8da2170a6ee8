//! One pair's clouds in a 3D viewer, as points of 16 bits a coordinate in base64.

use std::array::from_fn;

use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::run_folder::run::Background;
use echoloop_clouds::Cloud;

use super::{optional_length, pairs};
use crate::ReportError;
use crate::finished_runs::{FinishedRun, RunError};
use crate::format::{base64, escape, fixed, with_unit};

/// Greatest number of points of one cloud on the page.
pub const MAX_LAYER_POINTS: usize = 40_000;

/// Steps of a coordinate along its side of the box: 16 bits.
const STEPS: f64 = 65_535.0;

/// One pair twice: as the default and as the tuned parameters measure and align it.
#[derive(Clone, Debug, Default)]
pub struct PairClouds {
    /// Name of the pair.
    pub label: String,
    /// Target and source under the default parameters, both in the target's frame, the source in
    /// its estimated pose.
    pub before: [CloudLayer; 2],
    /// The same under the tuned parameters.
    pub after: [CloudLayer; 2],
    /// Error of the pose in `before`, if known.
    pub before_error: Option<PairError>,
    /// Error of the pose in `after`, if known.
    pub after_error: Option<PairError>,
}

/// A cloud in the target's frame, metres, z up. Points that are not finite are left out; of more
/// than [`MAX_LAYER_POINTS`] an even selection is shown.
#[derive(Clone, Debug, Default)]
pub struct CloudLayer {
    /// Points x, y, z.
    pub points: Vec<[f32; 3]>,
    /// Intensity of each point, 0 to 1; may be empty.
    pub intensity: Vec<f32>,
}

impl PairClouds {
    /// The shown pair of a finished run.
    ///
    /// # Errors
    ///
    /// [`RunError`] of a cloud's file.
    pub(super) fn of_run(run: &FinishedRun, background: &Background) -> Result<Self, RunError> {
        let pair = run.shown_pair();
        let layer = |cloud: Cloud| CloudLayer {
            points: cloud.points.iter().map(|p| p.coords.into()).collect(),
            intensity: Vec::new(),
        };
        let error =
            |summary: &Summary| summary.errors.iter().find(|error| error.pair == pair).cloned();
        let [before, after] = run.clouds()?.map(|clouds| clouds.map(layer));
        let label = pairs::label(background, pair);
        Ok(Self {
            label: format!("{label}: the held-out pair the default did worst on"),
            before,
            after,
            before_error: error(&run.result.default_summary),
            after_error: error(&run.result.tuned_summary),
        })
    }

    pub(super) fn check(&self) -> Result<(), ReportError> {
        self.before.iter().chain(&self.after).try_for_each(|layer| {
            optional_length("intensity", layer.intensity.len(), layer.points.len(), "points")
        })
    }
}

/// A box in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

/// The viewer with its data; empty without clouds.
pub(super) fn section(clouds: Option<&PairClouds>) -> String {
    let Some(clouds) = clouds else {
        return String::new();
    };
    let layers =
        [&clouds.before[0], &clouds.before[1], &clouds.after[0], &clouds.after[1]].map(shown);
    let has_intensity = layers.iter().any(|layer| layer.iter().any(|(_, i)| *i > 0.0));
    let view = view(&layers);
    let data: String = layers.iter().map(|layer| layer_data(layer, &view)).collect();
    format!(
        "<section id=\"clouds\"><h2>One pair in three dimensions</h2>\
         <p class=\"lead\">{}: the target stands still, the source lies where registration put it. \
         Both views share one camera.</p>\
         {}<div class=\"pair views\">{}{}</div>{}\
         <div id=\"viewer\" hidden data-view=\"{}\">{data}</div></section>\n",
        escape(&clouds.label),
        controls(has_intensity),
        panel("before", "Default", clouds.before_error.as_ref()),
        panel("after", "Tuned", clouds.after_error.as_ref()),
        hint(),
        view_text(&view)
    )
}

fn controls(has_intensity: bool) -> String {
    let intensity = if has_intensity { "<option value=\"2\">intensity</option>" } else { "" };
    format!(
        "<div class=\"controls\">\
         <label><input type=\"checkbox\" id=\"show-target\" checked><i class=\"swatch \
         target\"></i>target</label>\
         <label><input type=\"checkbox\" id=\"show-source\" checked><i class=\"swatch \
         source\"></i>source</label>\
         <label>colour by <select id=\"colour-by\"><option value=\"0\">cloud</option>\
         <option value=\"1\">height</option>{intensity}</select></label>\
         <label>point size <input type=\"range\" id=\"point-size\" min=\"0.5\" max=\"3\" \
         step=\"0.25\" value=\"1\"></label>\
         <button type=\"button\" id=\"view-reset\">reset view</button>\
         <button type=\"button\" id=\"view-top\">from above</button></div>"
    )
}

fn panel(id: &str, title: &str, error: Option<&PairError>) -> String {
    let off = match error.filter(|error| error.translation_m.is_finite()) {
        Some(error) => format!(
            "{} and {} off",
            with_unit(&fixed(error.translation_m * 100.0, 1), "cm"),
            with_unit(&fixed(error.rotation_deg, 2), "°")
        ),
        None => "error unknown".to_owned(),
    };
    format!(
        "<figure><figcaption><b>{title}</b> <span>{off}</span></figcaption>\
         <canvas id=\"view-{id}\" tabindex=\"0\" role=\"img\" aria-describedby=\"view-hint\" \
         aria-label=\"Point clouds with {} parameters, {off}\"></canvas>\
         <p class=\"fallback\" hidden>This view needs WebGL2, which this browser does not \
         offer.</p></figure>",
        title.to_lowercase()
    )
}

fn hint() -> &'static str {
    "<p class=\"hint\" id=\"view-hint\">Drag to orbit, shift-drag or two fingers to pan; click a \
     view, then scroll to zoom. Keys: arrows orbit, shift and arrows pan, + and − zoom, 0 resets. \
     <span id=\"view-grid\"></span></p>\
     <noscript><p class=\"fallback\">The views need JavaScript.</p></noscript>"
}

/// The finite points, thinned evenly to [`MAX_LAYER_POINTS`], each with its intensity.
fn shown(layer: &CloudLayer) -> Vec<([f32; 3], f32)> {
    let finite: Vec<usize> = (0..layer.points.len())
        .filter(|i| layer.points[*i].iter().all(|c| c.is_finite()))
        .collect();
    let count = finite.len().min(MAX_LAYER_POINTS);
    (0..count)
        .map(|i| finite[i * finite.len() / count])
        .map(|i| (layer.points[i], layer.intensity.get(i).copied().unwrap_or(0.0)))
        .collect()
}

/// The camera's box: all but the outermost points of both targets and of the tuned source, so that
/// neither a stray echo nor a failed registration decides the view.
fn view(layers: &[Vec<([f32; 3], f32)>; 4]) -> Bounds {
    let [target, _, tuned_target, tuned_source] = layers;
    let all = || target.iter().chain(tuned_target).chain(tuned_source);
    let mut view = Bounds { low: [-1.0; 3], high: [1.0; 3] };
    for axis in 0..3 {
        let mut values: Vec<f32> = all().map(|(p, _)| p[axis]).collect();
        if values.is_empty() {
            continue;
        }
        values.sort_by(f32::total_cmp);
        let at = |share: f64| f64::from(values[((values.len() - 1) as f64 * share) as usize]);
        (view.low[axis], view.high[axis]) = (at(0.03), at(0.97));
    }
    view
}

fn view_text(view: &Bounds) -> String {
    let half = [0, 1, 2].map(|k| ((view.high[k] - view.low[k]) / 2.0).max(0.1));
    half.map(|h| format!("{h:.3}")).join(" ")
}

/// One layer: its box relative to the view's centre as attributes, its points as text.
fn layer_data(layer: &[([f32; 3], f32)], view: &Bounds) -> String {
    let bounds = bounds(layer);
    let centre = [0, 1, 2].map(|k| f64::midpoint(view.low[k], view.high[k]));
    let origin = [0, 1, 2].map(|k| format!("{:.5}", bounds.low[k] - centre[k])).join(" ");
    let extent = [0, 1, 2].map(|k| format!("{:.5}", bounds.high[k] - bounds.low[k])).join(" ");
    format!(
        "<script type=\"text/plain\" data-origin=\"{origin}\" data-extent=\"{extent}\">{}</script>",
        base64(&quantise(layer, &bounds))
    )
}

fn bounds(layer: &[([f32; 3], f32)]) -> Bounds {
    let mut bounds = Bounds { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };
    for (point, _) in layer {
        let point = point.map(f64::from);
        bounds.low = from_fn(|k| bounds.low[k].min(point[k]));
        bounds.high = from_fn(|k| bounds.high[k].max(point[k]));
    }
    match layer.is_empty() {
        true => Bounds { low: [0.0; 3], high: [0.0; 3] },
        false => bounds,
    }
}

/// Eight bytes a point: x, y, z within the box and intensity, each `u16`, little-endian.
fn quantise(layer: &[([f32; 3], f32)], bounds: &Bounds) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(layer.len() * 8);
    for (point, intensity) in layer {
        let shares: [f64; 3] = from_fn(|k| {
            let extent = (bounds.high[k] - bounds.low[k]).max(f64::MIN_POSITIVE);
            (f64::from(point[k]) - bounds.low[k]) / extent
        });
        for share in shares.into_iter().chain([f64::from(*intensity)]) {
            bytes.extend(((share * STEPS).round() as u16).to_le_bytes());
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantised_points_return_within_half_a_step() {
        let layer: Vec<_> = (0..100)
            .map(|i| i as f32)
            .map(|t| ([t * 0.37 - 9.0, (t * 0.7).sin() * 40.0, t * t * 0.01], 0.5))
            .collect();
        let bounds = bounds(&layer);
        let bytes = quantise(&layer, &bounds);
        for ((point, _), packed) in layer.iter().zip(bytes.chunks(8)) {
            for k in 0..3 {
                let code = f64::from(u16::from_le_bytes([packed[2 * k], packed[2 * k + 1]]));
                let extent = bounds.high[k] - bounds.low[k];
                let back = bounds.low[k] + code / STEPS * extent;
                assert!((back - f64::from(point[k])).abs() <= 0.5001 * extent / STEPS);
            }
        }
    }

    #[test]
    fn a_large_layer_is_thinned_evenly_and_loses_points_that_are_not_finite() {
        let mut points: Vec<[f32; 3]> = (0..100_000).map(|i| [i as f32, 0.0, 0.0]).collect();
        points[0] = [f32::NAN, 0.0, 0.0];
        let layer = CloudLayer { points, intensity: vec![] };
        let shown = shown(&layer);
        assert_eq!(shown.len(), MAX_LAYER_POINTS);
        assert_eq!(shown[0].0[0], 1.0);
        assert!(shown.windows(2).all(|w| (2.0..=3.0).contains(&(w[1].0[0] - w[0].0[0]))));
    }
}
