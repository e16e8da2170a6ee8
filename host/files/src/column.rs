//! A column: one number of each point, with the bits that the file has.

/// Declares [`NumberType`] from Rust's types.
macro_rules! number_types {
    ($($name:ident $type:ident),+) => {
        /// The type of a number in a file.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum NumberType {
            $(#[doc = concat!("As Rust's `", stringify!($type), "`.")] $name,)+
        }

        impl NumberType {
            /// Bytes of one number.
            #[must_use]
            pub fn size(self) -> usize {
                match self { $(Self::$name => size_of::<$type>(),)+ }
            }

            /// The number in the first bytes of eight, little endian.
            #[must_use]
            pub fn value(self, bytes: [u8; 8]) -> f64 {
                match self {
                    $(Self::$name => {
                        let mut number = [0; size_of::<$type>()];
                        number.copy_from_slice(&bytes[..size_of::<$type>()]);
                        $type::from_le_bytes(number) as f64
                    })+
                }
            }

            /// The little-endian bytes of a number, first of eight; an integer type rounds and
            /// saturates.
            #[must_use]
            pub fn bytes(self, value: f64) -> [u8; 8] {
                let is_float = matches!(self, Self::F32 | Self::F64);
                let value = if is_float { value } else { value.round() };
                match self { $(Self::$name => padded(&(value as $type).to_le_bytes()),)+ }
            }
        }

        #[cfg(test)]
        const TYPES: &[NumberType] = &[$(NumberType::$name),+];
    };
}

number_types! {
    I8 i8, U8 u8, I16 i16, U16 u16, I32 i32, U32 u32, I64 i64, U64 u64, F32 f32, F64 f64
}

/// Up to eight bytes, then zeros.
#[must_use]
pub fn padded(bytes: &[u8]) -> [u8; 8] {
    let mut eight = [0; 8];
    eight[..bytes.len()].copy_from_slice(bytes);
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
        self.parts().map(|part| self.kind.value(padded(part)))
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

    #[test]
    fn every_type_returns_its_numbers_and_rounds_and_saturates_others() {
        for &kind in TYPES {
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
