//! A desk to try the command at: a folder, a yard to scan, a small configuration.

#![allow(dead_code)] // each test file uses what it needs

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// A folder of its own for each test, with a yard to scan and a small configuration for it.
pub(crate) struct Desk(tempfile::TempDir);

/// What a command said, and how it ended.
pub(crate) struct Said {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

pub(crate) const SMALL: &str = "\
[scene]\nsource = \"yard.obj\"\n[scanner]\ncolumns = 48\nrows = 16\nelevation_deg = 60.0\n\
[data]\ntrain_pairs = 4\ntest_pairs = 3\nbaseline_m = 0.5\n\
[tune]\ngenerations = 3\npopulation = 5\npairs_per_generation = 2\nshortlist = 2\n";

/// A walled yard with sheds: OBJ, metres, z up.
fn yard() -> String {
    let mut text = String::from("# a yard\n");
    let mut corners = 0;
    let mut quad = |points: [[f32; 3]; 4]| {
        points.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
        corners += 4;
        text += &format!("f {} {} {} {}\n", corners - 3, corners - 2, corners - 1, corners);
    };
    quad([[-40., -40., 0.], [40., -40., 0.], [40., 40., 0.], [-40., 40., 0.]]);
    let mut block = |x: f32, y: f32, dx: f32, dy: f32, z: f32| {
        let (u, v) = (x + dx, y + dy);
        quad([[x, y, 0.], [u, y, 0.], [u, y, z], [x, y, z]]);
        quad([[x, v, 0.], [u, v, 0.], [u, v, z], [x, v, z]]);
        quad([[x, y, 0.], [x, v, 0.], [x, v, z], [x, y, z]]);
        quad([[u, y, 0.], [u, v, 0.], [u, v, z], [u, y, z]]);
        quad([[x, y, z], [u, y, z], [u, v, z], [x, v, z]]);
    };
    for side in [-40.0, 39.0] {
        block(side, -40., 1., 80., 7.);
        block(-40., side, 80., 1., 7.);
    }
    for i in 0..12_u16 {
        let (column, row) = (f32::from(i % 4), f32::from(i / 4));
        let skew = f32::from(i * 37 % 11) / 3.0;
        block(-32. + 19. * column + skew, -28. + 22. * row - skew, 2. + skew, 5. - skew, 2. + skew);
    }
    text
}

impl Desk {
    pub(crate) fn new() -> Self {
        let desk = Self(tempfile::tempdir().expect("a folder"));
        desk.write("yard.obj", yard());
        desk.write("small.toml", SMALL);
        desk
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("a file is written");
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn read(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).expect(name)
    }

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_echoloop"));
        command.current_dir(self.0.path()).args(arguments).stdin(Stdio::null());
        command
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Said {
        Said::of(self.command(arguments).output().expect("echoloop starts"))
    }

    /// Runs what must succeed.
    pub(crate) fn succeed(&self, arguments: &[&str]) -> Said {
        let said = self.run(arguments);
        assert_eq!(said.code, Some(0), "{arguments:?}: {}", said.err);
        said
    }

    /// Tunes with the small configuration, and more.
    pub(crate) fn tune(&self, more: &[&str]) -> Said {
        self.succeed(&[&["tune", "-c", "small.toml", "-q"], more].concat())
    }

    /// Every file below the folder with its bytes.
    pub(crate) fn snapshot(&self) -> Vec<(PathBuf, Vec<u8>)> {
        fn walk(folder: &Path, found: &mut Vec<(PathBuf, Vec<u8>)>) {
            for entry in fs::read_dir(folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                if path.is_dir() && !path.is_symlink() {
                    found.push((path.clone(), Vec::new()));
                    walk(&path, found);
                } else {
                    let content = fs::read_link(&path)
                        .map(|to| to.to_string_lossy().into_owned().into_bytes());
                    found.push((
                        path.clone(),
                        content.or_else(|_| fs::read(&path)).expect("readable"),
                    ));
                }
            }
        }
        let mut found = Vec::new();
        walk(self.0.path(), &mut found);
        found.sort();
        found
    }

    /// The command must exit with 2, say all of `parts`, and change nothing on disk.
    pub(crate) fn refuses(&self, arguments: &[&str], parts: &[&str]) {
        let before = self.snapshot();
        let said = self.run(arguments);
        assert_eq!(said.code, Some(2), "{arguments:?}: {}{}", said.out, said.err);
        assert!(
            said.err.lines().any(|line| line.starts_with("error:")),
            "{arguments:?}: {}",
            said.err
        );
        for part in parts {
            assert!(said.err.contains(part), "{arguments:?} does not say {part:?}: {}", said.err);
        }
        assert_eq!(said.out, "", "{arguments:?}: an error is no output");
        let after = self.snapshot();
        let names = |all: &[(PathBuf, Vec<u8>)]| {
            all.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>()
        };
        assert_eq!(names(&after), names(&before), "{arguments:?} leaves something behind");
        assert!(after == before, "{arguments:?} changes a file");
    }
}

impl Said {
    pub(crate) fn of(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Self { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {}", self.out))
    }
}
