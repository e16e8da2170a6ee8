//! Names, types and units of the columns in our clouds, chosen as the drivers of sensors have them.

use crate::{Column, NumberType};

/// A column of our clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Its name in PLY and PCD.
    pub name: &'static str,
    /// Its type in files that we write. Files of others may have any type.
    pub kind: NumberType,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Its meaning, in one line.
    pub what: &'static str,
}

impl Attribute {
    /// Column of this attribute, from one value per point in its unit.
    #[must_use]
    pub fn column(&self, values: impl ExactSizeIterator<Item = f64>) -> Column {
        let mut column = Column::new(self.name, self.kind, values.len());
        values.for_each(|value| column.push(value));
        column
    }
}

/// Amplitude, named as in PCL's `PointXYZI` and the drivers of Velodyne and Ouster.
pub const INTENSITY: Attribute = Attribute {
    name: "intensity",
    kind: NumberType::F32,
    unit: "full scale = 1",
    what: "amplitude over ambient; a lower bound if saturated",
};

/// Reflectance, named as in Ouster's driver, whose values are counts.
pub const REFLECTIVITY: Attribute = Attribute {
    name: "reflectivity",
    kind: NumberType::F32,
    unit: "white = 1",
    what: "reflectance of a Lambertian surface square to the beam; 63.999 means at least that",
};

/// σ_R, by which registration weighs points.
pub const RANGE_SD: Attribute = Attribute {
    name: "range_sd",
    kind: NumberType::F32,
    unit: "m",
    what: "standard deviation of the range along the beam, σ_R; 0.255996 means at least that",
};

/// Signal-to-noise ratio; no driver has one.
pub const SNR: Attribute = Attribute {
    name: "snr",
    kind: NumberType::F32,
    unit: "",
    what: "height over the noise's σ, both after the filter; 255.996 means at least that",
};

/// Width of the echo, named as in RIEGL's clouds.
pub const PULSE_WIDTH: Attribute = Attribute {
    name: "pulse_width",
    kind: NumberType::F32,
    unit: "ns",
    what: "width of the echo at half height, after the filter",
};

/// The flags byte of the link.
pub const FLAGS: Attribute = Attribute {
    name: "flags",
    kind: NumberType::U8,
    unit: "bits",
    what: "1 saturated, 2 merged, 4 low confidence, 8 walk-corrected, 16 truncated",
};

/// Row of the beam, named as in the drivers of Velodyne, Ouster, Hesai and RoboSense.
pub const RING: Attribute = Attribute {
    name: "ring",
    kind: NumberType::U16,
    unit: "",
    what: "row of the beam, 0 the lowest; of a table its channel",
};

/// Azimuth index, named as in Ouster's scans.
pub const COLUMN: Attribute = Attribute {
    name: "column",
    kind: NumberType::U16,
    unit: "",
    what: "azimuth index of the beam, from 0; of a rosette or a table the index of the point \
           within its ring, from 0; 65,535 means at least that",
};

/// Index of the echo, named as in SICK's driver.
pub const ECHO: Attribute = Attribute {
    name: "echo",
    kind: NumberType::U8,
    unit: "",
    what: "index of the echo among those reported for its beam, 0 the nearest",
};

/// Firing time, named as in Velodyne's driver.
pub const TIME: Attribute = Attribute {
    name: "time",
    kind: NumberType::F32,
    unit: "s",
    what: "time at which the beam was fired, from the beginning of the scan",
};

/// All attributes, in the order of our files.
pub const ATTRIBUTES: [Attribute; 10] =
    [RANGE_SD, INTENSITY, REFLECTIVITY, SNR, PULSE_WIDTH, FLAGS, RING, COLUMN, ECHO, TIME];

/// True for the name of an attribute. A file that has it must have one number of it per point.
#[must_use]
pub fn is_attribute(name: &str) -> bool {
    ATTRIBUTES.iter().any(|attribute| attribute.name == name)
}
