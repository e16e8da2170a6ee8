//! PLY files.

use std::path::Path;

use super::{Cloud, CloudError};
use echoloop_files::ply::{self, Body};
use nalgebra::Point3;

/// The vertices of a PLY file, or what was expected of it.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    vertices(bytes).map_err(|what| format!("expected a PLY file: {what}"))
}

/// What follows the vertices is not looked at.
fn vertices(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let (header, reader) = ply::header(bytes)?;
    let vertex = ply::vertex(&header)?;
    let mut body = Body::new(&header, reader, Some("vertex"))?;
    for element in header.elements.values().take_while(|element| element.name != vertex.name) {
        body.skip(element)?;
    }
    Ok(body.vertices(vertex)?.into_iter().map(Point3::from).collect())
}

/// Writes a cloud as little-endian binary PLY: `float x y z`, and `float nx ny nz` when there are
/// normals.
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
    let axes: &[&str] =
        if cloud.normals.is_some() { &["x", "y", "z", "nx", "ny", "nz"] } else { &["x", "y", "z"] };
    let properties: String = axes.iter().map(|axis| format!("property float {axis}\n")).collect();
    let count = cloud.points.len();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    )
    .into_bytes();
    for (i, point) in cloud.points.iter().enumerate() {
        let normal = cloud.normals.as_ref().and_then(|normals| normals.get(i));
        for value in point.coords.iter().chain(normal.into_iter().flat_map(|normal| normal.iter()))
        {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}
