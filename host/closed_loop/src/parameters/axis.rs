//! One axis of the unit cube.

use echoloop_parameters::{Refused, Scale};

/// A parameter of the search: name, unit, range, default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Section and key of the configuration.
    pub name: &'static str,
    /// Unit; empty for plain numbers.
    pub unit: &'static str,
    /// Spacing of the values.
    pub scale: Scale,
    /// Minimum.
    pub min: f64,
    /// Maximum.
    pub max: f64,
    /// Default.
    pub default: f64,
}

impl Axis {
    /// The value at a coordinate of 0 to 1, in the parameter's unit.
    pub fn from_cube(&self, coordinate: f64) -> f64 {
        let u = coordinate.clamp(0.0, 1.0);
        let Self { min, max, .. } = *self;
        match self.scale {
            Scale::Linear => min + u * (max - min),
            Scale::Log => (min * libm::exp(u * libm::log(max / min))).clamp(min, max),
            Scale::Integer => min + cell(u, max - min + 1.0),
            Scale::PowerOfTwo => min * libm::exp2(cell(u, libm::log2(max / min).round() + 1.0)),
        }
    }

    /// The coordinate of a value; for a whole number, the middle of its share.
    pub fn to_cube(&self, value: f64) -> f64 {
        let Self { min, max, .. } = *self;
        let u = match self.scale {
            Scale::Linear => (value - min) / (max - min),
            Scale::Log => libm::log(value / min) / libm::log(max / min),
            Scale::Integer => (value - min + 0.5) / (max - min + 1.0),
            Scale::PowerOfTwo => (libm::log2(value / min) + 0.5) / (libm::log2(max / min) + 1.0),
        };
        u.clamp(0.0, 1.0)
    }

    /// Number of values, each with an equal share of the axis; `None` where every value is allowed.
    pub fn cells(&self) -> Option<usize> {
        match self.scale {
            Scale::Linear | Scale::Log => None,
            Scale::Integer => Some((self.max - self.min) as usize + 1),
            Scale::PowerOfTwo => Some(libm::log2(self.max / self.min) as usize + 1),
        }
    }

    pub(super) fn require(&self, value: f64) -> Result<(), Refused> {
        if self.cells().is_some() && value.is_finite() && value.fract() != 0.0 {
            return Err(Refused::new(self.name, value, "a whole number"));
        }
        let Self { name: key, min, max, unit, .. } = *self;
        if (min..=max).contains(&value) {
            return Ok(());
        }
        let space = if unit.is_empty() { "" } else { " " };
        let problem = format!(" is outside {min} to {max}{space}{unit}");
        Err(Refused { key, value: value.to_string(), problem })
    }
}

/// Index of the share of a coordinate among `count` equal shares of 0 to 1.
fn cell(u: f64, count: f64) -> f64 {
    (u * count).floor().min(count - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(name: &'static str, scale: Scale, min: f64, max: f64) -> Axis {
        Axis { name, unit: "", scale, min, max, default: min }
    }

    #[test]
    fn values_go_to_the_cube_and_back() {
        let axes = [
            axis("a", Scale::Linear, -10.0, 30.0),
            axis("b", Scale::Log, 1e-4, 0.2),
            axis("c", Scale::Integer, 10.0, 100.0),
            axis("d", Scale::PowerOfTwo, 1.0, 8.0),
        ];
        for axis in axes {
            for u in [0.0, 0.1, 0.37, 0.5, 0.99, 1.0] {
                let value = axis.from_cube(u);
                assert!((axis.min..=axis.max).contains(&value));
                let again = axis.from_cube(axis.to_cube(value));
                assert!((again - value).abs() <= 1e-12 * value.abs().max(1.0), "{} {u}", axis.name);
            }
            assert_eq!(axis.from_cube(0.0), axis.min);
            assert!((axis.from_cube(1.0) - axis.max).abs() < 1e-12);
        }
    }

    #[test]
    fn whole_numbers_have_equal_shares() {
        let axis = axis("c", Scale::Integer, 1.0, 4.0);
        let values: Vec<f64> =
            [0.0, 0.24, 0.26, 0.51, 0.76, 1.0].map(|u| axis.from_cube(u)).to_vec();
        assert_eq!(values, [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]);
    }
}
