//! File of traced pairs: traced once, read in a moment.
//!
//! ```text
//! "ECHOPAIR"  version: u32  header's bytes: u32  header: JSON  body: zlib  CRC-64/XZ of all before
//! ```
//!
//! Little endian. The header has the configuration that the pairs were traced with, checksums of
//! the scene's files, and for each pair its place, poses and numbers of returns and glares. The
//! body has the scans, first and second of each pair to tune on, then of each to judge on: the
//! number of returns of each beam (u16), then all ranges, then all strengths (f32). Of the floats
//! the first bytes of all numbers come first, then the second bytes, and so on: exponents are
//! alike, and zlib packs them better side by side. Of glare the beams (u32), ranges and strengths
//! follow, and of another LiDAR its irradiances and paths, one a beam.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use echoloop_dsp::ParameterId;
use echoloop_files::{one_line, read_data};
use echoloop_frontend::{Glare, OtherLight, Return, SceneResponse};
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::pairs::{Dataset, ScanPair, viewpoints};
use super::response::Response;
use crate::beams::Beams;
use crate::checksum::Checksum;
use crate::config::{Interference, Retroreflectors, RunConfig, SceneConfig, parse, written};
use crate::dataset::fingerprint::SceneFiles;
use crate::dataset::source::Source;
use echoloop_clouds::pose::{Pose, relative};

const MAGIC: &[u8; 8] = b"ECHOPAIR";
/// Version of the file. It rises with the format, and when the same configuration makes other
/// scenes; files of another version are refused.
const VERSION: u32 = 3;
const PREFIX: usize = 16;
const SUFFIX: usize = 8;
/// Most memory of what is read, in sizes of the file, beside [`ROOM`] bytes.
const MOST_GROWTH: u64 = 8;
const ROOM: u64 = 64 << 20;
/// Most returns of a scan: 131,072 beams with 225 sub-rays each.
const MOST_RETURNS: u64 = 131_072 * 225;

/// Unusable file of pairs.
#[derive(Debug, Error)]
#[error("{}: {what}", path.display())]
pub struct StoreError {
    path: PathBuf,
    what: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    /// Configuration, TOML.
    config: String,
    files: SceneFiles,
    pattern: String,
    triangles: usize,
    train: Vec<Head>,
    test: Vec<Head>,
}

/// Pair without its returns.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    place: String,
    world_from_sensor: [Placed; 2],
    overlap: f64,
    /// Number of returns of each scan.
    returns: [u64; 2],
    /// Number of glares of each scan.
    glares: [u64; 2],
}

/// Pose to the last bit: x, y, z, m, then the quaternion's i, j, k, w.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Placed([f64; 7]);

/// Bytes of a file of pairs.
///
/// # Errors
///
/// Reason that the pairs cannot be stored.
pub fn stored(config: &RunConfig, dataset: &Dataset) -> Result<Vec<u8>, String> {
    if Source::is_recording(&config.scene.source) {
        return Err("recorded scans need no store: they are read as fast".into());
    }
    // Of a steered sensor, the beams of one aim.
    let beams = dataset.beams.aimed(&config.lidar.0).map_err(|refusal| refusal.to_string())?;
    let header = Header {
        config: written(config).map_err(|error| error.to_string())?,
        files: SceneFiles::of(config),
        pattern: pattern(&beams),
        triangles: dataset.triangles,
        train: dataset.train.iter().map(|pair| Head::new(pair, &beams)).collect(),
        test: dataset.test.iter().map(|pair| Head::new(pair, &beams)).collect(),
    };
    let header = serde_json::to_vec(&header).map_err(|error| error.to_string())?;
    let length = u32::try_from(header.len()).map_err(|_| "too many pairs for a file")?;
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(length.to_le_bytes());
    bytes.extend(header);
    let mut body = ZlibEncoder::new(bytes, Compression::fast());
    let pairs = dataset.train.iter().chain(&dataset.test);
    let mut scans = pairs.flat_map(|pair| [&pair.first, &pair.second]);
    let written = scans.try_for_each(|scan| write_scan(&mut body, &scan.to(&beams)));
    let done = written.and_then(|()| body.finish()).map_err(|error| error.to_string());
    let mut bytes = done?;
    bytes.extend(Checksum::of(&[&bytes]).to_le_bytes());
    Ok(bytes)
}

/// Configuration that the pairs of a file were traced with.
pub fn stored_config(path: &Path) -> Result<RunConfig, StoreError> {
    let fail = |what: String| StoreError { path: path.to_owned(), what };
    let bytes = read_data(path).map_err(|error| fail(format!("cannot be read: {error}")))?;
    let (header, _) = open(&bytes).map_err(fail)?;
    parse(&header.config).map_err(|error| fail(one_line(&error)))
}

/// Pairs of a file, which must be those of the configuration.
///
/// # Errors
///
/// [`StoreError`] says what is wrong with the file, or which key differs.
pub(super) fn load_stored(
    path: &Path,
    config: &RunConfig,
    beams: Beams,
) -> Result<Dataset, StoreError> {
    let fail = |what: String| StoreError { path: path.to_owned(), what };
    let bytes = read_data(path).map_err(|error| fail(format!("cannot be read: {error}")))?;
    let (header, body) = open(&bytes).map_err(fail)?;
    let traced_with = parse(&header.config).map_err(|error| fail(one_line(&error)))?;
    same(&traced_with, config).map_err(fail)?;
    let beams = beams.aimed(&config.lidar.0).map_err(|refusal| fail(refusal.to_string()))?;
    let beams = beams.into_owned();
    if header.pattern != pattern(&beams) {
        return Err(fail("its beams are not those of scanner.pattern any more".into()));
    }
    same_files(&header.files, &SceneFiles::of(config)).map_err(fail)?;
    let (train, test) = (header.train.len(), header.test.len());
    if (train, test) != (config.data.train_pairs, config.data.test_pairs) {
        return Err(fail(format!(
            "holds {train} and {test} pairs, not those of its configuration"
        )));
    }
    read_pairs(header, body, bytes.len() as u64, (beams, &config.scene)).map_err(fail)
}

/// Pattern of the beams as text; a table's has the hash of its beams.
fn pattern(beams: &Beams) -> String {
    format!("{:?}", beams.pattern())
}

/// Header and compressed body of a file whose checksum is right.
fn open(bytes: &[u8]) -> Result<(Header, &[u8]), String> {
    let no_pairs = || "no file of pairs (of `echoloop store`)".to_owned();
    let number = |from: usize| -> Option<u32> {
        Some(u32::from_le_bytes(bytes.get(from..from + 4)?.try_into().ok()?))
    };
    if !bytes.starts_with(MAGIC) {
        return Err(no_pairs());
    }
    let (version, length) = number(8).zip(number(12)).ok_or_else(no_pairs)?;
    if version != VERSION {
        return Err(format!("of version {version}, expected {VERSION}: store the pairs anew"));
    }
    let cut = || "cut short or damaged: its checksum is another".to_owned();
    let (content, sum) = bytes.split_last_chunk::<SUFFIX>().ok_or_else(cut)?;
    if Checksum::of(&[content]).to_le_bytes() != *sum {
        return Err(cut());
    }
    let rest = content.get(PREFIX..).ok_or_else(cut)?;
    let (header, body) = rest.split_at_checked(length as usize).ok_or_else(cut)?;
    let header = serde_json::from_slice(header);
    Ok((header.map_err(|error| format!("header: {}", one_line(&error.to_string())))?, body))
}

/// Refuses pairs of another configuration, by the first key that differs.
fn same(stored: &RunConfig, now: &RunConfig) -> Result<(), String> {
    let table = |config: &RunConfig| toml::Table::try_from(shaping(config));
    let (Ok(stored), Ok(now)) = (table(stored), table(now)) else {
        return Err("holds a configuration that cannot be written".into());
    };
    match first_difference("", &toml::Value::Table(stored), &toml::Value::Table(now)) {
        None => Ok(()),
        Some((key, stored, now)) => Err(format!(
            "its pairs have {key} = {}, and {} is asked for: trace anew without scene.stored, or \
             leave the key as it is there",
            one_line(&stored),
            one_line(&now)
        )),
    }
}

/// Refuses pairs of a scene whose files have changed. A missing file is accepted: the pairs do not
/// need it.
fn same_files(stored: &SceneFiles, now: &SceneFiles) -> Result<(), String> {
    let differ = |stored: &Option<String>, now: &Option<String>| now.is_some() && stored != now;
    if differ(&stored.scene, &now.scene) || differ(&stored.materials, &now.materials) {
        return Err("its pairs are of a scene whose files have changed: store them anew".into());
    }
    Ok(())
}

/// Configuration with the keys that shape pairs, and all others at their defaults.
fn shaping(config: &RunConfig) -> RunConfig {
    let usual = RunConfig::default();
    let mut own = RunConfig {
        seed: config.seed,
        scene: config.scene.clone(),
        scanner: config.scanner.clone(),
        data: config.data,
        motion: config.motion,
        ..usual.clone()
    };
    own.scene.stored = String::new();
    for field in ParameterId::AIM {
        own.lidar.0.set(field, config.lidar.0.get(field));
    }
    own.data.success_translation_m = usual.data.success_translation_m;
    own.data.success_rotation_deg = usual.data.success_rotation_deg;
    own.receiver.divergence_mrad = config.receiver.divergence_mrad;
    own.receiver.subrays = config.receiver.subrays;
    if config.scene.retroreflectors == Retroreflectors::Bright {
        own.receiver.aperture_mm = config.receiver.aperture_mm;
        own.receiver.transmission = config.receiver.transmission;
    }
    own
}

/// First key that differs, and both values; a missing value is an empty string.
fn first_difference(
    path: &str,
    stored: &toml::Value,
    now: &toml::Value,
) -> Option<(String, String, String)> {
    if let (toml::Value::Table(stored), toml::Value::Table(now)) = (stored, now) {
        let keys = stored.keys().chain(now.keys().filter(|key| !stored.contains_key(*key)));
        let none = toml::Value::String(String::new());
        return keys.into_iter().find_map(|key| {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            first_difference(&path, stored.get(key).unwrap_or(&none), now.get(key).unwrap_or(&none))
        });
    }
    (stored != now).then(|| (path.to_owned(), stored.to_string(), now.to_string()))
}

fn read_pairs(
    header: Header,
    body: &[u8],
    file: u64,
    (beams, scene): (Beams, &SceneConfig),
) -> Result<Dataset, String> {
    let has_other = scene.interference != Interference::None;
    let has_stray_light = has_other || scene.retroreflectors == Retroreflectors::Bright;
    let heads = || header.train.iter().chain(&header.test);
    let (count, of_beams) = (heads().count() as u64, u64::from(beams.pattern().beams()));
    let most = |count: u64| count.min(MOST_RETURNS + 1);
    let returns = heads().flat_map(|head| head.returns).map(most);
    let glares = heads().flat_map(|head| head.glares).map(most);
    let of_beam = if has_other { 2 + 8 } else { 2 };
    let size = 2 * count * of_beam * of_beams + 8 * returns.sum::<u64>() + 12 * glares.sum::<u64>();
    if size > MOST_GROWTH * file + ROOM {
        return Err("says that it holds far more than its size".into());
    }
    let mut body = ZlibDecoder::new(body);
    let fired_with = if has_stray_light { beams.fired_with() } else { Arc::default() };
    let seen = Seen {
        beams: of_beams as usize,
        has_other,
        cells: beams.cells(),
        has_glare: scene.retroreflectors == Retroreflectors::Bright && !fired_with.is_empty(),
        fired_with,
    };
    let mut pairs = |heads: Vec<Head>, first: usize| -> Result<Vec<ScanPair>, String> {
        let numbered = (first..).zip(heads);
        numbered.map(|(number, head)| head.with(number, &mut body, &seen)).collect()
    };
    let judged_from = header.train.len();
    let (train, test) = (pairs(header.train, 0)?, pairs(header.test, judged_from)?);
    match body.read(&mut [0]) {
        Ok(0) => Ok(Dataset { beams, train, test, check: Vec::new(), triangles: header.triangles }),
        _ => Err("holds more than it says".into()),
    }
}

/// Properties that all scans of a file share.
struct Seen {
    /// Number of beams.
    beams: usize,
    /// True where another LiDAR is seen.
    has_other: bool,
    cells: Vec<u32>,
    /// True where bright signs are seen by beams that are fired at once.
    has_glare: bool,
    fired_with: Arc<[u32]>,
}

impl Head {
    fn new(pair: &ScanPair, beams: &Beams) -> Self {
        let scans = [&pair.first, &pair.second].map(|scan| scan.to(beams));
        Self {
            place: pair.place.clone(),
            world_from_sensor: pair.world_from_sensor.map(Placed::from),
            overlap: pair.overlap,
            returns: scans.each_ref().map(|scan| scan.returns.len() as u64),
            glares: scans.each_ref().map(|scan| scan.glare.len() as u64),
        }
    }

    fn with(self, number: usize, body: &mut impl Read, seen: &Seen) -> Result<ScanPair, String> {
        if !(0.0..=1.0).contains(&self.overlap) || self.place.contains(char::is_control) {
            return Err("holds a pair that is none".into());
        }
        let mut scan = |index| -> Result<Response, String> {
            let counts: [u64; 2] = [self.returns[index], self.glares[index]];
            Ok(Response::Fixed(Arc::new(read_scan(body, seen, counts)?)))
        };
        let [first, second] = [scan(0), scan(1)];
        let [from_first, from_second] = self.world_from_sensor.map(Placed::pose);
        let world_from_sensor = [from_first?, from_second?];
        Ok(ScanPair {
            place: self.place,
            truth: relative(&world_from_sensor[0], &world_from_sensor[1]),
            world_from_sensor,
            first: first?,
            second: second?,
            viewpoints: viewpoints(number),
            overlap: self.overlap,
        })
    }
}

impl From<Pose> for Placed {
    fn from(pose: Pose) -> Self {
        let ([x, y, z], turn) = (pose.translation.vector.into(), pose.rotation.coords);
        Self([x, y, z, turn.x, turn.y, turn.z, turn.w])
    }
}

impl Placed {
    fn pose(self) -> Result<Pose, String> {
        let Self([x, y, z, i, j, k, w]) = self;
        let turn = Quaternion::new(w, i, j, k);
        match self.0.iter().all(|v| v.is_finite()) && (turn.norm() - 1.0).abs() < 1e-6 {
            true => Ok(Pose::from_parts(
                Translation3::new(x, y, z),
                UnitQuaternion::new_unchecked(turn), // to the bit, as it was
            )),
            false => Err("holds a pose that is none".into()),
        }
    }
}

fn write_scan(body: &mut impl Write, scan: &SceneResponse) -> std::io::Result<()> {
    let counts = scan.beams.windows(2).map(|pair| (pair[1] - pair[0]) as u16);
    body.write_all(&counts.flat_map(u16::to_le_bytes).collect::<Vec<u8>>())?;
    body.write_all(&planes(scan.returns.iter().map(|one| one.range_m)))?;
    body.write_all(&planes(scan.returns.iter().map(|one| one.strength_per_m2)))?;
    body.write_all(&scan.glare.iter().flat_map(|of| of.beam.to_le_bytes()).collect::<Vec<u8>>())?;
    body.write_all(&planes(scan.glare.iter().map(|of| of.light.range_m)))?;
    body.write_all(&planes(scan.glare.iter().map(|of| of.light.strength_per_m2)))?;
    body.write_all(&planes(scan.other.iter().map(|light| light.irradiance_w_m2)))?;
    body.write_all(&planes(scan.other.iter().map(|light| light.path_m)))
}

fn read_scan(
    body: &mut impl Read,
    seen: &Seen,
    [returns, glares]: [u64; 2],
) -> Result<SceneResponse, String> {
    let cut = || "holds less than it says".to_owned();
    let number = |count: u64| usize::try_from(count).ok().filter(|_| count <= MOST_RETURNS);
    let count = number(returns).ok_or("says that it holds more returns than a scan has")?;
    let glares = number(glares).filter(|glares| *glares == 0 || seen.has_glare);
    let glares = glares.ok_or("says that it holds glare where there is none")?;
    let mut take = |bytes: usize| -> Result<Vec<u8>, String> {
        let mut taken = Vec::new();
        let read = body.by_ref().take(bytes as u64).read_to_end(&mut taken);
        read.ok().filter(|&read| read == bytes).map(|_| taken).ok_or_else(cut)
    };
    let counts = take(2 * seen.beams)?;
    let ends = counts.as_chunks().0.iter().scan(0_u64, |end, count| {
        *end += u64::from(u16::from_le_bytes(*count));
        Some(*end)
    });
    let ends: Vec<u64> = std::iter::once(0).chain(ends).collect();
    if ends.last() != Some(&returns) {
        return Err("holds beams whose returns are not as many as it says".into());
    }
    let (ranges, strengths) = (take(4 * count)?, take(4 * count)?);
    let glared = take(4 * glares)?;
    let (glare_ranges, glare_strengths) = (take(4 * glares)?, take(4 * glares)?);
    let lights = if seen.has_other { 4 * seen.beams } else { 0 };
    let (lights, paths) = (take(lights)?, take(lights)?);
    let other = numbers(&lights).zip(numbers(&paths));
    let other = other.map(|(irradiance_w_m2, path_m)| OtherLight { irradiance_w_m2, path_m });
    let glared = glared.as_chunks().0.iter().map(|beam| u32::from_le_bytes(*beam));
    let glare = glared.zip(lights_of(&glare_ranges, &glare_strengths));
    let scan = SceneResponse {
        beams: ends.iter().map(|&end| end as u32).collect(), // no more than there are returns
        returns: lights_of(&ranges, &strengths).collect(),
        cells: seen.cells.clone(),
        glare: glare.map(|(beam, light)| Glare { beam, light }).collect(),
        other: other.collect(),
        fired_with: Arc::clone(&seen.fired_with),
    };
    is_sound(&scan)
        .then_some(scan)
        .ok_or_else(|| "holds a return, glare or light that is none".into())
}

fn lights_of(ranges: &[u8], strengths: &[u8]) -> impl Iterator<Item = Return> {
    let each = numbers(ranges).zip(numbers(strengths));
    each.map(|(range_m, strength_per_m2)| Return { range_m, strength_per_m2 })
}

/// True when ranges rise within each beam, all numbers are finite and strengths positive, and glare
/// is in beams that there are.
fn is_sound(scan: &SceneResponse) -> bool {
    let number = |one: &Return| {
        (0.0..f32::INFINITY).contains(&one.range_m)
            && one.strength_per_m2 > 0.0
            && one.strength_per_m2.is_finite()
    };
    let rise = |beam| scan.of(beam).is_sorted_by(|a, b| a.range_m <= b.range_m);
    let light = |of: &OtherLight| {
        [of.irradiance_w_m2, of.path_m].iter().all(|value| (0.0..f32::INFINITY).contains(value))
    };
    let rises = |a: &Glare, b: &Glare| (a.beam, a.light.range_m) <= (b.beam, b.light.range_m);
    let has_beam = |of: &Glare| (of.beam as usize) < scan.len() && number(&of.light);
    scan.other.iter().all(light)
        && scan.returns.iter().all(number)
        && scan.glare.iter().all(has_beam)
        && scan.glare.is_sorted_by(rises)
        && (0..scan.len()).all(rise)
}

/// First bytes of all numbers, then all second bytes, third, fourth.
fn planes(values: impl Iterator<Item = f32>) -> Vec<u8> {
    let values: Vec<[u8; 4]> = values.map(f32::to_le_bytes).collect();
    (0..4).flat_map(|plane| values.iter().map(move |bytes| bytes[plane])).collect()
}

fn numbers(planes: &[u8]) -> impl Iterator<Item = f32> {
    let count = planes.len() / 4;
    (0..count).map(move |i| f32::from_le_bytes([0, 1, 2, 3].map(|plane| planes[plane * count + i])))
}

#[cfg(test)]
mod tests {
    use super::super::configured;
    use super::*;

    fn config(more: &[&str]) -> RunConfig {
        let scene = ["scene.source=structured", "scene.towns=[1]", "scanner.pattern=grid"];
        let small = ["scanner.columns=24", "scanner.rows=8"];
        configured(
            &[&scene[..], &small, &["data.train_pairs=2", "data.test_pairs=1"], more].concat(),
        )
    }

    fn load(bytes: &[u8], config: &RunConfig) -> Result<Dataset, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pairs");
        std::fs::write(&path, bytes).unwrap();
        let text = |error: StoreError| error.to_string().replace(&path.display().to_string(), "F");
        load_stored(&path, config, config.scanner.beams()).map_err(text)
    }

    /// Bytes with a valid checksum again, as after a change on purpose.
    fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
        bytes.truncate(bytes.len() - SUFFIX);
        let sum = Checksum::of(&[&bytes]).to_le_bytes();
        bytes.extend(sum);
        bytes
    }

    #[test]
    fn pairs_read_back_bit_for_bit() {
        let fired_at_once = |stray_light: &str| {
            let scene = ["scene.source=structured", "scene.towns=[1]", stray_light];
            let beams = ["scanner.pattern=os1-64", "scanner.columns=360"];
            let pairs = ["data.train_pairs=1", "data.test_pairs=1"];
            configured(&[&scene[..], &beams, &pairs].concat())
        };
        for (config, has_glare) in [
            (config(&[]), false),
            (config(&["scene.interference=flash"]), false),
            (fired_at_once("scene.interference=flash"), false),
            (fired_at_once("scene.retroreflectors=bright"), true),
        ] {
            let traced = Dataset::build(&config, &|_, _| ()).unwrap();
            let glares: usize = traced.views().map(|scan| scan.glare.len()).sum();
            assert_eq!(glares > 0, has_glare, "{glares}");
            let bytes = stored(&config, &traced).unwrap();
            let back = load(&bytes, &config).unwrap();
            let text = |set: &Dataset| format!("{:?} {:?} {}", set.train, set.test, set.triangles);
            assert_eq!(text(&back), text(&traced));
            let bits = |set: &Dataset| {
                set.train.iter().map(|pair| Placed::from(pair.truth).0.map(f64::to_bits)).collect()
            };
            let (own, found): (Vec<_>, Vec<_>) = (bits(&traced), bits(&back));
            assert_eq!(own, found);
        }
    }

    #[test]
    fn bright_signs_bind_stored_pairs_to_the_aperture() {
        let bright =
            |more: &[&str]| config(&[&["scene.retroreflectors=bright"][..], more].concat());
        let own = bright(&[]);
        let bytes = stored(&own, &Dataset::build(&own, &|_, _| ()).unwrap()).unwrap();
        let other = load(&bytes, &bright(&["receiver.aperture_mm=30"])).unwrap_err();
        assert!(other.contains("receiver.aperture_mm = 25.0"), "{other}");
    }

    #[test]
    fn pairs_of_another_configuration_are_refused_by_the_key_that_differs() {
        let own = config(&[]);
        let bytes = stored(&own, &Dataset::build(&own, &|_, _| ()).unwrap()).unwrap();
        for (set, key) in [
            ("data.baseline_m=3", "data.baseline_m = 2.0, and 3.0"),
            ("seed=9", "seed = 1, and 9"),
            ("scanner.rows=9", "scanner.rows = 8, and 9"),
            ("receiver.subrays=3", "receiver.subrays = 5, and 3"),
            ("scene.source=unstructured", "scene.source = \"structured\", and \"unstructured\""),
        ] {
            let said = load(&bytes, &config(&[set])).unwrap_err();
            assert!(said.contains(key), "{said}");
        }
        // Keys that shape no pair may differ.
        for set in ["lidar.power=9", "data.success_translation_m=2", "weather.kind=fog"] {
            assert!(load(&bytes, &config(&[set])).is_ok(), "{set}");
        }
    }

    #[test]
    fn a_cut_changed_older_or_foreign_file_is_refused() {
        let own = config(&[]);
        let bytes = stored(&own, &Dataset::build(&own, &|_, _| ()).unwrap()).unwrap();
        for length in [0, 7, 12, 15, 16, 40, bytes.len() / 2, bytes.len() - 1] {
            assert!(load(&bytes[..length], &own).is_err(), "{length} bytes");
        }
        let mut changed = bytes.clone();
        changed[bytes.len() / 2] ^= 1;
        assert!(load(&changed, &own).unwrap_err().contains("checksum"));
        let mut later = bytes.clone();
        later[8] = 4;
        assert_eq!(
            load(&later, &own).unwrap_err(),
            "F: of version 4, expected 3: store the pairs anew"
        );
        assert_eq!(load(b"ply\n", &own).unwrap_err(), "F: no file of pairs (of `echoloop store`)");
    }

    #[test]
    fn a_file_with_a_false_header_is_refused() {
        let own = config(&[]);
        let dataset = Dataset::build(&own, &|_, _| ()).unwrap();
        let bytes = stored(&own, &dataset).unwrap();
        let changed = |from: &str, to: &str| {
            assert_eq!(from.len(), to.len());
            let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
            let mut changed = bytes.clone();
            changed[at..at + to.len()].copy_from_slice(to.as_bytes());
            load(&sealed(changed), &own)
        };
        let count =
            format!("\"returns\":[{}", dataset.train[0].first.to(&dataset.beams).returns.len());
        let more = count.replace("[1", "[9").replace("[2", "[8").replace("[3", "[7");
        assert_ne!(count, more);
        assert!(changed(&count, &more).unwrap_err().contains("returns"));
        assert!(changed("\"triangles\"", "\"quadrangle").is_err());
        let mut header = bytes.clone();
        header[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(load(&sealed(header), &own).is_err());
    }

    /// Bytes with a changed header, and with another body if there is one.
    fn rewritten(bytes: &[u8], change: impl FnOnce(&mut Header), body: Option<Vec<u8>>) -> Vec<u8> {
        let (mut header, own) = open(bytes).unwrap();
        change(&mut header);
        let text = serde_json::to_vec(&header).unwrap();
        let length = (text.len() as u32).to_le_bytes();
        let body = body.map_or_else(
            || own.to_vec(),
            |body| {
                let mut packed = ZlibEncoder::new(Vec::new(), Compression::fast());
                packed.write_all(&body).unwrap();
                packed.finish().unwrap()
            },
        );
        sealed([&bytes[..12], &length, &text, &body, &[0; SUFFIX]].concat())
    }

    #[test]
    fn a_file_with_a_right_checksum_and_invalid_content_is_refused() {
        let own = config(&[]);
        let bytes = stored(&own, &Dataset::build(&own, &|_, _| ()).unwrap()).unwrap();
        let said = |change: fn(&mut Header), body: Option<Vec<u8>>| {
            load(&rewritten(&bytes, change, body), &own).unwrap_err()
        };
        assert!(load(&rewritten(&bytes, |_| (), None), &own).is_ok());
        let none = said(|header| header.train.clear(), None);
        assert_eq!(none, "F: holds 0 and 1 pairs, not those of its configuration");
        for change in [
            |header: &mut Header| header.train[0].overlap = -5.0,
            |header: &mut Header| header.train[0].overlap = 1.5,
            |header: &mut Header| header.test[0].place = "a\u{1b}[2J".into(),
        ] {
            assert_eq!(said(change, None), "F: holds a pair that is none");
        }
        let turned = |header: &mut Header| header.train[0].world_from_sensor[1].0[6] = 9.0;
        assert_eq!(said(turned, None), "F: holds a pose that is none");
    }

    #[test]
    fn glare_where_there_can_be_none_is_refused() {
        let scene = ["scene.source=structured", "scene.towns=[1]", "scene.retroreflectors=bright"];
        let beams = ["scanner.pattern=os1-64", "scanner.columns=360"];
        let pairs = ["data.train_pairs=1", "data.test_pairs=1"];
        let bright = configured(&[&scene[..], &beams, &pairs].concat());
        let mut dataset = Dataset::build(&bright, &|_, _| ()).unwrap();
        let said = |dataset: &Dataset, change: fn(&mut Header)| {
            let bytes = stored(&bright, dataset).unwrap();
            load(&rewritten(&bytes, change, None), &bright).unwrap_err()
        };
        let fewer = said(&dataset, |header| header.train[0].glares[0] -= 1);
        assert!(fewer.starts_with("F: holds "), "{fewer}");
        let most = said(&dataset, |header| header.train[0].glares[0] = u64::MAX);
        assert!(most.contains("far more than its size"), "{most}");
        let mut changed = |change: fn(&mut Vec<Glare>)| {
            let Response::Fixed(scan) = &mut dataset.train[0].first else { panic!("fixed") };
            let whole = Arc::clone(scan);
            change(&mut Arc::make_mut(scan).glare);
            let said = said(&dataset, |_| ());
            dataset.train[0].first = Response::Fixed(whole);
            said
        };
        let none = "F: holds a return, glare or light that is none";
        assert_eq!(changed(|glare| glare[0].beam = 90_000), none, "no such beam");
        assert_eq!(changed(|glare| glare.reverse()), none, "not sorted");
        assert_eq!(changed(|glare| glare[0].light.strength_per_m2 = -1.0), none);
        // With dim signs there is none.
        let own = config(&[]);
        let bytes = stored(&own, &Dataset::build(&own, &|_, _| ()).unwrap()).unwrap();
        let one = rewritten(&bytes, |header| header.train[0].glares[0] = 1, None);
        let said = load(&one, &own).unwrap_err();
        assert_eq!(said, "F: says that it holds glare where there is none");
    }

    #[test]
    fn counts_of_returns_that_overflow_32_bits_are_refused() {
        let own = config(&["scanner.columns=512", "scanner.rows=256"]);
        let mut small = Dataset::build(&config(&[]), &|_, _| ()).unwrap();
        small.beams = own.scanner.beams();
        let bytes = stored(&own, &small).unwrap();
        // 2³² + 1 in all, which is 1 in 32 bits.
        let mut left = (1_u64 << 32) + 1;
        let mut counts = Vec::new();
        for _ in 0..512 * 256 {
            let count = left.min(u64::from(u16::MAX));
            counts.extend((count as u16).to_le_bytes());
            left -= count;
        }
        let one = [&5.0_f32.to_le_bytes()[..], &1e-6_f32.to_le_bytes()].concat();
        let no_returns = vec![0; 2 * 512 * 256];
        let body = [counts, one, no_returns.repeat(5)].concat();
        let change = |header: &mut Header| {
            let heads = header.train.iter_mut().chain(&mut header.test);
            heads.for_each(|head| head.returns = [0, 0]);
            header.train[0].returns = [1, 0];
        };
        let said = load(&rewritten(&bytes, change, Some(body)), &own).unwrap_err();
        assert_eq!(said, "F: holds beams whose returns are not as many as it says");
    }

    #[test]
    fn pairs_of_a_changed_scene_file_are_refused_and_of_a_missing_one_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("pillars.obj");
        // A floor, and pillars on it.
        let write = |height: f64| {
            let mut text = "v -60 -60 0\nv 60 -60 0\nv 60 60 0\nv -60 60 0\nf 1 2 3 4\n".to_owned();
            for at in 0..36 {
                let (x, y) = (16 * (at % 6) - 40, 16 * (at / 6) - 40);
                for (u, v) in [(x, y), (x + 3, y), (x + 3, y + 3), (x, y + 3)] {
                    text += &format!("v {u} {v} 0\nv {u} {v} {height}\n");
                }
                let corner = |k: i32| 5 + 8 * at + 2 * (k % 4);
                for k in 0..4 {
                    let (a, b) = (corner(k), corner(k + 1));
                    text += &format!("f {a} {b} {} {}\n", b + 1, a + 1);
                }
            }
            std::fs::write(&scene, text).unwrap();
        };
        write(8.0);
        let own = config(&[&format!("scene.source={}", scene.display())]);
        let bytes = stored(&own, &Dataset::build(&own, &|_, _| ()).unwrap()).unwrap();
        assert!(load(&bytes, &own).is_ok());
        write(8.5);
        let said = load(&bytes, &own).unwrap_err();
        assert!(said.contains("files have changed"), "{said}");
        std::fs::remove_file(&scene).unwrap();
        assert!(load(&bytes, &own).is_ok());
    }
}
