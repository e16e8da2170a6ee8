//! Architecture, checked in the built crates: allowed dependencies, and no `std` below the sensor.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Each crate of ours, its folder, and those of ours that it may name in its dependencies.
const ALLOWED: [(&str, &str, &[&str]); 36] = [
    ("echoloop-dsp", "firmware/dsp", &[]),
    ("echoloop-dispatch", "host/dispatch", &[]),
    ("echoloop-random", "host/random", &["echoloop-dispatch"]),
    ("echoloop-files", "host/files", &[]),
    ("echoloop-parameters", "host/parameters", &[]),
    ("echoloop-needs", "tests/needs", &[]),
    ("echoloop-campaign", "host/campaign", &[]),
    ("echoloop-clouds", "host/clouds", &["echoloop-files", "echoloop-needs"]),
    (
        "echoloop-kernels",
        "firmware/kernels",
        &["echoloop-dispatch", "echoloop-dsp", "echoloop-needs"],
    ),
    ("echoloop-link", "firmware/link", &["echoloop-dsp"]),
    ("echoloop-sensor", "firmware/sensor", &["echoloop-dsp", "echoloop-link"]),
    ("echoloop-restarts", "firmware/restarts", &[]),
    ("echoloop-image", "firmware/image", IMAGE),
    (
        "echoloop-part",
        "firmware/part",
        &["echoloop-dsp", "echoloop-kernels", "echoloop-link", "echoloop-sensor"],
    ),
    ("echoloop-stm32f4", "firmware/stm32f4", PART),
    ("echoloop-nrf52840", "firmware/nrf52840", PART),
    (
        "echoloop-registration",
        "host/registration",
        &["echoloop-clouds", "echoloop-dispatch", "echoloop-needs", "echoloop-parameters"],
    ),
    (
        "echoloop-frontend",
        "host/frontend",
        &["echoloop-dispatch", "echoloop-parameters", "echoloop-random"],
    ),
    ("echoloop-cmaes", "host/cmaes", &["echoloop-random"]),
    (
        "echoloop-sim",
        "sim",
        &[
            "echoloop-dispatch",
            "echoloop-dsp",
            "echoloop-files",
            "echoloop-frontend",
            "echoloop-needs",
            "echoloop-random",
        ],
    ),
    (
        "echoloop-sensors",
        "host/sensors",
        &[
            "echoloop-dsp",
            "echoloop-files",
            "echoloop-frontend",
            "echoloop-kernels",
            "echoloop-link",
            "echoloop-parameters",
            "echoloop-sensor",
            "echoloop-sim",
        ],
    ),
    ("echoloop-statistics", "host/statistics", &["echoloop-random"]),
    (
        "echoloop-instruments",
        "host/instruments",
        &["echoloop-dsp", "echoloop-files", "echoloop-random"],
    ),
    (
        "echoloop-closed-loop",
        "host/closed_loop",
        &[
            "echoloop-clouds",
            "echoloop-cmaes",
            "echoloop-dsp",
            "echoloop-files",
            "echoloop-frontend",
            "echoloop-link",
            "echoloop-needs",
            "echoloop-parameters",
            "echoloop-random",
            "echoloop-registration",
            "echoloop-sensors",
            "echoloop-sim",
            "echoloop-statistics",
        ],
    ),
    (
        "echoloop-report",
        "host/report",
        &[
            "echoloop-closed-loop",
            "echoloop-clouds",
            "echoloop-files",
            "echoloop-random",
            "echoloop-registration",
            "echoloop-sim",
            "echoloop-statistics",
        ],
    ),
    (
        "echoloop-folders",
        "host/folders",
        &["echoloop-clouds", "echoloop-files", "echoloop-registration"],
    ),
    (
        "echoloop-python",
        "host/python",
        &[
            "echoloop-closed-loop",
            "echoloop-clouds",
            "echoloop-dsp",
            "echoloop-instruments",
            "echoloop-kernels",
            "echoloop-parameters",
            "echoloop-registration",
            "echoloop-sensors",
        ],
    ),
    (
        "echoloop-study",
        "host/study",
        &[
            "echoloop-campaign",
            "echoloop-closed-loop",
            "echoloop-clouds",
            "echoloop-cmaes",
            "echoloop-files",
            "echoloop-random",
            "echoloop-registration",
            "echoloop-report",
            "echoloop-statistics",
        ],
    ),
    ("echoloop-app", "host/app", LIBRARIES),
    ("echoloop-tests", "tests", PROGRAM),
    ("echoloop-benches", "benches", PROGRAM),
    ("echoloop-examples", "examples", PROGRAM),
    (
        "echoloop-own-firmware",
        "examples/own_firmware",
        &[
            "echoloop-dsp",
            "echoloop-kernels",
            "echoloop-link",
            "echoloop-sensor",
            "echoloop-sensors",
        ],
    ),
    (
        "echoloop-detector-firmware",
        "examples/detector_firmware",
        &["echoloop-dsp", "echoloop-kernels"],
    ),
    ("echoloop-fuzz", "fuzz", &["echoloop-tests"]),
    ("xtask", "xtask", &["echoloop-campaign", "echoloop-statistics"]),
];

/// Crates of an image.
const IMAGE: &[&str] =
    &["echoloop-dsp", "echoloop-kernels", "echoloop-link", "echoloop-restarts", "echoloop-sensor"];

/// Crates of an image for a part on sale, and of its tests.
const PART: &[&str] = &["echoloop-dsp", "echoloop-part", "echoloop-restarts", "echoloop-sensor"];

/// Crates of the program, and of its tests.
const LIBRARIES: &[&str] = &[
    "echoloop-campaign",
    "echoloop-closed-loop",
    "echoloop-clouds",
    "echoloop-cmaes",
    "echoloop-dispatch",
    "echoloop-dsp",
    "echoloop-files",
    "echoloop-folders",
    "echoloop-frontend",
    "echoloop-instruments",
    "echoloop-kernels",
    "echoloop-link",
    "echoloop-needs",
    "echoloop-parameters",
    "echoloop-random",
    "echoloop-registration",
    "echoloop-report",
    "echoloop-sensor",
    "echoloop-sensors",
    "echoloop-sim",
    "echoloop-statistics",
    "echoloop-study",
];

/// The same and the program's own library.
const PROGRAM: &[&str] = &[
    "echoloop-app",
    "echoloop-campaign",
    "echoloop-closed-loop",
    "echoloop-clouds",
    "echoloop-cmaes",
    "echoloop-dispatch",
    "echoloop-dsp",
    "echoloop-files",
    "echoloop-folders",
    "echoloop-frontend",
    "echoloop-instruments",
    "echoloop-kernels",
    "echoloop-link",
    "echoloop-needs",
    "echoloop-parameters",
    "echoloop-random",
    "echoloop-registration",
    "echoloop-report",
    "echoloop-sensor",
    "echoloop-sensors",
    "echoloop-sim",
    "echoloop-statistics",
    "echoloop-study",
];

/// The crates that run on a microcontroller.
const NO_STD: [&str; 9] = [
    "echoloop-dsp",
    "echoloop-kernels",
    "echoloop-link",
    "echoloop-sensor",
    "echoloop-restarts",
    "echoloop-image",
    "echoloop-part",
    "echoloop-stm32f4",
    "echoloop-nrf52840",
];

/// Processors with images, one of each kind: what is built for them is looked at.
const BOARDS: [&str; 2] = ["thumbv7em-none-eabihf", "riscv32imac-unknown-none-elf"];

/// Crates of which another dependency brings an older version too, and which one that is.
const BROUGHT_TWICE: [(&str, &str); 5] = [
    ("thiserror", "pcd-rs"),
    ("criterion", "rdst"),
    ("embedded-hal", "cortex-m"),
    ("embedded-io", "stm32f4xx-hal"),
    ("heapless", "usb-device"),
];

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Packages that are built into a crate, itself included, one line `name vX.Y.Z|feature,feature`
/// each, for this machine or for a target. Procedural macros run at build time only and do not
/// count.
fn built_into(package: &str, target: Option<&str>) -> BTreeSet<String> {
    built_with(package, target, &[])
}

/// [`built_into`], with flags that choose features.
fn built_with(package: &str, target: Option<&str>, features: &[&str]) -> BTreeSet<String> {
    let target = target.map(|triple| ["--target", triple]);
    let output = Command::new(env!("CARGO"))
        .current_dir(workspace())
        .args([
            "tree",
            "--offline",
            "--locked",
            "--package",
            package,
            "--edges",
            "normal,no-proc-macro",
        ])
        .args(target.iter().flatten())
        .args(features)
        .args(["--prefix", "none", "--no-dedupe", "--format", "{p}|{f}"])
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("cargo writes UTF-8");
    text.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

fn name(line: &str) -> &str {
    line.split(' ').next().unwrap_or_default()
}

fn table(path: &str) -> toml::Table {
    let text = std::fs::read_to_string(workspace().join(path)).expect("the workspace has it");
    text.parse().expect("TOML")
}

/// Every section of dependencies of a manifest: of all targets, and of one.
fn dependencies(manifest: &toml::Table) -> Vec<(String, &toml::Table)> {
    const SECTIONS: [&str; 3] = ["dependencies", "dev-dependencies", "build-dependencies"];
    let of_all = SECTIONS.map(|section| (section.to_owned(), manifest.get(section)));
    let targets = manifest.get("target").and_then(toml::Value::as_table).into_iter().flatten();
    let of_one = targets.flat_map(|(target, sections)| {
        SECTIONS.map(|section| (format!("target.{target}.{section}"), sections.get(section)))
    });
    let found = of_all.into_iter().chain(of_one);
    found.filter_map(|(section, entries)| Some((section, entries?.as_table()?))).collect()
}

#[test]
fn every_crate_names_only_those_it_may() {
    for (package, folder, allowed) in ALLOWED {
        let manifest = table(&format!("{folder}/Cargo.toml"));
        assert_eq!(manifest["package"]["name"].as_str(), Some(package), "{folder}");
        for (section, entries) in dependencies(&manifest) {
            let wrong = entries
                .keys()
                .find(|key| key.starts_with("echoloop-") && !allowed.contains(&key.as_str()));
            assert_eq!(wrong, None, "{package} may not have it in [{section}]");
        }
    }
}

#[test]
fn dependencies_for_one_target_count() {
    let kernels = table("firmware/kernels/Cargo.toml");
    let x86 = r#"target.cfg(target_arch = "x86_64").dependencies"#;
    let found = dependencies(&kernels).into_iter().find(|(section, _)| section == x86);
    let (_, entries) = found.expect("the dispatch is for x86-64 only");
    assert!(entries.contains_key("echoloop-dispatch"));
}

#[test]
fn every_member_of_the_workspace_is_in_the_table() {
    let manifest = table("Cargo.toml");
    let members = manifest["workspace"]["members"].as_array().expect("members");
    let members: BTreeSet<&str> = members.iter().filter_map(toml::Value::as_str).collect();
    assert_eq!(members, ALLOWED.iter().map(|(_, folder, _)| *folder).collect());
}

/// Crates that others may take by themselves.
const FOR_OTHERS: [&str; 6] = [
    "firmware/dsp",
    "firmware/link",
    "host/clouds",
    "host/registration",
    "host/cmaes",
    "host/frontend",
];

#[test]
fn crates_for_others_say_what_crates_io_asks_for_and_their_readme_compiles() {
    for folder in FOR_OTHERS {
        let manifest = table(&format!("{folder}/Cargo.toml"));
        let package = manifest["package"].as_table().expect("a package");
        for key in ["description", "license", "rust-version", "readme"] {
            assert!(package.contains_key(key), "{folder} has no {key}");
        }
        let words = |key: &str| package[key].as_array().map_or(0, Vec::len);
        assert!((1..=5).contains(&words("keywords")), "{folder}");
        assert!((1..=5).contains(&words("categories")), "{folder}");
        for keyword in package["keywords"].as_array().into_iter().flatten() {
            let text = keyword.as_str().unwrap_or_default();
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
            assert!(text.len() <= 20 && text.chars().all(is_plain), "{folder}: {text}");
        }
        let read = |name: &str| std::fs::read_to_string(workspace().join(folder).join(name));
        assert!(read("README.md").expect("a readme").contains("```rust"), "{folder}");
        assert!(read("src/lib.rs").expect("a library").contains("../README.md"), "{folder}");
    }
}

#[test]
fn the_libraries_bring_neither_the_program_nor_its_command_line() {
    for package in
        ["echoloop-clouds", "echoloop-registration", "echoloop-cmaes", "echoloop-frontend"]
    {
        let unwanted =
            ["clap", "indicatif", "echoloop-dsp", "echoloop-link", "echoloop-sim", "echoloop-app"];
        let built = built_into(package, None);
        let found = built.iter().map(|line| name(line)).find(|name| unwanted.contains(name));
        assert_eq!(found, None, "{package} is built with it");
    }
}

#[test]
fn test_helpers_are_built_into_no_crate_but_the_tests() {
    for (package, folder, _) in ALLOWED.iter().filter(|(_, f, _)| !["tests", "fuzz"].contains(f)) {
        let built = built_into(package, None);
        let needs = built.iter().filter(|line| name(line) == "echoloop-needs").count();
        assert_eq!(needs, usize::from(*folder == "tests/needs"), "{package}");
    }
}

#[test]
fn the_firmware_is_built_without_std_and_without_an_allocator() {
    for (package, target) in NO_STD.iter().flat_map(|p| BOARDS.map(|target| (p, target))) {
        for line in built_into(package, Some(target)) {
            let (crate_name, features) = line.split_once('|').expect("as formatted");
            let wrong =
                features.split(',').find(|f| ["std", "alloc", "use-std", "use_std"].contains(f));
            assert_eq!(wrong, None, "{package} builds {crate_name} with it for {target}");
        }
    }
}

#[test]
fn every_crate_of_an_image_lies_below_firmware() {
    for (package, target) in NO_STD.iter().flat_map(|p| BOARDS.map(|target| (p, target))) {
        let built = built_into(package, Some(target));
        let ours: Vec<&str> =
            built.iter().map(|line| name(line)).filter(|n| n.starts_with("echoloop-")).collect();
        let elsewhere = ours.iter().find(|name| !NO_STD.contains(name));
        assert_eq!(elsewhere, None, "{package} is built with it for {target}");
        assert!(ours.contains(package));
    }
    for (package, folder, _) in ALLOWED {
        assert_eq!(NO_STD.contains(&package), folder.starts_with("firmware/"), "{package}");
    }
}

#[test]
fn the_detector_alone_brings_neither_nalgebra_nor_serde_nor_postcard() {
    let unwanted = |line: &&String| {
        ["nalgebra", "serde", "postcard"].iter().any(|part| name(line).starts_with(part))
    };
    for target in BOARDS.map(Some).into_iter().chain([None]) {
        for package in ["echoloop-dsp", "echoloop-kernels", "echoloop-detector-firmware"] {
            let built = built_with(package, target, &["--no-default-features"]);
            assert_eq!(built.iter().find(unwanted), None, "{package} for {target:?}");
            assert!(built.iter().any(|line| name(line) == "echoloop-dsp"), "{package}");
        }
        let whole = built_into("echoloop-dsp", target);
        assert!(whole.iter().filter(unwanted).count() >= 3, "{whole:?}");
    }
}

#[test]
fn every_firmware_crate_says_no_std() {
    for package in NO_STD {
        let folder = package.replace("echoloop-", "firmware/");
        let source = workspace().join(folder).join("src/lib.rs");
        let text = std::fs::read_to_string(&source).expect("a library");
        assert!(
            text.lines().any(|line| line.starts_with("#![") && line.contains("no_std")),
            "{package}"
        );
        assert!(!text.contains("extern crate alloc"), "{package}");
    }
}

#[test]
fn every_dependency_is_locked_in_one_version() {
    let lock = table("Cargo.lock");
    let packages = lock["package"].as_array().expect("packages");
    let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in packages {
        let text = |key: &str| package[key].as_str().expect("a string");
        versions.entry(text("name")).or_default().push(text("version"));
    }
    let manifest = table("Cargo.toml");
    let direct = manifest["workspace"]["dependencies"].as_table().expect("dependencies");
    for dependency in direct.keys() {
        let found = versions.get(dependency.as_str()).map_or(0, Vec::len);
        let brought = BROUGHT_TWICE.iter().any(|(twice, _)| twice == dependency);
        assert_eq!(
            found,
            1 + usize::from(brought),
            "{dependency}: {:?}",
            versions.get(dependency.as_str())
        );
    }
    for (twice, by) in BROUGHT_TWICE {
        let package = packages.iter().find(|p| p["name"].as_str() == Some(by)).expect(by);
        let uses =
            package["dependencies"].as_array().expect(by).iter().filter_map(toml::Value::as_str);
        assert!(
            uses.into_iter().any(|used| name(used) == twice),
            "{by} does not bring {twice} any more"
        );
    }
}

#[test]
fn every_crate_takes_its_dependencies_from_the_workspace() {
    for (_, folder, _) in ALLOWED {
        let manifest = table(&format!("{folder}/Cargo.toml"));
        for (dependency, how) in dependencies(&manifest).into_iter().flat_map(|(_, all)| all) {
            let shared = how.get("workspace").and_then(toml::Value::as_bool);
            assert_eq!(shared, Some(true), "{folder}: {dependency} has a version of its own");
        }
    }
}

/// The crates that a cell of the page's table names: short names, or "all libraries and …".
fn names_of(cell: &str) -> BTreeSet<String> {
    let libraries = LIBRARIES.iter().map(|name| (*name).to_owned());
    match cell.trim() {
        "" => BTreeSet::new(),
        "all libraries" => libraries.collect(),
        "all libraries and `echoloop-app`" => {
            libraries.chain(["echoloop-app".to_owned()]).collect()
        }
        names => names.split(", ").map(|name| format!("echoloop-{name}")).collect(),
    }
}

#[test]
fn the_page_on_the_architecture_has_the_same_table() {
    let page = std::fs::read_to_string(workspace().join("docs/architecture.md")).expect("a page");
    let rows = page.lines().filter_map(|line| {
        let cells: Vec<&str> = line.strip_prefix("| `")?.strip_suffix('|')?.split('|').collect();
        let [name, folder, names] = cells[..] else { return None };
        let folder = folder.trim().trim_matches('`').to_owned();
        Some((name.trim().trim_end_matches('`').to_owned(), (folder, names_of(names))))
    });
    let declared: BTreeMap<String, (String, BTreeSet<String>)> = rows.collect();
    for (package, folder, allowed) in ALLOWED {
        let allowed = allowed.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(declared.get(package), Some(&(folder.to_owned(), allowed)), "{package}");
    }
    assert_eq!(declared.len(), ALLOWED.len());
}

/// Sections of a manifest that name dependencies, by their path, each with its table.
fn dependencies_of(manifest: &toml::Table) -> BTreeMap<String, toml::Table> {
    let mut sections = BTreeMap::new();
    for (name, value) in manifest {
        let Some(table) = value.as_table() else { continue };
        if name.ends_with("dependencies") {
            sections.insert(name.clone(), table.clone());
        } else if name == "target" {
            for (target, of_target) in table {
                let of_target = of_target.as_table().expect("a table");
                let own = dependencies_of(of_target).into_iter();
                sections.extend(own.map(|(section, own)| (format!("{target} {section}"), own)));
            }
        }
    }
    sections
}

#[test]
fn the_manifest_of_a_copied_firmware_has_what_the_example_is_built_with() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let read = |path: &str| -> toml::Table {
        let text = std::fs::read_to_string(root.join(path)).expect(path);
        text.parse().unwrap_or_else(|error| panic!("{path}: {error}"))
    };
    let workspace = read("Cargo.toml")["workspace"]["dependencies"].clone();
    for example in ["own_firmware", "detector_firmware"] {
        let of = |file: &str| dependencies_of(&read(&format!("examples/{example}/{file}")));
        let (own, copied) = (of("Cargo.toml"), of("copied.toml"));
        let names = |all: &BTreeMap<String, toml::Table>| -> BTreeSet<(String, String)> {
            let each = all.iter().flat_map(|(section, own)| own.keys().map(move |k| (section, k)));
            each.map(|(section, name)| (section.clone(), name.clone())).collect()
        };
        assert!(names(&own).len() >= 4, "{example}: {own:?}");
        assert_eq!(names(&own), names(&copied), "examples/{example}/copied.toml");
        for (name, copied) in copied.values().flatten() {
            let here = &workspace[name];
            match copied.get("path").and_then(toml::Value::as_str) {
                Some(path) => {
                    let here = here["path"].as_str().expect("a path");
                    assert_eq!(path, format!("../echoloop/{here}"), "{example}: {name}");
                }
                None => {
                    let version = copied.as_str().expect("a version");
                    let here = here.get("version").unwrap_or(here).as_str().expect("a version");
                    assert!(here.starts_with(version), "{example}: {name} {version}, {here} here");
                }
            }
        }
    }
}
