//! Files that a mesh names: the buffers of a glTF, and the MTL libraries of an OBJ.
//!
//! ```text
//! newmtl Material.012               a material of an OBJ's usemtl
//! map_Kd -bm 1 textures/brick.png   its texture, by whose name the surface is known
//! ```
//!
//! A mesh is untrusted input. By default only regular files below its own folder are opened, so
//! that a mesh neither reads files that its author could not nor blocks on a pipe.

use std::collections::HashSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::scene::Surface;
use echoloop_files::{one_line, read_text};

/// Largest number of material libraries of a mesh.
const MAX_LIBRARIES: usize = 16;
/// Largest number of names on its `mtllib` lines: each is a look-up in the file system.
const MAX_NAMES: usize = 1024;
/// Largest size of all its libraries, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// Files that a mesh may open: the material libraries of an OBJ, where a missing one is no fault,
/// and the buffers of a glTF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Libraries {
    /// Files in the folder of the mesh and below.
    #[default]
    Beside,
    /// Regular files anywhere.
    Anywhere,
    /// No file.
    None,
}

/// Opens the files of one mesh.
pub(super) struct ReferencedFiles<'a> {
    folder: &'a Path,
    which: Libraries,
    requested: HashSet<String>,
    opened: HashSet<PathBuf>,
    bytes: u64,
}

impl<'a> ReferencedFiles<'a> {
    /// Files for a mesh in `folder`.
    pub(super) fn new(folder: &'a Path, which: Libraries) -> Self {
        Self { folder, which, requested: HashSet::new(), opened: HashSet::new(), bytes: 0 }
    }

    /// Surfaces of materials, from the files of an `mtllib` line.
    pub(super) fn open(&mut self, names: &str) -> Result<Vec<(String, Surface)>, String> {
        let mut found = Vec::new();
        for name in self.names(names) {
            if let Some(path) = self.find(name)? {
                found.extend(self.read(&path, name)?);
            }
        }
        Ok(found)
    }

    /// Paths that [`ReferencedFiles::open`] would read.
    pub(super) fn files(&mut self, names: &str) -> Vec<PathBuf> {
        let names = self.names(names);
        names.into_iter().filter_map(|name| self.find(name).ok().flatten()).collect()
    }

    /// Names on an `mtllib` line that may be opened: a single one with blanks, if that file exists,
    /// or several.
    fn names<'n>(&self, names: &'n str) -> Vec<&'n str> {
        if self.which == Libraries::None || names.is_empty() {
            return Vec::new();
        }
        let has_blanks = names.contains(char::is_whitespace);
        match !has_blanks || self.folder.join(names).exists() {
            true => vec![names],
            false => names.split_whitespace().collect(),
        }
    }

    /// True on the first request of a name: some programs repeat it before each object.
    fn is_first_request(&mut self, name: &str) -> Result<bool, String> {
        if self.requested.contains(name) {
            return Ok(false);
        }
        if self.requested.len() == MAX_NAMES {
            return Err(format!(
                "mtllib {:?} is one of more than {MAX_NAMES} names",
                one_line(name)
            ));
        }
        Ok(self.requested.insert(name.to_owned()))
    }

    /// Path of a library that is allowed and not yet read; `None` where there is none.
    fn find(&mut self, name: &str) -> Result<Option<PathBuf>, String> {
        if !self.is_first_request(name)? {
            return Ok(None);
        }
        let Some(path) = self.resolve("mtllib", name)? else { return Ok(None) };
        if self.opened.len() == MAX_LIBRARIES && !self.opened.contains(&path) {
            return Err(format!("mtllib {:?} is one of more than {MAX_LIBRARIES}", one_line(name)));
        }
        Ok(self.opened.insert(path.clone()).then_some(path))
    }

    /// Path of a name, if the file exists and the mesh may open it.
    fn resolve(&self, what: &str, name: &str) -> Result<Option<PathBuf>, String> {
        let outside_folder = || {
            let name = one_line(name);
            Err(format!(
                "{what} {name:?} lies in another folder than the mesh: scene.libraries = \
                 \"anywhere\" reads it, and \"none\" reads no library"
            ))
        };
        let is_below = |part| matches!(part, Component::Normal(_) | Component::CurDir);
        if self.which == Libraries::Beside && !Path::new(name).components().all(is_below) {
            return outside_folder();
        }
        let Ok(path) = fs::canonicalize(self.folder.join(name)) else { return Ok(None) };
        // A link may lead elsewhere too.
        let home = fs::canonicalize(self.folder).unwrap_or_default();
        if self.which == Libraries::Beside && !path.starts_with(home) {
            return outside_folder();
        }
        match fs::metadata(&path).is_ok_and(|found| found.is_file()) {
            true => Ok(Some(path)),
            false => Err(format!("{what} {:?} is not a regular file", one_line(name))),
        }
    }

    /// Bytes of a buffer of a glTF. A missing buffer is an error, because there is no mesh without
    /// it.
    pub(super) fn buffer(&mut self, uri: &str) -> Result<Vec<u8>, String> {
        let path = self.buffer_file(uri)?;
        fs::read(&path).map_err(|error| format!("buffer {:?}: {error}", one_line(uri)))
    }

    /// Path of a buffer of a glTF.
    pub(super) fn buffer_file(&mut self, uri: &str) -> Result<PathBuf, String> {
        let name = one_line(uri);
        if self.which == Libraries::None {
            return Err(format!("buffer {name:?} is not read with scene.libraries = \"none\""));
        }
        let path =
            decoded(uri).ok_or_else(|| format!("buffer {name:?} is not written in UTF-8"))?;
        if path.contains(':') {
            return Err(format!("buffer {name:?} is no file beside the mesh"));
        }
        if self.requested.len() == MAX_NAMES {
            return Err(format!("buffer {name:?} is one of more than {MAX_NAMES}"));
        }
        self.requested.insert(uri.to_owned());
        self.resolve("buffer", &path)?.ok_or_else(|| format!("buffer {name:?} is not there"))
    }

    fn read(&mut self, path: &Path, name: &str) -> Result<Vec<(String, Surface)>, String> {
        let named = |what: &dyn std::fmt::Display| format!("mtllib {:?}: {what}", one_line(name));
        self.bytes += fs::metadata(path).map_err(|error| named(&error))?.len();
        if self.bytes > MAX_BYTES {
            let most = MAX_BYTES >> 20;
            return Err(named(&format_args!("all of the mesh have more than {most} MB")));
        }
        Ok(surfaces(&read_text(path, MAX_BYTES).map_err(|error| named(&error))?))
    }
}

/// First word of a line, and the rest of it.
pub(super) fn keyword(line: &str) -> (&str, &str) {
    let line = line.trim();
    line.split_once(char::is_whitespace).map_or((line, ""), |(word, rest)| (word, rest.trim()))
}

/// Path of a percent-encoded URI: "two%20words.bin".
fn decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut parts = uri.split('%');
    bytes.extend(parts.next()?.bytes());
    for part in parts {
        bytes.push(u8::from_str_radix(part.get(..2)?, 16).ok()?);
        bytes.extend(part[2..].bytes());
    }
    String::from_utf8(bytes).ok()
}

/// Surfaces of the materials of an MTL library, by the last texture of each whose name is known.
#[must_use]
pub fn surfaces(text: &str) -> Vec<(String, Surface)> {
    let mut found: Vec<(String, Surface)> = Vec::new();
    let (mut material, mut has_surface) = ("", false);
    for line in text.lines() {
        let (keyword, rest) = keyword(line);
        match keyword {
            "newmtl" => (material, has_surface) = (rest, false),
            "map_Kd" if !material.is_empty() => {
                let Some(surface) = texture_surface(rest) else { continue };
                // A name may be as long as the file, so it is kept only once.
                match found.last_mut() {
                    Some((_, last)) if has_surface => *last = surface,
                    _ => found.push((material.to_owned(), surface)),
                }
                has_surface = true;
            }
            _ => {}
        }
    }
    found
}

/// Surface by the texture of a `map_Kd` line; the name of the file is its last word.
fn texture_surface(words: &str) -> Option<Surface> {
    Surface::from_loose_name(words.rsplit(['/', '\\']).next().unwrap_or_default())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_texture_names_the_surface_of_a_material_without_a_known_name() {
        let text = "# a\nnewmtl Material.012\n\tKd 0.5\nmap_Kd -bm 1 ..\\tex/red_brick.png\n\
                    newmtl two words\nmap_Kd x.png\nNs\nnewmtl\nmap_Kd glass.png\n";
        assert_eq!(surfaces(text), [("Material.012".to_owned(), Surface::Brick)]);
        assert_eq!(surfaces("map_Kd brick.png\n"), []);
    }

    #[test]
    fn the_last_texture_of_a_material_counts_and_its_name_is_kept_once() {
        let name = "a".repeat(1 << 20);
        let pictures = "map_Kd brick.png\n".repeat(100_000);
        let text = format!("newmtl {name}\n{pictures}map_Kd x.png\nmap_Kd glass.png\nnewmtl b\n");
        assert_eq!(surfaces(&text), [(name, Surface::Glass)]);
    }

    /// A folder with a mesh's folder in it, and libraries in both.
    fn folders() -> tempfile::TempDir {
        let outer = tempfile::tempdir().unwrap();
        fs::create_dir_all(outer.path().join("mesh/below")).unwrap();
        for name in ["out.mtl", "mesh/in.mtl", "mesh/two words.mtl", "mesh/below/deep.mtl"] {
            fs::write(outer.path().join(name), "newmtl a\nmap_Kd brick.png\n").unwrap();
        }
        outer
    }

    /// Reason why the names of an `mtllib` line are refused.
    fn refusal(home: &Path, which: Libraries, names: &str) -> String {
        ReferencedFiles::new(home, which).open(names).unwrap_err()
    }

    #[test]
    fn libraries_below_the_folder_of_the_mesh_are_read_once_and_missing_ones_skipped() {
        let outer = folders();
        let home = outer.path().join("mesh");
        let files =
            ReferencedFiles::new(&home, Libraries::Beside).files("in.mtl lost.mtl below/deep.mtl");
        let paths =
            ["in.mtl", "below/deep.mtl"].map(|name| home.join(name).canonicalize().unwrap());
        assert_eq!(files, paths);
        assert!(ReferencedFiles::new(&home, Libraries::None).files("in.mtl").is_empty());
        let mut files = ReferencedFiles::new(&home, Libraries::Beside);
        let known = [("a".to_owned(), Surface::Brick)];
        for name in ["in.mtl", "two words.mtl", "lost.mtl ./below/deep.mtl"] {
            assert_eq!(files.open(name).unwrap(), known, "{name}");
        }
        assert_eq!(files.open("in.mtl lost.mtl").unwrap(), []);
        assert_eq!(files.open("").unwrap(), []);
    }

    #[test]
    fn a_library_of_another_folder_is_read_only_when_asked_for() {
        let outer = folders();
        let home = outer.path().join("mesh");
        let absolute = outer.path().join("out.mtl").display().to_string();
        #[cfg(unix)]
        std::os::unix::fs::symlink("../out.mtl", home.join("link.mtl")).unwrap();
        for name in ["../out.mtl", "below/../../out.mtl", &absolute, "link.mtl", "/dev/zero"] {
            let message = refusal(&home, Libraries::Beside, name);
            assert!(message.contains("another folder"), "{name}: {message}");
            assert_eq!(ReferencedFiles::new(&home, Libraries::None).open(name).unwrap(), []);
        }
        for name in ["../out.mtl", &absolute, "link.mtl"] {
            let found = ReferencedFiles::new(&home, Libraries::Anywhere).open(name).unwrap();
            assert_eq!(found, [("a".to_owned(), Surface::Brick)], "{name}");
        }
    }

    #[test]
    fn a_buffer_is_a_file_below_the_folder_of_the_mesh_and_must_exist() {
        let outer = folders();
        let home = outer.path().join("mesh");
        fs::write(home.join("a b.bin"), "12").unwrap();
        let open = |which, uri: &str| ReferencedFiles::new(&home, which).buffer(uri);
        assert_eq!(open(Libraries::Beside, "a%20b.bin"), Ok(b"12".to_vec()));
        assert_eq!(open(Libraries::Anywhere, "below/../a b.bin"), Ok(b"12".to_vec()));
        let table = [
            ("lost.bin", "is not there"),
            ("../out.mtl", "another folder"),
            ("%2e%2e/out.mtl", "another folder"),
            ("/etc/passwd", "another folder"),
            ("http://example.org/a.bin", "no file beside"),
            ("file:///etc/passwd", "no file beside"),
            ("below", "not a regular file"),
            ("a%zz", "not written in UTF-8"),
            ("a%2", "not written in UTF-8"),
        ];
        for (uri, expected) in table {
            let message = open(Libraries::Beside, uri).unwrap_err();
            assert!(message.contains(expected), "{uri}: {message}");
        }
        assert!(open(Libraries::None, "a%20b.bin").unwrap_err().contains("\"none\""));
    }

    #[cfg(unix)]
    #[test]
    fn only_regular_files_are_opened() {
        let outer = folders();
        let home = outer.path().join("mesh");
        let made = std::process::Command::new("mkfifo").arg(home.join("pipe.mtl")).status();
        assert!(made.is_ok_and(|made| made.success()));
        for (which, name) in [
            (Libraries::Anywhere, "/dev/zero"),
            (Libraries::Beside, "pipe.mtl"),
            (Libraries::Beside, "below"),
        ] {
            let message = refusal(&home, which, name);
            assert!(message.contains("not a regular file"), "{message}");
        }
    }

    #[test]
    fn libraries_are_bounded_in_number_and_size() {
        let home = tempfile::tempdir().unwrap();
        let mut names = String::new();
        for i in 0..50 {
            fs::write(home.path().join(format!("{i}.mtl")), "").unwrap();
            names += &format!("{i}.mtl ");
        }
        let home = home.path();
        let message = refusal(home, Libraries::Beside, &names);
        assert_eq!(message, "mtllib \"16.mtl\" is one of more than 16");
        let big = fs::File::create(home.join("big.mtl")).unwrap();
        big.set_len(MAX_BYTES + 1).unwrap();
        let message = refusal(home, Libraries::Beside, "big.mtl");
        assert!(message.contains("more than 16 MB"), "{message}");
        let absent: Vec<String> = (0..=MAX_NAMES).map(|i| format!("x{i}.mtl")).collect();
        let message = refusal(home, Libraries::Beside, &absent.join(" "));
        assert_eq!(message, "mtllib \"x1024.mtl\" is one of more than 1024 names");
        let again = "x.mtl ".repeat(MAX_NAMES + 1);
        assert_eq!(ReferencedFiles::new(home, Libraries::Beside).open(&again), Ok(Vec::new()));
    }
}
