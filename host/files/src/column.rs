//! What a file says of each of its points beside the place, a column a name.

/// How a file has a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Whole, signed, a byte.
    I8,
    /// Whole, a byte.
    U8,
    /// Whole, signed, 2 bytes.
    I16,
    /// Whole, 2 bytes.
    U16,
    /// Whole, signed, 4 bytes.
    I32,
    /// Whole, 4 bytes.
    U32,
    /// Whole, signed, 8 bytes.
    I64,
    /// Whole, 8 bytes.
    U64,
    /// IEEE 754, 4 bytes.
    F32,
    /// IEEE 754, 8 bytes.
    F64,
}

impl Kind {
    /// Bytes of a number.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// A number from its little-endian bytes, the first of eight.
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

    /// A number as its little-endian bytes, the first of eight; of a whole kind the nearest it has.
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

/// A number's bytes, and zeros up to eight.
pub fn eight<const N: usize>(bytes: [u8; N]) -> [u8; 8] {
    let mut eight = [0; 8];
    eight[..N].copy_from_slice(&bytes);
    eight
}

/// A number of each point, as a file has them: whatever it means, its bits stay as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What the file calls it.
    pub name: String,
    kind: Kind,
    /// Little endian, number after number.
    bytes: Vec<u8>,
}

impl Column {
    /// One without numbers yet, and room for so many.
    #[must_use]
    pub fn new(name: &str, kind: Kind, room: usize) -> Self {
        Self { name: name.into(), kind, bytes: Vec::with_capacity(room * kind.size()) }
    }

    /// The same numbers by another name.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = name.into();
        self
    }

    /// How its numbers are kept.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// How many numbers it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes.len() / self.kind.size()
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Its numbers; of 8 whole bytes the nearest.
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

    /// Adds a number; of a whole kind the nearest it has.
    pub fn push(&mut self, value: f64) {
        self.push_number(self.kind.bytes(value));
    }

    /// Adds the number of its kind whose little-endian bytes come first.
    pub fn push_number(&mut self, bytes: [u8; 8]) {
        self.push_bytes(&bytes[..self.kind.size()]);
    }

    /// Adds numbers of its kind, little endian, or a part of one.
    pub fn push_bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Leaves out the numbers that are not to be kept.
    pub fn retain(&mut self, keep: &[bool]) {
        let size = self.kind.size();
        let mut at = 0;
        self.bytes.retain(|_| {
            at += 1;
            keep.get((at - 1) / size).copied().unwrap_or(true)
        });
    }

    /// The same numbers in another kind.
    #[must_use]
    pub fn to_kind(&self, kind: Kind) -> Self {
        let mut column = Self::new(&self.name, kind, self.len());
        self.values().for_each(|value| column.push(value));
        column
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [Kind; 10] = [
        Kind::I8,
        Kind::U8,
        Kind::I16,
        Kind::U16,
        Kind::I32,
        Kind::U32,
        Kind::I64,
        Kind::U64,
        Kind::F32,
        Kind::F64,
    ];

    #[test]
    fn every_kind_gives_its_numbers_back_and_the_nearest_of_what_it_lacks() {
        for kind in KINDS {
            let mut column = Column::new("a", kind, 3);
            [0.0, 7.0, 100.0].into_iter().for_each(|value| column.push(value));
            assert_eq!(column.values().collect::<Vec<_>>(), [0.0, 7.0, 100.0], "{kind:?}");
            assert_eq!((column.len(), column.parts().len()), (3, 3), "{kind:?}");
            column.retain(&[true, false, true]);
            assert_eq!(column.values().collect::<Vec<_>>(), [0.0, 100.0], "{kind:?}");
            assert_eq!(column.to_kind(Kind::F64).values().collect::<Vec<_>>(), [0.0, 100.0]);
        }
        let nearest = |kind: Kind, value| kind.value(kind.bytes(value));
        assert_eq!(nearest(Kind::U8, -3.0), 0.0);
        assert_eq!(nearest(Kind::U8, 3.6), 4.0);
        assert_eq!(nearest(Kind::U16, 1e9), 65_535.0);
        assert_eq!(nearest(Kind::I8, -1e9), -128.0);
        assert_eq!(nearest(Kind::F32, 0.1), f64::from(0.1_f32));
    }
}
