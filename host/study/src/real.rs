//! Real clouds: settings of registration that were tuned in simulation, evaluated on recorded pairs
//! beside the defaults and beside settings chosen from the clouds themselves.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use echoloop_clouds::pose::{Pose, read_pose, rotation_error_deg, to_rows, translation_error_m};
use echoloop_clouds::{Cloud, read_cloud};
use echoloop_files::{MOST_TEXT, one_line, read_text};
use echoloop_registration::{Registration, Suggestions, build};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::axes::{TableMethod, distinct, name_of};
use super::cell::{Base, Cell, tuned};
use super::folder::Folder;
use echoloop_closed_loop::checksum::Checksum;
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};
use echoloop_closed_loop::config::{RegistrationConfig, RunConfig};
use echoloop_closed_loop::parameters::{Parameters, ThetaReg, ValueError};
use echoloop_closed_loop::run_folder::files::file_error;

/// Reason why real clouds cannot be evaluated; it names the file or the cell.
pub type RealError = Box<dyn Error + Send + Sync>;

/// A pair of the list.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    target: PathBuf,
    source: PathBuf,
    target_from_source: Option<PathBuf>,
    world_from_target: Option<PathBuf>,
    world_from_source: Option<PathBuf>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    pair: Vec<Entry>,
}

/// Two clouds and the motion between them.
#[derive(Clone, Debug)]
pub struct RealPair {
    /// Name in the list.
    pub name: String,
    /// Checksum of both clouds' points and of the motion.
    content: String,
    target: Cloud,
    source: Cloud,
    target_from_source: Pose,
}

/// Reads a list and all that it names; relative paths begin in `folder`.
///
/// # Errors
///
/// [`RealError`] names the file.
pub fn read_real_pairs(list: &Path, folder: &Path) -> Result<Vec<RealPair>, RealError> {
    let wrong = |problem: String| RealError::from(format!("{}: {problem}", list.display()));
    let text = read_text(list, MOST_TEXT).map_err(file_error("read", list))?;
    let entries: Result<List, _> = toml::from_str(&text);
    let entries = entries.map_err(|error| wrong(one_line(&error.to_string())))?;
    if entries.pair.is_empty() {
        return Err(wrong("no pair; expected [[pair]] with name, target and source".into()));
    }
    entries.pair.iter().map(|entry| entry.read(folder, &wrong)).collect()
}

impl Entry {
    fn read(
        &self,
        folder: &Path,
        wrong: &dyn Fn(String) -> RealError,
    ) -> Result<RealPair, RealError> {
        let pose = |file: &PathBuf| read_pose(&folder.join(file));
        let target_from_source =
            match (&self.target_from_source, &self.world_from_target, &self.world_from_source) {
                (Some(motion), None, None) => pose(motion)?,
                (None, Some(target), Some(source)) => pose(target)?.inverse() * pose(source)?,
                _ => {
                    return Err(wrong(format!(
                        "pair {:?}: expected target_from_source, or world_from_target and \
                         world_from_source",
                        one_line(&self.name)
                    )));
                }
            };
        let cloud = |file: &PathBuf| read_cloud(&folder.join(file)).map(|(cloud, _)| cloud);
        let (target, source) = (cloud(&self.target)?, cloud(&self.source)?);
        for (cloud, file) in [(&target, &self.target), (&source, &self.source)] {
            if cloud.points.is_empty() {
                let empty = io::Error::other("no point; expected a scan");
                return Err(file_error("register", &folder.join(file))(empty).into());
            }
        }
        let content = checksum([&target, &source], &target_from_source);
        Ok(RealPair { name: self.name.clone(), content, target, source, target_from_source })
    }
}

fn checksum(clouds: [&Cloud; 2], motion: &Pose) -> String {
    let points = clouds.into_iter().flat_map(|cloud| &cloud.points);
    let points: Vec<u8> = points
        .flat_map(|point| [point.x, point.y, point.z].map(f32::to_le_bytes))
        .flatten()
        .collect();
    let motion: Vec<u8> = to_rows(motion).into_iter().flat_map(f64::to_le_bytes).collect();
    let count = clouds[0].points.len() as u64; // a point moved to the other cloud changes it
    Checksum::of(&[&count.to_le_bytes(), &points, &motion]).to_string()
}

/// A method with settings to evaluate, and its row without results.
struct Variant {
    row: RealRow,
    /// `None`: chosen from each pair's clouds.
    settings: Option<ThetaReg>,
    config: RunConfig,
}

/// Result of one pair.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RealOutcome {
    /// Name of the pair.
    pub name: String,
    /// Checksum of its clouds' points and of its true motion.
    pub content: String,
    /// e_t of Eq. 7, m.
    pub translation_m: f64,
    /// e_R of Eq. 7, degrees.
    pub rotation_deg: f64,
    /// True when both errors are within the cells' limits.
    pub found: bool,
    /// Reason why the registration stopped.
    pub stop: String,
}

/// Results of a method and its settings on all pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RealRow {
    /// The method.
    pub method: TableMethod,
    /// Origin of the settings, in words.
    pub settings: String,
    /// Preset, when the settings are its defaults.
    pub default: Option<Preset>,
    /// Cell that tuned the settings, if one did.
    pub cell: Option<Cell>,
    /// Result of each pair.
    pub pairs: Vec<RealOutcome>,
    /// Pairs found.
    pub found: usize,
    /// Mean over the pairs found, m.
    pub mean_translation_m: Option<f64>,
    /// Mean over the pairs found, degrees.
    pub mean_rotation_deg: Option<f64>,
}

/// Evaluates the defaults, the settings chosen from the clouds, and those that each finished cell
/// of registration or joint tuning chose. `begun` receives the number of registrations; `done` is
/// called after each.
///
/// # Errors
///
/// [`RealError`] of a cell that cannot be read.
pub fn judge_real(
    pairs: &[RealPair],
    base: &Base,
    folder: &Folder,
    cells: &[Cell],
    begun: &dyn Fn(usize),
    done: &(dyn Fn() + Sync),
) -> Result<Vec<RealRow>, RealError> {
    let variants = variants(base, folder, cells)?;
    begun(variants.len() * pairs.len());
    let tasks: Vec<(&Variant, &RealPair)> =
        variants.iter().flat_map(|variant| pairs.iter().map(move |pair| (variant, pair))).collect();
    let outcomes: Vec<RealOutcome> = tasks
        .par_iter()
        .map(|(variant, pair)| {
            let outcome = variant.register(pair);
            done();
            outcome
        })
        .collect();
    let each = outcomes.chunks(pairs.len());
    Ok(variants.into_iter().zip(each).map(|(variant, pairs)| variant.row(pairs)).collect())
}

/// Distinct settings by method: defaults, those chosen from the clouds, tuned ones.
fn variants(base: &Base, folder: &Folder, cells: &[Cell]) -> Result<Vec<Variant>, RealError> {
    let plain = || cells.iter().filter(|cell| cell.ablation.is_none());
    let mut variants: Vec<Variant> = Vec::new();
    for method in distinct(plain().map(|cell| cell.method)) {
        let of_method = || plain().filter(|cell| cell.method == method);
        let mut add = |variant: Variant| {
            let of = |e: &Variant| (e.row.method, e.row.settings.clone());
            if !variants.iter().any(|known| of(known) == of(&variant)) {
                variants.push(variant);
            }
        };
        for cell in of_method() {
            add(Variant::untuned(base, cell)?);
        }
        for cell in of_method() {
            add(Variant::new(cell, cell.config(base)?, "chosen from the clouds".into(), None));
        }
        for cell in of_method() {
            Variant::tuned(base, folder, cell)?.into_iter().for_each(&mut add);
        }
    }
    Ok(variants)
}

/// Parameters that do not fit a cell's configuration.
fn misfit(cell: &Cell, error: ValueError) -> RealError {
    format!("{cell}: {error}").into()
}

impl Variant {
    fn new(cell: &Cell, config: RunConfig, settings: String, theta: Option<ThetaReg>) -> Self {
        let row = RealRow {
            method: cell.method,
            settings,
            default: None,
            cell: None,
            pairs: Vec::new(),
            found: 0,
            mean_translation_m: None,
            mean_rotation_deg: None,
        };
        Self { row, settings: theta, config }
    }

    /// Defaults of a cell's preset.
    fn untuned(base: &Base, cell: &Cell) -> Result<Self, RealError> {
        let config = cell.untuned().config(base)?;
        let start =
            Parameters::start(&config, &config.device()).map_err(|error| misfit(cell, error))?;
        let settings = format!("default, {}", name_of(cell.ranges));
        let mut variant = Self::new(cell, config, settings, Some(start.registration));
        variant.row.default = Some(cell.ranges);
        Ok(variant)
    }

    /// Settings that a cell's search of registration chose; none where it is unfinished or its
    /// record cannot be used.
    fn tuned(base: &Base, folder: &Folder, cell: &Cell) -> Result<Option<Self>, RealError> {
        let is_tuned = matches!(cell.protocol, Protocol::Registration | Protocol::Joint);
        let record = is_tuned.then(|| folder.record(cell).ok().flatten()).flatten();
        let Some(record) = record else { return Ok(None) };
        let config = cell.config(base)?;
        let device = config.device();
        let start = Parameters::start(&config, &device).map_err(|error| misfit(cell, error))?;
        let theta = start
            .with_values(&record.parameters, &config, &device)
            .map_err(|error| misfit(cell, error))?;
        let by = if cell.strategy == Some(Strategy::Paper) { ", paper's search" } else { "" };
        let (scene, ranges) = (name_of(cell.scene), name_of(cell.ranges));
        let settings = format!("tuned, {}, {scene}, {ranges}{by}", tuned(cell));
        let mut variant = Self::new(cell, config, settings, Some(theta.registration));
        variant.row.cell = Some(*cell);
        Ok(Some(variant))
    }

    /// Registers a pair from the identity, as for the cells.
    fn register(&self, pair: &RealPair) -> RealOutcome {
        let (target, source) = (&pair.target, &pair.source);
        let RunConfig { registration: RegistrationConfig { method, mode, .. }, data, .. } =
            &self.config;
        let built: Option<Box<dyn Registration>> = match &self.settings {
            Some(settings) => settings.build().ok(),
            None => {
                let settings = Suggestions::new(target, source).method(*method, *mode, None);
                build(&settings, None).ok()
            }
        };
        let start = Pose::identity();
        let outcome = built.map(|method| method.register(target, source, &start));
        let (estimate, stop) = outcome.map_or((start, "bad settings".to_owned()), |outcome| {
            (outcome.target_from_source, outcome.stop.name().to_owned())
        });
        let translation_m = translation_error_m(&estimate, &pair.target_from_source);
        let rotation_deg = rotation_error_deg(&estimate, &pair.target_from_source);
        let found = translation_m <= data.success_translation_m
            && rotation_deg <= data.success_rotation_deg;
        let (name, content) = (pair.name.clone(), pair.content.clone());
        RealOutcome { name, content, translation_m, rotation_deg, found, stop }
    }

    fn row(self, pairs: &[RealOutcome]) -> RealRow {
        let found: Vec<&RealOutcome> = pairs.iter().filter(|outcome| outcome.found).collect();
        let mean = |value: fn(&RealOutcome) -> f64| {
            let sum: f64 = found.iter().map(|outcome| value(outcome)).sum();
            (!found.is_empty()).then(|| sum / found.len() as f64)
        };
        RealRow {
            found: found.len(),
            mean_translation_m: mean(|outcome| outcome.translation_m),
            mean_rotation_deg: mean(|outcome| outcome.rotation_deg),
            pairs: pairs.to_vec(),
            ..self.row
        }
    }
}

/// Lines of a text table, with the translation error of each pair that was found.
pub fn real_lines(rows: &[RealRow]) -> Vec<Vec<String>> {
    let names = rows.first().into_iter().flat_map(|row| row.pairs.iter().map(|p| p.name.clone()));
    let head = ["method", "settings", "found", "RTE", "RRE"].map(str::to_owned);
    let mut lines: Vec<Vec<String>> = vec![head.into_iter().chain(names).collect()];
    let number = |value: Option<f64>, scale: f64, digits: usize, unit: &str| {
        value.map_or("–".into(), |value| format!("{:.digits$}{unit}", scale * value))
    };
    lines.extend(rows.iter().map(|row| {
        let own = [
            row.method.title().to_owned(),
            row.settings.clone(),
            format!("{} of {}", row.found, row.pairs.len()),
            number(row.mean_translation_m, 100.0, 2, " cm"),
            number(row.mean_rotation_deg, 1.0, 3, "°"),
        ];
        let pairs = row.pairs.iter().map(|pair| match pair.found {
            true => number(Some(pair.translation_m), 100.0, 2, " cm"),
            false => "not found".into(),
        });
        own.into_iter().chain(pairs).collect()
    }));
    lines
}
