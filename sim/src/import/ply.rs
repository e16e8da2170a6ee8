//! PLY: the file's own parser reads it, after its header has been held against its length.

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    DefaultElement, ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult,
    PropertyType, ScalarType,
};

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

#[derive(Debug, Default)]
struct Vertex([f32; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        match value {
            Property::Float(v) => self.0[axis] = v,
            Property::Double(v) => self.0[axis] = v as f32,
            other => match integer(&other) {
                Some(v) => self.0[axis] = v as f32,
                None => return PropertyAccessResult::UnsupportedType,
            },
        }
        PropertyAccessResult::Set
    }
}

#[derive(Debug, Default)]
struct Face {
    corners: Vec<i64>,
    semantic: Option<i64>,
    part: Option<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match name {
            "vertex_indices" | "vertex_index" => match integers(value) {
                Some(corners) => self.corners = corners,
                None => return PropertyAccessResult::UnsupportedType,
            },
            "semantic" => self.semantic = integer(&value),
            "part" => self.part = integer(&value),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn integer(value: &Property) -> Option<i64> {
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

fn integers(value: Property) -> Option<Vec<i64>> {
    Some(match value {
        Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
        Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
        Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
        Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
        Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
        Property::ListUInt(v) => v.into_iter().map(i64::from).collect(),
        _ => return None,
    })
}

pub(super) fn read(bytes: &[u8], default: Surface) -> Result<Mesh, Fault> {
    let mut reader = Reader::new(bytes);
    let malformed =
        |what: ply_rs_bw::parser::ParseError| Fault::Format(one_line(&what.to_string()));
    let header = Parser::<DefaultElement>::new().read_header(&mut reader).map_err(malformed)?;
    check_layout(&header, reader.get_ref().len())?;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                vertices = Parser::<Vertex>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(malformed)?
            }
            "face" => {
                faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(malformed)?
            }
            _ => drop(
                Parser::<DefaultElement>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(malformed)?,
            ),
        }
    }
    let parts = part_surfaces(&header);
    let surface = |face: &Face| face_surface(face, &parts, default);
    assemble(vertices, &faces, surface)
}

/// The parser's message on one line, cut short: it quotes the file, which may be binary.
fn one_line(message: &str) -> String {
    let words = message.split_whitespace().collect::<Vec<_>>().join(" ");
    words.chars().map(|c| if c.is_control() { '?' } else { c }).take(160).collect()
}

/// Refuses what has no mesh in it, and counts that the file is too short for: nothing is allocated
/// for those.
fn check_layout(header: &Header, length: usize) -> Result<(), Fault> {
    let expected = |what: &str| Fault::Format(format!("expected {what}"));
    let vertex = header.elements.get("vertex").ok_or_else(|| expected("an `element vertex`"))?;
    if !["x", "y", "z"].iter().all(|&axis| vertex.properties.contains_key(axis)) {
        return Err(expected("vertex properties x, y and z"));
    }
    let face = header.elements.get("face").ok_or_else(|| expected("an `element face`"))?;
    if !["vertex_indices", "vertex_index"].iter().any(|&name| face.properties.contains_key(name)) {
        return Err(expected("a face property list vertex_indices"));
    }
    let least =
        |element: &ElementDef| element.count.saturating_mul(least_size(element, header.encoding));
    let needed = header
        .elements
        .iter()
        .fold(0_usize, |sum, (_, element)| sum.saturating_add(least(element)));
    // The last line of an ascii file may lack its newline.
    if needed > length + 1 {
        let what =
            format!("its header promises at least {needed} bytes of data, but {length} follow");
        return Err(Fault::Format(what));
    }
    Ok(())
}

/// Fewest bytes one element can take.
fn least_size(element: &ElementDef, encoding: Encoding) -> usize {
    let scalar = |kind: &ScalarType| match kind {
        _ if encoding == Encoding::Ascii => 2,
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        _ => 8,
    };
    let sizes = element.properties.iter().map(|(_, property)| match &property.data_type {
        PropertyType::Scalar(kind) | PropertyType::List(kind, _) => scalar(kind),
    });
    sizes.sum::<usize>().max(1)
}

/// What comments say of parts: "part 3 Oak_bark" or "part 0=bark 1=leaf".
fn part_surfaces(header: &Header) -> Vec<(i64, Surface)> {
    let comments = header.comments.iter().map(ToString::to_string);
    comments.flat_map(|comment| part_names(&comment)).collect()
}

fn part_names(comment: &str) -> Vec<(i64, Surface)> {
    let Some((_, after)) = comment.split_once("part ") else {
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

fn face_surface(face: &Face, parts: &[(i64, Surface)], default: Surface) -> Surface {
    if let Some(semantic) = face.semantic {
        return usize::try_from(semantic)
            .ok()
            .and_then(|s| SEMANTICS.get(s))
            .copied()
            .unwrap_or(default);
    }
    let named =
        |part: i64| parts.iter().find(|(number, _)| *number == part).map(|(_, surface)| *surface);
    face.part.and_then(named).unwrap_or(default)
}

fn assemble(
    vertices: Vec<Vertex>,
    faces: &[Face],
    surface: impl Fn(&Face) -> Surface,
) -> Result<Mesh, Fault> {
    let mut mesh =
        Mesh { vertices: vertices.into_iter().map(|v| v.0).collect(), ..Mesh::default() };
    let count = mesh.vertices.len();
    for (number, face) in faces.iter().enumerate() {
        if face.corners.len() < 3 {
            let what =
                format!("face {number} has {} corners, expected three or more", face.corners.len());
            return Err(Fault::Format(what));
        }
        let checked = |&index: &i64| match u32::try_from(index) {
            Ok(i) if (i as usize) < count => Ok(i),
            _ => Err(MeshFault::IndexOutOfRange { face: number, index, vertices: count }),
        };
        let corners = face.corners.iter().map(checked).collect::<Result<Vec<u32>, _>>()?;
        mesh.triangles.extend(fan(&corners));
        mesh.materials.resize(mesh.triangles.len(), surface(face).index());
    }
    Ok(mesh)
}

/// Triangles of a polygon, as a fan from its first corner.
fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_name_the_surfaces_of_parts() {
        assert_eq!(
            part_names("a tree; part 0=bark 1=leaf quad"),
            [(0, Surface::Bark), (1, Surface::Leaf)]
        );
        assert_eq!(part_names("part 12 red_brick-mesh"), [(12, Surface::Brick)]);
        assert_eq!(part_names("part 1 Cube-mesh"), []);
        assert_eq!(part_names("made by hand"), []);
    }
}
