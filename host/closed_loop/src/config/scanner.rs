//! `[scanner]`: beams of the sensor.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use echoloop_dsp::{
    Aim, Grid, ParameterId, Rosette, ScanPattern, Settings, Spinning, SpinningModel, Steered,
};
use echoloop_files::one_line;
use echoloop_parameters::{Bounds, Refused, section};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::beams::Beams;
use crate::beams::list::{BeamList, MOST_LISTED};
use echoloop_sensors::pattern::MOST_BEAMS;

section! {
    /// Beams of the sensor.
    ///
    /// A key that does not apply to the pattern is absent, and refused when it is given.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(remote = "Self", expecting = "a table, [scanner]")]
    #[serde(deny_unknown_fields, default = "ScannerConfig::left_out")]
    pub struct ScannerConfig in "scanner" {
        pattern: String, "", Bounds::Words("one of grid, raster, steered, vlp-16, vlp-32c, \
             vls-128, hdl-64e, os1-64, os1-128, livox-mid-40, or a table as FILE.csv"),
            "Where the beams point: `grid`, `raster`, `steered`, a sensor (`vlp-16`, `vlp-32c`, \
             `vls-128`, `hdl-64e`, `os1-64`, `os1-128`, `livox-mid-40`), or a table: FILE.csv.";
        #[serde(skip_serializing_if = "Option::is_none")]
        columns: Option<u16>, "beams", Bounds::between(1.0, MOST_BEAMS[0] as f64),
            "Beams along azimuth: of a grid, a raster, a steered sensor, a turn of a spinning one.";
        #[serde(skip_serializing_if = "Option::is_none")]
        rows: Option<u16>, "beams", Bounds::between(1.0, MOST_BEAMS[1] as f64),
            "Beams along elevation, of a grid, a raster or a steered sensor.";
        #[serde(skip_serializing_if = "Option::is_none")]
        azimuth_deg: Option<f64>, "°", Bounds::between(0.01, 360.0),
            "Full azimuth range of a grid, a raster or a steered sensor, degrees.";
        #[serde(skip_serializing_if = "Option::is_none")]
        elevation_deg: Option<f64>, "°", Bounds::between(0.01, 180.0),
            "Full elevation range of a grid, a raster or a steered sensor, degrees.";
        #[serde(skip_serializing_if = "Option::is_none")]
        beams: Option<u32>, "beams", Bounds::between(1.0, MOST_LISTED as f64),
            "Beams of a scan, of a rosette (`livox-mid-40`).";
        height_m: f64, "m", Bounds::between(0.1, 100.0),
            "Height above the ground, m.";
    }
    beside {
        /// The table, once it is read.
        #[serde(skip)]
        list: Read,
    }
}

impl Default for ScannerConfig {
    fn default() -> Self {
        Self::left_out().completed()
    }
}

/// Serde derives the plain form, in which keys may be left out; the pattern fills them in.
impl<'de> Deserialize<'de> for ScannerConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::deserialize(deserializer).map(Self::completed)
    }
}

impl Serialize for ScannerConfig {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

/// A table, read at its first use, so that the configuration of a run can be shown without it. The
/// hash in the pattern tells tables apart; here all are equal.
#[derive(Clone, Debug, Default)]
struct Read(OnceLock<Result<Arc<BeamList>, String>>);

impl PartialEq for Read {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Kind of pattern that `scanner.pattern` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Grid,
    Raster,
    Steered,
    Spinning(SpinningModel),
    Rosette,
    Table,
}

/// Names of the patterns that are no files.
const NAMED: [(&str, Kind); 10] = [
    ("grid", Kind::Grid),
    ("raster", Kind::Raster),
    ("steered", Kind::Steered),
    ("vlp-16", Kind::Spinning(SpinningModel::Vlp16)),
    ("vlp-32c", Kind::Spinning(SpinningModel::Vlp32c)),
    ("vls-128", Kind::Spinning(SpinningModel::Vls128)),
    ("hdl-64e", Kind::Spinning(SpinningModel::Hdl64e)),
    ("os1-64", Kind::Spinning(SpinningModel::Os1x64)),
    ("os1-128", Kind::Spinning(SpinningModel::Os1x128)),
    ("livox-mid-40", Kind::Rosette),
];

impl Kind {
    fn of(pattern: &str) -> Option<Self> {
        let named = NAMED.iter().find(|(name, _)| *name == pattern).map(|(_, kind)| *kind);
        let is_table = Path::new(pattern).extension().is_some_and(|end| end == "csv");
        named.or(is_table.then_some(Self::Table))
    }

    /// Columns: the paper's grid; a turn at 10 Hz, by the manuals: a round of 55.296 µs (VLP), of
    /// 53.3 µs (VLS), 0.1728° (HDL), 1024 (OS1).
    fn usual_columns(self) -> Option<u16> {
        match self {
            Self::Grid | Self::Raster => Some(192),
            Self::Steered => Some(Steered::REFERENCE.aim.columns),
            Self::Spinning(SpinningModel::Vlp16 | SpinningModel::Vlp32c) => Some(1808),
            Self::Spinning(SpinningModel::Vls128) => Some(1876),
            Self::Spinning(SpinningModel::Hdl64e) => Some(2083),
            Self::Spinning(SpinningModel::Os1x64 | SpinningModel::Os1x128) => Some(1024),
            Self::Rosette | Self::Table => None,
        }
    }
}

impl ScannerConfig {
    /// A pattern with its usual keys.
    pub fn of(pattern: &str) -> Self {
        Self { pattern: pattern.into(), ..Self::left_out() }.completed()
    }

    /// The section with every key left out.
    fn left_out() -> Self {
        Self {
            pattern: "steered".into(),
            columns: None,
            rows: None,
            azimuth_deg: None,
            elevation_deg: None,
            beams: None,
            height_m: 2.0,
            list: Read::default(),
        }
    }

    /// Fills in the keys that the pattern has and that were left out.
    fn completed(self) -> Self {
        let kind = Kind::of(&self.pattern);
        let aim = Steered::REFERENCE.aim;
        let usual = match kind {
            Some(Kind::Grid | Kind::Raster) => Some((64, [180.0; 2])),
            Some(Kind::Steered) => {
                let degrees = [aim.azimuth_cdeg, aim.elevation_cdeg].map(|c| f64::from(c) / 100.0);
                Some((aim.rows, degrees))
            }
            _ => None,
        };
        let (rows, degrees) = usual.unzip();
        let beams = (kind == Some(Kind::Rosette)).then_some(Rosette::MID_40.beams);
        Self {
            columns: self.columns.or(kind.and_then(Kind::usual_columns)),
            rows: self.rows.or(rows),
            azimuth_deg: self.azimuth_deg.or(degrees.map(|[azimuth, _]| azimuth)),
            elevation_deg: self.elevation_deg.or(degrees.map(|[_, elevation]| elevation)),
            beams: self.beams.or(beams),
            ..self
        }
    }

    /// Names of the patterns that are no files.
    pub fn patterns() -> impl Iterator<Item = &'static str> {
        NAMED.iter().map(|(name, _)| *name)
    }

    /// The firmware's form. A pattern that [`super::RunConfig::check`] refuses has no beams.
    pub fn pattern(&self) -> ScanPattern {
        match Kind::of(&self.pattern) {
            Some(Kind::Grid) => ScanPattern::Grid(self.grid()),
            Some(Kind::Raster) => ScanPattern::Raster(self.grid()),
            Some(Kind::Steered) => ScanPattern::Steered(self.steered()),
            Some(Kind::Spinning(model)) => {
                ScanPattern::Spinning(Spinning { model, columns: self.columns.unwrap_or(0) })
            }
            Some(Kind::Rosette) => {
                let beams = self.beams.unwrap_or(0);
                ScanPattern::Rosette(Rosette { beams, ..Rosette::MID_40 })
            }
            Some(Kind::Table) | None => {
                ScanPattern::Table(self.list().map(|list| list.name()).unwrap_or_default())
            }
        }
    }

    /// Its beams.
    pub fn beams(&self) -> Beams {
        match self.list() {
            Some(list) => Beams::of_list(Arc::clone(list)),
            None => Beams::new(self.pattern()),
        }
    }

    /// Its beams, of a section whose values are as they must be.
    pub fn checked_beams(&self) -> Option<Beams> {
        self.check().ok().map(|()| self.beams())
    }

    /// The table, of a pattern that is one.
    pub fn list(&self) -> Option<&Arc<BeamList>> {
        self.read().as_ref().ok()
    }

    fn read(&self) -> &Result<Arc<BeamList>, String> {
        let read = || match Kind::of(&self.pattern) {
            Some(Kind::Table) => BeamList::read(Path::new(&self.pattern)).map(Arc::new),
            _ => Err("it is no table".into()),
        };
        self.list.0.get_or_init(read)
    }

    fn grid(&self) -> Grid {
        let centi = |degrees: Option<f64>| (degrees.unwrap_or(0.0) * 100.0).round() as u16;
        Grid {
            columns: self.columns.unwrap_or(0),
            rows: self.rows.unwrap_or(0),
            azimuth_cdeg: centi(self.azimuth_deg),
            elevation_cdeg: centi(self.elevation_deg),
        }
    }

    /// Reference mount with an own aim of as many beams over as many degrees.
    fn steered(&self) -> Steered {
        let Grid { columns, rows, azimuth_cdeg, elevation_cdeg } = self.grid();
        let own = Steered::REFERENCE;
        // Less of a tilt where the span leaves no room for it.
        let room_cdeg = own.raster.elevation_cdeg.saturating_sub(elevation_cdeg) / 2;
        let tilt_cdeg = own.aim.tilt_cdeg.max(-(room_cdeg as i16)); // 45° at most
        let aim = Aim { columns, rows, azimuth_cdeg, elevation_cdeg, tilt_cdeg, ..own.aim };
        Steered { aim, ..own }
    }

    /// Checks all but the table's times, which depend on the scan's duration.
    pub(super) fn check(&self) -> Result<(), Refused> {
        let Some(kind) = Kind::of(&self.pattern) else { return Err(self.unknown()) };
        self.check_what_applies(kind)?;
        self.check_keys()?;
        match (kind, self.read()) {
            (Kind::Table, Err(reason)) => Err(self.table(reason)),
            (Kind::Steered, _) => self.check_own_aim(),
            _ => Ok(()),
        }
    }

    /// Refuses an own aim that the mount does not have, by the key that gives it.
    fn check_own_aim(&self) -> Result<(), Refused> {
        let own = self.steered();
        let Err(refusal) = own.aimed(&Settings::default()) else { return Ok(()) };
        let (number, value) = match refusal.field {
            ParameterId::Rows => (2, self.rows.map(f64::from)),
            ParameterId::AzimuthSpan => (3, self.azimuth_deg),
            ParameterId::ElevationSpan => (4, self.elevation_deg),
            // Too fine for the mount, or too many for the time of a scan.
            _ => (1, self.columns.map(f64::from)),
        };
        let value = value.unwrap_or_default().to_string();
        Err(Refused { key: Self::KEYS[number].key, value, problem: format!(": {refusal}") })
    }

    fn unknown(&self) -> Refused {
        let key = &Self::KEYS[0];
        key.refused(format_args!("{:?}", one_line(&self.pattern)), key.bounds)
    }

    fn table(&self, reason: &str) -> Refused {
        let (key, value) = (Self::KEYS[0].key, one_line(&self.pattern));
        Refused { key, value, problem: format!(": {reason}") }
    }

    /// Checks that no beam of a table is fired after the end of a scan with a duration.
    pub(super) fn check_times(&self, duration_s: f64) -> Result<(), Refused> {
        let Some(list) = self.list().filter(|_| duration_s > 0.0) else { return Ok(()) };
        let (latest_ns, line) = list.latest;
        match latest_ns as f64 / 1e9 {
            latest if latest > duration_s => Err(self.table(&format!(
                "line {line}: time_s = {latest} must be within motion.duration_s = {duration_s}"
            ))),
            _ => Ok(()),
        }
    }

    /// Refuses keys that the pattern does not have, and a pattern without a key that it needs.
    fn check_what_applies(&self, kind: Kind) -> Result<(), Refused> {
        let grid = matches!(kind, Kind::Grid | Kind::Raster | Kind::Steered);
        let columns = grid || matches!(kind, Kind::Spinning(_));
        let given = [
            (self.columns.map(f64::from), columns),
            (self.rows.map(f64::from), grid),
            (self.azimuth_deg, grid),
            (self.elevation_deg, grid),
            (self.beams.map(f64::from), kind == Kind::Rosette),
        ];
        for (key, (value, applies)) in Self::KEYS[1..].iter().zip(given) {
            match value {
                Some(value) if !applies => {
                    let expected = format!("left out: a pattern {:?} has none", self.pattern);
                    return Err(key.refused(value, expected));
                }
                None if applies => return Err(key.refused("none", key.bounds)),
                _ => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> ScannerConfig {
        toml::from_str(text).unwrap()
    }

    fn fault(text: &str) -> String {
        of(text).check().unwrap_err().to_string()
    }

    #[test]
    fn every_name_is_a_pattern_with_the_beams_of_its_sensor_at_10_hz() {
        let beams = NAMED.map(|(name, _)| {
            let scanner = ScannerConfig::of(name);
            scanner.check().unwrap();
            assert_eq!(of(&toml::to_string(&scanner).unwrap()), scanner);
            (name, scanner.pattern().beams())
        });
        let expected = [
            ("grid", 12_288),
            ("raster", 12_288),
            ("steered", 6_400),
            ("vlp-16", 28_928),
            ("vlp-32c", 57_856),
            ("vls-128", 240_128),
            ("hdl-64e", 133_312),
            ("os1-64", 65_536),
            ("os1-128", 131_072),
            ("livox-mid-40", 10_000),
        ];
        assert_eq!(beams, expected);
    }

    #[test]
    fn the_key_names_every_pattern() {
        let names = NAMED.map(|(name, _)| name).join(", ");
        let expected = format!("one of {names}, or a table as FILE.csv");
        assert_eq!(ScannerConfig::KEYS[0].bounds.to_string(), expected);
        let named = |name| ScannerConfig::KEYS[0].help.contains(&format!("`{name}`"));
        assert!(NAMED.iter().all(|(name, _)| named(name)));
    }

    #[test]
    fn what_a_pattern_has_no_use_for_is_refused_by_name() {
        for (text, said) in [
            ("pattern = \"os1-64\"\nrows = 64", "scanner.rows = 64 must be left out"),
            ("pattern = \"os1-64\"\nazimuth_deg = 90", "scanner.azimuth_deg = 90 must be left out"),
            ("pattern = \"livox-mid-40\"\ncolumns = 9", "scanner.columns = 9 must be left out"),
            (
                "pattern = \"a.csv\"\nelevation_deg = 9",
                "scanner.elevation_deg = 9 must be left out",
            ),
            ("beams = 5", "scanner.beams = 5 must be left out: a pattern \"steered\" has none"),
            ("pattern = \"os1-64\"\ncolumns = 4097", "scanner.columns = 4097 must be 1 to 4096"),
            ("pattern = \"livox-mid-40\"\nbeams = 0", "scanner.beams = 0 must be 1 to 131072"),
            ("pattern = \"raster\"\nrows = 0", "scanner.rows = 0 must be 1 to 1024"),
            ("azimuth_deg = nan", "scanner.azimuth_deg = NaN must be 0.01 to 360"),
            ("pattern = \"os2\"", "scanner.pattern = \"os2\" must be one of grid, raster, steered"),
        ] {
            let fault = fault(text);
            assert!(fault.starts_with(said), "{text}: {fault}");
        }
    }

    #[test]
    fn an_own_aim_that_the_mount_does_not_have_is_refused_by_its_key() {
        for (text, said) in [
            ("elevation_deg = 91", "scanner.elevation_deg = 91: elevation_span 91 ° is beyond"),
            ("rows = 201", "scanner.rows = 201: rows 201 beams are finer than the mount's step"),
            ("columns = 626", "scanner.columns = 626: frame_time 100 ms is shorter than"),
        ] {
            let fault = fault(text);
            assert!(fault.starts_with(said), "{text}: {fault}");
        }
        // Less tilt where the span leaves no room for the usual one.
        let wide = of("elevation_deg = 80");
        wide.check().unwrap();
        assert_eq!(wide.pattern().to_string(), "200 × 32 over 360° × 80° about -5°");
    }

    #[test]
    fn a_table_is_read_once_and_is_refused_with_its_name_and_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.csv");
        let name = path.to_string_lossy().into_owned();
        let said = ScannerConfig::of(&name).check().unwrap_err().to_string();
        assert!(said.contains("mine.csv: cannot be read"), "{said}");
        let header = "azimuth_deg,elevation_deg,time_s,channel\n";
        std::fs::write(&path, header.to_owned() + "1,2,0,0\n3,x,0,0\n").unwrap();
        let said = ScannerConfig::of(&name).check().unwrap_err().to_string();
        assert!(said.ends_with("mine.csv: line 3: elevation_deg = x must be -90 to 90"), "{said}");
        std::fs::write(&path, header.to_owned() + "1,2,0.2,0\n3,4,0,5\n").unwrap();
        let scanner = ScannerConfig::of(&name);
        scanner.check().unwrap();
        std::fs::remove_file(&path).unwrap();
        let ScanPattern::Table(table) = scanner.pattern() else { panic!("a table") };
        assert_eq!((table.beams, table.channels), (2, 6));
        scanner.check_times(0.0).unwrap();
        scanner.check_times(0.2).unwrap();
        let said = scanner.check_times(0.1).unwrap_err().to_string();
        let expected = "line 2: time_s = 0.2 must be within motion.duration_s = 0.1";
        assert!(said.ends_with(expected), "{said}");
    }
}
