//! What our clouds say of a point beside its place: each name, type and unit once.

use crate::{Column, Kind};

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Its name in PLY and PCD.
    pub name: &'static str,
    /// How a file that we write has it. A file of others may have any number.
    pub kind: Kind,
    /// Its unit; empty for a number that has none.
    pub unit: &'static str,
    /// What it is.
    pub what: &'static str,
}

impl Attribute {
    /// Its column, of numbers in its unit.
    #[must_use]
    pub fn column(&self, values: impl ExactSizeIterator<Item = f64>) -> Column {
        let mut column = Column::new(self.name, self.kind, values.len());
        values.for_each(|value| column.push(value));
        column
    }
}

/// As PCL's `PointXYZI`, and the drivers of Velodyne and Ouster.
pub const INTENSITY: Attribute = Attribute {
    name: "intensity",
    kind: Kind::F32,
    unit: "full scale = 1",
    what: "amplitude over ambient; a lower bound if saturated",
};

/// The name is that of Ouster's driver, which has counts of its own there.
pub const REFLECTIVITY: Attribute = Attribute {
    name: "reflectivity",
    kind: Kind::F32,
    unit: "white = 1",
    what: "of a Lambertian surface square to the beam; 63.999 means at least that",
};

/// σ_R, what registration weighs by.
pub const RANGE_SD: Attribute = Attribute {
    name: "range_sd",
    kind: Kind::F32,
    unit: "m",
    what: "standard deviation of the range along the beam, σ_R; 0.255996 means at least that",
};

/// No driver has one.
pub const SNR: Attribute = Attribute {
    name: "snr",
    kind: Kind::F32,
    unit: "",
    what: "height over the noise's σ, both after the filter; 255.996 means at least that",
};

/// As in RIEGL's clouds.
pub const PULSE_WIDTH: Attribute = Attribute {
    name: "pulse_width",
    kind: Kind::F32,
    unit: "ns",
    what: "of the echo, at half height after the filter",
};

/// The link's byte.
pub const FLAGS: Attribute = Attribute {
    name: "flags",
    kind: Kind::U8,
    unit: "bits",
    what: "1 saturated, 2 merged, 4 low confidence, 8 walk-corrected, 16 truncated",
};

/// As the drivers of Velodyne, Ouster, Hesai and RoboSense.
pub const RING: Attribute = Attribute {
    name: "ring",
    kind: Kind::U16,
    unit: "",
    what: "row of the beam, 0 the lowest; of a table its channel",
};

/// As in an Ouster's scan.
pub const COLUMN: Attribute = Attribute {
    name: "column",
    kind: Kind::U16,
    unit: "",
    what: "azimuth index of the beam, 0 the first; of a rosette or a table the how manieth of its \
           ring; 65,535 means at least that",
};

/// As of SICK's driver.
pub const ECHO: Attribute = Attribute {
    name: "echo",
    kind: Kind::U8,
    unit: "",
    what: "number of the echo among those reported of its beam, 0 the nearest",
};

/// As of Velodyne's driver.
pub const TIME: Attribute = Attribute {
    name: "time",
    kind: Kind::F32,
    unit: "s",
    what: "when the beam was fired, from the beginning of the scan",
};

/// All, in the order of our files.
pub const ATTRIBUTES: [Attribute; 10] =
    [RANGE_SD, INTENSITY, REFLECTIVITY, SNR, PULSE_WIDTH, FLAGS, RING, COLUMN, ECHO, TIME];

/// Whether a name is one of ours: a file that has it must have one number of it a point.
#[must_use]
pub fn is_attribute(name: &str) -> bool {
    ATTRIBUTES.iter().any(|attribute| attribute.name == name)
}
