//! PCD: reading by pcd-rs, and the layout for writing.
//!
//! Compressed data are unpacked here. pcd-rs unpacks every column, twice, and a file of 1 MB may
//! unpack to 88 MB.

use std::io::Cursor;

use echoloop_files::attribute::{RANGE_SD, is_attribute};
use echoloop_files::{Column, Coordinates, NumberType, check_lines, one_line, padded};
use pcd_rs::{DataKind, DynReader, DynRecord, Field, FieldDef, PcdMeta, ValueKind};

use super::layout::Layout;
use super::{check_growth, lzf};
use crate::recorded::{Keep, Recorded};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Most bytes that one byte of LZF can unpack to: 264 for 3.
const LZF_GROWTH: u64 = 88;
/// Most bytes of a header.
const MOST_HEADER: usize = 1 << 20;

/// Reads a PCD file; the error says what was expected.
pub(crate) fn parse(bytes: &[u8], keep: Keep) -> Result<Recorded, String> {
    let expected =
        |error: pcd_rs::Error| format!("expected a PCD file: {}", one_line(&error.to_string()));
    let mut cursor = Cursor::new(&bytes[..bytes.len().min(MOST_HEADER)]);
    let meta = PcdMeta::from_reader(&mut cursor).map_err(expected)?;
    let data = &bytes[cursor.position() as usize..];
    check_size(&meta, data)?;
    let fields = fields(&meta, keep)?;
    let mut read = Read::new(&fields, &meta, data.len())?;
    match meta.data {
        DataKind::Ascii => {
            check_lines(data)?;
            for (point, record) in DynReader::from_bytes(bytes).map_err(expected)?.enumerate() {
                read.push_text(&fields, point, &record.map_err(expected)?)?;
            }
        }
        DataKind::Binary => read.push_binary(&fields, record_size(&meta), data),
        DataKind::BinaryCompressed => read.push_packed(&fields, data)?,
    }
    Ok(read.recorded(&meta, keep))
}

/// Refuses a header that promises more points than the data can hold.
fn check_size(meta: &PcdMeta, data: &[u8]) -> Result<(), String> {
    let points = meta.num_points;
    let fields = || meta.field_defs.iter();
    let record = fields().try_fold(0u64, |sum, field| {
        let each = if meta.data == DataKind::Ascii { 2 } else { field.kind.byte_size() as u64 };
        sum.checked_add(field.count.checked_mul(each)?)
    });
    let needed = record.and_then(|record| record.checked_mul(points));
    let found = data.len() as u64;
    let has = match meta.data {
        DataKind::Ascii => found + 1, // the last line may lack its line end
        DataKind::Binary => found,
        DataKind::BinaryCompressed => return check_packed(needed, data),
    };
    if needed.is_none_or(|needed| needed > has) {
        return Err(format!("expected the {points} points of the PCD header, found {found} bytes"));
    }
    Ok(())
}

/// Bytes of a record of binary data, whose size has been checked.
fn record_size(meta: &PcdMeta) -> usize {
    meta.field_defs.iter().map(|def| def.kind.byte_size() * def.count as usize).sum()
}

/// Checks the two sizes before compressed data against the file and the header.
fn check_packed(needed: Option<u64>, data: &[u8]) -> Result<(), String> {
    let word = |at: usize| {
        data.get(at..at + 4).and_then(|w| w.try_into().ok()).map(u32::from_le_bytes).map(u64::from)
    };
    let (Some(packed), Some(unpacked)) = (word(0), word(4)) else {
        return Err("expected the two sizes of compressed PCD data".into());
    };
    if packed > data.len() as u64 - 8 || unpacked > packed * LZF_GROWTH || needed != Some(unpacked)
    {
        let needed = needed.map_or("countless".into(), |n| n.to_string());
        return Err(format!(
            "expected compressed PCD data that unpacks to {needed} bytes, \
             found {packed} that unpack to {unpacked}"
        ));
    }
    Ok(())
}

/// A field whose numbers are kept.
struct Wanted {
    name: String,
    kind: NumberType,
    /// Index in a record of pcd-rs, which leaves padding out.
    place: usize,
    /// Byte offset in a record of the file.
    offset: usize,
    /// Byte offset of its first number in unpacked data, which are stored field by field.
    start: u64,
    to: Destination,
}

/// The destination of the numbers of a field.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Destination {
    /// An axis of the points.
    Axis(usize),
    /// σ_R.
    RangeSd,
    /// The column of that index.
    Column(usize),
}

impl Destination {
    /// Bytes of memory per number.
    fn size(self, kind: NumberType) -> usize {
        match self {
            // As wide as the file has it, beside the point itself.
            Self::Axis(_) if !is_single(kind) => size_of::<f64>() + size_of::<f32>(),
            Self::Axis(_) | Self::RangeSd => size_of::<f32>(),
            Self::Column(_) => kind.size(),
        }
    }
}

/// True when `f32` holds every number of a kind.
fn is_single(kind: NumberType) -> bool {
    kind == NumberType::F32 || kind.size() < size_of::<f32>()
}

/// The fields to keep, in the order of the file.
fn fields(meta: &PcdMeta, keep: Keep) -> Result<Vec<Wanted>, String> {
    let (mut fields, mut columns) = (Vec::<Wanted>::new(), 0);
    let (mut place, mut offset) = (0, 0_u64);
    for def in &meta.field_defs {
        if let Some(to) = destination(def, keep, columns)? {
            columns += usize::from(matches!(to, Destination::Column(_)));
            let start = offset.saturating_mul(meta.num_points);
            let (name, kind) = (def.name.clone(), kind(def.kind));
            fields.push(Wanted { name, kind, place, offset: offset as usize, start, to });
        }
        place += usize::from(!def.is_padding());
        let size = def.count.saturating_mul(def.kind.byte_size() as u64);
        offset = offset.saturating_add(size); // with no points, any count passes check_size
    }
    match AXES.iter().enumerate().find(|(axis, _)| !has(&fields, Destination::Axis(*axis))) {
        Some((_, axis)) => Err(format!("expected a field {axis:?} in the PCD header")),
        None => Ok(fields),
    }
}

fn has(fields: &[Wanted], to: Destination) -> bool {
    fields.iter().any(|field| field.to == to)
}

/// The destination of a field after `columns` columns; None when it is not kept.
fn destination(def: &FieldDef, keep: Keep, columns: usize) -> Result<Option<Destination>, String> {
    let axis = AXES.iter().position(|axis| *axis == def.name);
    if def.count != 1 {
        return match axis.is_some() || is_attribute(&def.name) {
            true => Err(format!(
                "expected one number a point in the PCD field {:?}, found {}",
                def.name, def.count
            )),
            false => Ok(None),
        };
    }
    Ok(match axis {
        Some(axis) => Some(Destination::Axis(axis)),
        None if def.name == RANGE_SD.name => Some(Destination::RangeSd),
        None => (keep == Keep::All && !def.is_padding()).then_some(Destination::Column(columns)),
    })
}

fn kind(kind: ValueKind) -> NumberType {
    match kind {
        ValueKind::I8 => NumberType::I8,
        ValueKind::U8 => NumberType::U8,
        ValueKind::I16 => NumberType::I16,
        ValueKind::U16 => NumberType::U16,
        ValueKind::I32 => NumberType::I32,
        ValueKind::U32 => NumberType::U32,
        ValueKind::I64 => NumberType::I64,
        ValueKind::U64 => NumberType::U64,
        ValueKind::F32 => NumberType::F32,
        ValueKind::F64 => NumberType::F64,
    }
}

/// The numbers read so far.
struct Read {
    points: Coordinates,
    range_sds: Option<Vec<f32>>,
    columns: Vec<Column>,
}

impl Read {
    /// Room for the fields of all points. Their count has been checked against the file.
    fn new(fields: &[Wanted], meta: &PcdMeta, length: usize) -> Result<Self, String> {
        let each: usize = fields.iter().map(|field| field.to.size(field.kind)).sum();
        check_growth(meta.num_points.saturating_mul(each as u64), length as u64)?;
        let count = meta.num_points as usize;
        let is_column = |field: &&Wanted| matches!(field.to, Destination::Column(_));
        let column = |field: &Wanted| Column::new(&field.name, field.kind, count);
        let is_axis = |field: &&Wanted| matches!(field.to, Destination::Axis(_));
        let axes = fields.iter().filter(is_axis).map(|field| field.kind);
        let mut points = Coordinates::new(axes, count);
        points.fill(count);
        Ok(Self {
            points,
            range_sds: has(fields, Destination::RangeSd).then(|| vec![0.0; count]),
            columns: fields.iter().filter(is_column).map(column).collect(),
        })
    }

    /// Stores the number of a field at a point. Columns must get their points in order.
    fn put(&mut self, field: &Wanted, point: usize, bytes: [u8; 8]) {
        let number = || field.kind.value(bytes);
        match field.to {
            Destination::Axis(axis) => self.points.set(point, axis, number()),
            Destination::RangeSd => {
                self.range_sds.iter_mut().for_each(|sds| sds[point] = number() as f32);
            }
            Destination::Column(column) => self.columns[column].push_number(bytes),
        }
    }

    /// Stores the fields of a line of text.
    fn push_text(
        &mut self,
        fields: &[Wanted],
        point: usize,
        record: &DynRecord,
    ) -> Result<(), String> {
        for field in fields {
            let number = record.0.get(field.place).and_then(number);
            let none = || format!("expected a number in the PCD field {:?}", one_line(&field.name));
            let number = number.ok_or_else(none)?;
            self.put(field, point, number);
        }
        Ok(())
    }

    /// Stores binary records, whose count has been checked.
    fn push_binary(&mut self, fields: &[Wanted], record: usize, data: &[u8]) {
        for (point, record) in data.chunks_exact(record).take(self.points.len()).enumerate() {
            for field in fields {
                self.put(field, point, padded(&record[field.offset..][..field.kind.size()]));
            }
        }
    }

    /// Stores compressed data, whose sizes have been checked: one field after the other.
    fn push_packed(&mut self, fields: &[Wanted], data: &[u8]) -> Result<(), String> {
        let word =
            |at: usize| data[at..at + 4].iter().rev().fold(0, |sum, b| sum << 8 | usize::from(*b));
        let mut parts: Vec<Part<'_>> =
            fields.iter().map(|field| Part { field, number: [0; 8] }).collect();
        lzf::unpack(&data[8..8 + word(0)], word(4) as u64, |at, piece| {
            parts.iter_mut().for_each(|part| part.take(at, piece, self));
        })
    }

    fn recorded(self, meta: &PcdMeta, keep: Keep) -> Recorded {
        let many = |def: &&FieldDef| def.count != 1 && !def.is_padding() && keep == Keep::All;
        let left_out = meta.field_defs.iter().filter(many).map(|def| one_line(&def.name)).collect();
        let located = Recorded::of(self.points, self.range_sds);
        Recorded { columns: self.columns, left_out, ..located }
    }
}

/// A field of unpacked data, and the bytes of its number so far.
struct Part<'f> {
    field: &'f Wanted,
    number: [u8; 8],
}

impl Part<'_> {
    /// Stores the numbers of its field in a piece that begins at byte `at`.
    fn take(&mut self, at: u64, piece: &[u8], read: &mut Read) {
        let size = self.field.kind.size();
        let end = self.field.start + (size * read.points.len()) as u64;
        for place in self.field.start.max(at)..end.min(at + piece.len() as u64) {
            let offset = (place - self.field.start) as usize;
            self.number[offset % size] = piece[(place - at) as usize];
            if (offset + 1).is_multiple_of(size) {
                read.put(self.field, offset / size, self.number);
            }
        }
    }
}

/// The little-endian bytes of a field of one number; None for several.
fn number(field: &Field) -> Option<[u8; 8]> {
    fn only<T: Copy, const N: usize>(values: &[T], bytes: fn(T) -> [u8; N]) -> Option<[u8; 8]> {
        match values {
            [value] => Some(padded(&bytes(*value))),
            _ => None,
        }
    }
    match field {
        Field::I8(v) => only(v, i8::to_le_bytes),
        Field::I16(v) => only(v, i16::to_le_bytes),
        Field::I32(v) => only(v, i32::to_le_bytes),
        Field::I64(v) => only(v, i64::to_le_bytes),
        Field::U8(v) => only(v, u8::to_le_bytes),
        Field::U16(v) => only(v, u16::to_le_bytes),
        Field::U32(v) => only(v, u32::to_le_bytes),
        Field::U64(v) => only(v, u64::to_le_bytes),
        Field::F32(v) => only(v, f32::to_le_bytes),
        Field::F64(v) => only(v, f64::to_le_bytes),
    }
}

/// Binary, unorganized, viewpoint at the origin. Normals have the names of PCL.
pub(crate) const LAYOUT: Layout =
    Layout { normals: ["normal_x", "normal_y", "normal_z"], kind: |kind| kind, header };

fn header(columns: &[Column], count: usize) -> String {
    let row = |name: &str, of: &dyn Fn(&Column) -> String| {
        let words: String = columns.iter().map(|column| format!(" {}", of(column))).collect();
        format!("{name}{words}\n")
    };
    [
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n".into(),
        row("FIELDS", &|column| column.name.clone()),
        row("SIZE", &|column| column.kind().size().to_string()),
        row("TYPE", &|column| letter(column.kind()).into()),
        row("COUNT", &|_| "1".into()),
        format!("WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\n"),
        "DATA binary\n".into(),
    ]
    .concat()
}

fn letter(kind: NumberType) -> &'static str {
    match kind {
        NumberType::I8 | NumberType::I16 | NumberType::I32 | NumberType::I64 => "I",
        NumberType::U8 | NumberType::U16 | NumberType::U32 | NumberType::U64 => "U",
        NumberType::F32 | NumberType::F64 => "F",
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Point3;
    use pcd_rs::{DynWriter, Schema, WriterInit};

    use super::*;

    /// Compressed file written by pcd-rs.
    fn written(kinds: [ValueKind; 3], rows: &[[f64; 3]]) -> Vec<u8> {
        let schema = Schema::from_iter([
            ("intensity", ValueKind::U16, 1),
            ("x", kinds[0], 1),
            ("z", kinds[2], 1),
            ("normal", ValueKind::F32, 3),
            ("y", kinds[1], 1),
        ]);
        let init = WriterInit {
            width: rows.len() as u64,
            height: 1,
            viewpoint: Default::default(),
            data_kind: DataKind::BinaryCompressed,
            schema: Some(schema),
            version: None,
        };
        let mut bytes = Vec::new();
        let mut writer: DynWriter<_> = init.build_from_writer(Cursor::new(&mut bytes)).unwrap();
        let field = |kind, v: f64| match kind {
            ValueKind::F64 => Field::F64(vec![v]),
            ValueKind::I16 => Field::I16(vec![v as i16]),
            _ => Field::F32(vec![v as f32]),
        };
        for [x, y, z] in rows {
            let record = DynRecord(vec![
                Field::U16(vec![7]),
                field(kinds[0], *x),
                field(kinds[2], *z),
                Field::F32(vec![0.0, 0.0, 1.0]),
                field(kinds[1], *y),
            ]);
            writer.push(&record).unwrap();
        }
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn data_packed_by_pcd_rs_unpack_to_the_same_points() {
        let rows: Vec<[f64; 3]> = (0..30_000)
            .map(|i| [f64::from(i % 977) * 0.37, f64::from(i / 3), f64::from(i % 5) - 2.5])
            .collect();
        let kinds = [ValueKind::F32, ValueKind::I16, ValueKind::F64];
        let bytes = written(kinds, &rows);
        let ours = parse(&bytes, Keep::All).unwrap();
        let theirs: Vec<DynRecord> =
            DynReader::from_bytes(&bytes).unwrap().map(Result::unwrap).collect();
        assert_eq!(ours.cloud.points.len(), theirs.len());
        for (i, record) in theirs.iter().enumerate() {
            let value = |at: usize| value_of(record, at);
            let expected = [value(1), value(4), value(2)].map(|v| v as f32);
            assert_eq!(ours.cloud.points[i], Point3::from(expected), "point {i}");
        }
        assert_eq!(
            ours.cloud.points[29_999],
            Point3::new((f64::from(29_999 % 977) * 0.37) as f32, 9_999.0, 1.5)
        );
        let [intensity] = &ours.columns[..] else { panic!("{:?}", ours.columns.len()) };
        assert_eq!((intensity.name.as_str(), intensity.kind()), ("intensity", NumberType::U16));
        assert!(intensity.values().all(|v| v == 7.0) && intensity.len() == 30_000);
        assert_eq!(ours.left_out, ["normal"]);
        assert_eq!(parse(&bytes, Keep::Points).unwrap().columns, []);
    }

    /// A number of a record as pcd-rs reads it.
    fn value_of(record: &DynRecord, at: usize) -> f64 {
        match &record.0[at] {
            Field::F32(v) => v[0].into(),
            Field::I16(v) => v[0].into(),
            Field::F64(v) => v[0],
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_file_that_unpacks_to_hundreds_of_times_its_size_is_refused() {
        let points = 20_000_000_u32;
        let (copies, left) = ((3 * points - 1) / 264, (3 * points - 1) % 264);
        let mut packed = vec![0, 7];
        packed.extend([0xe0, 255, 0].repeat(copies as usize));
        packed.extend([0, 7].repeat(left as usize));
        let head = format!(
            "VERSION 0.7\nFIELDS x y z\nSIZE 1 1 1\nTYPE U U U\nCOUNT 1 1 1\nWIDTH {points}\n\
             HEIGHT 1\nPOINTS {points}\nDATA binary_compressed\n"
        );
        let sizes = [packed.len() as u32, 3 * points].map(u32::to_le_bytes).concat();
        let message =
            parse(&[head.as_bytes(), &sizes, &packed].concat(), Keep::Points).unwrap_err();
        assert!(message.contains("at most 6 times its size"), "{message}");
    }
}
