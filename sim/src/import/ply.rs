//! PLY: vertices, faces as fans, and surfaces by semantic, part or label.

use std::collections::HashMap;

use echoloop_files::ply::{self, Body};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult};

use super::fan::Fan;
use super::fault::Fault;
use crate::scene::{Mesh, MeshFault, Surface};

/// Surfaces of the per-face `semantic` of the Ingolstadt LoD3 models: other, roof, wall, ground,
/// window, door, installation, outer ceiling, outer floor, closure.
const SEMANTICS: [Surface; 10] = [
    Surface::Unknown,
    Surface::RoofTile,
    Surface::Plaster,
    Surface::Paving,
    Surface::Glass,
    Surface::Wood,
    Surface::Metal,
    Surface::Plaster,
    Surface::Concrete,
    Surface::Plaster,
];

/// Triangles at most from faces with one-byte indices: such faces name only 256 vertices, and each
/// byte of the file would become a triangle of 13 bytes.
const MAX_BYTE_TRIANGLES: usize = 1 << 20;

/// Face as in the file; its list of corners keeps its type, so that it takes no more memory than
/// there.
#[derive(Debug, Default)]
struct Face {
    corners: Option<Property>,
    semantic: Option<i64>,
    part: Option<i64>,
    label: Option<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match name {
            "vertex_indices" | "vertex_index" if integers(&value).is_some() => {
                self.corners = Some(value);
            }
            "vertex_indices" | "vertex_index" => return PropertyAccessResult::UnsupportedType,
            "semantic" => self.semantic = integer(&value),
            "part" => self.part = integer(&value),
            LABEL => self.label = integer(&value),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Vertex as in the file.
#[derive(Debug, Default)]
struct Vertex {
    at: [f32; 3],
    label: Option<i64>,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let axis = ["x", "y", "z"].iter().position(|axis| *axis == name);
        match (axis, value.to_f32_lossy()) {
            (Some(axis), Some(value)) => self.at[axis] = value,
            (Some(_), None) => return PropertyAccessResult::UnsupportedType,
            (None, _) if name == LABEL => self.label = integer(&value),
            (None, _) => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Value of an integer property.
pub(super) fn integer(value: &Property) -> Option<i64> {
    Some(match *value {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        _ => return None,
    })
}

fn integers(list: &Property) -> Option<Box<dyn Iterator<Item = i64> + '_>> {
    fn widened<T: Copy + Into<i64>>(list: &[T]) -> Box<dyn Iterator<Item = i64> + '_> {
        Box::new(list.iter().map(|&v| v.into()))
    }
    Some(match list {
        Property::ListChar(v) => widened(v),
        Property::ListUChar(v) => widened(v),
        Property::ListShort(v) => widened(v),
        Property::ListUShort(v) => widened(v),
        Property::ListInt(v) => widened(v),
        Property::ListUInt(v) => widened(v),
        _ => return None,
    })
}

pub(super) fn read(bytes: &[u8], default: Surface) -> Result<Mesh, Fault> {
    let (header, reader) = ply::header(bytes)?;
    let (vertex, face) = (ply::vertex(&header)?, faces(&header)?);
    let mut body = Body::new(&header, reader, None)?;
    let parts = named_surfaces(&header, "part ");
    let mut labels =
        Labels { surfaces: named_surfaces(&header, "label "), of_vertices: Vec::new() };
    let (mut mesh, mut number) = (Mesh::default(), 0);
    for element in header.elements.values() {
        if element.name == vertex.name {
            let has_labels = vertex.properties.contains_key(LABEL);
            mesh.vertices.reserve(element.count);
            body.read(element, |vertex: Vertex| {
                mesh.vertices.push(vertex.at);
                if has_labels {
                    labels.of_vertices.push(labels.surface(vertex.label));
                }
                Ok::<_, String>(())
            })?;
        } else if element.name == face.name {
            body.read(element, |face: Face| {
                check_byte_indices(&mesh, &face)?;
                add(&mut mesh, &face, number, vertex.count)?;
                let surface = face_surface(&face, &parts, &labels).unwrap_or(default);
                mesh.materials.resize(mesh.triangles.len(), surface.index());
                number += 1;
                Ok::<_, Fault>(())
            })?;
        } else {
            body.skip(element)?;
        }
    }
    Ok(mesh)
}

/// Refuses a face that would exceed [`MAX_BYTE_TRIANGLES`].
fn check_byte_indices(mesh: &Mesh, face: &Face) -> Result<(), Fault> {
    let bytes = match &face.corners {
        Some(Property::ListUChar(corners)) => corners.len(),
        Some(Property::ListChar(corners)) => corners.len(),
        _ => return Ok(()),
    };
    match mesh.triangles.len() + bytes > MAX_BYTE_TRIANGLES {
        true => Err(Fault::Format(format!(
            "vertex numbers of one byte make more than {MAX_BYTE_TRIANGLES} triangles"
        ))),
        false => Ok(()),
    }
}

/// Element of the faces in a header.
fn faces(header: &Header) -> Result<&ElementDef, String> {
    let face = header.elements.get("face").ok_or("expected an `element face`")?;
    match ["vertex_indices", "vertex_index"].iter().any(|&name| face.properties.contains_key(name))
    {
        true => Ok(face),
        false => Err("expected a face property list vertex_indices".into()),
    }
}

/// Surfaces by number from comments on parts or labels, as "part 3 Oak_bark" or "part 0=bark
/// 1=leaf". The first comment on a number counts.
fn named_surfaces(header: &Header, what: &str) -> HashMap<i64, Surface> {
    let mut surfaces = HashMap::new();
    let comments = header.comments.iter().map(ToString::to_string);
    for (number, surface) in comments.flat_map(|comment| names(&comment, what)) {
        surfaces.entry(number).or_insert(surface);
    }
    surfaces
}

fn names(comment: &str, what: &str) -> Vec<(i64, Surface)> {
    let Some((_, after)) = comment.split_once(what) else {
        return Vec::new();
    };
    let listed = |word: &str| {
        let (number, name) = word.split_once('=')?;
        Some((number.parse().ok()?, Surface::from_loose_name(name)?))
    };
    let single = |text: &str| {
        let (number, name) = text.split_once(' ')?;
        Some((number.parse().ok()?, Surface::from_loose_name(name)?))
    };
    after.split_whitespace().filter_map(listed).chain(single(after)).collect()
}

/// Property of a face or a vertex that numbers its class.
const LABEL: &str = "label";

/// Surfaces by label, and the surfaces of the vertices.
struct Labels {
    surfaces: HashMap<i64, Surface>,
    of_vertices: Vec<Option<Surface>>,
}

impl Labels {
    fn surface(&self, label: Option<i64>) -> Option<Surface> {
        self.surfaces.get(&label?).copied()
    }

    /// Majority surface of the first three corners, else that of the first.
    fn of_corners(&self, face: &Face) -> Option<Surface> {
        let corners = face.corners.as_ref().and_then(integers)?;
        let of = |corner: i64| *self.of_vertices.get(usize::try_from(corner).ok()?)?;
        let [a, b, c] = corners.take(3).map(of).collect::<Vec<_>>().try_into().ok()?;
        if b == c { b } else { a }
    }
}

fn face_surface(face: &Face, parts: &HashMap<i64, Surface>, labels: &Labels) -> Option<Surface> {
    if let Some(semantic) = face.semantic {
        return SEMANTICS.get(usize::try_from(semantic).ok()?).copied();
    }
    let of_part = || parts.get(&face.part?).copied();
    labels.surface(face.label).or_else(of_part).or_else(|| labels.of_corners(face))
}

/// Adds a polygon as a fan from its first corner.
fn add(mesh: &mut Mesh, face: &Face, number: usize, vertices: usize) -> Result<(), Fault> {
    let mut fan = Fan::default();
    for index in face.corners.as_ref().and_then(integers).into_iter().flatten() {
        let corner = u32::try_from(index).ok().filter(|&i| (i as usize) < vertices);
        let corner = corner.ok_or(MeshFault::IndexOutOfRange { face: number, index, vertices })?;
        mesh.triangles.extend(fan.push(corner));
    }
    match fan.count {
        count @ 0..3 => {
            Err(Fault::Format(format!("face {number} has {count} corners, expected three or more")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_name_the_surfaces_of_parts_and_labels() {
        assert_eq!(
            names("a tree; part 0=bark 1=leaf quad", "part "),
            [(0, Surface::Bark), (1, Surface::Leaf)]
        );
        assert_eq!(names("part 12 red_brick-mesh", "part "), [(12, Surface::Brick)]);
        assert_eq!(names("part 1 Cube-mesh", "part "), []);
        assert_eq!(names("label 12 road", "label "), [(12, Surface::Asphalt)]);
        assert_eq!(names("made by hand", "part "), []);
    }
}
