//! No import circle among the files of any crate: whoever opens a file can read what it stands on,
//! and that ends.
//!
//! An arrow goes from a file to every file that defines a name which its code uses, however often
//! the name is re-exported on the way. Declarations of modules and re-exports are no arrows: they
//! say where a thing is found, and use nothing. What a file takes from the module around it does
//! count: what the files of a folder share is a file of its own when that module uses them. Code
//! for tests only does not count. What follows from types alone is not seen: a method called on a
//! value names no file.

mod arrows;
mod module;
mod names;
mod source;
mod uses;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use arrows::{Arrow, circles};
use source::Crate;

/// Arrows that still lie on a circle. May only shrink: one that is gone has to be struck out.
const KNOWN: &[(&str, &str)] = &[];

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text(path: &str) -> Option<String> {
    std::fs::read_to_string(workspace().join(path)).ok()
}

fn manifest(folder: &str) -> toml::Table {
    text(&format!("{folder}/Cargo.toml")).expect("a manifest").parse().expect("TOML")
}

/// Folders of the members of the workspace.
fn members() -> Vec<String> {
    let manifest = manifest(".");
    let members = manifest["workspace"]["members"].as_array().expect("members").iter();
    members.map(|member| member.as_str().expect("a folder").to_owned()).collect()
}

/// The root files of every member of the workspace: its library, its programs, benches, examples
/// and integration tests, by the manifest and where cargo looks for them.
fn roots() -> Vec<String> {
    members().iter().flat_map(|folder| roots_of(folder)).collect()
}

fn roots_of(folder: &str) -> BTreeSet<String> {
    let manifest = manifest(folder);
    let told = ["bin", "bench", "example", "test"].into_iter().flat_map(|kind| {
        let targets = manifest.get(kind).and_then(toml::Value::as_array).into_iter().flatten();
        targets.filter_map(|target| Some(target.get("path")?.as_str()?.to_owned()))
    });
    let usual = ["src/bin", "benches", "examples", "tests"].into_iter().flat_map(|kind| {
        let entries = workspace().join(folder).join(kind).read_dir().into_iter().flatten();
        let names = entries.map(|e| e.expect("an entry").file_name().into_string().expect("UTF-8"));
        let paths = names.map(move |name| format!("{kind}/{name}"));
        paths.map(|path| if path.ends_with(".rs") { path } else { path + "/main.rs" })
    });
    let own = ["src/lib.rs", "src/main.rs"].map(str::to_owned).into_iter();
    let roots = own.chain(told).chain(usual).map(|root| format!("{folder}/{root}"));
    roots.filter(|root| workspace().join(root).is_file()).collect()
}

/// Every crate of ours.
static CRATES: LazyLock<Vec<Crate>> = LazyLock::new(|| {
    roots().iter().map(|root| Crate::read(root, &text).unwrap_or_else(|e| panic!("{e}"))).collect()
});

#[test]
fn no_file_of_a_crate_needs_itself_by_way_of_others() {
    let (mut unknown, mut found) = (Vec::new(), BTreeSet::new());
    for source in CRATES.iter() {
        for Arrow { from, to, names } in circles(source) {
            if !KNOWN.contains(&(&from, &to)) {
                unknown.push(format!("({from:?}, {to:?}), // uses {}", names.join(", ")));
            }
            found.insert((from, to));
        }
    }
    assert!(unknown.is_empty(), "on an import circle:\n  {}", unknown.join("\n  "));
    let is_gone = |(from, to): &&(&str, &str)| !found.contains(&((*from).into(), (*to).into()));
    let gone: Vec<_> = KNOWN.iter().filter(is_gone).collect();
    assert!(gone.is_empty(), "no longer on a circle, strike it out: {gone:#?}");
}

#[test]
fn every_file_of_a_crate_is_read_or_is_for_tests() {
    let read: BTreeSet<&String> = CRATES.iter().flat_map(|source| &source.files).collect();
    assert!(read.len() > 200, "only {}", read.len());
    for folder in members() {
        for file in rust_files(&workspace().join(&folder)) {
            let path =
                file.strip_prefix(workspace()).expect("below").to_string_lossy().into_owned();
            // Modules for tests only, and the build's programs, which are one file each.
            let other = path.ends_with("/tests.rs")
                || path.contains("/src/") && path.contains("/tests/")
                || path.ends_with("/build.rs");
            assert!(other || read.contains(&path), "{path} is not read");
        }
    }
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let entries = folder.read_dir().expect("a folder").map(|entry| entry.expect("an entry").path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let own = files.into_iter().filter(|path| path.extension().is_some_and(|e| e == "rs"));
    own.chain(folders.iter().flat_map(|folder| rust_files(folder))).collect()
}

/// The arrows on circles of a crate that is given as paths and texts, each `from -> to: names`.
fn circles_of(files: &[(&str, &str)]) -> Vec<String> {
    let read = |path: &str| {
        files.iter().find(|(name, _)| *name == path).map(|(_, text)| (*text).to_owned())
    };
    let source = Crate::read("lib.rs", &read).expect("the crate is whole");
    let line = |Arrow { from, to, names }: Arrow| format!("{from} -> {to}: {}", names.join(", "));
    circles(&source).into_iter().map(line).collect()
}

#[test]
fn two_files_that_use_each_other_are_a_circle() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "use crate::b::B; pub struct A(B);"),
        ("b.rs", "pub struct B; fn f(_: super::a::A) {}"),
    ]);
    assert_eq!(found, ["a.rs -> b.rs: B", "b.rs -> a.rs: A"]);
}

#[test]
fn a_circle_of_three_is_found_and_who_only_looks_at_it_is_not_on_it() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b; mod c; mod d;"),
        ("a.rs", "pub fn a() { crate::b::b() }"),
        ("b.rs", "use super::c; pub fn b() { c::c() }"),
        ("c.rs", "pub fn c() { if false { println!(\"{:?}\", crate::a::a()) } }"),
        ("d.rs", "use crate::{a::a, b::b}; fn d() { a(); b() }"),
    ]);
    assert_eq!(found, ["a.rs -> b.rs: b", "b.rs -> c.rs: c", "c.rs -> a.rs: a"]);
}

#[test]
fn a_module_that_uses_what_takes_from_it_is_a_circle() {
    let found = circles_of(&[
        ("lib.rs", "mod stage; pub struct Error;"),
        ("stage/mod.rs", "mod step; pub struct Settings; pub fn run() { step::run(&Settings); }"),
        ("stage/step.rs", "use super::Settings; pub fn run(_: &Settings) -> crate::Error {}"),
    ]);
    let expected =
        ["stage/mod.rs -> stage/step.rs: run", "stage/step.rs -> stage/mod.rs: Settings"];
    assert_eq!(found, expected);
}

#[test]
fn what_files_take_from_a_module_that_only_holds_them_is_no_circle() {
    let found = circles_of(&[
        ("lib.rs", "mod stage; pub struct Error; pub use stage::step::run;"),
        ("stage/mod.rs", "pub mod step; pub struct Settings;"),
        ("stage/step.rs", "use super::Settings; pub fn run(_: &Settings) -> crate::Error {}"),
    ]);
    assert_eq!(found, [""; 0]);
}

#[test]
fn a_circle_that_leaves_the_folder_and_comes_back_to_its_module_is_found() {
    let found = circles_of(&[
        ("lib.rs", "mod stage; mod other;"),
        ("stage/mod.rs", "mod step; pub struct Settings; pub fn run() { step::run(); }"),
        ("stage/step.rs", "pub fn run() { crate::other::run(); }"),
        ("other.rs", "use crate::stage::Settings; pub fn run() -> Settings {}"),
    ]);
    let expected = [
        "stage/mod.rs -> stage/step.rs: run",
        "stage/step.rs -> other.rs: run",
        "other.rs -> stage/mod.rs: Settings",
    ];
    assert_eq!(found, expected);
}

#[test]
fn a_name_is_followed_through_re_exports_renames_and_globs() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b; pub use a::A as First; pub(crate) use b::*;"),
        ("a.rs", "use crate::B; pub struct A(B);"),
        ("b.rs", "pub struct B; fn f(_: crate::First) {}"),
    ]);
    assert_eq!(found, ["a.rs -> b.rs: B", "b.rs -> a.rs: A"]);
}

#[test]
fn what_a_macro_is_given_and_a_variant_count_as_uses() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "use crate::b::Choice; pub const A: bool = matches!(Choice::One, Choice::One);"),
        ("b.rs", "pub enum Choice { One } fn f() { assert!(crate::a::A); }"),
    ]);
    assert_eq!(found, ["a.rs -> b.rs: Choice", "b.rs -> a.rs: A"]);
}

#[test]
fn a_macro_and_a_function_of_one_name_are_two_things() {
    let found = circles_of(&[
        ("lib.rs", "mod a; pub fn write() { a::a() }"),
        ("a.rs", "pub fn a() { write!(x, \"\"); }"),
    ]);
    assert_eq!(found, [""; 0]);
}

#[test]
fn a_file_lies_where_its_path_says() {
    let found = circles_of(&[
        ("lib.rs", "mod a; #[path = \"b/c.rs\"] mod c;"),
        ("a.rs", "pub fn a() { crate::c::c() }"),
        ("b/c.rs", "pub fn c() { crate::a::a() }"),
    ]);
    assert_eq!(found, ["a.rs -> b/c.rs: c", "b/c.rs -> a.rs: a"]);
}

#[test]
fn declared_and_re_exported_modules_are_no_circle() {
    let found = circles_of(&[
        ("lib.rs", "mod a; pub mod b; pub use a::A; pub use b::{B, make as make_b};"),
        ("a.rs", "pub struct A;"),
        ("b.rs", "use crate::A; pub struct B(A); pub fn make() -> B { B(A) }"),
    ]);
    assert_eq!(found, [""; 0]);
}

#[test]
fn code_for_tests_only_is_no_circle() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b; #[cfg(test)] mod absent;"),
        ("a.rs", "pub struct A; #[cfg(test)] mod tests { use crate::b::B; fn f(_: B) {} }"),
        ("b.rs", "use crate::a::A; pub struct B(A); #[cfg(test)] fn f() {}"),
    ]);
    assert_eq!(found, [""; 0]);
}

#[test]
fn a_variable_a_field_or_another_crate_s_name_is_no_use() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b; use a::a;\npub fn lib() { a() }"),
        ("a.rs", "use std::fmt::Debug as B; pub fn a() { let lib = 1; println!(\"{}\", lib); }"),
        ("b.rs", "pub struct B { lib: u8 } fn f(b: &B) -> u8 { assert!(b.lib > 0); b.lib }"),
    ]);
    assert_eq!(found, [""; 0]);
}

#[test]
fn modules_within_a_file_belong_to_the_file() {
    let found = circles_of(&[
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "pub mod inner { use super::super::b::B; pub struct A(B); }"),
        ("b.rs", "pub struct B; fn f(_: crate::a::inner::A) {}"),
    ]);
    assert_eq!(found, ["a.rs -> b.rs: B", "b.rs -> a.rs: A"]);
}
