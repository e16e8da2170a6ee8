//! Compressed triangles of a scene, for its page.
//!
//! ```text
//! corner   code = round((p − low) / (high − low) · 65535), of each coordinate
//! order    triangles by material, distinct corners by their first use
//! x, y, z  zigzag(code − the corner's before), all low bytes, then all high bytes
//! index    corners so far − index, 0 being a new one; 7 bits a byte, the lowest first (LEB128)
//! all      zlib (RFC 1950), which every browser inflates
//! ```
//!
//! Neighbours in a mesh lie near each other and share corners: differences are small, high bytes
//! mostly zero, and so are most indices.

use std::array::from_fn;
use std::collections::HashMap;
use std::io::Write;

use echoloop_sim::scene::Mesh;
use flate2::Compression;
use flate2::write::ZlibEncoder;

/// Greatest number of triangles on a page: some 25 MB of text, within reach of a small graphics
/// card.
pub(super) const MAX_TRIANGLES: usize = 4_000_000;

/// Quantization steps along each side of the box: 16 bits.
pub(super) const STEPS: f64 = 65_535.0;

/// A packed mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Packed {
    /// Smallest corner of the mesh's box, metres.
    pub(super) low: [f64; 3],
    /// Sides of the box, metres.
    pub(super) extent: [f64; 3],
    /// Number of distinct corners.
    pub(super) vertices: usize,
    /// Index of each material and its number of triangles, in the order of the triangles.
    pub(super) groups: Vec<(u8, usize)>,
    /// Number of triangles left out because two of their corners have the same code.
    pub(super) collapsed: usize,
    /// Number of triangles left out as the smallest of too many.
    pub(super) smallest: usize,
    /// Corners and indices, compressed.
    pub(super) bytes: Vec<u8>,
}

impl Packed {
    /// Packs the `most` largest triangles of a mesh.
    pub(super) fn new(mesh: &Mesh, most: usize) -> Self {
        let (low, high) = mesh.bounds().unwrap_or_default();
        let extent: [f64; 3] = from_fn(|k| f64::from(high[k]) - f64::from(low[k]));
        let low = low.map(f64::from);
        let codes: Vec<[u16; 3]> = mesh.vertices.iter().map(|v| code(v, &low, &extent)).collect();
        let kept = largest(mesh, most);
        let smallest = mesh.triangles.len() - kept.len();
        let mut drawn: Vec<(u8, [[u16; 3]; 3])> = kept
            .into_iter()
            .map(|t| (mesh.materials[t], mesh.triangles[t].map(|i| codes[i as usize])))
            .filter(|(_, [a, b, c])| a != b && b != c && c != a)
            .collect();
        drawn.sort_by_key(|(material, _)| *material); // stable: neighbours stay beside each other
        let (corners, indices) = indexed(drawn.iter().flat_map(|(_, corners)| *corners));
        Self {
            low,
            extent,
            vertices: corners.len(),
            groups: drawn.chunk_by(|a, b| a.0 == b.0).map(|run| (run[0].0, run.len())).collect(),
            collapsed: mesh.triangles.len() - smallest - drawn.len(),
            smallest,
            bytes: deflated(&[differences(&corners), indices].concat()),
        }
    }

    /// Length of a step along each axis, metres.
    pub(super) fn step_m(&self) -> [f64; 3] {
        self.extent.map(|side| side / STEPS)
    }
}

/// Steps of a point from the lower corner of its box, along each axis.
pub(super) fn code(vertex: &[f32; 3], low: &[f64; 3], extent: &[f64; 3]) -> [u16; 3] {
    from_fn(|k| {
        let share = (f64::from(vertex[k]) - low[k]) / extent[k].max(f64::MIN_POSITIVE);
        (share * STEPS).round() as u16
    })
}

/// Indices of the largest triangles, ascending; ties go to the earlier one.
fn largest(mesh: &Mesh, most: usize) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..mesh.triangles.len()).collect();
    if kept.len() > most {
        kept.sort_by(|&a, &b| mesh.area_m2(b).total_cmp(&mesh.area_m2(a)));
        kept.truncate(most);
        kept.sort_unstable();
    }
    kept
}

/// Distinct corners in the order of their first use, and the bytes of the indices into them.
fn indexed(corners: impl Iterator<Item = [u16; 3]>) -> (Vec<[u16; 3]>, Vec<u8>) {
    let (mut seen, mut unique, mut bytes) = (HashMap::new(), Vec::new(), Vec::new());
    for corner in corners {
        let next = unique.len();
        let index = *seen.entry(corner).or_insert(next);
        if index == next {
            unique.push(corner);
        }
        leb128(next - index, &mut bytes);
    }
    (unique, bytes)
}

fn leb128(mut number: usize, bytes: &mut Vec<u8>) {
    while number > 127 {
        bytes.push(number as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Differences of each coordinate from corner to corner: low bytes, then high bytes.
fn differences(corners: &[[u16; 3]]) -> Vec<u8> {
    let of_axis = |axis: usize| {
        let before = [0].into_iter().chain(corners.iter().map(move |corner| corner[axis]));
        let folded = corners.iter().zip(before).map(move |(corner, before)| {
            let step = corner[axis].wrapping_sub(before) as i16;
            (step << 1 ^ step >> 15) as u16
        });
        let folded: Vec<[u8; 2]> = folded.map(u16::to_le_bytes).collect();
        [0, 1].map(|byte| folded.iter().map(|word| word[byte]).collect::<Vec<_>>()).concat()
    };
    [0, 1, 2].map(of_axis).concat()
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    // Writing to memory cannot fail.
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use echoloop_sim::scene::{SceneKind, generate};
    use flate2::read::ZlibDecoder;

    use super::*;

    /// Corners and indices, as a page unpacks them.
    fn unpacked(packed: &Packed) -> (Vec<[u16; 3]>, Vec<usize>) {
        let mut bytes = Vec::new();
        ZlibDecoder::new(&packed.bytes[..]).read_to_end(&mut bytes).expect("zlib");
        let (count, mut corners) = (packed.vertices, vec![[0; 3]; packed.vertices]);
        for axis in 0..3 {
            let mut last = 0_u16;
            for (i, corner) in corners.iter_mut().enumerate() {
                let at = |half: usize| u16::from(bytes[(2 * axis + half) * count + i]);
                let folded = at(0) | at(1) << 8;
                last = last.wrapping_add(folded >> 1 ^ (folded & 1).wrapping_neg());
                corner[axis] = last;
            }
        }
        let (mut indices, mut next, mut back, mut shift) = (Vec::new(), 0, 0, 0);
        for byte in &bytes[6 * count..] {
            back |= usize::from(byte & 127) << shift;
            shift += 7;
            if *byte < 128 {
                indices.push(next - back);
                next += usize::from(back == 0);
                (back, shift) = (0, 0);
            }
        }
        (corners, indices)
    }

    #[test]
    fn a_packed_scene_unpacks_within_half_a_step_with_the_material_of_every_triangle() {
        let mesh = generate(SceneKind::Structured, 4).mesh;
        let packed = Packed::new(&mesh, MAX_TRIANGLES);
        let (corners, indices) = unpacked(&packed);
        let materials: Vec<u8> =
            packed.groups.iter().flat_map(|&(m, count)| vec![m; count]).collect();
        assert_eq!(indices.len(), 3 * materials.len());
        assert_eq!(materials.len() + packed.collapsed, mesh.triangles.len());
        let (step, half) = (packed.step_m(), 0.5 + 1e-3);
        let mut drawn = indices.chunks(3).zip(&materials);
        // In the packed order: by material, then in the mesh's order.
        let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
        order.sort_by_key(|&t| mesh.materials[t]);
        let mut collapsed = 0;
        for triangle in order {
            let wanted = mesh.corners(triangle);
            let code = wanted.map(|p| code(&p, &packed.low, &packed.extent));
            if code[0] == code[1] || code[1] == code[2] || code[2] == code[0] {
                collapsed += 1;
                continue;
            }
            let (indices, material) = drawn.next().expect("as many");
            assert_eq!(*material, mesh.materials[triangle]);
            for (p, &i) in wanted.iter().zip(indices) {
                for k in 0..3 {
                    let back = packed.low[k] + f64::from(corners[i][k]) * step[k];
                    let error = (back - f64::from(p[k])).abs();
                    assert!(error <= half * step[k], "{error} m of {} m", step[k]);
                }
            }
        }
        assert_eq!(collapsed, packed.collapsed);
        assert!(packed.collapsed * 1000 < mesh.triangles.len(), "{} collapsed", packed.collapsed);
    }

    #[test]
    fn a_scene_takes_less_than_six_bytes_a_triangle() {
        for kind in SceneKind::ALL {
            let mesh = generate(kind, 1).mesh;
            let packed = Packed::new(&mesh, MAX_TRIANGLES);
            let each = packed.bytes.len() as f64 / mesh.triangles.len() as f64;
            eprintln!("{kind}: {} bytes, {each:.2} a triangle", packed.bytes.len());
            assert!(each < 6.0, "{kind}: {each} bytes a triangle");
        }
    }

    #[test]
    fn the_largest_of_too_many_triangles_are_kept_and_the_others_counted() {
        let side = |k: usize| [0.5, 3.0, 1.0, 2.0][k];
        let triangle = |k: usize| [[0.0; 3], [side(k), 0.0, 0.0], [0.0, side(k), k as f32]];
        let mesh = Mesh {
            vertices: (0..4).flat_map(triangle).collect(),
            triangles: (0..4).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            materials: vec![2, 1, 0, 1],
        };
        let packed = Packed::new(&mesh, 2);
        assert_eq!(
            (packed.smallest, packed.collapsed, packed.groups.clone()),
            (2, 0, vec![(1, 2)])
        );
        assert_eq!(Packed::new(&mesh, 4).groups, [(0, 1), (1, 2), (2, 1)]);
    }

    #[test]
    fn a_flat_mesh_and_an_empty_one_can_be_packed() {
        let flat = Mesh {
            vertices: vec![[0.0, 0.0, 7.0], [1.0, 0.0, 7.0], [0.0, 1.0, 7.0]],
            triangles: vec![[0, 1, 2], [0, 1, 1]],
            materials: vec![0, 0],
        };
        let packed = Packed::new(&flat, 9);
        assert_eq!((packed.vertices, packed.collapsed, packed.groups), (3, 1, vec![(0, 1)]));
        assert_eq!(Packed::new(&Mesh::default(), 9).groups, []);
    }
}
