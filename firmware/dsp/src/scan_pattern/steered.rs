//! Beams that are steered one by one to cells of a raster.

use core::fmt;

use super::grid::Grid;
use crate::settings::reason::Reason;
use crate::settings::refusal::Refusal;
use crate::settings::{ParameterId, Settings};

/// Scan of a sensor that steers its one beam, as two mirrors or an optical phased array do: each
/// beam points to a cell of a raster, and the aim in the settings says to which.
///
/// A cell is the finest step of the steering, so a dense scan of all cells holds the response of
/// every aim. Beams are numbered `column · rows + row`, each column from its lowest row up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Steered {
    /// All cells: the field that the mount reaches, and its step.
    pub raster: Grid,
    /// Least time from one shot to the next, ns. The shots of a scan are spread over its time.
    pub shot_ns: u32,
    /// Aim. What the settings leave out stays as it is here.
    pub aim: Aim,
}

/// Aim of a steered scan.
///
/// With n columns over a span S, column c points `S/2 · w(u)` to the left of straight ahead, where
/// `u = (2c + 1 − n)/n` and `w(u) = u + f·(u³ − u)`: density is `1/(1 − f)` of the mean in the
/// middle and `1/(1 + 2f)` at the ends. Rows are the same, about the tilt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Aim {
    /// Number of beams along azimuth.
    pub columns: u16,
    /// Number of beams along elevation.
    pub rows: u16,
    /// Full azimuth range of the columns, 0.01°.
    pub azimuth_cdeg: u16,
    /// Full elevation range of the rows, 0.01°.
    pub elevation_cdeg: u16,
    /// Elevation of the middle of the rows, 0.01°.
    pub tilt_cdeg: i16,
    /// Foveation f of the columns, 0.001.
    pub azimuth_fovea_milli: i16,
    /// Foveation f of the rows, 0.001.
    pub elevation_fovea_milli: i16,
    /// Time of a scan, µs.
    pub frame_us: u32,
}

/// Fraction bits of a position within the raster.
const FRACTION: u32 = 22;

impl Steered {
    /// Reference mount: all around and 45° up and down in steps of 0.2°, at most a shot every 5 µs,
    /// and ten times a second 200 × 32 beams over 360° × 40°, 10° down in the middle
    /// (benches/record/aim.md).
    pub const REFERENCE: Self = Self {
        raster: Grid { columns: 1800, rows: 450, azimuth_cdeg: 36_000, elevation_cdeg: 9_000 },
        shot_ns: 5_000,
        aim: Aim {
            columns: 200,
            rows: 32,
            azimuth_cdeg: 36_000,
            elevation_cdeg: 4_000,
            tilt_cdeg: -1_000,
            azimuth_fovea_milli: 0,
            elevation_fovea_milli: 0,
            frame_us: 100_000,
        },
    };

    /// Number of beams of a scan.
    pub fn beams(&self) -> u32 {
        self.by_columns().beams()
    }

    /// Column and row of a beam.
    pub fn column_and_row(&self, beam: u32) -> [u32; 2] {
        self.by_columns().by_columns(beam)
    }

    /// Grid with as many columns and rows.
    fn by_columns(&self) -> Grid {
        Grid { columns: self.aim.columns, rows: self.aim.rows, ..self.raster }
    }

    /// Cell of a beam: column and row of the raster.
    pub fn cell(&self, beam: u32) -> [u32; 2] {
        let [column, row] = self.column_and_row(beam);
        [self.azimuths().cell(column), self.elevations().cell(row)]
    }

    /// Unit vector of a beam. In f32, within 10⁻⁶ of the exact one.
    pub fn direction(&self, beam: u32) -> [f32; 3] {
        self.raster.direction(self.cell(beam))
    }

    /// Unit vector of a beam, by the definition of its cell.
    pub fn exact_direction(&self, beam: u32) -> [f64; 3] {
        self.raster.exact_direction(self.cell(beam))
    }

    fn azimuths(&self) -> Axis {
        let Self { raster, aim, .. } = self;
        Axis {
            beams: aim.columns,
            span_cdeg: aim.azimuth_cdeg,
            middle_cdeg: 0,
            fovea_milli: aim.azimuth_fovea_milli,
            cells: raster.columns,
            full_cdeg: raster.azimuth_cdeg,
        }
    }

    fn elevations(&self) -> Axis {
        let Self { raster, aim, .. } = self;
        Axis {
            beams: aim.rows,
            span_cdeg: aim.elevation_cdeg,
            middle_cdeg: aim.tilt_cdeg,
            fovea_milli: aim.elevation_fovea_milli,
            cells: raster.rows,
            full_cdeg: raster.elevation_cdeg,
        }
    }

    /// The scan with the aim of these settings, each checked against its range.
    ///
    /// # Errors
    ///
    /// [`Refusal`] of an aim beyond the mount, of one that is finer than the raster, and of more
    /// shots than a scan has time for.
    pub fn aimed(&self, settings: &Settings) -> Result<Self, Refusal> {
        let aimed = Self { aim: self.aim.with(settings), ..*self };
        let Aim { azimuth_cdeg, elevation_cdeg, tilt_cdeg, .. } = aimed.aim;
        let refused = |field, value: i32, reason| Err(Refusal { field, value, reason });
        let (azimuths, elevations) = (aimed.azimuths(), aimed.elevations());
        for (id, span_cdeg, most_cdeg) in [
            (ParameterId::AzimuthSpan, azimuth_cdeg, self.raster.azimuth_cdeg),
            (ParameterId::ElevationSpan, elevation_cdeg, self.raster.elevation_cdeg),
        ] {
            if span_cdeg > most_cdeg {
                let reason = Reason::BeyondMount { most_cdeg: most_cdeg.into() };
                return refused(id, span_cdeg.into(), reason);
            }
        }
        let most_cdeg = i32::from(self.raster.elevation_cdeg.saturating_sub(elevation_cdeg)) / 2;
        if i32::from(tilt_cdeg).abs() > most_cdeg {
            let reason = Reason::BeyondMount { most_cdeg };
            return refused(ParameterId::Tilt, tilt_cdeg.into(), reason);
        }
        for (id, axis) in [(ParameterId::Columns, azimuths), (ParameterId::Rows, elevations)] {
            if !axis.rises() {
                let reason = Reason::FinerThanRaster { step_cdeg: axis.step_cdeg() };
                return refused(id, axis.beams.into(), reason);
            }
        }
        let needed_us = aimed.needed_us(settings.shots);
        if needed_us > aimed.aim.frame_us {
            let reason = Reason::FrameTooShort { needed_us };
            return refused(ParameterId::FrameTime, aimed.aim.frame_us as i32, reason);
        }
        Ok(aimed)
    }

    /// Time that the shots of a scan take, µs, rounded up.
    pub fn needed_us(&self, shots: i32) -> u32 {
        let all = u64::from(self.beams()).saturating_mul(shots.max(0) as u64);
        let needed_us = all.saturating_mul(self.shot_ns.into()).div_ceil(1000);
        u32::try_from(needed_us).unwrap_or(u32::MAX)
    }
}

impl Aim {
    /// The aim with what settings say of it. Values beyond 16 bits saturate; ranges forbid them.
    fn with(self, settings: &Settings) -> Self {
        let count = |value: Option<i32>, own: u16| {
            value.map_or(own, |value| u16::try_from(value.max(0)).unwrap_or(u16::MAX))
        };
        let signed = |value: Option<i32>, own: i16| {
            value.map_or(own, |value| i16::try_from(value.max(i16::MIN.into())).unwrap_or(i16::MAX))
        };
        Self {
            columns: count(settings.columns, self.columns),
            rows: count(settings.rows, self.rows),
            azimuth_cdeg: count(settings.azimuth_span_cdeg, self.azimuth_cdeg),
            elevation_cdeg: count(settings.elevation_span_cdeg, self.elevation_cdeg),
            tilt_cdeg: signed(settings.tilt_cdeg, self.tilt_cdeg),
            azimuth_fovea_milli: signed(settings.azimuth_fovea_milli, self.azimuth_fovea_milli),
            elevation_fovea_milli: signed(
                settings.elevation_fovea_milli,
                self.elevation_fovea_milli,
            ),
            frame_us: settings.frame_us.map_or(self.frame_us, |us| us.max(0) as u32),
        }
    }
}

/// Beams along one axis of the raster.
#[derive(Clone, Copy)]
struct Axis {
    beams: u16,
    span_cdeg: u16,
    middle_cdeg: i16,
    fovea_milli: i16,
    cells: u16,
    full_cdeg: u16,
}

impl Axis {
    /// Cell that a beam points to.
    ///
    /// All in Q22, each product and quotient rounded down: within 10⁻⁶ of the span of the exact
    /// position.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "u and w are at most 1, as f is clamped; counts and angles have 16 bits, divisors \
                  are at least 1: all products are below 2⁶⁰"
    )]
    fn cell(&self, beam: u32) -> u32 {
        let beams = i64::from(self.beams.max(1));
        let beam = i64::from(beam).min(beams);
        let u =
            (((2 * beam + 1 - beams) << FRACTION) / beams).clamp(-(1 << FRACTION), 1 << FRACTION);
        let cube = (((u * u) >> FRACTION) * u) >> FRACTION;
        let fovea_milli = i64::from(self.fovea_milli).clamp(-500, 1000); // beyond, w turns back
        let w = u + fovea_milli * (cube - u) / 1000;
        let (cells, full) = (i64::from(self.cells), i64::from(self.full_cdeg.max(1)));
        let middle = (((full + 2 * i64::from(self.middle_cdeg)) * cells) << FRACTION) / (2 * full);
        let half = ((i64::from(self.span_cdeg) * cells) << FRACTION) / (2 * full);
        let position = middle + ((half * w) >> FRACTION);
        (position >> FRACTION).clamp(0, (cells - 1).max(0)) as u32 // 16 bits
    }

    /// True when each beam points to a cell of its own, beyond that of the beam before.
    fn rises(&self) -> bool {
        let cells = |from| (from..u32::from(self.beams)).map(|beam| self.cell(beam));
        cells(0).zip(cells(1)).all(|(before, after)| before < after)
    }

    /// Step of the raster, 0.01°, rounded up.
    fn step_cdeg(&self) -> i32 {
        self.full_cdeg.div_ceil(self.cells.max(1)).into()
    }
}

impl fmt::Display for Steered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.aim.fmt(f)
    }
}

impl fmt::Display for Aim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { columns, rows, .. } = self;
        let [azimuth, elevation] =
            [self.azimuth_cdeg, self.elevation_cdeg].map(|cdeg| f64::from(cdeg) / 100.0);
        write!(f, "{columns} × {rows} over {azimuth}° × {elevation}°")?;
        if self.tilt_cdeg != 0 {
            write!(f, " about {}°", f64::from(self.tilt_cdeg) / 100.0)?;
        }
        let foveas = [self.azimuth_fovea_milli, self.elevation_fovea_milli];
        if foveas != [0; 2] {
            let [a, b] = foveas.map(|milli| f64::from(milli) / 1000.0);
            write!(f, ", foveated {a} and {b}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    /// Settings with this aim.
    fn aim(set: &[(ParameterId, i32)]) -> Settings {
        let mut settings = Settings::default();
        set.iter().for_each(|&(id, value)| settings.set(id, Some(value)));
        settings
    }

    /// Definition of a cell in f64, and the distance of the position to the next cell.
    fn expected(axis: &Axis, beam: u32) -> (f64, f64) {
        let n = f64::from(axis.beams);
        let u = (2.0 * f64::from(beam) + 1.0 - n) / n;
        let f = f64::from(axis.fovea_milli) / 1000.0;
        let w = u + f * (u * u * u - u);
        let degrees = f64::from(axis.middle_cdeg) + 0.5 * f64::from(axis.span_cdeg) * w;
        let position = (degrees / f64::from(axis.full_cdeg) + 0.5) * f64::from(axis.cells);
        (position.floor(), (position - libm::round(position)).abs())
    }

    #[test]
    fn every_beam_points_to_the_cell_of_its_definition() {
        let mut checked = 0;
        for (columns, span, fovea) in
            [(192, 36_000, 0), (300, 6_000, 0), (97, 12_345, 700), (411, 35_999, -400), (1, 100, 0)]
        {
            let settings = aim(&[
                (ParameterId::Columns, columns),
                (ParameterId::AzimuthSpan, span),
                (ParameterId::AzimuthFovea, fovea),
                (ParameterId::Rows, 40),
                (ParameterId::ElevationSpan, 3_210),
                (ParameterId::ElevationFovea, fovea),
                (ParameterId::Tilt, -1_111),
            ]);
            let aimed = Steered::REFERENCE.aimed(&settings).unwrap();
            for (axis, count) in [(aimed.azimuths(), columns), (aimed.elevations(), 40)] {
                for beam in 0..count as u32 {
                    let (cell, margin) = expected(&axis, beam);
                    // Closer to an edge than the arithmetic is exact, either cell is right.
                    if margin > 1e-3 {
                        assert_eq!(f64::from(axis.cell(beam)), cell, "{settings:?} {beam}");
                        checked += 1;
                    }
                }
            }
        }
        assert!(checked > 900, "{checked}");
    }

    #[test]
    fn beams_are_densest_where_the_fovea_is() {
        let gaps = |fovea| {
            let set = [
                (ParameterId::AzimuthFovea, fovea),
                (ParameterId::AzimuthSpan, 20_000),
                (ParameterId::Columns, 192),
            ];
            let aimed = Steered::REFERENCE.aimed(&aim(&set)).unwrap();
            let cells: Vec<u32> = (0..192).map(|column| aimed.azimuths().cell(column)).collect();
            [cells[9] - cells[0], cells[100] - cells[91], cells[191] - cells[182]]
        };
        assert_eq!(gaps(0).map(|gap| gap.abs_diff(47) <= 1), [true; 3]);
        let [left, middle, right] = gaps(600);
        assert!(left > 90 && right > 90 && (17..=20).contains(&middle), "{left} {middle} {right}");
        let [left, middle, right] = gaps(-400);
        assert!(left < 20 && right < 20 && (64..=67).contains(&middle), "{left} {middle} {right}");
    }

    #[test]
    fn what_the_settings_leave_out_is_the_sensor_s_own() {
        let own = Steered::REFERENCE;
        assert_eq!(own.aimed(&Settings::default()), Ok(own));
        let tilted = own.aimed(&aim(&[(ParameterId::Tilt, -1_500)])).unwrap();
        assert_eq!(tilted.aim, Aim { tilt_cdeg: -1_500, ..own.aim });
        // A tilt moves every row by as much: 5° are 25 cells.
        assert_eq!(tilted.cell(0), [own.cell(0)[0], own.cell(0)[1] - 25]);
    }

    #[test]
    fn an_aim_that_the_mount_cannot_have_is_refused_with_its_bound() {
        let fault = |set: &[(ParameterId, i32)]| {
            Steered::REFERENCE.aimed(&aim(set)).unwrap_err().to_string()
        };
        use ParameterId::{AzimuthSpan, Columns, ElevationSpan, FrameTime, Rows, Shots, Tilt};
        let narrow = Steered {
            raster: Grid { azimuth_cdeg: 12_000, columns: 600, ..Steered::REFERENCE.raster },
            ..Steered::REFERENCE
        };
        let said = narrow.aimed(&aim(&[(AzimuthSpan, 12_001)])).unwrap_err().to_string();
        assert_eq!(said, "azimuth_span 120.01 ° is beyond the mount, which reaches 120°");
        for (set, said) in [
            (
                &[(ElevationSpan, 9_001)][..],
                "elevation_span 90.01 ° is beyond the mount, which reaches 90°",
            ),
            (
                &[(ElevationSpan, 7_000), (Tilt, 1_001)],
                "tilt 10.01 ° is beyond the mount, which reaches 10°",
            ),
            (&[(Tilt, -2_501)], "tilt -25.01 ° is beyond the mount, which reaches 25°"),
            (
                &[(Columns, 301), (AzimuthSpan, 6_000)],
                "columns 301 beams are finer than the mount's step of 0.2° \
                 (lower it or the foveation, or widen the span)",
            ),
            (
                &[(Rows, 51), (ElevationSpan, 1_000)],
                "rows 51 beams are finer than the mount's step of 0.2° \
                 (lower it or the foveation, or widen the span)",
            ),
            (
                &[(Shots, 2), (Columns, 384), (FrameTime, 122_879)],
                "frame_time 122.879 ms is shorter than the shots of a scan, 122.88 ms",
            ),
        ] {
            assert_eq!(fault(set), said);
        }
        let last = [
            &[(ElevationSpan, 7_000), (Tilt, 1_000)][..],
            &[(Columns, 300), (AzimuthSpan, 6_000)],
            &[(Shots, 2), (Columns, 384), (FrameTime, 122_880)],
        ];
        assert!(last.iter().all(|set| Steered::REFERENCE.aimed(&aim(set)).is_ok()));
    }
}
