//! From a scan's echoes to a cloud.

use echoloop_dsp::Echoes;
use echoloop_dsp::project::point_m;
use echoloop_registration::cloud::Cloud;
use nalgebra::Vector3;

/// The points of a scan, sensor frame, m: one for each echo of each beam. `directions` are the
/// beams' unit vectors.
pub fn cloud_from_scan(scan: &[Echoes], directions: &[Vector3<f32>]) -> Cloud {
    let beams = scan.iter().zip(directions);
    Cloud::new(
        beams.flat_map(|(echoes, d)| echoes.iter().map(move |echo| point_m(d, echo))).collect(),
    )
}
