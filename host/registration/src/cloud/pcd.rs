//! PCD files.

use std::io::Cursor;

use nalgebra::Point3;
use pcd_rs::{DataKind, DynReader, DynRecord, Field, PcdMeta};

/// The most an LZF stream can grow: 264 bytes for 3.
const LZF_GROWTH: u64 = 88;

/// The points of a PCD file, or what was expected of it.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let expected = |error| format!("expected a PCD file: {error}");
    let mut cursor = Cursor::new(bytes);
    let meta = PcdMeta::from_reader(&mut cursor).map_err(expected)?;
    check_size(&meta, &bytes[cursor.position() as usize..])?;
    let axes = axes(&meta)?;
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

fn only<T: Copy>(values: &[T]) -> Option<T> {
    match values {
        [value] => Some(*value),
        _ => None,
    }
}
