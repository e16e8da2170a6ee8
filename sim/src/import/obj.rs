//! OBJ: positions, faces as fans, and surfaces by the names of materials and groups.
//!
//! Read here instead of by a crate: tobj panics on a normal index beyond 2⁶² and on an MTL's legal
//! `Kd 0.5`, and opens any file that the mesh names. A scene needs six of the format's forty
//! keywords.

use std::borrow::Cow;
use std::collections::HashMap;

use super::fan::Fan;
use super::fault::Fault;
use super::referenced_files::keyword;
use crate::scene::{Mesh, MeshFault, Surface};
use echoloop_files::one_line;

/// Reads the files of an `mtllib` line: surfaces of materials by name.
pub(super) type OpenLibrary<'a> = dyn FnMut(&str) -> Result<Vec<(String, Surface)>, String> + 'a;

/// Reads the faces and the vertices that they use; `library` reads the files of an `mtllib` line.
pub(super) fn read(
    bytes: &[u8],
    library: &mut OpenLibrary<'_>,
    default: Surface,
) -> Result<Mesh, Fault> {
    let text =
        std::str::from_utf8(bytes).map_err(|e| Fault::Format(format!("expected text: {e}")))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let vertices = lines(text).filter(|(_, line)| keyword(line).0 == "v").count();
    let mut reader = Reader::new(vertices, default);
    for (number, line) in lines(text) {
        reader.line(&line, library).map_err(|fault| match fault {
            Fault::Format(what) => Fault::Format(format!("line {number}: {what}")),
            Fault::Mesh(_) => fault,
        })?;
    }
    Ok(reader.finish())
}

/// Names on the `mtllib` lines of a file.
pub(super) fn libraries(text: &str) -> impl Iterator<Item = String> {
    lines(text).filter_map(|(_, line)| match keyword(&line) {
        ("mtllib", names) => Some(names.to_owned()),
        _ => None,
    })
}

/// Lines with their numbers from 1; a backslash at the end continues a line.
fn lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut rest = text.lines().zip(1..);
    std::iter::from_fn(move || {
        let (line, number) = rest.next()?;
        let Some(start) = line.strip_suffix('\\') else {
            return Some((number, Cow::Borrowed(line)));
        };
        // Appended in place: the whole file may be one continued line.
        let (mut whole, mut is_continued) = (start.to_owned(), true);
        while is_continued {
            let next = rest.next().map_or("", |(next, _)| next);
            let start = next.strip_suffix('\\');
            is_continued = start.is_some();
            whole.push(' ');
            whole.push_str(start.unwrap_or(next));
        }
        Some((number, Cow::Owned(whole)))
    })
}

/// State of the reader.
struct Reader {
    /// Corners are indices into `positions` until [`Reader::finish`].
    mesh: Mesh,
    positions: Vec<[f32; 3]>,
    /// Number of positions in the whole file.
    vertices: usize,
    faces: usize,
    /// Surfaces of the materials of the libraries, by name.
    materials: HashMap<String, Surface>,
    group: Option<Surface>,
    material: Option<Surface>,
    default: Surface,
}

impl Reader {
    fn new(vertices: usize, default: Surface) -> Self {
        Self {
            mesh: Mesh::default(),
            positions: Vec::with_capacity(vertices),
            vertices,
            faces: 0,
            materials: HashMap::new(),
            group: None,
            material: None,
            default,
        }
    }

    fn line(&mut self, line: &str, library: &mut OpenLibrary<'_>) -> Result<(), Fault> {
        let (keyword, rest) = keyword(line);
        match keyword {
            "v" => self.positions.push(position(rest)?),
            "f" => self.face(rest)?,
            "o" | "g" => self.group = Surface::from_loose_name(rest),
            "usemtl" => {
                let materials = || self.materials.get(rest).copied();
                self.material = Surface::from_loose_name(rest).or_else(materials);
            }
            "mtllib" => self.materials.extend(library(rest)?),
            _ => {}
        }
        Ok(())
    }

    /// Adds a polygon as a fan from its first corner.
    fn face(&mut self, words: &str) -> Result<(), Fault> {
        let mut fan = Fan::default();
        for word in words.split_whitespace() {
            let corner = self.corner(word)?;
            self.mesh.triangles.extend(fan.push(corner));
        }
        if fan.count < 3 {
            let (face, count) = (self.faces, fan.count);
            return Err(Fault::Format(format!(
                "face {face} has {count} corners, expected three or more vertex numbers"
            )));
        }
        let surface = self.material.or(self.group).unwrap_or(self.default);
        self.mesh.materials.resize(self.mesh.triangles.len(), surface.index());
        self.faces += 1;
        Ok(())
    }

    /// Index of the position of a corner; it may be defined after the face.
    fn corner(&self, word: &str) -> Result<u32, Fault> {
        let number = vertex_number(word).ok_or_else(|| {
            let word = one_line(word);
            Fault::Format(format!("expected a vertex number as 7, 7/1, 7//2 or -1, found {word:?}"))
        })?;
        // 1 is the first position of the file, -1 the last one read so far.
        let so_far = self.positions.len() as i64;
        let index = if number < 0 { so_far.saturating_add(number) } else { number - 1 };
        let (face, vertices) = (self.faces, self.vertices);
        let corner = u32::try_from(index).ok().filter(|&i| (i as usize) < vertices);
        corner.ok_or(MeshFault::IndexOutOfRange { face, index, vertices }.into())
    }

    /// Mesh of the positions in use, in the order of the faces.
    fn finish(mut self) -> Mesh {
        let mut places = vec![u32::MAX; self.positions.len()];
        for corner in self.mesh.triangles.as_flattened_mut() {
            let place = &mut places[*corner as usize];
            if *place == u32::MAX {
                *place = self.mesh.vertices.len() as u32;
                self.mesh.vertices.push(self.positions[*corner as usize]);
            }
            *corner = *place;
        }
        self.mesh
    }
}

/// First three numbers of a `v` line; a weight and colours may follow.
fn position(words: &str) -> Result<[f32; 3], Fault> {
    three(words).ok_or_else(|| Fault::Format("expected a position of three numbers after v".into()))
}

/// First three words of a line, as numbers.
pub(super) fn three(words: &str) -> Option<[f32; 3]> {
    let mut words = words.split_whitespace();
    let mut number = || words.next()?.parse().ok();
    Some([number()?, number()?, number()?])
}

/// First index of "7", "7/1", "7//2" or "7/1/2". The indices of textures and normals are checked
/// and ignored.
fn vertex_number(word: &str) -> Option<i64> {
    let mut parts = word.split('/');
    let number = parts.next()?.parse().ok()?;
    let others: Vec<&str> = parts.take(3).collect();
    let is_number = |part: &&str| part.is_empty() || part.parse::<i64>().is_ok();
    (others.len() < 3 && others.iter().all(is_number)).then_some(number)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Mesh, Fault> {
        read(text.as_bytes(), &mut |_| Ok(Vec::new()), Surface::Unknown)
    }

    #[test]
    fn every_way_to_name_a_corner_gives_the_same_triangle() {
        let v = "v 9 9 9\nv 0 0 0\nv 1 0 0 0.5\nv 0 1 0 1 0 0\n";
        let faces = [
            "f 2 3 4",
            "f 2/1 3/2 4/3",
            "f 2//1 3//6148914691236517206 4//1",
            "f -3 -2 -1",
            "f 2/1/1 \\\n 3/1/1 \\\r\n 4",
            "\tf\t2 3   4 ",
        ];
        for face in faces {
            let mesh = parse(&format!("{v}{face}\n")).unwrap();
            assert_eq!(mesh.vertices, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]], "{face}");
            assert_eq!(mesh.triangles, [[0, 1, 2]], "{face}");
        }
        assert_eq!(parse(&format!("f 2 3 4\n{v}")).unwrap().triangles, [[0, 1, 2]]);
    }

    #[test]
    fn a_line_may_continue_for_a_million_lines_and_keeps_its_number() {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n{} 3\n", "\\\n".repeat(1_000_000));
        assert_eq!(parse(&text).unwrap().triangles, [[0, 1, 2]]);
        assert_eq!(
            lines("a \\\nb\\\n\\\nc\nd").collect::<Vec<_>>(),
            [(1, Cow::from("a  b  c")), (5, Cow::from("d")),]
        );
        assert_eq!(lines("a\\").collect::<Vec<_>>(), [(1, Cow::from("a "))]);
    }

    #[test]
    fn a_corner_that_is_no_vertex_is_refused() {
        let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        let huge = [i64::MAX, i64::MIN, 4, 0, -4, 1 << 32, 6_148_914_691_236_517_206];
        for number in huge.map(|n| n.to_string()) {
            let found = parse(&format!("{v}f 1 2 {number}\n"));
            assert!(matches!(found, Err(Fault::Mesh(_))), "{number}: {found:?}");
        }
        for word in ["1/2/3/4", "1.5", "/1", "9223372036854775808", "1/x", "1//-"] {
            let Err(Fault::Format(what)) = parse(&format!("{v}f 1 2 {word}\n")) else {
                panic!("{word} was taken");
            };
            assert!(what.starts_with("line 4: expected a vertex number"), "{what}");
        }
    }

    #[test]
    fn a_surface_is_named_by_material_library_or_group() {
        let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib a.mtl\n";
        let mut library = |name: &str| {
            assert_eq!(name, "a.mtl");
            Ok(vec![("Material.001".to_owned(), Surface::Glass)])
        };
        let text = format!(
            "{v}f 1 2 3\ng red_brick wall\nf 1 2 3\nusemtl Material.001\nf 1 2 3\n\
             usemtl asphalt_9\nf 1 2 3\nusemtl zz\nf 1 2 3\n"
        );
        let mesh = read(text.as_bytes(), &mut library, Surface::Unknown).unwrap();
        let names =
            [Surface::Unknown, Surface::Brick, Surface::Glass, Surface::Asphalt, Surface::Brick];
        assert_eq!(mesh.materials, names.map(Surface::index));
    }
}
