//! PLY files.

use std::io::Cursor;
use std::path::Path;

use nalgebra::Point3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::{Cloud, CloudError};

/// A vertex: whatever else it has is ignored.
#[derive(Default)]
struct Vertex(Point3<f32>);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        let Some(value) = value.to_f32_lossy() else {
            return PropertyAccessResult::UnsupportedType;
        };
        self.0[axis] = value;
        PropertyAccessResult::Set
    }
}

/// The vertices of a PLY file, or what was expected of it.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let parser = Parser::<Vertex>::new();
    let mut reader = Reader::new(Cursor::new(bytes));
    let expected = |error| format!("expected a PLY file: {error}");
    let header = parser.read_header(&mut reader).map_err(expected)?;
    let vertex =
        header.elements.get("vertex").ok_or("expected an element \"vertex\" in the PLY header")?;
    check_axes(vertex)?;
    for element in header.elements.values() {
        let left = bytes.len() as u64 - reader.get_ref().position();
        check_size(element, header.encoding, left)?;
        let elements =
            parser.read_payload_for_element(&mut reader, element, &header).map_err(expected)?;
        if element.name == "vertex" {
            return Ok(elements.into_iter().map(|vertex| vertex.0).collect());
        }
    }
    Ok(Vec::new())
}

fn check_axes(vertex: &ElementDef) -> Result<(), String> {
    for axis in ["x", "y", "z"] {
        let property = vertex.properties.get(axis);
        if !property.is_some_and(|p| matches!(p.data_type, PropertyType::Scalar(_))) {
            return Err(format!("expected a numeric property {axis:?} of the PLY vertices"));
        }
    }
    Ok(())
}

/// A header may ask for any number of elements; the file's size says how many there can be.
fn check_size(element: &ElementDef, encoding: Encoding, left: u64) -> Result<(), String> {
    let ElementDef { name, count, properties, .. } = element;
    if properties.is_empty() && *count > 0 {
        return Err(format!("expected properties of the PLY element {name:?}"));
    }
    let least = |kind: &PropertyType| match (encoding, kind) {
        (Encoding::Ascii, _) => 2, // a digit and a blank or line end; the last may lack it
        (_, PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) => size(scalar),
    };
    let each: u64 = properties.values().map(|property| least(&property.data_type)).sum();
    let slack = u64::from(encoding == Encoding::Ascii);
    if (*count as u64).checked_mul(each).is_none_or(|needed| needed > left + slack) {
        return Err(format!(
            "expected {count} elements {name:?} of {each} bytes or more, found {left} bytes"
        ));
    }
    Ok(())
}

fn size(scalar: &ScalarType) -> u64 {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
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
