//! PLY files.

use std::path::Path;

use super::{Cloud, CloudError};
use echoloop_files::ply::{self, Body, Points, RANGE_SD};
use nalgebra::Point3;

/// The vertices of a PLY file, or what was expected of it.
pub(super) fn parse(bytes: &[u8]) -> Result<Cloud, String> {
    vertices(bytes).map_err(|what| format!("expected a PLY file: {what}"))
}

/// What follows the vertices is not looked at.
fn vertices(bytes: &[u8]) -> Result<Cloud, String> {
    let (header, reader) = ply::header(bytes)?;
    let vertex = ply::vertex(&header)?;
    let mut body = Body::new(&header, reader, Some("vertex"))?;
    for element in header.elements.values().take_while(|element| element.name != vertex.name) {
        body.skip(element)?;
    }
    let Points { at, range_sds: range_sd_m } = body.points(vertex)?;
    check_sds(range_sd_m.as_deref().unwrap_or_default())?;
    Ok(Cloud { range_sd_m, ..Cloud::new(at.into_iter().map(Point3::from).collect()) })
}

fn check_sds(range_sd_m: &[f32]) -> Result<(), String> {
    let wrong = range_sd_m.iter().enumerate().find(|(_, sd)| !(sd.is_finite() && **sd >= 0.0));
    match wrong {
        Some((i, sd)) => {
            Err(format!("the {RANGE_SD} of vertex {i} is {sd}, expected 0 m or more, finite"))
        }
        None => Ok(()),
    }
}

/// Writes a cloud as little-endian binary PLY: `float x y z`, `float nx ny nz` when there are
/// normals, `float range_sd` when it is known.
///
/// # Errors
///
/// [`CloudError::Io`] when the file cannot be written.
pub fn write_ply(path: &Path, cloud: &Cloud) -> Result<(), CloudError> {
    std::fs::write(path, ply_bytes(cloud))
        .map_err(|source| CloudError::Io { path: path.into(), source })
}

/// What [`write_ply`] writes.
pub fn ply_bytes(cloud: &Cloud) -> Vec<u8> {
    let normal: &[_] = if cloud.normals.is_some() { &["nx", "ny", "nz"] } else { &[] };
    let range_sd: &[_] = if cloud.range_sd_m.is_some() { &[RANGE_SD] } else { &[] };
    let names = [&["x", "y", "z"], normal, range_sd].concat();
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let count = cloud.points.len();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    )
    .into_bytes();
    for (i, point) in cloud.points.iter().enumerate() {
        let normal = cloud.normals.as_ref().and_then(|normals| normals.get(i));
        let range_sd = cloud.range_sd_m.as_ref().and_then(|sds| sds.get(i));
        let normal = normal.into_iter().flat_map(|normal| normal.iter());
        for value in point.coords.iter().chain(normal).chain(range_sd) {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}
