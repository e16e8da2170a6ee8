//! Reader of configurations, with exact error messages.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use echoloop_dsp::{ParameterId, Settings};
use echoloop_files::{MAX_LINE, MOST_TEXT, one_line, one_line_of, printable, read_text};
use echoloop_parameters::{Kind, Parameter, Refused};
use echoloop_registration::FgrMode;
use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use super::keys::{key, keys};
use super::{Budget, DataConfig, RegistrationConfig, RunConfig, TuneConfig};
use crate::config::preset::Strategy;
use crate::dataset::source::Source;
use crate::parameters::filled_columns;
use crate::run_folder::files::{FileError, file_error};

/// Error of a configuration.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is no configuration, or no candidate. The message has the place.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Problem and place.
        message: String,
    },
    /// A `--set` at fault.
    #[error("in {text}: {message}")]
    Override {
        /// Text as given.
        text: String,
        /// Problem.
        message: String,
    },
    /// A value is out of bounds.
    #[error(transparent)]
    Value(#[from] Refused),
}

/// One `a.b=v` of the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    text: String,
    keys: Vec<String>,
    value: toml::Value,
}

/// Most names in a path. The configuration is two deep; each name costs a recursive call.
const MOST_KEYS: usize = 8;

impl FromStr for Override {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (path, value) = text.split_once('=').ok_or("expected a.b=value")?;
        let keys: Vec<String> = path.trim().split('.').map(str::to_owned).collect();
        if keys.iter().any(String::is_empty) {
            return Err("expected a.b=value, with a name before and after each dot".into());
        }
        if keys.len() > MOST_KEYS {
            return Err(format!("expected a.b=value, found {} names before =", keys.len()));
        }
        let text = format!("--set {}", one_line(text));
        Ok(Self { text, keys, value: parse_value(value.trim()) })
    }
}

impl Override {
    /// Override made by a flag.
    pub fn flag(path: &str, value: impl Into<toml::Value>) -> Self {
        let value = value.into();
        Self {
            text: format!("--set {}", one_line(&format!("{path}={value}"))),
            keys: path.split('.').map(str::to_owned).collect(),
            value,
        }
    }

    /// The same override, called as the user wrote it.
    #[must_use]
    pub fn written(self, text: &str) -> Self {
        Self { text: one_line(text), ..self }
    }

    /// Text that it gives the key of that path.
    pub fn text_of(&self, path: &str) -> Option<&str> {
        let is_it = self.keys.iter().map(String::as_str).eq(path.split('.'));
        self.value.as_str().filter(|_| is_it)
    }

    /// Path that it sets.
    pub fn path(&self) -> String {
        self.keys.join(".")
    }

    /// Key that it sets in a section.
    pub fn key(&self, section: &str) -> Option<&str> {
        match self.keys.as_slice() {
            [first, key] if first == section => Some(key),
            _ => None,
        }
    }

    /// Values that its key expects, if these are numbers.
    fn wanted(&self) -> Option<String> {
        let key = key(&self.keys.join(".")).filter(|key| takes_numbers(key))?;
        Some(format!("expected {}", key.expected_of_text()))
    }

    fn insert(&self, table: &mut toml::Table) -> Result<(), String> {
        let Some((last, parents)) = self.keys.split_last() else { return Ok(()) };
        let mut table = table;
        for key in parents {
            let entry =
                table.entry(key.clone()).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            let no_table = || format!("`{}` is a value, not a section", one_line(key));
            table = entry.as_table_mut().ok_or_else(no_table)?;
        }
        table.insert(last.clone(), self.value.clone());
        Ok(())
    }
}

/// A TOML value where it is one, else a string: `--set scene.source=structured` needs no quotes.
fn parse_value(text: &str) -> toml::Value {
    toml::from_str::<toml::Table>(&format!("v = {text}"))
        .ok()
        .and_then(|mut table| table.remove("v"))
        .unwrap_or_else(|| toml::Value::String(text.to_owned()))
}

/// Reads a file, if given, and lays the overrides over it, one by one.
///
/// # Errors
///
/// [`LoadError`] names file, line and key, or the override at fault.
pub fn load(path: Option<&Path>, overrides: &[Override]) -> Result<RunConfig, LoadError> {
    let table = match path {
        Some(path) => read(path)?,
        None => toml::Table::new(),
    };
    laid_over(table, overrides)
}

/// A configuration with overrides laid over it, one by one.
///
/// # Errors
///
/// [`LoadError`] names the override at fault.
pub fn changed(config: &RunConfig, overrides: &[Override]) -> Result<RunConfig, LoadError> {
    let table = toml::Table::try_from(config)
        .map_err(|error| LoadError::Override { text: String::new(), message: error.to_string() })?;
    laid_over(table, overrides)
}

fn laid_over(mut table: toml::Table, overrides: &[Override]) -> Result<RunConfig, LoadError> {
    for change in overrides {
        let fail = |message: String| LoadError::Override { text: change.text.clone(), message };
        change.insert(&mut table).map_err(fail)?;
        // Each is checked as it is laid down, so that the error is its own.
        let read = table.clone().try_into::<RunConfig>();
        read.map_err(|error| fail(change.wanted().unwrap_or_else(|| message(&error))))?;
    }
    let section =
        |name: &str| table.get(name).and_then(toml::Value::as_table).cloned().unwrap_or_default();
    let given = Given { scanner: section("scanner"), lidar: section("lidar") };
    let (budget, data, tune) = (section("budget"), section("data"), section("tune"));
    let registration = section("registration");
    let mut config: RunConfig = table.try_into().map_err(|error: toml::de::Error| {
        LoadError::Override { text: String::new(), message: message(&error) }
    })?;
    follow_scene(&mut config, &given)?;
    if config.device().steered().is_some() {
        config.budget = over("budget", Budget::UNITREE_L2, budget)?;
        follow_scanner(&mut config, &given);
    }
    follow_method(&mut config, &data);
    if !registration.contains_key("refine") {
        let RegistrationConfig { method, mode, refine, .. } = &mut config.registration;
        let is_papers = *mode == FgrMode::Open3d || config.tune.strategy == Strategy::Paper;
        *refine = method.is_rough() && !is_papers;
    }
    // What depends on the strategy.
    config.tune = over("tune", TuneConfig::for_strategy(config.tune.strategy), tune)?;
    config.check()?;
    Ok(config)
}

/// Keys of two sections that the user gave.
struct Given {
    scanner: toml::Table,
    lidar: toml::Table,
}

/// Beams of recorded scans are those of the recording: their sensor is not steered by default.
fn follow_scene(config: &mut RunConfig, given: &Given) -> Result<(), LoadError> {
    if Source::is_recording(&config.scene.source) && !given.scanner.contains_key("pattern") {
        let grid = toml::Table::from_iter([("pattern".to_owned(), "grid".into())]);
        config.scanner = over("scanner", grid, given.scanner.clone())?;
    }
    Ok(())
}

/// Fills in keys of a steered sensor that depend on others: settings that are not the paper's, the
/// time of a scan, and as many columns as the budget has, of its own aim and of the settings'.
fn follow_scanner(config: &mut RunConfig, Given { scanner, lidar }: &Given) {
    let is_given = |id: ParameterId| lidar.contains_key(id.parameter().name);
    let frame_time = (config.budget.frame_ms != Budget::UNITREE_L2.frame_ms)
        .then_some((ParameterId::FrameTime, config.budget.frame_ms));
    for (id, value) in STEERED.into_iter().chain(frame_time) {
        if !is_given(id) {
            config.lidar.0.set(id, Some(id.parameter().to_code(value)));
        }
    }
    if scanner.contains_key("columns") {
        return;
    }
    let filled = |settings: &Settings, config: &RunConfig| {
        filled_columns(settings, &config.device()).and_then(|columns| u16::try_from(columns).ok())
    };
    config.scanner.columns = filled(&Settings::default(), config);
    if !is_given(ParameterId::Columns) {
        let columns = filled(&config.lidar.0, config);
        let has_others = columns != config.scanner.columns;
        config.lidar.0.columns = columns.filter(|_| has_others).map(i32::from);
    }
}

/// Settings of a steered sensor that are not the paper's. Over seven seeds, no other value of one
/// or two of its settings by hand errs 5 % less (benches/record/aim.md).
pub(super) const STEERED: [(ParameterId, f64); 2] =
    [(ParameterId::Power, 15.0), (ParameterId::GainSlope, 0.3)];

/// A section with the given keys over usual ones.
fn over<T: DeserializeOwned>(
    section: &str,
    usual: impl Serialize,
    given: toml::Table,
) -> Result<T, LoadError> {
    let fail = |message: String| LoadError::Override { text: section.into(), message };
    let mut table = toml::Table::try_from(usual).map_err(|error| fail(error.to_string()))?;
    table.extend(given);
    table.try_into().map_err(|error| fail(message(&error)))
}

/// Fills in keys of `[data]` that depend on the method ([`DataConfig::for_method`]) and on the
/// strategy.
fn follow_method(config: &mut RunConfig, given: &toml::Table) {
    let usual = DataConfig::for_method(config.registration.method);
    let data = &mut config.data;
    for (key, slot, value) in [
        ("baseline_m", &mut data.baseline_m, usual.baseline_m),
        ("train_baseline_factor", &mut data.train_baseline_factor, usual.train_baseline_factor),
        ("success_translation_m", &mut data.success_translation_m, usual.success_translation_m),
        ("success_rotation_deg", &mut data.success_rotation_deg, usual.success_rotation_deg),
    ] {
        if !given.contains_key(key) {
            *slot = value;
        }
    }
    let is_paper = config.tune.strategy == Strategy::Paper; // Sec. 4.1
    if !given.contains_key("train_pairs") {
        data.train_pairs = if is_paper { 10 } else { usual.train_pairs };
    }
    if !given.contains_key("check_pairs") {
        data.check_pairs =
            if is_paper { 0 } else { DataConfig::usual_check_pairs(data.train_pairs) };
    }
    if is_paper && !given.contains_key("train_baseline_factor") {
        data.train_baseline_factor = 1.0;
    }
}

/// The file's table, after its text has been taken for a [`RunConfig`]: errors then show the line.
fn read(path: &Path) -> Result<toml::Table, LoadError> {
    let text = read_text(path, MOST_TEXT).map_err(file_error("read", path))?;
    let fail = |message| LoadError::Parse { path: path.to_owned(), message };
    parse(&text).map_err(|problem| fail(problem + &wanted(&text).unwrap_or_default()))?;
    toml::from_str(&text).map_err(|error| fail(told(&error)))
}

/// True when serde's message names only the type of such a key, as `usize`; the bounds are then
/// added.
fn takes_numbers(key: &Parameter) -> bool {
    !matches!(key.kind, Kind::Text)
}

/// The first key of a file with a value of the wrong type, and the values it expects.
fn wanted(text: &str) -> Option<String> {
    let table: toml::Table = toml::from_str(text).ok()?;
    let is_wrong = |key: &&Parameter| {
        let path: Vec<String> = key.key.split('.').map(str::to_owned).collect();
        let at = |value: &toml::Value, key: &String| value.as_table()?.get(key).cloned();
        let whole = toml::Value::Table(table.clone());
        let Some(value) = path.iter().try_fold(whole, |value, key| at(&value, key)) else {
            return false;
        };
        let (mut alone, change) = (toml::Table::new(), Override::flag(key.key, value));
        change.insert(&mut alone).is_ok() && alone.try_into::<RunConfig>().is_err()
    };
    let key = keys().filter(|key| takes_numbers(key)).find(is_wrong)?;
    Some(format!("\n{}: expected {}", key.key, key.expected_of_text()))
}

/// The configuration of a text, unchecked.
///
/// # Errors
///
/// Line and column, the line itself with a caret below if it is short, and the problem.
pub fn parse(text: &str) -> Result<RunConfig, String> {
    toml::from_str(text).map_err(|error| told(&error))
}

/// The text of a configuration.
///
/// # Errors
///
/// [`toml::ser::Error`], of numbers that TOML does not have.
pub fn written(config: &RunConfig) -> Result<String, toml::ser::Error> {
    toml::to_string(config)
}

/// The problem, after an excerpt of the line at fault unless that is too long.
fn told(error: &toml::de::Error) -> String {
    let text = error.to_string();
    let is_excerpt = |line: &&str| line.contains(" | ");
    let is_long = |line: &str| line.chars().nth(MAX_LINE).is_some();
    let place = text.lines().next().unwrap_or_default();
    match text.lines().filter(is_excerpt).any(is_long) || is_long(place) {
        true => format!("{}\n{}", one_line(place), message(error)),
        false => {
            let excerpt = text.rsplit_once(error.message()).map_or(place, |(before, _)| before);
            printable(excerpt) + &message(error)
        }
    }
}

/// The problem without its place. The list of expected names is ours and may be long; the name
/// found is the file's and is shortened.
fn message(error: &toml::de::Error) -> String {
    const EXPECTED: &str = "`, expected ";
    match error.message().rsplit_once(EXPECTED) {
        Some((found, ours)) => one_line(found) + EXPECTED + &one_line_of(ours, 2_000),
        None => one_line(error.message()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steered_sensor_has_as_many_columns_as_its_budget_beside_rows_shots_and_samples() {
        let columns = |texts: &[&str]| {
            let config = set(texts).unwrap();
            (config.scanner.columns, config.lidar.0.columns)
        };
        assert_eq!(columns(&[]), (Some(200), None));
        assert_eq!(columns(&["scanner.rows=64"]), (Some(100), None));
        for key in ["lidar.rows=64", "lidar.shots=2", "lidar.waveform_resolution=1600"] {
            assert_eq!(columns(&[key]), (Some(200), Some(100)), "{key}");
        }
        assert_eq!(columns(&["budget.frame_ms=200"]), (Some(200), Some(400)));
        assert_eq!(columns(&["scanner.columns=50", "lidar.rows=64"]), (Some(50), None));
        assert_eq!(columns(&["lidar.columns=9", "lidar.rows=64"]), (Some(200), Some(9)));
        assert_eq!(columns(&["scanner.pattern=grid"]), (Some(192), None));
    }

    #[test]
    fn icp_finishes_what_leaves_that_to_another_but_not_the_paper_s_rows_and_a_file_says_so() {
        for (texts, refine) in [
            (&["registration.method=fgr"][..], true),
            (&["registration.method=mac"], true),
            (&["registration.method=icp"], false),
            (&["registration.method=auto"], false),
            (&["registration.method=fgr", "registration.mode=open3d"], false),
            (&["registration.method=mac", "tune.strategy=paper"], false),
            (&["registration.method=fgr", "registration.refine=false"], false),
            (&["registration.method=mac", "tune.strategy=paper", "registration.refine=true"], true),
        ] {
            let config = set(texts).unwrap();
            assert_eq!(config.registration.refine, refine, "{texts:?}");
            let again = changed(&config, &[]).unwrap();
            assert_eq!(again.registration, config.registration, "{texts:?}");
        }
    }

    #[test]
    fn a_configuration_without_keys_is_the_default_and_a_grid_has_the_paper_s_light() {
        assert_eq!(set(&[]).unwrap(), RunConfig::default());
        let grid = set(&["scanner.pattern=grid"]).unwrap();
        assert_eq!((grid.lidar.0, grid.budget), (Settings::default(), Budget::NONE));
    }

    #[test]
    fn global_methods_get_scans_farther_apart_unless_told_otherwise() {
        let data = |texts: &[&str]| set(texts).unwrap().data;
        assert_eq!(data(&["registration.method=icp"]), DataConfig::default());
        let global = data(&["registration.method=mac"]);
        assert_eq!(
            (global.baseline_m, global.success_translation_m, global.success_rotation_deg),
            (5.0, 1.0, 5.0)
        );
        let own = data(&["data.baseline_m=3", "registration.method=fgr"]);
        assert_eq!((own.baseline_m, own.success_translation_m), (3.0, 1.0));
    }

    #[test]
    fn pairs_to_tune_on_lie_as_far_apart_as_the_others_in_the_paper_s_way_alone() {
        let factor = |texts: &[&str]| set(texts).unwrap().data.train_baseline_factor;
        assert_eq!(factor(&[]), 2.0);
        assert_eq!(factor(&["tune.strategy=paper"]), 1.0);
        assert_eq!(factor(&["tune.strategy=paper", "data.train_baseline_factor=1.5"]), 1.5);
    }

    fn set(texts: &[&str]) -> Result<RunConfig, LoadError> {
        let overrides: Vec<Override> = texts.iter().map(|t| t.parse().unwrap()).collect();
        load(None, &overrides)
    }

    fn file(text: &str) -> Result<RunConfig, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.toml");
        std::fs::write(&path, text).unwrap();
        load(Some(&path), &[]).map_err(|error| error.to_string())
    }

    #[test]
    fn the_effective_configuration_reads_back_as_itself() {
        let config =
            set(&["lidar.power=50", "scene.source=unstructured", "registration.voxel_m=0.2"])
                .unwrap();
        let text = toml::to_string(&config).unwrap();
        assert_eq!(file(&text).unwrap(), config);
    }

    #[test]
    fn a_misspelt_key_is_shown_with_its_line_and_a_caret() {
        let error = file("seed = 1\n[lidar]\npowr = 3\n").unwrap_err();
        assert!(
            error.contains("line 3")
                && error.contains("^^^^")
                && error.contains("unknown field `powr`"),
            "{error}"
        );
        let error = file("[tune]\ngeneration = 3\n").unwrap_err();
        assert!(
            error.contains("line 2") && error.contains("unknown field `generation`"),
            "{error}"
        );
    }

    #[test]
    fn a_message_repeats_no_long_line_and_no_escapes() {
        for text in [
            "x".repeat(500_000) + "\x1b[31m\n",
            format!("seed = 1\nname = \"{}\"", "\u{1b}".repeat(300)),
            format!("[lidar]\npower = \"{}\"", "x".repeat(100_000)),
            format!("\"{}\x7f\" = 3", "x".repeat(100_000)),
        ] {
            let said = file(&text).unwrap_err();
            assert!(said.len() < 3_000 && !said.contains('\x1b'), "{} bytes: {said}", said.len());
            assert!(said.contains("line "), "{said}");
        }
    }

    #[test]
    fn a_key_of_many_names_is_refused() {
        for names in [9, 60_000] {
            let text = vec!["a"; names].join(".") + "=1";
            let said = text.parse::<Override>().unwrap_err();
            assert_eq!(said, format!("expected a.b=value, found {names} names before ="));
            assert!(file(&text).is_err());
        }
        let deep = format!("seed={}", "[".repeat(60_000));
        assert!(set(&[&deep]).unwrap_err().to_string().len() < 1_000);
        assert!(file(&deep).is_err());
    }

    #[test]
    fn a_value_out_of_range_is_shown_where_it_stands() {
        let error = file("[lidar]\npower = 500\n").unwrap_err();
        assert!(error.contains("line 2") && error.contains("above its maximum 100 W"), "{error}");
        for (text, part) in [
            ("[lidar]\npower = nan", "must be finite"),
            ("[lidar]\npower = -3", "below its minimum 0.00001 W"),
            ("[lidar]\nwaveform_resolution = 800.5", "must be a whole number"),
            ("[lidar]\ntiming = \"late\"", "rising-edge"),
            ("[lidar]\ntiming = 3", "invalid type"),
            ("[data]\ntrain_pairs = -1", "line 2"),
            ("scanner = 3", "expected a table, [scanner]"),
            ("[data]\nbaseline_m = nan", "data.baseline_m = NaN must be 0 to 100"),
            ("[receiver]\nadc_bits = 99", "receiver.adc_bits = 99 must be 8 to 14"),
            ("[tune]\nsigma = 0", "tune.sigma = 0 must be above 0"),
        ] {
            let error = file(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn a_number_of_the_wrong_kind_is_told_the_key_and_its_bound() {
        for (set, expected) in [
            ("data.train_pairs=-1", "expected a whole number, 1 to 10000"),
            ("data.train_pairs=1180591620717411303424", "expected a whole number, 1 to 10000"),
            ("tune.population=1.5", "expected a whole number, 0 (automatic) or 2 to 10000"),
            ("scanner.columns=70000", "expected a whole number, 1 to 4096"),
            ("data.baseline_m=far", "expected a number, 0 to 100"),
            ("seed=-1", "expected a whole number, 0 or more, below 2^63"),
            ("scene.towns=3", "expected a list, as [1, 2, 3], of 1 to 100 seeds"),
            ("motion.linear_m_s=[1, 2]", "expected three numbers, -100 to 100"),
            ("tune.common_noise=1", "expected true or false"),
        ] {
            let said = self::set(&[set]).unwrap_err().to_string();
            assert_eq!(said, format!("in --set {set}: {expected}"));
        }
        let said = file("[tune.weights]\nbits = 1\n[data]\ntrain_pairs = 1.5\n").unwrap_err();
        assert!(said.contains("line 4") && said.contains('^'), "{said}");
        assert!(
            said.ends_with("\ndata.train_pairs: expected a whole number, 1 to 10000"),
            "{said}"
        );
    }

    #[test]
    fn an_override_at_fault_is_named() {
        let error = set(&["tune.generations=5", "lidar.powr=1"]).unwrap_err().to_string();
        assert!(error.starts_with("in --set lidar.powr=1: unknown field `powr`"), "{error}");
        assert!("lidar.power".parse::<Override>().is_err());
        assert!("a..b=1".parse::<Override>().is_err());
    }

    #[test]
    fn a_long_key_or_list_is_not_repeated_whole() {
        let long = "k".repeat(5_000);
        let mut table = toml::Table::from_iter([(long.clone(), 1.into())]);
        let change: Override = format!("{long}.a=1").parse().unwrap();
        let said = change.insert(&mut table).unwrap_err();
        assert!(said.contains("is a value, not a section") && said.len() < 300, "{said}");
        let towns = vec!["1"; 50_000].join(",");
        let said = file(&format!("[scene]\ntowns = [{towns}]\n")).unwrap_err();
        assert!(said.contains("scene.towns = [1, 1,") && said.len() < 500, "{said}");
    }

    #[test]
    fn an_override_leaves_the_rest_of_the_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.toml");
        std::fs::write(&path, "seed = 9\n[lidar]\npower = 20\ngain = 3\n").unwrap();
        let config = load(Some(&path), &["lidar.power=30".parse().unwrap()]).unwrap();
        assert_eq!(
            (config.seed, config.lidar.0.power_uw, config.lidar.0.gain_cdb),
            (9, 30_000_000, 300)
        );
    }
}
