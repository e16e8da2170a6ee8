//! Kinds of values, and the types of the fields that hold them.

use crate::bounds::Bounds;

/// Kind of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number.
    Whole,
    /// A number.
    Number,
    /// This many numbers.
    Numbers(usize),
    /// Any number of whole numbers.
    List,
    /// `true` or `false`.
    Flag,
    /// A text, or a name.
    Text,
}

/// Type of a field that is a key. A choice by name, whose type reads no other names, implements
/// nothing.
pub trait Value {
    /// Kind of its values.
    const KIND: Kind = Kind::Text;

    /// True when the value is within bounds.
    fn is_within(&self, _bounds: &Bounds) -> bool {
        true
    }

    /// The value as a message repeats it.
    fn printed(&self) -> String {
        String::new()
    }
}

macro_rules! numbers {
    ($kind:ident: $($type:ty),*) => {$(
        impl Value for $type {
            const KIND: Kind = Kind::$kind;

            fn is_within(&self, bounds: &Bounds) -> bool {
                bounds.allows(*self as f64)
            }

            fn printed(&self) -> String {
                self.to_string()
            }
        }
    )*};
}

numbers!(Number: f64);
numbers!(Whole: u8, u16, u32, u64, usize);

impl<const N: usize> Value for [f64; N] {
    const KIND: Kind = Kind::Numbers(N);

    fn is_within(&self, bounds: &Bounds) -> bool {
        self.iter().all(|&number| bounds.allows(number))
    }

    fn printed(&self) -> String {
        format!("{self:?}")
    }
}

impl Value for Vec<u64> {
    const KIND: Kind = Kind::List;

    fn is_within(&self, bounds: &Bounds) -> bool {
        match bounds {
            Bounds::Count(range, _) => range.contains(self.len() as f64),
            _ => self.iter().all(|&number| bounds.allows(number as f64)),
        }
    }

    fn printed(&self) -> String {
        format!("{self:?}")
    }
}

/// A value that is left out is within any bounds.
impl<T: Value> Value for Option<T> {
    const KIND: Kind = T::KIND;

    fn is_within(&self, bounds: &Bounds) -> bool {
        self.as_ref().is_none_or(|value| value.is_within(bounds))
    }

    fn printed(&self) -> String {
        self.as_ref().map_or_else(|| "none".to_owned(), T::printed)
    }
}

impl Value for bool {
    const KIND: Kind = Kind::Flag;
}

impl Value for String {
    fn printed(&self) -> String {
        format!("{self:?}")
    }
}
