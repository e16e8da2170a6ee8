//! A column: one number of each point, with the bits that the file has.

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberType {
    /// Signed integer, 1 byte.
    I8,
    /// Unsigned integer, 1 byte.
    U8,
    /// Signed integer, 2 bytes.
    I16,
    /// Unsigned integer, 2 bytes.
    U16,
    /// Signed integer, 4 bytes.
    I32,
    /// Unsigned integer, 4 bytes.
    U32,
    /// Signed integer, 8 bytes.
    I64,
    /// Unsigned integer, 8 bytes.
    U64,
    /// IEEE 754, 4 bytes.
    F32,
    /// IEEE 754, 8 bytes.
    F64,
}

impl NumberType {
    /// Bytes of one number.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number in the first bytes of eight, little endian.
    #[must_use]
    pub fn value(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => a.cast_signed().into(),
            Self::U8 => a.into(),
            Self::I16 => i16::from_le_bytes([a, b]).into(),
            Self::U16 => u16::from_le_bytes([a, b]).into(),
            Self::I32 => i32::from_le_bytes([a, b, c, d]).into(),
            Self::U32 => u32::from_le_bytes([a, b, c, d]).into(),
            Self::I64 => i64::from_le_bytes(bytes) as f64,
            Self::U64 => u64::from_le_bytes(bytes) as f64,
            Self::F32 => f32::from_le_bytes([a, b, c, d]).into(),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }

    /// The little-endian bytes of a number, first of eight; an integer type rounds and saturates.
    #[must_use]
    pub fn bytes(self, value: f64) -> [u8; 8] {
        let whole = value.round();
        match self {
            Self::I8 => eight((whole as i8).to_le_bytes()),
            Self::U8 => eight((whole as u8).to_le_bytes()),
            Self::I16 => eight((whole as i16).to_le_bytes()),
            Self::U16 => eight((whole as u16).to_le_bytes()),
            Self::I32 => eight((whole as i32).to_le_bytes()),
            Self::U32 => eight((whole as u32).to_le_bytes()),
            Self::I64 => (whole as i64).to_le_bytes(),
            Self::U64 => (whole as u64).to_le_bytes(),
            Self::F32 => eight((value as f32).to_le_bytes()),
            Self::F64 => value.to_le_bytes(),
        }
    }
}

/// The bytes of a number, then zeros up to eight.
pub fn eight<const N: usize>(bytes: [u8; N]) -> [u8; 8] {
    let mut eight = [0; 8];
    eight[..N].copy_from_slice(&bytes);
    eight
}

/// One number of each point, under the name that a file has for it. Bits stay as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name in the file.
    pub name: String,
    kind: NumberType,
    /// The numbers one after the other, little endian.
    bytes: Vec<u8>,
}

impl Column {
    /// An empty column with room for `room` numbers.
    #[must_use]
    pub fn new(name: &str, kind: NumberType, room: usize) -> Self {
        Self { name: name.into(), kind, bytes: Vec::with_capacity(room * kind.size()) }
    }

    /// The same numbers by another name.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = name.into();
        self
    }

    /// The type of its numbers.
    #[must_use]
    pub fn kind(&self) -> NumberType {
        self.kind
    }

    /// Count of its numbers.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes.len() / self.kind.size()
    }

    /// True when it has no numbers.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Its numbers. Integers of 8 bytes are rounded to the nearest `f64`.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f64> {
        self.parts().map(|part| {
            let mut bytes = [0; 8];
            bytes[..part.len()].copy_from_slice(part);
            self.kind.value(bytes)
        })
    }

    /// The bytes of each number, little endian.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        self.bytes.chunks_exact(self.kind.size())
    }

    /// Adds a number; an integer type rounds and saturates.
    pub fn push(&mut self, value: f64) {
        self.push_number(self.kind.bytes(value));
    }

    /// Adds the number whose little-endian bytes come first.
    pub fn push_number(&mut self, bytes: [u8; 8]) {
        self.push_bytes(&bytes[..self.kind.size()]);
    }

    /// Adds the little-endian bytes of numbers; a number may come in parts.
    pub fn push_bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Keeps the numbers for which `keep` is true.
    pub fn retain(&mut self, keep: &[bool]) {
        let size = self.kind.size();
        let mut at = 0;
        self.bytes.retain(|_| {
            at += 1;
            keep.get((at - 1) / size).copied().unwrap_or(true)
        });
    }

    /// The same numbers as another type.
    #[must_use]
    pub fn to_kind(&self, kind: NumberType) -> Self {
        let mut column = Self::new(&self.name, kind, self.len());
        self.values().for_each(|value| column.push(value));
        column
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TYPES: [NumberType; 10] = [
        NumberType::I8,
        NumberType::U8,
        NumberType::I16,
        NumberType::U16,
        NumberType::I32,
        NumberType::U32,
        NumberType::I64,
        NumberType::U64,
        NumberType::F32,
        NumberType::F64,
    ];

    #[test]
    fn every_type_returns_its_numbers_and_rounds_and_saturates_others() {
        for kind in TYPES {
            let mut column = Column::new("a", kind, 3);
            [0.0, 7.0, 100.0].into_iter().for_each(|value| column.push(value));
            assert_eq!(column.values().collect::<Vec<_>>(), [0.0, 7.0, 100.0], "{kind:?}");
            assert_eq!((column.len(), column.parts().len()), (3, 3), "{kind:?}");
            column.retain(&[true, false, true]);
            assert_eq!(column.values().collect::<Vec<_>>(), [0.0, 100.0], "{kind:?}");
            assert_eq!(column.to_kind(NumberType::F64).values().collect::<Vec<_>>(), [0.0, 100.0]);
        }
        let nearest = |kind: NumberType, value| kind.value(kind.bytes(value));
        assert_eq!(nearest(NumberType::U8, -3.0), 0.0);
        assert_eq!(nearest(NumberType::U8, 3.6), 4.0);
        assert_eq!(nearest(NumberType::U16, 1e9), 65_535.0);
        assert_eq!(nearest(NumberType::I8, -1e9), -128.0);
        assert_eq!(nearest(NumberType::F32, 0.1), f64::from(0.1_f32));
    }
}
