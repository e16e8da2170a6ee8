//! Reading PLY, a batch of elements at a time: elements that nobody asks for take no memory.
//!
//! ply-rs-bw reads header and elements; binary vertices of numbers alone are taken apart here.
//! Checked first, because it does not: the header ends, no name stands twice, the data are long
//! enough for the counts, no line of text is longer than 4 MB.

use std::collections::HashSet;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyDef,
    PropertyType, ScalarType,
};

use crate::attribute::RANGE_SD;
use crate::{Column, Coordinates, NumberType, check_lines, one_line, padded};

/// Most bytes of a header.
const MOST_HEADER: usize = 1 << 20;
/// Elements read at a time.
const BATCH: usize = 1024;

/// The data after a header, read up to where its elements have been taken.
#[derive(Debug)]
pub struct Body<'a> {
    header: &'a Header,
    reader: Reader<&'a [u8]>,
}

/// Reads a header; returns it and a reader at the first byte of the data.
///
/// # Errors
///
/// A message: not a PLY file, a header without an end, or a name that occurs twice.
pub fn header(bytes: &[u8]) -> Result<(Header, Reader<&[u8]>), String> {
    check_names(&bytes[..bytes.len().min(MOST_HEADER)])?;
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(malformed)?;
    Ok((header, reader))
}

impl<'a> Body<'a> {
    /// The data after a header. Counts of the elements are checked against the size of the data, up
    /// to the element named `last`, or all if there is none of that name.
    ///
    /// # Errors
    ///
    /// A message: an element without properties, too few bytes for the elements, or a line longer
    /// than 4 MB.
    pub fn new(
        header: &'a Header,
        reader: Reader<&'a [u8]>,
        last: Option<&str>,
    ) -> Result<Self, String> {
        let data: &[u8] = reader.get_ref();
        let wanted = header.elements.values().position(|element| Some(&*element.name) == last);
        let wanted = header.elements.values().take(wanted.map_or(usize::MAX, |at| at + 1));
        check_counts(wanted, header.encoding, data.len())?;
        if header.encoding == Encoding::Ascii {
            check_lines(data)?;
        }
        Ok(Self { header, reader })
    }

    /// Passes each item of the next element to `take`. Elements come in the order of the header.
    ///
    /// # Errors
    ///
    /// A message about the data, or the error of `take`.
    pub fn read<E: PropertyAccess, F: From<String>>(
        &mut self,
        element: &ElementDef,
        mut take: impl FnMut(E) -> Result<(), F>,
    ) -> Result<(), F> {
        let mut left = element.count;
        while left > 0 {
            let batch = ElementDef { count: left.min(BATCH), ..element.clone() };
            left -= batch.count;
            let read =
                Parser::<E>::new().read_payload_for_element(&mut self.reader, &batch, self.header);
            read.map_err(|error| ended(&error, element))?.into_iter().try_for_each(&mut take)?;
        }
        Ok(())
    }

    /// Skips the next element.
    ///
    /// # Errors
    ///
    /// A message about the data.
    pub fn skip(&mut self, element: &ElementDef) -> Result<(), String> {
        self.read(element, |Skipped| Ok(()))
    }

    /// Reads the vertices, which must be the next element; if `others`, with a column for every
    /// other property that is no list.
    ///
    /// # Errors
    ///
    /// A message about the data.
    pub fn points(
        &mut self,
        element: &ElementDef,
        others: bool,
    ) -> Result<(Points, Vec<Column>), String> {
        let mut points = Points::of(element);
        let mut columns = if others { columns(element) } else { Vec::new() };
        if let Some(row) = Row::of(element, self.header.encoding) {
            row.take(self.rows(element, &row)?, &mut points, &mut columns);
            return Ok((points, columns));
        }
        if !others {
            self.read(element, |vertex: Vertex| {
                points.push(&vertex);
                Ok::<_, String>(())
            })?;
            return Ok((points, columns));
        }
        self.read(element, |WholeVertex { vertex, others }| {
            points.push(&vertex);
            let others = others.iter().filter_map(number);
            columns.iter_mut().zip(others).for_each(|(column, bytes)| column.push_number(bytes));
            Ok::<_, String>(())
        })?;
        Ok((points, columns))
    }

    /// The bytes of the next element, whose rows are all as long.
    fn rows(&mut self, element: &ElementDef, row: &Row) -> Result<&'a [u8], String> {
        let data: &'a [u8] = self.reader.get_ref();
        let size = element.count.checked_mul(row.size);
        let split = size.and_then(|size| data.split_at_checked(size));
        let (rows, rest) = split.ok_or_else(|| too_short(element))?;
        *self.reader.get_mut() = rest;
        Ok(rows)
    }
}

/// A row of a binary element without lists. The parser makes an enum of each number and looks its
/// name up: three times the work.
struct Row {
    axes: [Field; 3],
    range_sd: Option<Field>,
    /// In the order of the header.
    others: Vec<Field>,
    /// Bytes of all fields.
    size: usize,
}

#[derive(Clone, Copy)]
struct Field {
    /// Byte at which it begins in a row.
    at: usize,
    kind: NumberType,
    is_big_endian: bool,
}

impl Row {
    /// None for text, and where rows differ in length.
    fn of(element: &ElementDef, encoding: Encoding) -> Option<Self> {
        let is_big_endian = match encoding {
            Encoding::Ascii => return None,
            Encoding::BinaryBigEndian => true,
            Encoding::BinaryLittleEndian => false,
        };
        let (mut fields, mut size) = (Vec::new(), 0);
        for property in element.properties.values() {
            let kind = scalar(&property.data_type)?;
            fields.push((&*property.name, Field { at: size, kind, is_big_endian }));
            size += kind.size();
        }
        let named = |name: &str| fields.iter().find(|field| field.0 == name).map(|field| field.1);
        let [Some(x), Some(y), Some(z)] = AXES.map(named) else { return None };
        let others = fields.iter().filter(|(name, _)| !is_of_points(name));
        let others = others.map(|(_, field)| *field).collect();
        Some(Self { axes: [x, y, z], range_sd: named(RANGE_SD.name), others, size })
    }

    /// Adds rows to the points, and to the columns of the other properties, if they are wanted.
    fn take(&self, rows: &[u8], points: &mut Points, columns: &mut [Column]) {
        // A batch stays in the cache while its columns are taken.
        for rows in rows.chunks(self.size * BATCH) {
            for row in rows.chunks_exact(self.size) {
                let at = self.axes.map(|axis| axis.value(row));
                let range_sd = self.range_sd.map(|field| field.value(row) as f32);
                points.push(&Vertex { at, range_sd });
            }
            for (column, field) in columns.iter_mut().zip(&self.others) {
                match field.kind.size() {
                    1 => field.copy::<1>(rows, self.size, column),
                    2 => field.copy::<2>(rows, self.size, column),
                    4 => field.copy::<4>(rows, self.size, column),
                    _ => field.copy::<8>(rows, self.size, column),
                }
            }
        }
    }
}

impl Field {
    /// Its little-endian bytes in a row.
    fn bytes<const N: usize>(self, row: &[u8]) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&row[self.at..self.at + N]);
        if self.is_big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn value(self, row: &[u8]) -> f64 {
        let padded = match self.kind.size() {
            1 => padded(&self.bytes::<1>(row)),
            2 => padded(&self.bytes::<2>(row)),
            4 => padded(&self.bytes::<4>(row)),
            _ => self.bytes::<8>(row),
        };
        self.kind.value(padded)
    }

    fn copy<const N: usize>(self, rows: &[u8], row_size: usize, column: &mut Column) {
        rows.chunks_exact(row_size).for_each(|row| column.push_bytes(&self.bytes::<N>(row)));
    }
}

/// The element `vertex` of a header.
///
/// # Errors
///
/// A message, when there is none or it lacks x, y or z.
pub fn vertex(header: &Header) -> Result<&ElementDef, String> {
    let element = header.elements.get("vertex").ok_or("expected an `element vertex`")?;
    let is_scalar = |axis: &&str| {
        let property = element.properties.get(*axis);
        property.is_some_and(|p| scalar(&p.data_type).is_some())
    };
    match AXES.iter().find(|axis| !is_scalar(axis)) {
        Some(axis) => {
            Err(format!("expected numeric vertex properties x, y and z, found no {axis:?}"))
        }
        None => Ok(element),
    }
}

/// An element of which nothing is kept.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Names of the lists among the vertex properties, which are not read.
pub fn lists(vertex: &ElementDef) -> impl Iterator<Item = &str> {
    let properties = vertex.properties.values();
    properties.filter(|p| scalar(&p.data_type).is_none()).map(|p| p.name.as_str())
}

/// The vertices of a file as points of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Coordinates x, y, z of each, as in the file, `[n]`.
    pub at: Coordinates,
    /// The [`RANGE_SD`] of each, m, `[n]`, if the file has it.
    pub range_sds: Option<Vec<f32>>,
}

impl Points {
    /// Room for the vertices. Their count has been checked against the size of the file.
    fn of(element: &ElementDef) -> Self {
        let has_sds = element.properties.contains_key(RANGE_SD.name);
        let range_sds = has_sds.then(|| Vec::with_capacity(element.count));
        let axes = AXES.iter().filter_map(|axis| element.properties.get(*axis));
        let kinds = axes.filter_map(|axis| scalar(&axis.data_type));
        Self { at: Coordinates::new(kinds, element.count), range_sds }
    }

    fn push(&mut self, vertex: &Vertex) {
        self.at.push(vertex.at);
        self.range_sds.iter_mut().for_each(|sds| sds.extend(vertex.range_sd));
    }
}

/// An empty column for each property that is neither in [`Points`] nor a list.
fn columns(element: &ElementDef) -> Vec<Column> {
    let properties = element.properties.values().filter(|p| !is_of_points(&p.name));
    let column = |p: &PropertyDef| Some(Column::new(&p.name, scalar(&p.data_type)?, element.count));
    properties.filter_map(column).collect()
}

fn is_of_points(name: &str) -> bool {
    AXES.contains(&name) || name == RANGE_SD.name
}

/// The type of a property of one number; None for a list.
fn scalar(property: &PropertyType) -> Option<NumberType> {
    let PropertyType::Scalar(scalar) = property else { return None };
    Some(match scalar {
        ScalarType::Char => NumberType::I8,
        ScalarType::UChar => NumberType::U8,
        ScalarType::Short => NumberType::I16,
        ScalarType::UShort => NumberType::U16,
        ScalarType::Int => NumberType::I32,
        ScalarType::UInt => NumberType::U32,
        ScalarType::Float => NumberType::F32,
        ScalarType::Double => NumberType::F64,
    })
}

/// The little-endian bytes of a number; None for a list.
fn number(property: &Property) -> Option<[u8; 8]> {
    Some(match property {
        Property::Char(v) => padded(&v.to_le_bytes()),
        Property::UChar(v) => padded(&v.to_le_bytes()),
        Property::Short(v) => padded(&v.to_le_bytes()),
        Property::UShort(v) => padded(&v.to_le_bytes()),
        Property::Int(v) => padded(&v.to_le_bytes()),
        Property::UInt(v) => padded(&v.to_le_bytes()),
        Property::Float(v) => padded(&v.to_le_bytes()),
        Property::Double(v) => padded(&v.to_le_bytes()),
        _ => return None,
    })
}

/// A number; None for a list.
fn value_of(property: &Property) -> Option<f64> {
    Some(match property {
        Property::Char(v) => (*v).into(),
        Property::UChar(v) => (*v).into(),
        Property::Short(v) => (*v).into(),
        Property::UShort(v) => (*v).into(),
        Property::Int(v) => (*v).into(),
        Property::UInt(v) => (*v).into(),
        Property::Float(v) => (*v).into(),
        Property::Double(v) => *v,
        _ => return None,
    })
}

/// The coordinates and the `range_sd` of a vertex; other properties are ignored.
struct Vertex {
    at: [f64; 3],
    range_sd: Option<f32>,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { at: [0.0; 3], range_sd: None }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let axis = AXES.iter().position(|axis| *axis == name);
        if axis.is_none() && name != RANGE_SD.name {
            return PropertyAccessResult::Ignored;
        }
        let Some(value) = value_of(&value) else {
            return PropertyAccessResult::UnsupportedType;
        };
        match axis {
            Some(axis) => self.at[axis] = value,
            None => self.range_sd = Some(value as f32),
        }
        PropertyAccessResult::Set
    }
}

/// A vertex and its other properties, in the order of the header.
struct WholeVertex {
    vertex: Vertex,
    others: Vec<Property>,
}

impl PropertyAccess for WholeVertex {
    fn new() -> Self {
        Self { vertex: Vertex::new(), others: Vec::new() }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if is_of_points(name) {
            return self.vertex.set_property(name, value);
        }
        self.others.push(value);
        PropertyAccessResult::Set
    }
}

fn malformed(error: ParseError) -> String {
    one_line(&error.to_string())
}

/// The message for an early end of the file names the count of the header: the parser knows only
/// that of its batch.
fn ended(error: &ParseError, element: &ElementDef) -> String {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => too_short(element),
        _ => one_line(&error.to_string()),
    }
}

fn too_short(element: &ElementDef) -> String {
    format!("end of file before the last of {} elements {:?}", element.count, element.name)
}

/// Refuses a name that two elements of the file, or two properties of an element, share. The parser
/// would keep the last one at the place of the first, and shift all numbers between.
fn check_names(start: &[u8]) -> Result<(), String> {
    let (mut elements, mut properties) = (HashSet::new(), HashSet::new());
    for line in start.split(|&byte| byte == b'\n' || byte == b'\r') {
        let words: Vec<&[u8]> =
            line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take(8).collect();
        let (names, name) = match words[..] {
            [b"end_header"] => return Ok(()),
            [b"element", name, ..] => {
                properties.clear();
                (&mut elements, name)
            }
            [b"property", .., name] => (&mut properties, name),
            _ => continue,
        };
        if !names.insert(name) {
            let name = one_line(&String::from_utf8_lossy(name));
            return Err(format!("its header names {name:?} twice"));
        }
    }
    match start.len() {
        MOST_HEADER => Err(format!("no end_header in its first {} MB", MOST_HEADER >> 20)),
        _ => Ok(()), // the parser refuses a header without an end
    }
}

/// Refuses a header that promises more elements than the data can hold.
fn check_counts<'h>(
    elements: impl Iterator<Item = &'h ElementDef>,
    encoding: Encoding,
    length: usize,
) -> Result<(), String> {
    let mut needed = 0_usize;
    for element in elements {
        if element.properties.is_empty() && element.count > 0 {
            let name = one_line(&element.name);
            return Err(format!("expected properties of the element {name:?}"));
        }
        let each = element.properties.values().map(|p| least_size(&p.data_type, encoding));
        needed = needed.saturating_add(element.count.saturating_mul(each.sum()));
    }
    // The last line of an ASCII file may lack its end.
    if needed > length + usize::from(encoding == Encoding::Ascii) {
        return Err(format!(
            "its header promises at least {needed} bytes of data, but {length} follow"
        ));
    }
    Ok(())
}

/// Fewest bytes that a property can take.
fn least_size(kind: &PropertyType, encoding: Encoding) -> usize {
    let (PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) = kind;
    match scalar {
        _ if encoding == Encoding::Ascii => 2, // a digit, and a blank or line end
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn vertices(text: &str) -> Result<Coordinates, String> {
        let (header, reader) = header(text.as_bytes())?;
        let vertex = vertex(&header)?;
        let mut body = Body::new(&header, reader, Some("vertex"))?;
        for element in header.elements.values() {
            if element.name == "vertex" {
                return Ok(body.points(vertex, false)?.0.at);
            }
            body.skip(element)?;
        }
        unreachable!("vertex() found them")
    }

    const XYZ: &str = "property float x\nproperty float y\nproperty float z\nend_header\n";

    #[test]
    fn more_elements_than_a_batch_come_in_their_order() {
        let rows: String = (0..3000).map(|i| format!("{i} 0 {}\n", 2 * i)).collect();
        let other = "7\n".repeat(2000);
        let text = format!(
            "ply\nformat ascii 1.0\nelement other 2000\nproperty int i\nelement vertex 3000\n{XYZ}\
             {other}{rows}"
        );
        let found = vertices(&text).unwrap();
        let Coordinates::Single(found) = found else { panic!("{found:?}") };
        assert_eq!((found.len(), found[2999]), (3000, [2999.0, 0.0, 5998.0]));
        let cut = vertices(text.trim_end().rsplit_once('\n').unwrap().0).unwrap_err();
        assert!(cut.contains("end of file before the last of 3000 elements"), "{cut}");
    }

    #[test]
    fn rows_of_numbers_are_read_in_either_order_of_bytes_as_from_text() {
        let head = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex 3000\nproperty uchar ring\n\
                 property double z\nproperty float x\nproperty short y\nproperty float \
                 range_sd\nproperty uint t\nelement face 1\nproperty uchar of\nend_header\n"
            )
        };
        // More than two batches.
        let row = |i: i16| (i as u8, -2.5e6 * f64::from(i), 1.25f32, -i, 0.5f32, u32::MAX);
        let rows: Vec<(u8, f64, f32, i16, f32, u32)> = (0..3000).map(row).collect();
        let binary = |bytes: fn(&[u8]) -> Vec<u8>| {
            let row = |(ring, z, x, y, sd, t): &(u8, f64, f32, i16, f32, u32)| {
                let fields: [&[u8]; 6] = [
                    &ring.to_le_bytes(),
                    &z.to_le_bytes(),
                    &x.to_le_bytes(),
                    &y.to_le_bytes(),
                    &sd.to_le_bytes(),
                    &t.to_le_bytes(),
                ];
                fields.map(bytes).concat()
            };
            [rows.iter().flat_map(row).collect(), vec![42]].concat()
        };
        let little = [head("binary_little_endian").into_bytes(), binary(<[u8]>::to_vec)].concat();
        let reversed = |field: &[u8]| field.iter().rev().copied().collect();
        let big = [head("binary_big_endian").into_bytes(), binary(reversed)].concat();
        let line = |(ring, z, x, y, sd, t): &_| format!("{ring} {z} {x} {y} {sd} {t}\n");
        let lines: String = rows.iter().map(line).collect();
        let text = [head("ascii"), lines, "42\n".into()].concat().into_bytes();
        let read = |bytes: &[u8]| {
            let (header, reader) = header(bytes).unwrap();
            let mut body = Body::new(&header, reader, None).unwrap();
            let found = body.points(&header.elements["vertex"], true).unwrap();
            let mut after = Vec::new();
            body.read(&header.elements["face"], |WholeVertex { others, .. }| {
                after.extend(others.iter().filter_map(value_of));
                Ok::<_, String>(())
            })
            .unwrap();
            assert_eq!(after, [42.0], "the next element begins where this one ends");
            found
        };
        let (points, columns) = read(&text);
        let Coordinates::Double(at) = &points.at else { panic!("{:?}", points.at) };
        assert_eq!((at.len(), at[2999]), (3000, [1.25, -2999.0, -7.4975e9]));
        for bytes in [&little, &big] {
            assert_eq!(read(bytes), (points.clone(), columns.clone()));
        }
    }

    #[test]
    fn a_name_that_occurs_twice_is_refused() {
        let start = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n";
        for (more, name) in [
            (format!("property uchar x\n{XYZ}"), "\"x\""),
            (format!("property list uchar int x\n{XYZ}"), "\"x\""),
            (format!("property float y\nelement vertex 1\n{XYZ}"), "\"vertex\""),
        ] {
            let message = vertices(&format!("{start}{more}1 1 1 1\n")).unwrap_err();
            assert!(message.contains(name) && message.contains("twice"), "{message}");
        }
        let text = format!(
            "ply\nformat ascii 1.0\nelement a 0\nproperty int x\nelement vertex 1\n{XYZ}1 2 3\n"
        );
        assert_eq!(vertices(&text).unwrap(), Coordinates::Single(vec![[1.0, 2.0, 3.0]]));
    }

    #[test]
    fn a_text_without_bounds_is_refused_in_few_words() {
        let start = "ply\nformat ascii 1.0\nelement vertex 1\n";
        let table = [
            (format!("ply\n{}", "comment a\n".repeat(200_000)), "no end_header"),
            (format!("{start}{XYZ}{} 2 3\n", "1".repeat(5 << 20)), "longer than 4 MB"),
            (format!("ply\nformat ascii 1.0\n{}\n", "x\x1b".repeat(100_000)), "\\u{1b}"),
            (format!("{start}{XYZ}1 {} 3\n", "two\x1b".repeat(100_000)), "\\u{1b}"),
            (
                format!("ply\nformat ascii 1.0\nelement a 5\nelement vertex 1\n{XYZ}1 2 3\n"),
                "\"a\"",
            ),
            (format!("ply\nformat ascii 1.0\nelement vertex {}\n{XYZ}", u64::MAX), "promises"),
        ];
        for (text, part) in table {
            let message = vertices(&text).unwrap_err();
            assert!(message.contains(part) && message.len() < 1500, "{message}");
            assert!(!message.contains('\x1b'), "{message}");
        }
    }
}
