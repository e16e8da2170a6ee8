//! Spinning sensors.

use core::f32::consts::{PI, TAU};
use core::fmt;

use super::angle::{exact_unit, unit};
use super::lasers::{HDL_64E, Laser, OS1_64, OS1_128, VLP_16, VLP_32C, VLS_128};

/// Model of a spinning sensor whose lasers are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SpinningModel {
    /// Velodyne VLP-16.
    Vlp16,
    /// Velodyne VLP-32C.
    Vlp32c,
    /// Velodyne VLS-128.
    Vls128,
    /// Velodyne HDL-64E S3.
    Hdl64e,
    /// Ouster OS1-64.
    Os1x64,
    /// Ouster OS1-128.
    Os1x128,
}

impl SpinningModel {
    /// Every model, in the order of the numbers on the wire.
    pub const ALL: [Self; 6] =
        [Self::Vlp16, Self::Vlp32c, Self::Vls128, Self::Hdl64e, Self::Os1x64, Self::Os1x128];

    /// Lasers of the model, in the maker's order.
    pub fn lasers(self) -> &'static [Laser] {
        match self {
            Self::Vlp16 => &VLP_16,
            Self::Vlp32c => &VLP_32C,
            Self::Vls128 => &VLS_128,
            Self::Hdl64e => &HDL_64E,
            Self::Os1x64 => &OS1_64,
            Self::Os1x128 => &OS1_128,
        }
    }

    /// True when a laser's azimuth against the head's counts clockwise, as Ouster's does;
    /// Velodyne's counts the other way (`cos(rotation − correction)`, `y = −sin(…)` in its driver).
    /// Both heads turn clockwise, seen from above.
    pub fn offsets_are_clockwise(self) -> bool {
        matches!(self, Self::Os1x64 | Self::Os1x128)
    }

    /// True when the turn begins behind: Ouster's encoder counts from the connector, and x points
    /// away from it. Velodyne's turn begins ahead.
    pub fn begins_behind(self) -> bool {
        matches!(self, Self::Os1x64 | Self::Os1x128)
    }

    /// Number of time slots of a column: VLP-16 and VLP-32C have 24 of 2.304 µs, VLS-128 20 of
    /// 2.665 µs (their manuals and drivers). All lasers of an OS1 fire at once; so do the HDL-64E's
    /// here, because its table gives no times.
    pub fn slots(self) -> u32 {
        match self {
            Self::Vlp16 | Self::Vlp32c => 24,
            Self::Vls128 => 20,
            Self::Hdl64e | Self::Os1x64 | Self::Os1x128 => 1,
        }
    }

    /// Slot in which a laser fires. VLP-16 fires one laser after the other, VLP-32C two at a time,
    /// VLS-128 eight at a time with an empty slot after the first 64.
    pub fn slot(self, laser: u32) -> u32 {
        match self {
            Self::Vlp16 => laser,
            Self::Vlp32c => laser >> 1,
            Self::Vls128 => (laser >> 3).saturating_add(laser >> 6),
            Self::Hdl64e | Self::Os1x64 | Self::Os1x128 => 0,
        }
    }
}

/// Scan of a spinning sensor: one turn, divided into columns.
///
/// Its beams are numbered `column · lasers + laser`. A beam is fired at `(column · slots + slot +
/// ½) / (columns · slots)` of the scan, and the head has then turned by as much of 360°, clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Spinning {
    /// Model of the sensor.
    pub model: SpinningModel,
    /// Number of columns a turn.
    pub columns: u16,
}

impl Spinning {
    /// Number of lasers.
    pub fn lasers(&self) -> u16 {
        self.model.lasers().len() as u16 // 128 at most
    }

    /// Number of beams of a scan.
    pub fn beams(&self) -> u32 {
        u32::from(self.columns).saturating_mul(self.lasers().into())
    }

    /// Column and laser of a beam.
    pub fn column_and_laser(&self, beam: u32) -> [u32; 2] {
        let lasers = u32::from(self.lasers());
        [beam.checked_div(lasers).unwrap_or(0), beam.checked_rem(lasers).unwrap_or(0)]
    }

    /// Index of a beam's laser among all by elevation, 0 the lowest.
    pub fn ring(&self, beam: u32) -> u32 {
        let [_, laser] = self.column_and_laser(beam);
        let lasers = self.model.lasers();
        let Some([elevation, _]) = lasers.get(laser as usize) else { return 0 };
        lasers.iter().filter(|[other, _]| other < elevation).count() as u32
    }

    /// Time at which a beam is fired, as a fraction of the scan: numerator and denominator.
    pub fn time(&self, beam: u32) -> [u32; 2] {
        let [column, laser] = self.column_and_laser(beam);
        let slots = self.model.slots();
        let slot = column.saturating_mul(slots).saturating_add(self.model.slot(laser));
        let halves = slot.saturating_mul(2).saturating_add(1);
        [halves, u32::from(self.columns).max(1).saturating_mul(slots).saturating_mul(2)]
    }

    /// Unit vector of a beam. In f32, within 10⁻⁶ of the exact one.
    pub fn direction(&self, beam: u32) -> [f32; 3] {
        let [_, laser] = self.column_and_laser(beam);
        let [elevation, azimuth] = self.model.lasers().get(laser as usize).map_or([0; 2], |l| *l);
        let [part, whole] = self.time(beam);
        // Half a turn at most, one way or the other: f32 is finer there. `whole` is even.
        let half = whole >> 1;
        let (more, less) = match self.model.begins_behind() {
            true => (half, part),
            false if part > half => (whole, part),
            false => (0, part),
        };
        let heading = TAU * (more as f32 - less as f32) / whole as f32;
        let beside = if self.model.offsets_are_clockwise() { -rad(azimuth) } else { rad(azimuth) };
        unit(heading + beside, rad(elevation))
    }

    /// Unit vector of a beam, by its definition. The head turns clockwise seen from above, so
    /// azimuth falls.
    pub fn exact_direction(&self, beam: u32) -> Option<[f64; 3]> {
        let [_, laser] = self.column_and_laser(beam);
        let [elevation, beside] =
            self.model.lasers().get(laser as usize)?.map(|v| f64::from(v) * 1e-4);
        let [part, whole] = self.time(beam).map(f64::from);
        let begin = if self.model.begins_behind() { 180.0 } else { 0.0 };
        let beside = if self.model.offsets_are_clockwise() { -beside } else { beside };
        Some(exact_unit(begin - 360.0 * part / whole + beside, elevation))
    }
}

impl fmt::Display for Spinning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {} of a {:?}", self.columns, self.lasers(), self.model)
    }
}

/// 0.0001° to radians.
fn rad(angle: i32) -> f32 {
    angle as f32 * (PI / 1_800_000.0)
}
