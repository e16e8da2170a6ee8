//! PLY: reading the vertices, and the layout for writing.

use echoloop_files::attribute::is_attribute;
use echoloop_files::ply::{self, Body};
use echoloop_files::{Column, NumberType, one_line};

use super::layout::Layout;
use crate::recorded::{Keep, Recorded};

/// Reads the vertices of a PLY file; the error says what was expected.
pub(crate) fn parse(bytes: &[u8], keep: Keep) -> Result<Recorded, String> {
    vertices(bytes, keep).map_err(|what| format!("expected a PLY file: {what}"))
}

/// Elements after the vertices are not read.
fn vertices(bytes: &[u8], keep: Keep) -> Result<Recorded, String> {
    let (header, reader) = ply::header(bytes)?;
    let vertex = ply::vertex(&header)?;
    if let Some(list) = ply::lists(vertex).find(|name| is_attribute(name)) {
        return Err(format!("expected one number a vertex of {list:?}, found a list"));
    }
    let mut body = Body::new(&header, reader, Some("vertex"))?;
    for element in header.elements.values().take_while(|element| element.name != vertex.name) {
        body.skip(element)?;
    }
    let (points, columns) = body.points(vertex, keep == Keep::All)?;
    let left_out = ply::lists(vertex).map(one_line).collect();
    Ok(Recorded { columns, left_out, ..Recorded::of(points.at, points.range_sds) })
}

/// Little-endian binary, one element `vertex`. PLY has no integers of 8 bytes: they become
/// `double`.
pub(crate) const LAYOUT: Layout = Layout {
    normals: ["nx", "ny", "nz"],
    kind: |kind| match kind {
        NumberType::I64 | NumberType::U64 => NumberType::F64,
        kind => kind,
    },
    header,
};

fn header(columns: &[Column], count: usize) -> String {
    let property = |column: &Column| format!("property {} {}\n", name(column.kind()), column.name);
    let properties: String = columns.iter().map(property).collect();
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    )
}

/// PLY's older type names, except for `ushort`: Open3D reads only `uint16`.
fn name(kind: NumberType) -> &'static str {
    match kind {
        NumberType::I8 => "char",
        NumberType::U8 => "uchar",
        NumberType::I16 => "short",
        NumberType::U16 => "uint16",
        NumberType::I32 => "int",
        NumberType::U32 => "uint",
        NumberType::F32 => "float",
        NumberType::F64 | NumberType::I64 | NumberType::U64 => "double",
    }
}
