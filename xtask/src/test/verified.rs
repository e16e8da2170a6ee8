//! Record of the sources for which every image was last built, measured and run on its board.
//!
//! An image is decided by its sources, the packages it is built from, their features, its profile
//! and the compiler. While these are as recorded, the test command builds the images of
//! [`ALWAYS`](super::ALWAYS) alone; a difference has it build and run all of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use crc::{CRC_64_XZ, Crc, Digest};
use serde::{Deserialize, Serialize};

/// The record, below the workspace's root.
pub(super) const RECORD: &str = "firmware/verified.toml";

/// Files and folders that decide the images and their measurement, Markdown pages left out.
const SOURCES: [&str; 8] = [
    "firmware",
    "examples/detector_firmware",
    "memory.x",
    ".cargo/config.toml",
    "xtask/src/firmware.rs",
    "xtask/src/image.rs",
    "xtask/src/target.rs",
    "xtask/src/thumb.rs",
];

const CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

/// Inputs that decide every image.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Verified {
    /// Checksum of sources, packages, features and profiles, hexadecimal.
    inputs: String,
    /// Version of the compiler, as "rustc 1.95.0".
    compiler: String,
}

impl Verified {
    /// The state of a workspace.
    ///
    /// # Errors
    ///
    /// When a source cannot be read.
    pub(super) fn now(root: &Path, compiler: &str) -> Result<Self> {
        let mut digest = CRC.digest();
        for source in SOURCES {
            add_sources(&mut digest, root, &root.join(source))?;
        }
        let packages = packages(&read_toml(&root.join("Cargo.lock"))?, &firmware(root)?);
        digest.update(format!("{packages:?}").as_bytes());
        digest.update(settings(&read_toml(&root.join("Cargo.toml"))?, &packages).as_bytes());
        Ok(Self { inputs: format!("{:016x}", digest.finalize()), compiler: compiler.to_owned() })
    }

    /// Reason why the record does not hold for this state; none when it does.
    pub(super) fn differs_from_record(&self, root: &Path) -> Option<String> {
        let text = fs::read_to_string(root.join(RECORD)).unwrap_or_default();
        let Ok(recorded) = toml::from_str::<Self>(&text) else {
            return Some(format!("there is no record {RECORD}"));
        };
        if recorded.compiler != self.compiler {
            let Self { compiler, .. } = self;
            return Some(format!("this is {compiler}, the record's {}", recorded.compiler));
        }
        (recorded != *self).then(|| "sources of the images differ from the record's".to_owned())
    }

    /// Writes the record.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub(super) fn write(&self, root: &Path) -> Result<()> {
        let head = "# State of the sources when every image was last built, measured and run on \
                    its board.\n# Written by `cargo xtask test --all`.\n";
        let path = root.join(RECORD);
        fs::write(&path, format!("{head}{}", toml::to_string(self)?))
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// Adds a file, or every file of a folder in the order of names, each with its path.
fn add_sources(digest: &mut Digest<'_, u64>, root: &Path, path: &Path) -> Result<()> {
    if path.is_dir() {
        let entries = path.read_dir().with_context(|| format!("cannot read {}", path.display()))?;
        let mut paths: Vec<PathBuf> =
            entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
        paths.sort();
        return paths.iter().try_for_each(|path| add_sources(digest, root, path));
    }
    let name = path.strip_prefix(root)?.to_string_lossy().replace('\\', "/");
    if name == RECORD || name.ends_with(".md") {
        return Ok(());
    }
    let content = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    for part in [name.as_bytes(), &content] {
        digest.update(&part.len().to_le_bytes());
        digest.update(part);
    }
    Ok(())
}

fn read_toml(path: &Path) -> Result<toml::Table> {
    let text =
        fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    text.parse().with_context(|| path.display().to_string())
}

/// Names of the packages below `firmware`, and of the example that has images.
fn firmware(root: &Path) -> Result<Vec<String>> {
    let folders = root.join("firmware").read_dir()?.map(|entry| Ok(entry?.path()));
    let mut folders = folders.collect::<Result<Vec<_>>>()?;
    folders.push(root.join("examples/detector_firmware"));
    let manifests = folders.iter().map(|f| f.join("Cargo.toml")).filter(|path| path.is_file());
    manifests
        .map(|path| {
            let name = read_toml(&path)?
                .get("package")
                .and_then(|p| p.get("name")?.as_str().map(str::to_owned));
            name.with_context(|| format!("{} has no name", path.display()))
        })
        .collect()
}

/// Versions and checksums, by name, of the roots and of their dependencies in a lock file.
fn packages(lock: &toml::Table, roots: &[String]) -> BTreeMap<String, BTreeSet<String>> {
    let all = lock.get("package").and_then(toml::Value::as_array).map_or(&[][..], Vec::as_slice);
    let text = |package: &toml::Value, key: &str| {
        package.get(key).and_then(toml::Value::as_str).unwrap_or_default().to_owned()
    };
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut pending: Vec<(String, Option<String>)> =
        roots.iter().map(|name| (name.clone(), None)).collect();
    while let Some((name, version)) = pending.pop() {
        for package in all.iter().filter(|package| text(package, "name") == name) {
            let own = text(package, "version");
            if version.as_ref().is_some_and(|wanted| *wanted != own) {
                continue;
            }
            if found.entry(name.clone()).or_default().insert(own + " " + &text(package, "checksum"))
            {
                let deps = package.get("dependencies").and_then(toml::Value::as_array);
                let deps = deps.into_iter().flatten().filter_map(toml::Value::as_str);
                pending.extend(deps.map(|dep| match dep.split_once(' ') {
                    Some((name, version)) => (name.to_owned(), Some(version.to_owned())),
                    None => (dep.to_owned(), None),
                }));
            }
        }
    }
    found
}

/// Parts of the workspace's manifest that these packages and the images' profile depend on.
fn settings(manifest: &toml::Table, packages: &BTreeMap<String, BTreeSet<String>>) -> String {
    let workspace = manifest.get("workspace");
    let dependencies = workspace.and_then(|w| w.get("dependencies")?.as_table());
    let own = dependencies.into_iter().flatten().filter(|(name, _)| packages.contains_key(*name));
    let own: BTreeMap<_, _> = own.map(|(name, value)| (name, value.to_string())).collect();
    let shared = workspace.and_then(|w| w.get("package"));
    let profile = |name| manifest.get("profile").and_then(|profiles| profiles.get(name));
    let (release, firmware) = (profile("release"), profile("firmware"));
    format!("{own:?}{shared:?}{release:?}{firmware:?}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::workspace;

    const LOCK: &str = r#"
        [[package]]
        name = "image"
        version = "0.1.0"
        dependencies = ["fixed", "syn 2.0.1"]
        [[package]]
        name = "fixed"
        version = "1.31.0"
        checksum = "aa"
        [[package]]
        name = "syn"
        version = "2.0.1"
        [[package]]
        name = "syn"
        version = "3.0.9"
        [[package]]
        name = "clap"
        version = "4.6.0"
        dependencies = ["syn 3.0.9"]
    "#;

    #[test]
    fn packages_of_an_image_are_its_dependency_tree_at_the_locked_versions() {
        let found = packages(&LOCK.parse().unwrap(), &["image".to_owned()]);
        let versions = |name: &str| found[name].iter().cloned().collect::<Vec<_>>();
        assert_eq!(found.keys().collect::<Vec<_>>(), ["fixed", "image", "syn"]);
        assert_eq!(
            (versions("fixed"), versions("syn")),
            (vec!["1.31.0 aa".into()], vec!["2.0.1 ".into()])
        );
    }

    #[test]
    fn settings_of_other_packages_do_not_count_and_features_of_an_images_do() {
        let packages = packages(&LOCK.parse().unwrap(), &["image".to_owned()]);
        let of = |text: &str| settings(&text.parse().unwrap(), &packages);
        let before = of("[workspace.dependencies]\nfixed = \"1\"\nclap = \"4\"");
        assert_eq!(before, of("[workspace.dependencies]\nclap = \"5\"\nfixed = \"1\""));
        assert_ne!(before, of("[workspace.dependencies]\nfixed = { version = \"1\" }"));
        assert_ne!(of("[profile.firmware]\nlto = \"fat\""), of("[profile.firmware]\nlto = true"));
        assert_eq!(of("[profile.dev]\nopt-level = 1"), of("[profile.dev]\nopt-level = 2"));
    }

    /// A workspace with just the sources of the images.
    fn small_workspace() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for source in SOURCES {
            let path = root.join(source);
            let file = if path.extension().is_some() { path } else { path.join("src/lib.rs") };
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "1").unwrap();
        }
        fs::write(root.join("Cargo.lock"), LOCK).unwrap();
        fs::write(root.join("Cargo.toml"), "[workspace]").unwrap();
        folder
    }

    #[test]
    fn a_record_holds_until_a_source_or_the_compiler_changes_and_pages_do_not_count() {
        let folder = small_workspace();
        let root = folder.path();
        let now = |compiler| Verified::now(root, compiler).unwrap();
        assert!(now("rustc 1").differs_from_record(root).unwrap().contains("no record"));
        now("rustc 1").write(root).unwrap();
        assert_eq!(now("rustc 1").differs_from_record(root), None);
        fs::write(root.join("firmware/WIRE.md"), "a page").unwrap();
        assert_eq!(now("rustc 1").differs_from_record(root), None);
        let why = now("rustc 2").differs_from_record(root).unwrap();
        assert_eq!(why, "this is rustc 2, the record's rustc 1");
        for change in ["firmware/src/lib.rs", "memory.x", "firmware/new.rs"] {
            fs::write(root.join(change), "2").unwrap();
            assert!(now("rustc 1").differs_from_record(root).is_some(), "{change}");
            now("rustc 1").write(root).unwrap();
        }
    }

    #[test]
    fn every_source_of_the_images_is_there_and_their_packages_are_found() {
        let root = workspace().unwrap();
        Verified::now(&root, "rustc").unwrap();
        let names = firmware(&root).unwrap();
        let found = packages(&read_toml(&root.join("Cargo.lock")).unwrap(), &names);
        for name in ["echoloop-dsp", "echoloop-image", "echoloop-detector-firmware", "fixed"] {
            assert!(found.contains_key(name), "{name}");
        }
    }
}
