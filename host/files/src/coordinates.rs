//! Coordinates of points, as exact as the file has them and no wider than that needs.

use crate::NumberType;

/// Coordinates x, y, z of points, `[n]`.
#[derive(Clone, Debug, PartialEq)]
pub enum Coordinates {
    /// Numbers that `f32` holds exactly: `f32` itself, and integers of up to 16 bits.
    Single(Vec<[f32; 3]>),
    /// Wider integers, and numbers of text: `f32` may round them.
    Wide(Vec<[f64; 3]>),
    /// `f64`.
    Double(Vec<[f64; 3]>),
}

impl Coordinates {
    /// No coordinates yet, and room for `room` points with axes of these types.
    #[must_use]
    pub fn new(kinds: impl IntoIterator<Item = NumberType>, room: usize) -> Self {
        use NumberType::{F32, F64, I8, I16, U8, U16};
        let rank = |kind| match kind {
            I8 | U8 | I16 | U16 | F32 => 0,
            F64 => 2,
            _ => 1,
        };
        match kinds.into_iter().map(rank).max().unwrap_or(0) {
            0 => Self::Single(Vec::with_capacity(room)),
            1 => Self::Wide(Vec::with_capacity(room)),
            _ => Self::Double(Vec::with_capacity(room)),
        }
    }

    /// Adds a point.
    pub fn push(&mut self, at: [f64; 3]) {
        match self {
            Self::Single(points) => points.push(at.map(|v| v as f32)),
            Self::Wide(points) | Self::Double(points) => points.push(at),
        }
    }

    /// Adds points at the origin, until there are `count`.
    pub fn fill(&mut self, count: usize) {
        match self {
            Self::Single(points) => points.resize(count, [0.0; 3]),
            Self::Wide(points) | Self::Double(points) => points.resize(count, [0.0; 3]),
        }
    }

    /// Sets one coordinate; a point that does not exist is left alone.
    pub fn set(&mut self, point: usize, axis: usize, value: f64) {
        match self {
            Self::Single(points) => {
                points.get_mut(point).iter_mut().for_each(|at| at[axis] = value as f32);
            }
            Self::Wide(points) | Self::Double(points) => {
                points.get_mut(point).iter_mut().for_each(|at| at[axis] = value);
            }
        }
    }

    /// Count of the points.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Single(points) => points.len(),
            Self::Wide(points) | Self::Double(points) => points.len(),
        }
    }

    /// True when there is no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_as_wide_as_the_widest_axis_needs() {
        use NumberType::{F32, F64, I16, I32, U8};
        let one = |kinds: [NumberType; 3]| {
            let mut coordinates = Coordinates::new(kinds, 1);
            coordinates.push([0.0; 3]);
            [0.1, 2.0, 3.0].into_iter().enumerate().for_each(|(i, v)| coordinates.set(0, i, v));
            coordinates
        };
        assert_eq!(one([U8, F32, I16]), Coordinates::Single(vec![[0.1, 2.0, 3.0]]));
        assert_eq!(one([I32, F32, I16]), Coordinates::Wide(vec![[0.1, 2.0, 3.0]]));
        assert_eq!(one([I32, F32, F64]), Coordinates::Double(vec![[0.1, 2.0, 3.0]]));
    }
}
