//! STL: triangles without materials, as text or as binary records of 50 bytes.
//!
//! Read here instead of by a crate: stl_io reads only the first solid of a text file, takes a
//! binary file whose header begins with "solid" for text, and splits a line into words however long
//! it is.

use echoloop_files::one_line;

use super::fault::Fault;
use super::obj::three;
use super::referenced_files::keyword;
use crate::scene::{Mesh, Surface};

/// Bytes of the header of a binary file, including the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: normal, three corners, two unused bytes.
const RECORD: usize = 50;

/// Reads the triangles of a file; the name of a solid may give its surface.
pub(super) fn read(bytes: &[u8], default: Surface) -> Result<Mesh, Fault> {
    let declared = declared_triangles(bytes);
    let is_exact = declared.is_some_and(|count| bytes.len() == HEADER + RECORD * count);
    let begins = bytes.trim_ascii_start().get(..5).unwrap_or_default();
    if !is_exact && begins.eq_ignore_ascii_case(b"solid") {
        return text(bytes, default);
    }
    let Some(count) = declared else {
        let found = bytes.len();
        return Err(Fault::Format(format!(
            "expected text that begins with \"solid\" or a header of {HEADER} bytes, found {found} \
             bytes"
        )));
    };
    binary(&bytes[HEADER..], count, default)
}

/// Number of triangles that the header of a binary file declares.
fn declared_triangles(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?.first_chunk()?;
    Some(u32::from_le_bytes(*count) as usize)
}

fn binary(body: &[u8], count: usize, default: Surface) -> Result<Mesh, Fault> {
    let (records, _) = body.as_chunks::<RECORD>();
    let Some(records) = records.get(..count) else {
        let found = records.len();
        return Err(Fault::Format(format!("its header promises {count} triangles, found {found}")));
    };
    let mut mesh = Mesh::default();
    for record in records {
        let (numbers, _) = record[12..48].as_chunks::<4>();
        let corner = |at: usize| [0, 1, 2].map(|axis| f32::from_le_bytes(numbers[at + axis]));
        add(&mut mesh, [corner(0), corner(3), corner(6)], default);
    }
    Ok(mesh)
}

fn add(mesh: &mut Mesh, corners: [[f32; 3]; 3], surface: Surface) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(corners);
    mesh.triangles.push([first, first + 1, first + 2]);
    mesh.materials.push(surface.index());
}

fn text(bytes: &[u8], default: Surface) -> Result<Mesh, Fault> {
    let text =
        std::str::from_utf8(bytes).map_err(|e| Fault::Format(format!("expected text: {e}")))?;
    let mut reader = Reader { mesh: Mesh::default(), solid: None, corners: Vec::new(), default };
    for (line, number) in text.lines().zip(1..) {
        reader.line(line).map_err(|what| Fault::Format(format!("line {number}: {what}")))?;
    }
    match reader.solid {
        Some(_) => Err(Fault::Format("end of file before endsolid".into())),
        None => Ok(reader.mesh),
    }
}

/// State of the reader of text.
struct Reader {
    mesh: Mesh,
    /// Surface of the current solid; `None` between solids.
    solid: Option<Surface>,
    /// Corners of the current loop: three at most.
    corners: Vec<[f32; 3]>,
    default: Surface,
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let (word, rest) = keyword(line);
        match (word.to_ascii_lowercase().as_str(), self.solid) {
            ("", _) => Ok(()),
            ("solid", None) => {
                self.solid = Some(Surface::from_loose_name(rest).unwrap_or(self.default));
                Ok(())
            }
            ("facet" | "outer" | "endfacet", Some(_)) => Ok(()),
            ("vertex", Some(_)) => self.corner(rest),
            ("endloop", Some(surface)) => self.triangle(surface),
            ("endsolid", Some(_)) if self.corners.is_empty() => {
                self.solid = None;
                Ok(())
            }
            (_, None) => Err(format!("expected solid, found {:?}", one_line(word))),
            (_, Some(_)) => {
                Err(format!("expected a facet or endsolid, found {:?}", one_line(word)))
            }
        }
    }

    fn corner(&mut self, words: &str) -> Result<(), String> {
        if self.corners.len() == 3 {
            return Err("a facet has more than three corners".into());
        }
        self.corners.push(three(words).ok_or("expected three numbers after vertex")?);
        Ok(())
    }

    fn triangle(&mut self, surface: Surface) -> Result<(), String> {
        let Some(&corners) = self.corners.first_chunk() else {
            return Err(format!("a facet has {} corners, expected three", self.corners.len()));
        };
        self.corners.clear();
        add(&mut self.mesh, corners, surface);
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                         vertex 0 1 2.5e0\nendloop\nendfacet\n";

    fn message(bytes: &[u8]) -> String {
        let Err(Fault::Format(what)) = read(bytes, Surface::Unknown) else { panic!("was taken") };
        what
    }

    fn binary_file(header: &str, count: u32) -> Vec<u8> {
        let mut file = header.as_bytes().to_vec();
        file.resize(80, b' ');
        file.extend(count.to_le_bytes());
        let numbers: [f32; 12] = [9., 9., 9., 0., 0., 0., 1., 0., 0., 0., 1., 2.5];
        file.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        file.extend([7, 7]);
        file
    }

    #[test]
    fn text_and_bytes_are_the_same_triangle_whatever_the_header_begins_with() {
        let of_text = read(format!("solid\n{FACET}endsolid\n").as_bytes(), Surface::Stone).unwrap();
        assert_eq!(of_text.vertices, [[0., 0., 0.], [1., 0., 0.], [0., 1., 2.5]]);
        assert_eq!(of_text.materials, [Surface::Stone.index()]);
        for header in ["", "solid made by a program", "exported"] {
            assert_eq!(read(&binary_file(header, 1), Surface::Stone).unwrap(), of_text, "{header}");
        }
    }

    #[test]
    fn every_solid_is_read_and_its_name_gives_the_surface() {
        let file = format!(
            "  SOLID brick wall\n{FACET}endsolid brick wall\n\nsolid Part1\n{FACET}{FACET}\
             endsolid\n"
        );
        let mesh = read(file.as_bytes(), Surface::Unknown).unwrap();
        let expected = [Surface::Brick, Surface::Unknown, Surface::Unknown].map(Surface::index);
        assert_eq!(mesh.materials, expected);
    }

    #[test]
    fn a_truncated_or_malformed_stl_is_refused_with_its_line() {
        let two = FACET.replace("vertex 1 0 0\n", "");
        let four = FACET.replace("vertex 1 0 0\n", "vertex 1 0 0\nvertex 1 0 0\n");
        let table = [
            (format!("solid\n{FACET}"), "before endsolid"),
            (format!("solid\n{two}endsolid\n"), "line 6: a facet has 2 corners"),
            (format!("solid\n{four}endsolid\n"), "line 7: a facet has more than three"),
            (format!("solid\n{}", FACET.replace("1 0 0", "1 x 0")), "line 5: expected three"),
            ("solid\nsolid\n".into(), "line 2: expected a facet or endsolid, found \"solid\""),
            (format!("solid\nendsolid\n{FACET}"), "line 3: expected solid"),
            ("hello".into(), "found 5 bytes"),
        ];
        for (file, expected) in table {
            let message = message(file.as_bytes());
            assert!(message.contains(expected), "{message}");
        }
        assert_eq!(message(&binary_file("", 2)), "its header promises 2 triangles, found 1");
    }
}
