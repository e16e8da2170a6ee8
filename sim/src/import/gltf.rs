//! glTF: the meshes of a scene with the transforms of its nodes, and surfaces by name.
//!
//! The crate `gltf` reads and checks the JSON. Numbers are taken from the buffers here, because a
//! file may declare more than they hold. y points up by definition, and the unit is the metre.

use std::collections::HashMap;
use std::rc::Rc;

use base64::Engine;
use echoloop_files::one_line;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::Source;
use gltf::mesh::{Mode, Primitive};
use gltf::{Gltf, Node};
use nalgebra::{Matrix4, Point3};

use super::fault::Fault;
use crate::scene::{Mesh, MeshFault, Surface};

/// Opens a file by the URI that the mesh gives for it.
pub(super) type OpenFile<'a> = dyn FnMut(&str) -> Result<Vec<u8>, String> + 'a;

/// Largest number of JSON objects of a document: each takes memory, however few bytes it has in the
/// file.
const MAX_OBJECTS: usize = 1 << 17;
/// Largest number of commas of a document: they separate its numbers and names.
const MAX_COMMAS: usize = 1 << 19;
/// Number of vertices and triangles that a mesh may have beyond one per four bytes of its file:
/// nodes may repeat one mesh.
const MAX_REPEATED: usize = 1 << 20;

/// Reads the default scene; the first where none is marked; all nodes where there is no scene.
pub(super) fn read(bytes: &[u8], open: &mut OpenFile<'_>, default: Surface) -> Result<Mesh, Fault> {
    let gltf = document(bytes)?;
    let buffers = buffers(&gltf, open)?;
    let held: usize = buffers.iter().map(|buffer| buffer.len()).sum();
    let most = bytes.len().max(held) / 4 + MAX_REPEATED;
    let textures = gltf.as_json().images.iter().map(|image| {
        let file = image.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        let file = file.and_then(|uri| Surface::from_loose_name(uri.rsplit('/').next()?));
        file.or_else(|| Surface::from_loose_name(image.name.as_deref()?))
    });
    let textures = textures.collect();
    let mut reader = Reader { buffers, textures, mesh: Mesh::default(), most, default };
    let mut visited = vec![false; gltf.nodes().len()];
    let mut pending: Vec<PlacedNode<'_>> = roots(&gltf).into_iter().map(PlacedNode::root).collect();
    while let Some(place) = pending.pop() {
        if std::mem::replace(&mut visited[place.node.index()], true) {
            let node = place.node.index();
            return Err(Fault::Format(format!(
                "node {node} has two parents or is its own ancestor"
            )));
        }
        pending.extend(place.children());
        reader.show(&place)?;
    }
    Ok(reader.mesh)
}

/// URIs of the buffers that lie in files of their own.
pub(super) fn files(bytes: &[u8]) -> Vec<String> {
    let Ok(gltf) = document(bytes) else { return Vec::new() };
    let uri = |buffer: gltf::Buffer<'_>| match buffer.source() {
        Source::Uri(uri) if !uri.starts_with("data:") => Some(uri.to_owned()),
        _ => None,
    };
    gltf.buffers().filter_map(uri).collect()
}

fn document(bytes: &[u8]) -> Result<Gltf, String> {
    let json = json(bytes)?;
    let count = |byte: u8| json.iter().filter(|&&b| b == byte).count();
    if count(b'{') > MAX_OBJECTS || count(b',') > MAX_COMMAS {
        return Err(format!("its JSON has more than {MAX_OBJECTS} objects or {MAX_COMMAS} commas"));
    }
    let message = |error| match error {
        gltf::Error::Validation(faults) => match faults.first() {
            Some((path, fault)) => one_line(&format!("{path}: {fault}")),
            None => "it is not valid".into(),
        },
        error => one_line(&error.to_string()),
    };
    let unchecked = Gltf::from_slice_without_validation(bytes).map_err(message)?;
    check_attributes(unchecked.as_json())?;
    Gltf::from_slice(bytes).map_err(message)
}

/// Refuses attributes that name a missing accessor: the crate indexes without a check.
fn check_attributes(root: &gltf::json::Root) -> Result<(), String> {
    let accessors = root.accessors.len();
    for (mesh, own) in root.meshes.iter().enumerate() {
        let named = own.primitives.iter().flat_map(|primitive| primitive.attributes.values());
        if let Some(beyond) = named.map(|index| index.value()).find(|&index| index >= accessors) {
            return Err(format!("mesh {mesh} names accessor {beyond} of {accessors}"));
        }
    }
    Ok(())
}

/// JSON of a .gltf, or of the first chunk of a .glb.
fn json(bytes: &[u8]) -> Result<&[u8], String> {
    if !bytes.starts_with(b"glTF") {
        return Ok(bytes);
    }
    let number = |at: usize| {
        let number = bytes.get(at..at + 4).and_then(|b| b.first_chunk());
        number.map(|b| u32::from_le_bytes(*b) as usize)
    };
    let (Some(whole), Some(length)) = (number(8), number(12)) else {
        return Err("its header is cut short".into());
    };
    if whole < 20 || whole > bytes.len() {
        let found = bytes.len();
        return Err(format!("its header promises {whole} bytes, found {found}"));
    }
    bytes.get(20..20 + length).ok_or_else(|| format!("its JSON is shorter than {length} bytes"))
}

/// Bytes of every buffer; a file that several name is read once.
fn buffers(gltf: &Gltf, open: &mut OpenFile<'_>) -> Result<Vec<Rc<Vec<u8>>>, String> {
    let mut opened: HashMap<&str, Rc<Vec<u8>>> = HashMap::new();
    let mut all = Vec::new();
    for buffer in gltf.buffers() {
        let index = buffer.index();
        let bytes = match buffer.source() {
            Source::Bin => match &gltf.blob {
                Some(blob) if index == 0 && all.is_empty() => Rc::new(blob.clone()),
                _ => return Err(format!("buffer {index} has neither a file nor a binary chunk")),
            },
            Source::Uri(uri) => match opened.get(uri) {
                Some(bytes) => bytes.clone(),
                None => {
                    let bytes = Rc::new(match uri.strip_prefix("data:") {
                        Some(data) => decoded(data, index)?,
                        None => open(uri)?,
                    });
                    opened.insert(uri, bytes.clone());
                    bytes
                }
            },
        };
        if bytes.len() < buffer.length() {
            let (promised, found) = (buffer.length(), bytes.len());
            return Err(format!("buffer {index} promises {promised} bytes, found {found}"));
        }
        all.push(bytes);
    }
    Ok(all)
}

/// Bytes of a data URI: "application/octet-stream;base64,AAAA".
fn decoded(data: &str, index: usize) -> Result<Vec<u8>, String> {
    let text = data.split_once(";base64,").map(|(_, text)| text);
    let bytes = text.and_then(|t| base64::engine::general_purpose::STANDARD.decode(t).ok());
    bytes.ok_or_else(|| format!("buffer {index} is data that is not in base64"))
}

fn roots(gltf: &Gltf) -> Vec<Node<'_>> {
    if let Some(scene) = gltf.default_scene().or_else(|| gltf.scenes().next()) {
        return scene.nodes().collect();
    }
    let mut is_child = vec![false; gltf.nodes().len()];
    gltf.nodes().flat_map(|node| node.children()).for_each(|child| is_child[child.index()] = true);
    gltf.nodes().filter(|node| !is_child[node.index()]).collect()
}

/// Node with its transform.
struct PlacedNode<'a> {
    node: Node<'a>,
    scene_from_node: Matrix4<f64>,
    /// Surface by the name of the node or of its nearest named ancestor.
    surface: Option<Surface>,
}

impl<'a> PlacedNode<'a> {
    fn root(node: Node<'a>) -> Self {
        Self::below(node, &Matrix4::identity(), None)
    }

    fn below(node: Node<'a>, scene_from_parent: &Matrix4<f64>, above: Option<Surface>) -> Self {
        let parent_from_node = Matrix4::from(node.transform().matrix()).cast::<f64>();
        let surface = node.name().and_then(Surface::from_loose_name).or(above);
        Self { node, scene_from_node: scene_from_parent * parent_from_node, surface }
    }

    fn children(&self) -> impl Iterator<Item = Self> + use<'a, '_> {
        self.node.children().map(|node| Self::below(node, &self.scene_from_node, self.surface))
    }
}

/// Mesh built so far, and the data it is built from.
struct Reader {
    buffers: Vec<Rc<Vec<u8>>>,
    /// Surfaces by the names of the textures.
    textures: Vec<Option<Surface>>,
    mesh: Mesh,
    /// Largest number of vertices and triangles.
    most: usize,
    default: Surface,
}

impl Reader {
    fn show(&mut self, place: &PlacedNode<'_>) -> Result<(), Fault> {
        let Some(mesh) = place.node.mesh() else { return Ok(()) };
        let of_mesh = || mesh.name().and_then(Surface::from_loose_name);
        let named = place.surface.or_else(of_mesh).unwrap_or(self.default);
        for primitive in mesh.primitives() {
            let surface = self.material(&primitive).unwrap_or(named);
            self.add(&primitive, &place.scene_from_node, surface)?;
        }
        Ok(())
    }

    /// Surface by the name of the material, else of its texture.
    fn material(&self, primitive: &Primitive<'_>) -> Option<Surface> {
        let material = primitive.material();
        let picture = || {
            let info = material.pbr_metallic_roughness().base_color_texture()?;
            *self.textures.get(info.texture().source()?.index())?
        };
        material.name().and_then(Surface::from_loose_name).or_else(picture)
    }

    /// Adds the triangles of a primitive; points and lines have none.
    fn add(
        &mut self,
        primitive: &Primitive<'_>,
        scene_from_node: &Matrix4<f64>,
        surface: Surface,
    ) -> Result<(), Fault> {
        let is_surface =
            matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        let positions = primitive.get(&gltf::Semantic::Positions);
        let (true, Some(positions)) = (is_surface, positions) else { return Ok(()) };
        let points = self.positions(&positions)?;
        let corners = match primitive.indices() {
            Some(indices) => self.indices(&indices)?,
            None => Corners::InOrder(points.count),
        };
        let triangles = corners.triangles(primitive.mode());
        if self.mesh.vertices.len() + self.mesh.triangles.len() + points.count + triangles
            > self.most
        {
            let most = self.most;
            return Err(Fault::Format(format!("it has more than {most} vertices and triangles")));
        }
        let first = self.mesh.vertices.len() as u32;
        let vertices = (0..points.count).map(|at| {
            let [x, y, z] = points.position(at).map(f64::from);
            let moved = scene_from_node.transform_point(&Point3::new(x, y, z));
            [moved.x as f32, moved.y as f32, moved.z as f32]
        });
        let vertices: Vec<[f32; 3]> = vertices.collect();
        for triangle in 0..triangles {
            let face = self.mesh.triangles.len();
            let corner = |number: usize| {
                let corner = corners.get(number);
                let found = corner.filter(|&c| (c as usize) < points.count);
                let index = corner.map_or(-1, i64::from);
                let fault = MeshFault::IndexOutOfRange { face, index, vertices: points.count };
                found.map(|corner| first + corner).ok_or(fault)
            };
            let [a, b, c] = corner_numbers(primitive.mode(), triangle);
            self.mesh.triangles.push([corner(a)?, corner(b)?, corner(c)?]);
        }
        self.mesh.vertices.extend(vertices);
        self.mesh.materials.resize(self.mesh.triangles.len(), surface.index());
        Ok(())
    }

    fn positions(&self, accessor: &Accessor<'_>) -> Result<Strided, String> {
        match (accessor.data_type(), accessor.dimensions()) {
            (DataType::F32, Dimensions::Vec3) => Strided::new(&self.buffers, accessor),
            (kind, shape) => Err(format!(
                "accessor {}: expected positions of three floats, found {shape:?} of {kind:?}",
                accessor.index()
            )),
        }
    }

    fn indices(&self, accessor: &Accessor<'_>) -> Result<Corners, String> {
        let size = match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => 1,
            (DataType::U16, Dimensions::Scalar) => 2,
            (DataType::U32, Dimensions::Scalar) => 4,
            (kind, shape) => {
                return Err(format!(
                    "accessor {}: expected whole numbers as indices, found {shape:?} of {kind:?}",
                    accessor.index()
                ));
            }
        };
        Ok(Corners::Listed(Strided::new(&self.buffers, accessor)?, size))
    }
}

/// Elements of an accessor in a buffer.
struct Strided {
    bytes: Rc<Vec<u8>>,
    first: usize,
    stride: usize,
    count: usize,
}

impl Strided {
    /// Refuses an accessor that reaches beyond its view or buffer.
    fn new(buffers: &[Rc<Vec<u8>>], accessor: &Accessor<'_>) -> Result<Self, String> {
        let index = accessor.index();
        if accessor.sparse().is_some() {
            return Err(format!("accessor {index} is sparse, which is not read"));
        }
        let view = accessor.view().ok_or_else(|| format!("accessor {index} has no bufferView"))?;
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        let bytes = buffers.get(view.buffer().index()).cloned().unwrap_or_default();
        let count = accessor.count();
        let ends = || {
            let end_of_view = view.offset().checked_add(view.length())?;
            let first = view.offset().checked_add(accessor.offset())?;
            let end = first.checked_add(count.checked_sub(1)?.checked_mul(stride)?)?;
            let end = end.checked_add(size)?;
            (stride >= size && end <= end_of_view.min(bytes.len())).then_some(first)
        };
        let first = ends().ok_or_else(|| format!("accessor {index} lies outside of its buffer"))?;
        Ok(Self { bytes, first, stride, count })
    }

    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let start = self.first + at * self.stride;
        self.bytes.get(start..).and_then(|b| b.first_chunk()).copied().unwrap_or([0; N])
    }

    fn position(&self, at: usize) -> [f32; 3] {
        let bytes: [u8; 12] = self.bytes(at);
        let (numbers, _) = bytes.as_chunks::<4>();
        [0, 1, 2].map(|axis| f32::from_le_bytes(numbers[axis]))
    }
}

/// Vertex indices of the triangles.
enum Corners {
    InOrder(usize),
    /// Unsigned integers and their size in bytes.
    Listed(Strided, u8),
}

impl Corners {
    fn len(&self) -> usize {
        match self {
            Self::InOrder(count) => *count,
            Self::Listed(list, _) => list.count,
        }
    }

    fn triangles(&self, mode: Mode) -> usize {
        match mode {
            Mode::TriangleStrip | Mode::TriangleFan => self.len().saturating_sub(2),
            _ => self.len() / 3,
        }
    }

    fn get(&self, number: usize) -> Option<u32> {
        match self {
            Self::InOrder(_) => u32::try_from(number).ok(),
            Self::Listed(list, 1) => Some(list.bytes::<1>(number)[0].into()),
            Self::Listed(list, 2) => Some(u16::from_le_bytes(list.bytes(number)).into()),
            Self::Listed(list, _) => Some(u32::from_le_bytes(list.bytes(number))),
        }
    }
}

/// Positions of a triangle's corners in the list of indices; the winding has no meaning.
fn corner_numbers(mode: Mode, triangle: usize) -> [usize; 3] {
    match mode {
        Mode::TriangleStrip => [triangle, triangle + 1, triangle + 2],
        Mode::TriangleFan => [0, triangle + 1, triangle + 2],
        _ => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A buffer of three corners and of the indices 0, 1, 2; a node for each of `nodes`.
    fn document(nodes: &str, roots: &str, materials: &str) -> String {
        let positions: [f32; 9] = [0., 0., 0., 1., 0., 0., 0., 1., 0.];
        let mut bytes: Vec<u8> = positions.iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend([0, 0, 1, 0, 2, 0]);
        let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{roots}]}}],
            "nodes":[{nodes}],"materials":[{materials}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}},
                      {{"name":"lawn","primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "buffers":[{{"uri":"data:application/octet-stream;base64,{data}","byteLength":42}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}},
                           {{"buffer":0,"byteOffset":36,"byteLength":6}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                           "min":[0,0,0],"max":[1,1,0]}},
                         {{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}}]}}"#
        )
    }

    fn parse(text: &str) -> Result<Mesh, Fault> {
        read(text.as_bytes(), &mut |uri| Err(format!("asked for {uri}")), Surface::Unknown)
    }

    fn message(text: &str) -> String {
        match parse(text) {
            Err(Fault::Format(what)) => what,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn nodes_move_turn_and_scale_what_is_below_them() {
        // A quarter turn about z and 10 m along x, of a child that is twice as large 1 m up.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let nodes = format!(
            r#"{{"children":[1],"translation":[10,0,0],"rotation":[0,0,{half},{half}]}},
               {{"mesh":0,"matrix":[2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,1,1]}}"#
        );
        let mesh = parse(&document(&nodes, "0", r#"{"name":"x"}"#)).unwrap();
        let expected = [[10., 0., 1.], [10., 2., 1.], [8., 0., 1.]];
        for (vertex, expected) in mesh.vertices.iter().zip(expected) {
            let near = vertex.iter().zip(expected).all(|(v, e): (_, f32)| (v - e).abs() < 1e-6);
            assert!(near, "{:?}", mesh.vertices);
        }
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn a_surface_is_named_by_material_node_ancestor_or_mesh() {
        let nodes = r#"{"children":[1,2],"name":"brick house"},{"mesh":1},
                       {"mesh":1,"name":"window"},{"mesh":1},{"mesh":0,"name":"window"}"#;
        let of = |material: &str| parse(&document(nodes, "0,3,4", material)).unwrap().materials;
        let mut found = of(r#"{"name":"Oak_bark"}"#);
        let mut expected =
            [Surface::Bark, Surface::Grass, Surface::Glass, Surface::Brick].map(Surface::index);
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
        assert!(!of(r#"{"name":"M.001"}"#).contains(&Surface::Bark.index()));
    }

    #[test]
    fn a_texture_names_the_surface_of_a_material_without_a_known_name() {
        let material = r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#;
        let text = document(r#"{"mesh":0}"#, "0", material);
        let textured = |image: &str| {
            let more = format!(r#""textures":[{{"source":0}}],"images":[{image}],"meshes""#);
            parse(&text.replacen(r#""meshes""#, &more, 1)).unwrap().materials
        };
        assert_eq!(textured(r#"{"uri":"tex/asphalt.png"}"#), [Surface::Asphalt.index()]);
        assert_eq!(
            textured(r#"{"uri":"data:image/png;base64,road","name":"glass"}"#),
            [Surface::Glass.index()]
        );
    }

    #[test]
    fn a_node_that_is_its_own_child_or_has_two_parents_is_refused() {
        let circle = r#"{"children":[1]},{"children":[0],"mesh":0}"#;
        assert!(message(&document(circle, "0", "{}")).contains("two parents"));
        assert!(message(&document(r#"{"mesh":0}"#, "0,0", "{}")).contains("two parents"));
    }

    #[test]
    fn a_document_that_declares_more_than_it_holds_is_refused() {
        let whole = document(r#"{"mesh":0}"#, "0", "{}");
        assert!(parse(&whole).is_ok());
        let table = [
            (r#""byteLength":42"#, r#""byteLength":43"#, "buffer 0 promises 43 bytes, found 42"),
            (r#""count":3,"type":"SCALAR""#, r#""count":4,"type":"SCALAR""#, "accessor 1 lies out"),
            (
                r#""count":3,"type":"VEC3""#,
                r#""count":9223372036854775807,"type":"VEC3""#,
                "outside",
            ),
            (r#""type":"VEC3""#, r#""type":"VEC2""#, "three floats"),
            ("5123", "5126", "whole numbers as indices"),
            ("base64,", "base65,", "not in base64"),
            (r#""indices":1"#, r#""indices":7"#, "indices"),
            (r#""POSITION":0"#, r#""POSITION":1"#, ""),
            (r#""POSITION":0"#, r#""POSITION":4294967295"#, "names accessor 4294967295 of 2"),
            (r#""mesh":0"#, r#""mesh":5"#, "mesh"),
            ("{", "[", ""),
        ];
        for (from, to, expected) in table {
            let message = message(&whole.replacen(from, to, 1));
            assert!(message.contains(expected), "{to}: {message}");
        }
        let far = whole.replacen(r#""byteOffset":36"#, r#""byteOffset":12"#, 1);
        assert!(matches!(parse(&far), Err(Fault::Mesh(MeshFault::IndexOutOfRange { .. }))));
        let outside = whole.replacen("data:application", "../x.bin?", 1);
        assert!(message(&outside).starts_with("asked for ../x.bin?"));
    }

    #[test]
    fn a_binary_file_is_cut_into_its_two_chunks() {
        let text = document(r#"{"mesh":0}"#, "0", "{}");
        let start = text.find("\"uri\"").unwrap();
        let end = start + text[start..].find("\"byteLength\"").unwrap();
        let mut json = format!("{}{}", &text[..start], &text[end..]);
        json.push_str(&" ".repeat(json.len().next_multiple_of(4) - json.len()));
        let positions: [f32; 9] = [0., 0., 0., 1., 0., 0., 0., 1., 0.];
        let mut bin: Vec<u8> = positions.iter().flat_map(|n| n.to_le_bytes()).collect();
        bin.extend([0, 0, 1, 0, 2, 0, 0, 0]);
        let chunk = |kind: &[u8; 4], body: &[u8]| {
            [&(body.len() as u32).to_le_bytes()[..], kind, body].concat()
        };
        let chunks = [chunk(b"JSON", json.as_bytes()), chunk(b"BIN\0", &bin)].concat();
        let length = (12 + chunks.len() as u32).to_le_bytes();
        let whole = [b"glTF", &2_u32.to_le_bytes()[..], &length, &chunks].concat();
        let mut open = |_: &str| Err("nothing to open".to_owned());
        let mesh = read(&whole, &mut open, Surface::Unknown).unwrap();
        assert_eq!(mesh, parse(&text).unwrap());
        for end in 0..whole.len() {
            assert!(read(&whole[..end], &mut open, Surface::Unknown).is_err(), "{end}");
        }
    }
}
