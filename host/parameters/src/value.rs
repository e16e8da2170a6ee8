//! What a key's value may be: the types of the fields.

use crate::must::Must;

/// How a value is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number.
    Whole,
    /// A number.
    Number,
    /// So many numbers.
    Numbers(usize),
    /// Whole numbers, as many as there are.
    List,
    /// `true` or `false`.
    Flag,
    /// A text, or a name.
    Text,
}

/// The type of a field that is a key. Of a choice by name, whose type reads no other names, nothing
/// need be said.
pub trait Value {
    /// How it is written.
    const KIND: Kind = Kind::Text;

    /// Whether it is as it must be.
    fn is_as(&self, _must: &Must) -> bool {
        true
    }

    /// As a message repeats it.
    fn shown(&self) -> String {
        String::new()
    }
}

macro_rules! numbers {
    ($kind:ident: $($type:ty),*) => {$(
        impl Value for $type {
            const KIND: Kind = Kind::$kind;

            fn is_as(&self, must: &Must) -> bool {
                must.holds(*self as f64)
            }

            fn shown(&self) -> String {
                self.to_string()
            }
        }
    )*};
}

numbers!(Number: f64);
numbers!(Whole: u8, u16, u32, u64, usize);

impl<const N: usize> Value for [f64; N] {
    const KIND: Kind = Kind::Numbers(N);

    fn is_as(&self, must: &Must) -> bool {
        self.iter().all(|&number| must.holds(number))
    }

    fn shown(&self) -> String {
        format!("{self:?}")
    }
}

impl Value for Vec<u64> {
    const KIND: Kind = Kind::List;

    fn is_as(&self, must: &Must) -> bool {
        match must {
            Must::Count(range, _) => range.holds(self.len() as f64),
            _ => self.iter().all(|&number| must.holds(number as f64)),
        }
    }

    fn shown(&self) -> String {
        format!("{self:?}")
    }
}

/// What is left out is as it must be.
impl<T: Value> Value for Option<T> {
    const KIND: Kind = T::KIND;

    fn is_as(&self, must: &Must) -> bool {
        self.as_ref().is_none_or(|value| value.is_as(must))
    }

    fn shown(&self) -> String {
        self.as_ref().map_or_else(|| "none".to_owned(), T::shown)
    }
}

impl Value for bool {
    const KIND: Kind = Kind::Flag;
}

impl Value for String {
    fn shown(&self) -> String {
        format!("{self:?}")
    }
}
