//! Writing a cloud as a header and binary records, one per point: PLY and PCD.

use std::collections::HashSet;

use echoloop_files::attribute::RANGE_SD;
use echoloop_files::{Column, NumberType};
use nalgebra::Vector3;

use crate::Cloud;
use crate::recorded::NORMALS;

/// The choices of a format that is a header and binary records.
pub(crate) struct Layout {
    /// Names of the components of a normal.
    pub(crate) normals: [&'static str; 3],
    /// The type in which it stores numbers of a type.
    pub(crate) kind: fn(NumberType) -> NumberType,
    /// The header for these columns and this count of records.
    pub(crate) header: fn(&[Column], usize) -> String,
}

impl Layout {
    /// A whole file: x, y, z, the normals, σ_R, then the other columns.
    pub(crate) fn bytes(&self, axes: [Column; 3], cloud: &Cloud, others: &[Column]) -> Vec<u8> {
        let columns = self.columns(axes, cloud, others);
        let count = cloud.points.len();
        let mut bytes = (self.header)(&columns, count).into_bytes();
        let record: usize = columns.iter().map(|column| column.kind().size()).sum();
        bytes.reserve_exact(count * record);
        let mut parts: Vec<_> = columns.iter().map(Column::parts).collect();
        for _ in 0..count {
            parts.iter_mut().filter_map(Iterator::next).for_each(|part| bytes.extend(part));
        }
        bytes
    }

    /// All columns, under unique names. A column of another length does not belong to the cloud.
    fn columns(&self, axes: [Column; 3], cloud: &Cloud, others: &[Column]) -> Vec<Column> {
        let count = cloud.points.len();
        let mut columns = Vec::from(axes);
        if let Some(normals) = &cloud.normals {
            let normals = normals.iter().map(|normal| normal.cast());
            columns.extend(vectors(self.normals, normals, NumberType::F32));
        }
        if let Some(sds) = &cloud.range_sd_m {
            columns.push(RANGE_SD.column(sds.iter().map(|sd| f64::from(*sd))));
        }
        columns.extend(others.iter().map(|other| self.renamed(other)));
        columns.retain(|column| column.len() == count);
        make_unique(&mut columns);
        columns
    }

    /// The column with a name and a type of this format. Normals get its own names.
    fn renamed(&self, other: &Column) -> Column {
        let axis = NORMALS.iter().find_map(|names| names.iter().position(|n| *n == other.name));
        let name = axis.map_or_else(|| plain(&other.name), |axis| self.normals[axis].to_owned());
        let kind = (self.kind)(other.kind());
        let column = if kind == other.kind() { other.clone() } else { other.to_kind(kind) };
        column.named(&name)
    }
}

/// The columns `x`, `y` and `z` of points, of a type.
pub(crate) fn axes(
    points: impl ExactSizeIterator<Item = Vector3<f64>> + Clone,
    kind: NumberType,
) -> [Column; 3] {
    vectors(["x", "y", "z"], points, kind)
}

fn vectors(
    names: [&str; 3],
    vectors: impl ExactSizeIterator<Item = Vector3<f64>> + Clone,
    kind: NumberType,
) -> [Column; 3] {
    std::array::from_fn(|axis| {
        let mut column = Column::new(names[axis], kind, vectors.len());
        vectors.clone().for_each(|vector| column.push(vector[axis]));
        column
    })
}

/// A name that is allowed in both headers: one word of letters, digits, `_` and `-`.
fn plain(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let name: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    match name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        true => name,
        false => format!("_{name}"),
    }
}

/// Appends `_` to a name until it is unique. `_` alone is taken: in PCD it means padding.
fn make_unique(columns: &mut [Column]) {
    let mut taken = HashSet::from(["_".to_owned()]);
    for column in columns {
        while !taken.insert(column.name.clone()) {
            column.name.push('_');
        }
    }
}
