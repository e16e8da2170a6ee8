//! PCD files. pcd-rs reads them, but for compressed data: it unpacks all columns, twice, of which a
//! file of 1 MB may have 88.

use std::io::Cursor;

use echoloop_files::{check_lines, shown};
use nalgebra::Point3;
use pcd_rs::{DataKind, DynReader, DynRecord, Field, FieldDef, PcdMeta, ValueKind};

use super::lzf;

/// The most an LZF stream can grow: 264 bytes for 3.
const LZF_GROWTH: u64 = 88;
/// Bytes of a header at most.
const MOST_HEADER: usize = 1 << 20;

/// The points of a PCD file, or what was expected of it.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let expected =
        |error: pcd_rs::Error| format!("expected a PCD file: {}", shown(&error.to_string()));
    let mut cursor = Cursor::new(&bytes[..bytes.len().min(MOST_HEADER)]);
    let meta = PcdMeta::from_reader(&mut cursor).map_err(expected)?;
    let data = &bytes[cursor.position() as usize..];
    check_size(&meta, data)?;
    let axes = axes(&meta)?;
    match meta.data {
        DataKind::Ascii => check_lines(data)?,
        DataKind::Binary => {}
        DataKind::BinaryCompressed => return packed_points(&meta, data),
    }
    let reader = DynReader::from_bytes(bytes).map_err(expected)?;
    reader.map(|record| point(&record.map_err(expected)?, axes)).collect()
}

/// A header may ask for any number of points; the file's size says how many there can be.
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
        DataKind::Ascii => found + 1, // the last line may lack its end
        DataKind::Binary => found,
        DataKind::BinaryCompressed => return check_packed(needed, data),
    };
    if needed.is_none_or(|needed| needed > has) {
        return Err(format!("expected the {points} points of the PCD header, found {found} bytes"));
    }
    Ok(())
}

/// The two sizes before compressed data must agree with the file and with the header.
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

/// Places of x, y, z in a record; the reader leaves padding out of it.
fn axes(meta: &PcdMeta) -> Result<[usize; 3], String> {
    let place = |axis: &str| {
        let at = meta
            .field_defs
            .iter()
            .filter(|field| !field.is_padding())
            .position(|field| field.name == axis);
        at.ok_or(format!("expected a field {axis:?} in the PCD header"))
    };
    Ok([place("x")?, place("y")?, place("z")?])
}

fn point(record: &DynRecord, axes: [usize; 3]) -> Result<Point3<f32>, String> {
    let value = |axis: usize| {
        record
            .0
            .get(axes[axis])
            .and_then(number)
            .ok_or("expected one number in each of the PCD fields x, y, z")
    };
    Ok(Point3::new(value(0)?, value(1)?, value(2)?))
}

fn number(field: &Field) -> Option<f32> {
    match field {
        Field::I8(v) => only(v).map(f32::from),
        Field::I16(v) => only(v).map(f32::from),
        Field::I32(v) => only(v).map(|v| v as f32),
        Field::I64(v) => only(v).map(|v| v as f32),
        Field::U8(v) => only(v).map(f32::from),
        Field::U16(v) => only(v).map(f32::from),
        Field::U32(v) => only(v).map(|v| v as f32),
        Field::U64(v) => only(v).map(|v| v as f32),
        Field::F32(v) => only(v),
        Field::F64(v) => only(v).map(|v| v as f32),
    }
}

/// The points of compressed data, whose sizes have been checked: column after column, x, y and z
/// among them.
fn packed_points(meta: &PcdMeta, data: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let count = meta.num_points;
    check_growth(count, data.len() as u64)?;
    let mut columns = Vec::new();
    let mut start = 0;
    for field in &meta.field_defs {
        columns.extend(Column::new(field, start, count)?);
        start += field.count * field.kind.byte_size() as u64 * count;
    }
    let word =
        |at: usize| data[at..at + 4].iter().rev().fold(0, |sum, b| sum << 8 | usize::from(*b));
    let mut points = vec![Point3::origin(); count as usize];
    lzf::unpack(&data[8..8 + word(0)], word(4) as u64, |at, piece| {
        columns.iter_mut().for_each(|column| column.take(at, piece, &mut points));
    })?;
    Ok(points)
}

/// Points take no more than 6 times the file and 48 MB: no cloud that somebody measured is packed
/// so well.
fn check_growth(points: u64, packed: u64) -> Result<(), String> {
    let bytes = points.saturating_mul(size_of::<Point3<f32>>() as u64);
    match bytes > 6 * packed + (48 << 20) {
        true => Err(format!("expected at most 6 times its size in points, found {bytes} bytes")),
        false => Ok(()),
    }
}

/// Where a coordinate lies in unpacked data.
struct Column {
    axis: usize,
    start: u64,
    end: u64,
    kind: ValueKind,
    /// A number of which a part came.
    number: [u8; 8],
}

impl Column {
    /// The column of a field, none when it is no coordinate.
    fn new(field: &FieldDef, start: u64, points: u64) -> Result<Option<Self>, String> {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == field.name) else {
            return Ok(None);
        };
        if field.count != 1 {
            return Err("expected one number in each of the PCD fields x, y, z".into());
        }
        let end = start + field.kind.byte_size() as u64 * points;
        Ok(Some(Self { axis, start, end, kind: field.kind, number: [0; 8] }))
    }

    /// Takes its part of a piece that begins at `at`.
    fn take(&mut self, at: u64, piece: &[u8], points: &mut [Point3<f32>]) {
        let (from, to) = (self.start.max(at), self.end.min(at + piece.len() as u64));
        let size = self.kind.byte_size();
        for place in from..to {
            let offset = (place - self.start) as usize;
            let part = offset % size;
            self.number[part] = piece[(place - at) as usize];
            if part + 1 == size {
                points[offset / size][self.axis] = little_endian(self.kind, self.number);
            }
        }
    }
}

/// A number of the file as metres; bytes beyond its size are another's.
fn little_endian(kind: ValueKind, bytes: [u8; 8]) -> f32 {
    let [a, b, c, d, ..] = bytes;
    match kind {
        ValueKind::I8 => f32::from(a.cast_signed()),
        ValueKind::U8 => f32::from(a),
        ValueKind::I16 => f32::from(i16::from_le_bytes([a, b])),
        ValueKind::U16 => f32::from(u16::from_le_bytes([a, b])),
        ValueKind::I32 => i32::from_le_bytes([a, b, c, d]) as f32,
        ValueKind::U32 => u32::from_le_bytes([a, b, c, d]) as f32,
        ValueKind::F32 => f32::from_le_bytes([a, b, c, d]),
        ValueKind::I64 => i64::from_le_bytes(bytes) as f32,
        ValueKind::U64 => u64::from_le_bytes(bytes) as f32,
        ValueKind::F64 => f64::from_le_bytes(bytes) as f32,
    }
}

fn only<T: Copy>(values: &[T]) -> Option<T> {
    match values {
        [value] => Some(*value),
        _ => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use pcd_rs::{DynWriter, Schema, WriterInit};

    use super::*;

    /// A file of pcd-rs, and its own way to read it.
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
    fn what_pcd_rs_packs_is_unpacked_to_the_same_points() {
        let rows: Vec<[f64; 3]> = (0..30_000)
            .map(|i| [f64::from(i % 977) * 0.37, f64::from(i / 3), f64::from(i % 5) - 2.5])
            .collect();
        let kinds = [ValueKind::F32, ValueKind::I16, ValueKind::F64];
        let bytes = written(kinds, &rows);
        let ours = parse(&bytes).unwrap();
        let theirs = DynReader::from_bytes(&bytes).unwrap();
        let theirs: Vec<Point3<f32>> =
            theirs.map(|record| point(&record.unwrap(), [1, 4, 2]).unwrap()).collect();
        assert_eq!(ours, theirs);
        assert_eq!(
            ours[29_999],
            Point3::new((f64::from(29_999 % 977) * 0.37) as f32, 9_999.0, 1.5)
        );
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
        let said = parse(&[head.as_bytes(), &sizes, &packed].concat()).unwrap_err();
        assert!(said.contains("at most 6 times its size"), "{said}");
    }
}
