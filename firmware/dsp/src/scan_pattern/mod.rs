//! Scan patterns: directions of the beams, and points that echoes come from.
//!
//! A new pattern is a file in this folder, its variant, example and match arms here, its name in
//! `host/closed_loop/src/config/scanner.rs`, and its place in the pages: `firmware/link/WIRE.md`,
//! `docs/data.md`, `docs/configuration.md`. Host and tests ask [`ScanPattern`] for the rest.

mod angle;
pub mod grid;
pub mod lasers;
pub mod rosette;
pub mod spinning;
pub mod steered;
pub mod table;

use core::fmt;

use crate::settings::reason::Reason;
use crate::settings::refusal::Refusal;
use crate::settings::{ParameterId, Settings};
use crate::stages::echo::Echo;
pub use angle::exact_unit;
use grid::Grid;
use rosette::Rosette;
use spinning::{Spinning, SpinningModel};
use steered::Steered;
use table::BeamTable;

/// Directions of the beams of a scan, in the sensor's frame: x ahead, y left, z up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ScanPattern {
    /// Grid, column by column: beam `column · rows + row`.
    Grid(Grid),
    /// Beams of a grid line by line, to and fro, with one laser.
    Raster(Grid),
    /// One turn of a spinning sensor.
    Spinning(Spinning),
    /// Rosette that continues from scan to scan.
    Rosette(Rosette),
    /// List of beams, of which this program has only the hash.
    Table(BeamTable),
    /// Beams that the settings aim.
    Steered(Steered),
}

impl Default for ScanPattern {
    /// The paper's field of view (Sec. 4.1), 192 × 64 beams.
    fn default() -> Self {
        Self::Grid(Grid::default())
    }
}

impl ScanPattern {
    /// One pattern of each kind, in the order of their numbers on the wire: tests go through them.
    pub const EXAMPLES: [Self; 6] = [
        Self::Grid(EXAMPLE_GRID),
        Self::Raster(EXAMPLE_GRID),
        Self::Spinning(Spinning { model: SpinningModel::Os1x128, columns: 65_000 }),
        Self::Rosette(Rosette::MID_40),
        Self::Table(BeamTable { beams: 131_072, channels: 300, hash: u32::MAX }),
        Self::Steered(Steered::REFERENCE),
    ];

    /// Number of beams of a scan.
    pub fn beams(&self) -> u32 {
        match self {
            Self::Grid(grid) | Self::Raster(grid) => grid.beams(),
            Self::Spinning(spinning) => spinning.beams(),
            Self::Rosette(rosette) => rosette.beams,
            Self::Table(table) => table.beams,
            Self::Steered(steered) => steered.beams(),
        }
    }

    /// Number of lasers, each with a receiver of its own: rows of a grid, lasers of a head.
    pub fn channels(&self) -> u16 {
        match self {
            Self::Grid(grid) => grid.rows,
            Self::Raster(_) | Self::Rosette(_) | Self::Steered(_) => 1,
            Self::Spinning(spinning) => spinning.lasers(),
            Self::Table(table) => table.channels,
        }
    }

    /// Unit vector of a beam of a scan: x, y, z. `None` for a table, and for a beam that does not
    /// exist. All scans are alike except those of a rosette.
    pub fn unit(&self, scan: u32, beam: u32) -> Option<[f32; 3]> {
        let unit = match self {
            _ if beam >= self.beams() => return None,
            Self::Grid(grid) => grid.direction(grid.by_columns(beam)),
            Self::Raster(grid) => grid.direction(grid.by_lines(beam)),
            Self::Spinning(spinning) => spinning.direction(beam),
            Self::Rosette(rosette) => rosette.direction(scan, beam),
            Self::Table(_) => return None,
            Self::Steered(steered) => steered.direction(beam),
        };
        Some(unit)
    }

    /// Unit vector of a beam from the pattern's definition, in f64: the reference for
    /// [`ScanPattern::unit`]. `None` where that gives none.
    pub fn exact_unit(&self, scan: u32, beam: u32) -> Option<[f64; 3]> {
        match self {
            _ if beam >= self.beams() => None,
            Self::Grid(grid) => Some(grid.exact_direction(grid.by_columns(beam))),
            Self::Raster(grid) => Some(grid.exact_direction(grid.by_lines(beam))),
            Self::Spinning(spinning) => spinning.exact_direction(beam),
            Self::Rosette(rosette) => Some(rosette.exact_direction(scan, beam)),
            Self::Table(_) => None,
            Self::Steered(steered) => Some(steered.exact_direction(beam)),
        }
    }

    /// True when all scans have the same directions.
    pub fn repeats(&self) -> bool {
        !matches!(self, Self::Rosette(_))
    }

    /// Number of columns and of rows; `None` for a pattern without them.
    pub fn columns_and_rows(&self) -> Option<[u16; 2]> {
        match self {
            Self::Grid(grid) | Self::Raster(grid) => Some([grid.columns, grid.rows]),
            Self::Spinning(spinning) => Some([spinning.columns, spinning.lasers()]),
            Self::Rosette(_) | Self::Table(_) => None,
            Self::Steered(steered) => Some([steered.aim.columns, steered.aim.rows]),
        }
    }

    /// Column and row of a beam, 0 the lowest row. A pattern without them counts as one row.
    pub fn column_and_row(&self, beam: u32) -> [u32; 2] {
        match self {
            Self::Grid(grid) => grid.by_columns(beam),
            Self::Raster(grid) => grid.by_lines(beam),
            Self::Spinning(spinning) => {
                let [column, _] = spinning.column_and_laser(beam);
                [column, spinning.ring(beam)]
            }
            Self::Rosette(_) | Self::Table(_) => [beam, 0],
            Self::Steered(steered) => steered.column_and_row(beam),
        }
    }

    /// Number of the column, or of the line of a raster, whose beams are fired together or soon
    /// after each other.
    pub fn burst(&self, beam: u32) -> u32 {
        let [column, row] = self.column_and_row(beam);
        if matches!(self, Self::Raster(_)) { row } else { column }
    }

    /// Time at which a beam is fired, as a fraction of the scan: numerator and denominator. `None`
    /// where times are even: beam b of n at (b + ½)/n.
    pub fn time(&self, beam: u32) -> Option<[u32; 2]> {
        match self {
            Self::Spinning(spinning) => Some(spinning.time(beam)),
            _ => None,
        }
    }

    /// Duration of a scan at the pattern's own rate, s; 0 for a pattern without one.
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Rosette(rosette) => rosette.duration_s(),
            Self::Steered(steered) => f64::from(steered.aim.frame_us) / 1e6,
            _ => 0.0,
        }
    }

    /// The pattern with the aim of these settings; a pattern that is not steered has none to set.
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the first field that the pattern does not allow.
    pub fn aimed(&self, settings: &Settings) -> Result<Self, Refusal> {
        if let Self::Steered(steered) = self {
            return steered.aimed(settings).map(Self::Steered);
        }
        for field in ParameterId::AIM {
            if let Some(value) = settings.get(field) {
                return Err(Refusal { field, value, reason: Reason::NotSteered });
            }
        }
        Ok(*self)
    }

    /// Cell of the raster that a beam points to, column and row; `None` where none is steered.
    pub fn cell(&self, beam: u32) -> Option<[u32; 2]> {
        match self {
            Self::Steered(steered) => Some(steered.cell(beam)),
            _ => None,
        }
    }

    /// Point that an echo of a beam comes from, m: x, y, z. `None` as for [`ScanPattern::unit`].
    ///
    /// It is within 10⁻⁶ of the range of the exact point: 0.12 mm at 120 m.
    pub fn xyz_m(&self, scan: u32, beam: u32, echo: &Echo) -> Option<[f32; 3]> {
        let range_m = echo.range as f32 / 256e3;
        Some(self.unit(scan, beam)?.map(|part| part * range_m))
    }

    /// [`ScanPattern::unit`] as a vector of nalgebra.
    #[cfg(feature = "nalgebra")]
    pub fn direction(&self, scan: u32, beam: u32) -> Option<nalgebra::Vector3<f32>> {
        self.unit(scan, beam).map(nalgebra::Vector3::from)
    }

    /// [`ScanPattern::xyz_m`] as a point of nalgebra.
    #[cfg(feature = "nalgebra")]
    pub fn point_m(&self, scan: u32, beam: u32, echo: &Echo) -> Option<nalgebra::Point3<f32>> {
        self.xyz_m(scan, beam, echo).map(nalgebra::Point3::from)
    }
}

/// Prints a pattern in a few words.
impl fmt::Display for ScanPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grid(grid) => grid.fmt(f),
            Self::Raster(grid) => write!(f, "{grid}, line by line"),
            Self::Spinning(spinning) => spinning.fmt(f),
            Self::Rosette(rosette) => rosette.fmt(f),
            Self::Table(table) => table.fmt(f),
            Self::Steered(steered) => steered.fmt(f),
        }
    }
}

const EXAMPLE_GRID: Grid =
    Grid { columns: 33, rows: 7, azimuth_cdeg: 36_000, elevation_cdeg: 4_321 };

#[cfg(test)]
mod tests {
    use super::*;

    fn spinning() -> impl Iterator<Item = Spinning> {
        SpinningModel::ALL.into_iter().map(|model| Spinning { model, columns: 1024 })
    }

    fn degrees(radians: f32) -> f32 {
        radians * (180.0 / core::f32::consts::PI)
    }

    fn elevation_deg([_, _, z]: [f32; 3]) -> f32 {
        degrees(libm::asinf(z))
    }

    fn azimuth_deg([x, y, _]: [f32; 3]) -> f32 {
        degrees(libm::atan2f(y, x))
    }

    fn norm(vector: [f32; 3]) -> f32 {
        libm::sqrtf(vector.map(|part| part * part).iter().sum())
    }

    #[test]
    fn each_beam_of_a_spinning_sensor_rises_as_its_table_says() {
        for sensor in spinning() {
            let pattern = ScanPattern::Spinning(sensor);
            for beam in 0..pattern.beams() {
                let laser = (beam % u32::from(sensor.lasers())) as usize;
                let expected = sensor.model.lasers()[laser][0] as f32 * 1e-4;
                let got = elevation_deg(pattern.unit(0, beam).unwrap());
                assert!((got - expected).abs() < 1e-4, "{sensor:?} {beam}: {got}, {expected}");
            }
        }
    }

    #[test]
    fn a_laser_of_a_spinning_sensor_goes_round_once_in_even_steps_clockwise() {
        for sensor in spinning() {
            let lasers = u32::from(sensor.lasers());
            for laser in 0..lasers {
                let at =
                    |column: u32| azimuth_deg(sensor.direction(column % 1024 * lasers + laser));
                for column in 0..1024 {
                    let step = (at(column) - at(column + 1)).rem_euclid(360.0);
                    assert!((step - 360.0 / 1024.0).abs() < 1e-4, "{sensor:?} {laser}: {step}");
                }
            }
        }
    }

    /// Azimuths by hand: a VLP-16 turns clockwise from ahead; an OS1 clockwise from behind, with
    /// its offset clockwise too.
    #[test]
    fn a_turn_begins_at_the_makers_azimuth() {
        let at = |model, column: u32, laser: u32| {
            let sensor = Spinning { model, columns: 1024 };
            azimuth_deg(sensor.direction(column * u32::from(sensor.lasers()) + laser))
        };
        let step = 360.0 / 1024.0;
        let near = |got: f32, expected: f32| {
            assert!((got - expected).abs() < 1e-4, "{got} for {expected}");
        };
        near(at(SpinningModel::Vlp16, 0, 0), -step / 48.0);
        near(at(SpinningModel::Vlp16, 256, 15), -90.0 - 31.0 / 48.0 * step);
        // The manual has laser 0 at 1.4° clockwise: the driver's table says −1.4.
        near(at(SpinningModel::Vlp32c, 0, 0), -step / 48.0 - 1.4);
        near(at(SpinningModel::Os1x64, 0, 0), 180.0 - step / 2.0 - 3.073);
        near(at(SpinningModel::Os1x64, 256, 3), 90.0 - step / 2.0 + 3.384);
    }

    #[test]
    fn lasers_fire_in_their_makers_order_and_within_their_column() {
        let slots = |model: SpinningModel| -> [u32; 3] {
            let last = model.lasers().len() as u32 - 1;
            [model.slot(0), model.slot(last), model.slots()]
        };
        assert_eq!(slots(SpinningModel::Vlp16), [0, 15, 24]); // 2.304 µs of 55.296
        assert_eq!(slots(SpinningModel::Vlp32c), [0, 15, 24]);
        assert_eq!(slots(SpinningModel::Vls128), [0, 16, 20]); // 2.665 µs of 53.3
        assert_eq!(slots(SpinningModel::Os1x128), [0, 0, 1]);
        for sensor in spinning() {
            let time = |beam| {
                let [part, whole] = sensor.time(beam);
                f64::from(part) / f64::from(whole)
            };
            for beam in 0..sensor.beams() {
                let column = f64::from(sensor.column_and_laser(beam)[0]);
                assert!((column / 1024.0..(column + 1.0) / 1024.0).contains(&time(beam)));
            }
        }
    }

    #[test]
    fn a_raster_has_the_beams_of_its_grid_line_by_line_to_and_fro() {
        let grid = Grid { columns: 3, rows: 2, azimuth_cdeg: 9_000, elevation_cdeg: 4_000 };
        let order = [0, 1, 2, 3, 4, 5].map(|beam| grid.by_lines(beam));
        assert_eq!(order, [[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]]);
        let (raster, plain) = (ScanPattern::Raster(grid), ScanPattern::Grid(grid));
        assert_eq!(raster.unit(0, 3), plain.unit(0, 2 * 2 + 1));
        assert_eq!((raster.beams(), raster.channels(), plain.channels()), (6, 1, 2));
    }

    #[test]
    fn a_rosette_stays_within_its_circle_and_passes_its_middle_and_its_edge() {
        let rosette = Rosette::MID_40;
        let off = |scan, beam| degrees(libm::acosf(rosette.direction(scan, beam)[0].min(1.0)));
        let (mut least, mut most) = (90.0_f32, 0.0_f32);
        for (scan, beam) in (0..10).flat_map(|scan| (0..rosette.beams).map(move |b| (scan, b))) {
            let unit = rosette.direction(scan, beam);
            assert!((norm(unit) - 1.0).abs() < 1e-6);
            (least, most) = (least.min(off(scan, beam)), most.max(off(scan, beam)));
        }
        assert!(most <= 19.201 && most > 19.19, "{most}");
        assert!(least < 0.1, "{least}");
    }

    #[test]
    fn a_rosette_turns_as_its_rotors_do_and_goes_on_from_scan_to_scan() {
        let rosette = Rosette::MID_40;
        assert_eq!(rosette.turn(7294, 0, 0), [7294, 12_000_000]);
        assert_eq!(rosette.turn(7294, 1, 0), [7294 * 20_001 % 12_000_000, 12_000_000]);
        assert_eq!(rosette.turn(-4664, 0, 0), [12_000_000 - 4664, 12_000_000]);
        let (mut longer, mut seen) = (rosette, 0);
        longer.beams = 20_000;
        for beam in 0..10_000 {
            assert_eq!(rosette.direction(1, beam), longer.direction(0, 10_000 + beam));
            seen += u32::from(rosette.direction(1, beam) == rosette.direction(0, beam));
        }
        assert_eq!(seen, 0);
        // 30 s later it is where it was.
        assert_eq!(rosette.direction(300, 7), rosette.direction(0, 7));
    }

    #[test]
    fn every_direction_is_its_definition_to_a_millionth() {
        let tables = |pattern: &ScanPattern| !matches!(pattern, ScanPattern::Table(_));
        let others = ScanPattern::EXAMPLES.into_iter().filter(tables);
        for pattern in spinning().map(ScanPattern::Spinning).chain(others) {
            for (scan, beam) in (0..pattern.beams().min(140_000)).map(|beam| (beam % 301, beam)) {
                let exact = pattern.exact_unit(scan, beam).unwrap();
                let own = pattern.unit(scan, beam).unwrap();
                let near = own.iter().zip(exact).all(|(&a, b)| (f64::from(a) - b).abs() < 1e-6);
                assert!(near, "{pattern:?} {beam}: {own:?} for {exact:?}");
            }
        }
    }

    #[test]
    fn a_beam_that_there_is_not_and_a_table_have_no_direction() {
        let table = ScanPattern::Table(BeamTable { beams: 4, channels: 2, hash: 1 });
        assert_eq!((table.unit(0, 0), table.beams(), table.channels()), (None, 4, 2));
        assert_eq!(table.exact_unit(0, 0), None);
        let grid = ScanPattern::default();
        assert_eq!(grid.unit(0, grid.beams()), None);
        assert!(grid.unit(0, grid.beams() - 1).is_some());
    }

    #[test]
    fn a_point_lies_at_the_echo_s_range() {
        let echo = Echo { range: 256_000 * 7, ..Default::default() };
        let point = ScanPattern::default().xyz_m(0, 3, &echo).unwrap();
        assert!((norm(point) - 7.0).abs() < 1e-5);
    }

    #[cfg(feature = "nalgebra")]
    #[test]
    fn vectors_have_the_same_numbers() {
        let (pattern, echo) =
            (ScanPattern::default(), Echo { range: 256_000, ..Default::default() });
        let direction = pattern.direction(0, 5).unwrap();
        assert_eq!(Some(direction.into()), pattern.unit(0, 5));
        assert_eq!(pattern.point_m(0, 5, &echo).unwrap().coords, direction);
        assert_eq!(pattern.direction(0, pattern.beams()), None);
    }
}
