//! Checksums of everything that a search depends on besides its configuration: a search resumes
//! only where they are equal.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use echoloop_clouds::pose::to_rows;
use echoloop_frontend::SceneResponse;
use echoloop_sim::import::{Libraries, library_files};
use serde::{Deserialize, Serialize};

use crate::beams::Beams;
use crate::checksum::{Checksum, Running};
use crate::config::RunConfig;
use crate::dataset::source::Source;
use crate::dataset::{Dataset, ScanPair};
use echoloop_sensors::sensor::Model;

/// Checksums of scene, sensor and scans, each of 16 hexadecimal digits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Content {
    /// Checksum of the scene's file; `None` for a generated scene.
    pub scene: Option<String>,
    /// Checksum of the material files that an OBJ names.
    pub materials: Option<String>,
    /// Checksum of front end, scan pattern and hardware, which shape the waveforms.
    pub front_end: String,
    /// Checksum of all returns and true motions.
    pub scans: String,
}

/// Checksums of the files that a scene is read from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFiles {
    /// As [`Content::scene`].
    pub scene: Option<String>,
    /// As [`Content::materials`].
    pub materials: Option<String>,
}

impl SceneFiles {
    /// Checksums of the files as they are now; `None` for a missing file.
    pub fn of(config: &RunConfig) -> Self {
        let files = Source::of(&config.scene.source).files();
        let libraries = config.scene.import().map(|options| options.libraries).unwrap_or_default();
        let sums = files.iter().filter_map(|file| Checksum::of_file(file).ok());
        let sums: Vec<String> = sums.map(|sum| sum.to_string()).collect();
        let scene = match &sums[..] {
            [] | [_] => sums.into_iter().next(),
            _ => Some(Checksum::of(&[sums.concat().as_bytes()]).to_string()),
        };
        let materials = files.first().and_then(|file| materials(file, libraries));
        Self { scene, materials: materials.map(|sum| sum.to_string()) }
    }
}

impl Content {
    /// Checksums of a configuration and its traced scans.
    pub fn of(config: &RunConfig, dataset: &Dataset) -> Self {
        let SceneFiles { scene, materials } = SceneFiles::of(config);
        Self {
            scene,
            materials,
            front_end: front_end(&Model::from(config)).to_string(),
            scans: scans(dataset).to_string(),
        }
    }
}

/// File of the library that this code is in, where the program is another's.
static LIBRARY: OnceLock<PathBuf> = OnceLock::new();

/// Names the file that [`build`] reads: of a library that another program has loaded.
pub fn of_library(path: PathBuf) {
    LIBRARY.get_or_init(|| path);
}

/// Checksum of the program's own file, or of [`of_library`]; `None` where the system does not let
/// it be read.
pub fn build() -> Option<String> {
    static BUILD: OnceLock<Option<String>> = OnceLock::new();
    let own = || {
        if let Some(library) = LIBRARY.get() {
            return Checksum::of_file(library).ok().map(|sum| sum.to_string());
        }
        // On Linux this leads to the running program even after its file was replaced.
        let linux = Path::new("/proc/self/exe");
        let path = if linux.exists() { linux.to_owned() } else { std::env::current_exe().ok()? };
        Checksum::of_file(&path).ok().map(|sum| sum.to_string())
    };
    BUILD.get_or_init(own).clone()
}

fn front_end(model: &Model) -> Checksum {
    // `Debug` prints every field with every digit.
    Checksum::of(&[format!("{model:?}").as_bytes()])
}

fn scans(dataset: &Dataset) -> Checksum {
    let mut sum = Running::default();
    for pair in dataset.pairs() {
        add_pair(&mut sum, pair, &dataset.beams);
    }
    sum.end()
}

/// Adds a pair. Of a steered sensor, the sensor's own aim stands for all.
fn add_pair(sum: &mut Running, pair: &ScanPair, beams: &Beams) {
    to_rows(&pair.truth).iter().for_each(|number| sum.add(&number.to_bits().to_le_bytes()));
    pair.viewpoints.iter().for_each(|number| sum.add(&number.to_le_bytes()));
    [&pair.first, &pair.second].into_iter().for_each(|scan| add_scan(sum, &scan.to(beams)));
}

fn add_scan(sum: &mut Running, scan: &SceneResponse) {
    scan.beams.iter().for_each(|beam| sum.add(&beam.to_le_bytes()));
    for back in scan.returns.iter().chain(scan.glare.iter().map(|of| &of.light)) {
        sum.add(&back.range_m.to_bits().to_le_bytes());
        sum.add(&back.strength_per_m2.to_bits().to_le_bytes());
    }
    scan.glare.iter().for_each(|of| sum.add(&of.beam.to_le_bytes()));
    for light in &scan.other {
        sum.add(&light.irradiance_w_m2.to_bits().to_le_bytes());
        sum.add(&light.path_m.to_bits().to_le_bytes());
    }
}

/// Checksum of the material libraries of an OBJ, in their order; `None` without any, and for a
/// pipe, which cannot be read twice.
fn materials(scene: &Path, libraries: Libraries) -> Option<Checksum> {
    if !scene.is_file() {
        return None;
    }
    let sums: String = library_files(scene, libraries)
        .iter()
        .map(|path| Checksum::of_file(path).map_or_else(|_| "none".into(), |sum| sum.to_string()))
        .collect();
    (!sums.is_empty()).then(|| Checksum::of(&[sums.as_bytes()]))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use echoloop_frontend::{Glare, Return};

    use super::*;
    use crate::dataset::configured;

    #[test]
    fn glare_changes_the_checksum_of_a_scan() {
        let sum = |glare: Vec<Glare>| {
            let mut sum = Running::default();
            add_scan(&mut sum, &SceneResponse { glare, ..SceneResponse::empty(4) });
            sum.end()
        };
        let light = Return { range_m: 20.0, strength_per_m2: 1e-4 };
        let [none, second, third] =
            [vec![], vec![Glare { beam: 1, light }], vec![Glare { beam: 2, light }]].map(sum);
        assert!(none != second && second != third && none != third);
    }

    #[test]
    fn a_scene_s_file_its_materials_and_the_front_end_each_have_their_checksum() {
        let folder = tempfile::tempdir().unwrap();
        let [obj, mtl] = ["yard.obj", "yard.mtl"].map(|name| folder.path().join(name));
        fs::write(&obj, "mtllib yard.mtl\nv 0 0 0\n").unwrap();
        fs::write(&mtl, "newmtl a\n").unwrap();
        let mut config = RunConfig::default();
        config.scene.source = obj.to_string_lossy().into_owned();
        let empty = Dataset {
            beams: config.scanner.beams(),
            train: Vec::new(),
            test: Vec::new(),
            check: Vec::new(),
            triangles: 0,
        };
        let before = Content::of(&config, &empty);
        fs::write(&mtl, "newmtl b\n").unwrap();
        let other_material = Content::of(&config, &empty);
        assert_eq!(other_material.scene, before.scene);
        assert_ne!(other_material.materials, before.materials);
        fs::write(&obj, "mtllib yard.mtl\nv 0 0 1\n").unwrap();
        assert_ne!(Content::of(&config, &empty).scene, before.scene);
        config.receiver.aperture_mm += 1e-9;
        assert_ne!(Content::of(&config, &empty).front_end, before.front_end);
        config.scene.source = "structured".into();
        let generated = Content::of(&config, &empty);
        assert_eq!((generated.scene, generated.materials), (None, None));
    }

    #[test]
    fn the_checksum_of_scans_covers_those_of_the_check() {
        let pairs = ["data.train_pairs=1", "data.test_pairs=1", "data.check_pairs=1"];
        let config = configured(&[&["scanner.columns=8", "scanner.rows=4"], &pairs[..]].concat());
        let mut found = Dataset::build_with_check(&config, &|_, _| ()).unwrap();
        let before = Content::of(&config, &found).scans;
        found.check[0].first = found.check[0].second.clone();
        assert_ne!(Content::of(&config, &found).scans, before);
    }

    #[test]
    fn the_build_is_the_checksum_of_the_program_s_own_file() {
        let of_file = Checksum::of_file(&std::env::current_exe().unwrap()).unwrap();
        assert_eq!(build(), Some(of_file.to_string()));
    }
}
