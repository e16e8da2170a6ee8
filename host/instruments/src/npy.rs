//! NumPy's `.npy`: one array of numbers.
//!
//! ```text
//! magic  \x93NUMPY, major, minor    length of the header: u16 (major 1) or u32, little-endian
//! header {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
//! data   in that order
//! ```
//!
//! No crate reads it: those bring a parser generator and assembly for the three entries of the
//! header.

use echoloop_files::{NumberType, one_line};

use super::array::{Array, Layout, Number};

const MAGIC: &[u8] = b"\x93NUMPY";

/// True when the bytes begin as a `.npy` file.
pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// An array of two dimensions, or of one dimension as a single row.
pub(super) fn parse(mut bytes: Vec<u8>) -> Result<Array, String> {
    let (header, data) = split(&bytes)
        .ok_or_else(|| refused("a header that ends within the file", "a shorter file"))?;
    let (rows, columns) = shape(entry(header, "shape").unwrap_or_default())?;
    let number = Number::from_descr(entry(header, "descr").unwrap_or_default())?;
    let by_columns = match entry(header, "fortran_order").unwrap_or_default() {
        order if order.starts_with("False") => false,
        order if order.starts_with("True") => true,
        order => return Err(refused("fortran_order True or False", order)),
    };
    let numbers = rows.checked_mul(columns);
    if numbers.and_then(|n| n.checked_mul(number.kind.size())) != Some(data.len()) {
        let wanted = format!("{rows} × {columns} numbers of {} bytes", number.kind.size());
        return Err(refused(&wanted, &format!("{} bytes", data.len())));
    }
    if columns == 0 && rows > 0 {
        // Rows without a number take no room in the file: nothing bounds how many it claims.
        return Err(refused("a number or more a row", &format!("{rows} × 0 numbers")));
    }
    bytes.drain(..bytes.len() - data.len());
    Array::new(bytes, number, Layout::Table { rows, columns, by_columns }, None)
}

fn refused(expected: &str, found: &str) -> String {
    let found = one_line(found);
    format!("not a .npy array of waveforms: expected {expected}, found {found}")
}

/// Header and data.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (length, rest) = match *rest {
        [1, _, low, high, ref rest @ ..] => (usize::from(u16::from_le_bytes([low, high])), rest),
        [2 | 3, _, a, b, c, d, ref rest @ ..] => (u32::from_le_bytes([a, b, c, d]) as usize, rest),
        _ => return None,
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((str::from_utf8(header).ok()?, data))
}

/// Rest of the header after a key and its colon.
fn entry<'h>(header: &'h str, key: &str) -> Option<&'h str> {
    let after =
        ["'", "\""].iter().find_map(|quote| header.split_once(&format!("{quote}{key}{quote}")))?.1;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

/// Rows and columns of `(3, 4), …` or `(4,), …`.
fn shape(text: &str) -> Result<(usize, usize), String> {
    let inside =
        text.strip_prefix('(').and_then(|text| text.split_once(')')).map(|(inside, _)| inside);
    let sizes = inside.map(|inside| {
        inside.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::parse).collect()
    });
    match sizes {
        Some(Ok::<Vec<usize>, _>(sizes)) => match sizes[..] {
            [columns] => Ok((1, columns)),
            [rows, columns] => Ok((rows, columns)),
            _ => Err(refused("one or two dimensions", &format!("{}", sizes.len()))),
        },
        _ => Err(refused("a shape", text.split(')').next().unwrap_or_default())),
    }
}

/// Types of numbers by their names in NumPy, the byte order left out.
const TYPES: [(&str, NumberType); 11] = [
    ("b1", NumberType::U8),
    ("u1", NumberType::U8),
    ("u2", NumberType::U16),
    ("u4", NumberType::U32),
    ("u8", NumberType::U64),
    ("i1", NumberType::I8),
    ("i2", NumberType::I16),
    ("i4", NumberType::I32),
    ("i8", NumberType::I64),
    ("f4", NumberType::F32),
    ("f8", NumberType::F64),
];

impl Number {
    /// From `'<f8', …`.
    fn from_descr(text: &str) -> Result<Self, String> {
        let name =
            text.trim_start_matches(['\'', '"']).split(['\'', '"']).next().unwrap_or_default();
        let unknown = || refused("numbers (u1 to u8, i1 to i8, f4, f8, b1)", &format!("'{name}'"));
        let mut letters = name.chars();
        let big_endian = match letters.next() {
            Some('<' | '|') => false,
            Some('=') => cfg!(target_endian = "big"),
            Some('>') => true,
            _ => return Err(unknown()),
        };
        let known = TYPES.iter().find(|(name, _)| *name == letters.as_str());
        known.map(|&(_, kind)| Self { big_endian, kind }).ok_or_else(unknown)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::read::no_number;
    use super::*;

    fn rows(bytes: &[u8]) -> Result<Vec<Vec<f64>>, String> {
        let array = parse(bytes.to_vec())?;
        Ok((0..array.rows()).map(|row| array.row(row).collect()).collect())
    }

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, header.as_bytes(), data].concat()
    }

    #[test]
    fn both_orders_and_both_ends_read_the_same() {
        let c = file(
            "{'descr': '<i2', 'fortran_order': False, 'shape': (2, 3), }  \n",
            &[1, 0, 2, 0, 3, 0, 255, 255, 5, 0, 6, 0],
        );
        let fortran = file(
            "{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }\n",
            &[0, 1, 255, 255, 0, 2, 0, 5, 0, 3, 0, 6],
        );
        let expected = [vec![1., 2., 3.], vec![-1., 5., 6.]];
        assert_eq!(rows(&c).unwrap(), expected);
        assert_eq!(rows(&fortran).unwrap(), expected);
    }

    #[test]
    fn one_dimension_is_one_waveform() {
        let data: Vec<u8> = [1.5f64, -2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(
            rows(&file("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }", &data))
                .unwrap(),
            [[1.5, -2.0]]
        );
        assert_eq!(
            rows(&file("{'shape': (1,), 'descr': \"|u1\", 'fortran_order': False}", &[200]))
                .unwrap(),
            [[200.0]]
        );
    }

    #[test]
    fn a_number_that_is_not_finite_is_named_by_row_and_column() {
        let data: Vec<u8> = [1f32, 2., 3., f32::NAN].iter().flat_map(|v| v.to_le_bytes()).collect();
        let file = file("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2), }", &data);
        assert_eq!(rows(&file), Err(no_number(2, 2, "NaN", "")));
    }

    #[test]
    fn files_that_are_no_array_of_waveforms_are_refused_by_name() {
        let table = [
            (
                file("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }", &[0; 15]),
                "1 × 2 numbers of 8 bytes, found 15 bytes",
            ),
            (
                file("{'descr': '<f8', 'fortran_order': False, 'shape': (), }", &[0; 8]),
                "one or two dimensions, found 0",
            ),
            (
                file("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1, 1), }", &[0; 8]),
                "one or two dimensions, found 3",
            ),
            (
                file("{'descr': '<c8', 'fortran_order': False, 'shape': (1,), }", &[0; 8]),
                "found '<c8'",
            ),
            (
                file("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,), }", &[0; 4]),
                "found '[('",
            ),
            (
                file(
                    "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999, 99999999999), \
                     }",
                    &[0; 4],
                ),
                "numbers of 4 bytes",
            ),
            (
                file("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 0), }", &[]),
                "a number or more a row, found 99999999999 × 0",
            ),
            (file("{'descr': '<f8', 'fortran_order': False, 'shape': (0,), }", &[]), "found 1 × 0"),
            (file("{}", &[]), "a shape"),
            (MAGIC.to_vec(), "a header that ends within the file"),
        ];
        for (bytes, part) in table {
            let problem = rows(&bytes).expect_err(part);
            assert!(problem.contains(part), "{problem}");
        }
    }
}
