//! Reading legacy VTK polydata, the format of libpointmatcher's clouds.

use std::str::FromStr;

use echoloop_files::{Coordinates, one_line};

use super::text::most_points;

/// Most bytes of a header line (VTK's own limit). A file of another format is not searched to its
/// end.
const LONGEST_LINE: usize = 256;

/// Reads the points of a legacy VTK file; the error says what was expected.
///
/// ```text
/// # vtk DataFile Version 3.0
/// any title
/// ASCII | BINARY
/// DATASET POLYDATA
/// POINTS 24989 float | double
/// x y z x y z …               binary: big-endian
/// ```
///
/// Everything after the points (vertices, normals, colours) is ignored.
pub(crate) fn parse(bytes: &[u8]) -> Result<Coordinates, String> {
    let mut rest = bytes;
    let version = line(&mut rest)?;
    if !version.starts_with("# vtk DataFile Version") {
        let version = one_line(version);
        return Err(format!("expected \"# vtk DataFile Version\" first, found {version:?}"));
    }
    line(&mut rest)?; // the title
    let encoding = line(&mut rest)?;
    expect(&mut rest, "DATASET POLYDATA")?;
    let (count, scalar) = points_line(&mut rest)?;
    match encoding {
        "ASCII" => match scalar {
            Scalar::Float => ascii(rest, count).map(Coordinates::Single),
            Scalar::Double => ascii(rest, count).map(Coordinates::Double),
        },
        "BINARY" => binary(rest, count, scalar),
        _ => {
            let encoding = one_line(encoding);
            Err(format!("expected ASCII or BINARY in the VTK header, found {encoding:?}"))
        }
    }
}

/// The type of a coordinate.
#[derive(Clone, Copy)]
enum Scalar {
    Float,
    Double,
}

/// The next line of the header, trimmed.
fn line<'a>(rest: &mut &'a [u8]) -> Result<&'a str, String> {
    let end = rest.iter().take(LONGEST_LINE).position(|&byte| byte == b'\n');
    let end = end.ok_or("expected a line of a VTK header")?;
    let text = std::str::from_utf8(&rest[..end]).map_err(|_| "expected text in the VTK header")?;
    *rest = &rest[end + 1..];
    Ok(text.trim())
}

/// The next line that is not empty.
fn filled_line<'a>(rest: &mut &'a [u8]) -> Result<&'a str, String> {
    loop {
        let line = line(rest)?;
        if !line.is_empty() {
            return Ok(line);
        }
    }
}

fn expect(rest: &mut &[u8], expected: &str) -> Result<(), String> {
    let found = filled_line(rest)?;
    match found.split_whitespace().eq(expected.split_whitespace()) {
        true => Ok(()),
        false => {
            let found = one_line(found);
            Err(format!("expected {expected:?} in the VTK header, found {found:?}"))
        }
    }
}

fn points_line(rest: &mut &[u8]) -> Result<(usize, Scalar), String> {
    let found = filled_line(rest)?;
    let fail = || {
        let found = one_line(found);
        format!("expected \"POINTS\", a count, and \"float\" or \"double\", found {found:?}")
    };
    let words: Vec<&str> = found.split_whitespace().collect();
    let &["POINTS", count, scalar] = words.as_slice() else { return Err(fail()) };
    let scalar = match scalar {
        "float" => Scalar::Float,
        "double" => Scalar::Double,
        _ => return Err(fail()),
    };
    Ok((count.parse().map_err(|_| fail())?, scalar))
}

/// Reads word by word. A wrong count in the header costs no more memory than the text is worth.
fn ascii<T: FromStr>(rest: &[u8], count: usize) -> Result<Vec<[T; 3]>, String> {
    let mut words = rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let mut points = Vec::with_capacity(count.min(most_points(rest)));
    for index in 0..count {
        let mut value = || {
            let word = words.next().ok_or_else(|| {
                format!("expected the {count} points of the VTK header, found {index}")
            })?;
            let text = std::str::from_utf8(word).ok();
            text.and_then(|text| text.parse().ok())
                .ok_or_else(|| format!("point {index}: expected three numbers"))
        };
        points.push([value()?, value()?, value()?]);
    }
    Ok(points)
}

fn binary(rest: &[u8], count: usize, scalar: Scalar) -> Result<Coordinates, String> {
    let each = match scalar {
        Scalar::Float => 12,
        Scalar::Double => 24,
    };
    let needed = count.checked_mul(each);
    let data = needed.and_then(|needed| rest.get(..needed)).ok_or_else(|| {
        format!(
            "expected the {count} points of the VTK header, {each} bytes each, found {} bytes",
            rest.len()
        )
    })?;
    Ok(match scalar {
        Scalar::Float => Coordinates::Single(points(data, f32::from_be_bytes)),
        Scalar::Double => Coordinates::Double(points(data, f64::from_be_bytes)),
    })
}

/// Points of three numbers, each of `WORD` bytes.
fn points<T, const WORD: usize>(data: &[u8], number: impl Fn([u8; WORD]) -> T) -> Vec<[T; 3]> {
    let (words, _) = data.as_chunks::<WORD>();
    let (points, _) = words.as_chunks::<3>();
    points.iter().map(|&[x, y, z]| [number(x), number(y), number(z)]).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn file(encoding: &str, points: &str, body: &[u8]) -> Vec<u8> {
        let header = format!(
            "# vtk DataFile Version 3.0\na title\n{encoding}\nDATASET POLYDATA\n{points}\n"
        );
        [header.as_bytes(), body].concat()
    }

    fn big(values: &[f64], single: bool) -> Vec<u8> {
        let bytes = |v: &f64| {
            if single { (*v as f32).to_be_bytes().to_vec() } else { v.to_be_bytes().to_vec() }
        };
        values.iter().flat_map(bytes).collect()
    }

    #[test]
    fn the_same_two_points_come_from_each_encoding_whatever_follows_them() {
        let values = [1.0, -2.0, 0.5, 4.0, 5.0, 6.0];
        let tail: &[u8] = b"\nVERTICES 2 4\n1 0\n1 1\nPOINT_DATA 2\nNORMALS n float\n0 0 1 0 0 1\n";
        let table = [
            file("ASCII", "POINTS 2 float", &[b"1 -2 0.5\n4 5 6 ", tail].concat()),
            file("ASCII", "POINTS 2 double", b"1 -2\n5e-1 4\n\n5 6"),
            file("BINARY", "POINTS 2 float", &[&big(&values, true), tail].concat()),
            file("BINARY", "\nPOINTS  2 double", &[&big(&values, false), tail].concat()),
        ];
        for content in table {
            match parse(&content).unwrap() {
                Coordinates::Single(points) => {
                    assert_eq!(points, [[1.0, -2.0, 0.5], [4.0, 5.0, 6.0]]);
                }
                Coordinates::Double(points) => {
                    assert_eq!(points, [[1.0, -2.0, 0.5], [4.0, 5.0, 6.0]]);
                }
                Coordinates::Wide(_) => unreachable!("the header names a type"),
            }
        }
    }

    #[test]
    fn lines_may_end_as_on_windows() {
        let text = "# vtk DataFile Version 2.0\r\nt\r\nASCII\r\nDATASET POLYDATA\r\n\
                    POINTS 1 float\r\n1 2 3\r\n";
        assert_eq!(parse(text.as_bytes()).unwrap(), Coordinates::Single(vec![[1.0, 2.0, 3.0]]));
    }

    #[test]
    fn a_malformed_file_is_an_error_that_says_what_was_expected() {
        let huge = format!("POINTS {} float", u64::MAX);
        let grid = b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_GRID\n".to_vec();
        let table = [
            (Vec::new(), "a line"),
            (vec![b'x'; 100_000], "a line"),
            (b"\xff\xff\n".to_vec(), "text"),
            (b"solid cube\n".to_vec(), "# vtk DataFile"),
            (file("XML", "POINTS 1 float", b"1 2 3\n"), "ASCII or BINARY"),
            (grid, "DATASET POLYDATA"),
            (file("ASCII", "VERTICES 1 2", b"1 0\n"), "POINTS"),
            (file("ASCII", "POINTS 1 int", b"1 2 3\n"), "\"double\""),
            (file("ASCII", "POINTS -1 float", b"1 2 3\n"), "a count"),
            (file("ASCII", "POINTS 2 float", b"1 2 3 4 5\n"), "2 points"),
            (file("ASCII", "POINTS 2 float", b"1 2 3 4 five 6\n"), "point 1"),
            (file("ASCII", &huge, b"1 2 3\n"), "points of the VTK header"),
            (file("BINARY", &huge, &[0; 12]), "points of the VTK header"),
            (file("BINARY", "POINTS 2 double", &[0; 47]), "24 bytes each"),
        ];
        for (content, expected) in table {
            let message = parse(&content).unwrap_err();
            assert!(message.contains(expected), "{message:?} does not say {expected:?}");
        }
    }

    #[test]
    fn a_message_repeats_no_more_than_200_characters_of_a_header() {
        let long = "\u{e9}\x1b".repeat(80); // 240 bytes a line
        let table = [
            format!("{long}\n").into_bytes(),
            file(&long, "POINTS 1 float", b""),
            file("ASCII", &long, b""),
            format!("# vtk DataFile Version 3.0\nt\nASCII\n{long}\n").into_bytes(),
        ];
        for content in table {
            let message = parse(&content).unwrap_err();
            assert!(!message.contains('\x1b'), "{message}");
            let repeated = message.matches('\u{e9}').count();
            assert!((1..=80).contains(&repeated), "{message}");
        }
        let ascii = "x".repeat(250);
        let message = parse(&file(&ascii, "POINTS 1 float", b"")).unwrap_err();
        assert!(message.contains(&"x".repeat(200)) && !message.contains(&ascii), "{message}");
    }
}
