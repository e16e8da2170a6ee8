//! One pair's clouds in a 3D viewer, as points of 16 bits a coordinate in base64.

use std::array::from_fn;

use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_clouds::Cloud;

use super::Report;
use super::pairs::label_of;
use crate::format::{base64, escape, fixed, with_unit};
use crate::packed::code;

/// Greatest number of points of one cloud on the page.
const MAX_POINTS: usize = 40_000;

/// A box in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

/// The viewer with its data: the held-out pair that the default did worst on, target and source in
/// the target's frame.
pub(super) fn section(report: &Report) -> String {
    let result = &report.run.result;
    let pair = result.shown_pair();
    let off = |summary: &Summary| off(summary.errors.iter().find(|error| error.pair == pair));
    let lead = format!(
        "{}: the held-out pair the default did worst on",
        label_of(&report.background, pair)
    );
    let captions =
        [("Default", off(&result.default_summary)), ("Tuned", off(&result.tuned_summary))];
    views(&lead, captions, &report.clouds)
}

/// Two views of a pair, side by side: captions with what is off, and target and source of each.
pub(crate) fn views(
    lead: &str,
    [before, after]: [(&str, String); 2],
    clouds: &[[Cloud; 2]; 2],
) -> String {
    let layers = clouds.as_flattened().iter().map(thinned).collect::<Vec<_>>();
    let view = view(&layers);
    let data: String = layers.iter().map(|layer| layer_data(layer, &view)).collect();
    format!(
        "<section id=\"clouds\"><h2>One pair in three dimensions</h2>\
         <p class=\"lead\">{}: the target stands \
         still, the source lies where registration put it. Both views share one camera.</p>\
         {CONTROLS}<div class=\"pair views\">{}{}</div>{HINT}\
         <div id=\"viewer\" hidden data-view=\"{}\">{data}</div></section>\n",
        escape(lead),
        panel("before", before),
        panel("after", after),
        view_text(&view)
    )
}

const CONTROLS: &str = "<div class=\"controls\">\
     <label><input type=\"checkbox\" id=\"show-target\" checked><i class=\"swatch \
     target\"></i>target</label>\
     <label><input type=\"checkbox\" id=\"show-source\" checked><i class=\"swatch \
     source\"></i>source</label>\
     <label>colour by <select id=\"colour-by\"><option value=\"0\">cloud</option>\
     <option value=\"1\">height</option></select></label>\
     <label>point size <input type=\"range\" id=\"point-size\" min=\"0.5\" max=\"3\" \
     step=\"0.25\" value=\"1\"></label>\
     <button type=\"button\" id=\"view-reset\">reset view</button>\
     <button type=\"button\" id=\"view-top\">from above</button></div>";

const HINT: &str = "<p class=\"hint\" id=\"view-hint\">Drag to orbit, shift-drag or two fingers to \
     pan; click a view, then scroll to zoom. Keys: arrows orbit, shift and arrows pan, + and − \
     zoom, 0 resets. <span id=\"view-grid\"></span></p>\
     <noscript><p class=\"fallback\">The views need JavaScript.</p></noscript>";

fn off(error: Option<&PairError>) -> String {
    match error.filter(|error| error.translation_m.is_finite()) {
        Some(error) => format!(
            "{} and {} off",
            with_unit(&fixed(error.translation_m * 100.0, 1), "cm"),
            with_unit(&fixed(error.rotation_deg, 2), "°")
        ),
        None => "error unknown".to_owned(),
    }
}

fn panel(id: &str, (title, off): (&str, String)) -> String {
    let (title, off) = (escape(title), escape(&off));
    format!(
        "<figure><figcaption><b>{title}</b> <span>{off}</span></figcaption>\
         <canvas id=\"view-{id}\" tabindex=\"0\" role=\"img\" aria-describedby=\"view-hint\" \
         aria-label=\"Point clouds with {} parameters, {off}\"></canvas>\
         <p class=\"fallback\" hidden>This view needs WebGL2, which this browser does not \
         offer.</p></figure>",
        title.to_lowercase()
    )
}

/// The finite points, thinned evenly to [`MAX_POINTS`].
fn thinned(cloud: &Cloud) -> Vec<[f32; 3]> {
    let points = cloud.points.iter().map(|point| point.coords.into());
    let finite: Vec<[f32; 3]> =
        points.filter(|point: &[f32; 3]| point.iter().all(|c| c.is_finite())).collect();
    let count = finite.len().min(MAX_POINTS);
    (0..count).map(|i| finite[i * finite.len() / count]).collect()
}

/// The camera's box: all but the outermost points of both targets and of the tuned source, so that
/// neither a stray echo nor a failed registration decides the view.
fn view(layers: &[Vec<[f32; 3]>]) -> Bounds {
    let all = || [0, 2, 3].into_iter().flat_map(|layer: usize| &layers[layer]);
    let mut view = Bounds { low: [-1.0; 3], high: [1.0; 3] };
    for axis in 0..3 {
        let mut values: Vec<f32> = all().map(|point| point[axis]).collect();
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
fn layer_data(layer: &[[f32; 3]], view: &Bounds) -> String {
    let bounds = bounds(layer);
    let centre = [0, 1, 2].map(|k| f64::midpoint(view.low[k], view.high[k]));
    let origin = [0, 1, 2].map(|k| format!("{:.5}", bounds.low[k] - centre[k])).join(" ");
    let extent = [0, 1, 2].map(|k| format!("{:.5}", bounds.high[k] - bounds.low[k])).join(" ");
    format!(
        "<script type=\"text/plain\" data-origin=\"{origin}\" data-extent=\"{extent}\">{}</script>",
        base64(&quantise(layer, &bounds))
    )
}

fn bounds(layer: &[[f32; 3]]) -> Bounds {
    if layer.is_empty() {
        return Bounds { low: [0.0; 3], high: [0.0; 3] };
    }
    let along = |k: usize| layer.iter().map(move |point| f64::from(point[k]));
    Bounds {
        low: from_fn(|k| along(k).fold(f64::INFINITY, f64::min)),
        high: from_fn(|k| along(k).fold(f64::NEG_INFINITY, f64::max)),
    }
}

/// Eight bytes a point, each `u16`, little-endian: x, y, z within the box, and the viewer's
/// intensity, which scans of a run do not keep.
fn quantise(layer: &[[f32; 3]], bounds: &Bounds) -> Vec<u8> {
    let extent: [f64; 3] = from_fn(|k| bounds.high[k] - bounds.low[k]);
    let words = layer.iter().flat_map(|point| {
        let [x, y, z] = code(point, &bounds.low, &extent);
        [x, y, z, 0]
    });
    words.flat_map(u16::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::STEPS;
    use nalgebra::Point3;

    #[test]
    fn quantised_points_return_within_half_a_step() {
        let layer: Vec<[f32; 3]> = (0..100)
            .map(|i| i as f32)
            .map(|t| [t * 0.37 - 9.0, (t * 0.7).sin() * 40.0, t * t * 0.01])
            .collect();
        let bounds = bounds(&layer);
        let bytes = quantise(&layer, &bounds);
        for (point, packed) in layer.iter().zip(bytes.chunks(8)) {
            for k in 0..3 {
                let code = f64::from(u16::from_le_bytes([packed[2 * k], packed[2 * k + 1]]));
                let extent = bounds.high[k] - bounds.low[k];
                let back = bounds.low[k] + code / STEPS * extent;
                assert!((back - f64::from(point[k])).abs() <= 0.5001 * extent / STEPS);
            }
        }
    }

    #[test]
    fn a_large_cloud_is_thinned_evenly_and_loses_points_that_are_not_finite() {
        let mut points: Vec<Point3<f32>> =
            (0..100_000).map(|i| Point3::new(i as f32, 0.0, 0.0)).collect();
        points[0].x = f32::NAN;
        let points = thinned(&Cloud::new(points));
        assert_eq!(points.len(), MAX_POINTS);
        assert_eq!(points[0][0], 1.0);
        assert!(points.windows(2).all(|w| (2.0..=3.0).contains(&(w[1][0] - w[0][0]))));
    }
}
