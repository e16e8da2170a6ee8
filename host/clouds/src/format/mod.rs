//! The file formats of clouds, one row each: reading, writing, refusals and help follow from it.

mod layout;
mod lzf;
mod pcd;
mod ply;
mod text;
mod vtk;

use std::path::Path;

use echoloop_files::{Column, Coordinates, NumberType};

use crate::Cloud;
use crate::recorded::{Keep, Recorded};

/// A format that clouds are read from.
pub(crate) struct Format {
    /// Extensions of its files, in lower case.
    pub(crate) extensions: &'static [&'static str],
    /// Its name, where that is not its extension; else empty.
    pub(crate) known_as: &'static str,
    /// The cloud in the bytes of a file, or what was expected of them.
    pub(crate) read: fn(&[u8], Keep) -> Result<Recorded, String>,
}

/// Refuses a file whose numbers would take more than 6 times its size plus 48 MB. No measured cloud
/// compresses that well.
pub(crate) fn check_growth(read: u64, file: u64) -> Result<(), String> {
    match read > file.saturating_mul(6).saturating_add(48 << 20) {
        true => Err(format!("expected at most 6 times its size in points, found {read} bytes")),
        false => Ok(()),
    }
}

/// Declares [`CloudFormat`] and the tables of all formats.
macro_rules! formats {
    (
        written { $(
            $(#[$doc:meta])*
            $variant:ident: $name:literal, $summary:literal, keeps_columns: $keeps:literal,
            read: $read:expr, write: $write:expr;
        )+ }
        only read { $( [$($extension:literal),+], $known_as:literal, read: $only_read:expr; )+ }
    ) => {
        /// A format that clouds are written in, always binary and little endian.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum CloudFormat {
            $($(#[$doc])* $variant,)+
        }

        impl CloudFormat {
            /// All formats that are written.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// The name of the format, which is also the extension of its files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)+ }
            }

            /// A line of help.
            #[must_use]
            pub fn summary(self) -> &'static str {
                match self { $(Self::$variant => $summary,)+ }
            }

            /// True when its files have σ_R and the columns, not the points alone.
            #[must_use]
            pub fn keeps_columns(self) -> bool {
                match self { $(Self::$variant => $keeps,)+ }
            }

            fn write(self) -> fn([Column; 3], &Cloud, &[Column]) -> Vec<u8> {
                match self { $(Self::$variant => $write,)+ }
            }
        }

        /// Formats that are read, those that are also written first.
        pub(crate) const READ: &[Format] = &[
            $(Format { extensions: &[$name], known_as: "", read: $read },)+
            $(Format {
                extensions: &[$($extension),+], known_as: $known_as, read: $only_read,
            },)+
        ];
    };
}

// To add a format: its file here, its `mod` above, a row, and its row in the table of README.md.
formats! {
    written {
        /// Stanford polygon format with one element, `vertex`.
        Ply: "ply", "binary PLY, an element `vertex`", keeps_columns: true,
            read: ply::parse, write: |axes, cloud, columns| ply::LAYOUT.bytes(axes, cloud, columns);
        /// Point Cloud Library, version 0.7. Unorganized, because beams without an echo are left
        /// out.
        Pcd: "pcd", "binary PCD 0.7, unorganized", keeps_columns: true,
            read: pcd::parse, write: |axes, cloud, columns| pcd::LAYOUT.bytes(axes, cloud, columns);
    }
    only read {
        ["vtk"], "", read: |bytes, _| vtk::parse(bytes).map(points_alone);
        ["bin"], "KITTI", read: text::parse_kitti;
        ["xyz", "txt", "asc", "csv"], "",
            read: |bytes, _| text::parse_text(bytes).map(points_alone);
    }
}

impl CloudFormat {
    /// The format that a file's extension names, in upper or lower case.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.name()))
    }

    /// The extensions that [`Self::of`] knows, for a message: ".ply or .pcd".
    #[must_use]
    pub fn extensions() -> String {
        alternatives(Self::ALL.iter().map(|format| format!(".{}", format.name())).collect())
    }

    /// A whole file: `x y z` in m, normals and `range_sd` if the cloud has them, and the columns.
    ///
    /// A column whose length is not the cloud's is left out. A name that is not allowed in a
    /// header, or that is taken already, is changed. PLY has no integers of 8 bytes: they become
    /// `double`.
    #[must_use]
    pub fn bytes(self, cloud: &Cloud, columns: &[Column]) -> Vec<u8> {
        let axes = layout::axes(cloud.points.iter().map(|p| p.coords.cast()), NumberType::F32);
        self.write()(axes, cloud, columns)
    }

    /// A whole file as [`Self::bytes`], with coordinates in the frame and of the type of the file
    /// that the cloud came from.
    #[must_use]
    pub fn recorded(self, recorded: &Recorded) -> Vec<u8> {
        match &recorded.exact {
            None => self.bytes(&recorded.cloud, &recorded.columns),
            Some(exact) => {
                let axes = layout::axes(exact.at_m.iter().map(|p| p.coords), exact.written());
                self.write()(axes, &recorded.cloud, &recorded.columns)
            }
        }
    }
}

/// An extension of each format that is read.
pub fn read_formats() -> impl Iterator<Item = &'static str> {
    READ.iter().filter_map(|format| format.extensions.first().copied())
}

/// Extensions of all formats that are read, for a message.
pub fn read_extensions() -> String {
    let named = |format: &Format| {
        let note = match format.known_as {
            "" => String::new(),
            name => format!(" ({name})"),
        };
        format.extensions.iter().map(move |extension| format!(".{extension}{note}"))
    };
    alternatives(READ.iter().flat_map(named).collect())
}

/// "a, b or c".
fn alternatives(mut words: Vec<String>) -> String {
    let last = words.pop().unwrap_or_default();
    if words.is_empty() { last } else { format!("{} or {last}", words.join(", ")) }
}

fn points_alone(points: Coordinates) -> Recorded {
    Recorded::of(points, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_name_every_extension() {
        assert_eq!(CloudFormat::extensions(), ".ply or .pcd");
        let read = ".ply, .pcd, .vtk, .bin (KITTI), .xyz, .txt, .asc or .csv";
        assert_eq!(read_extensions(), read);
    }

    #[test]
    fn the_front_page_lists_every_extension() {
        let page = include_str!("../../README.md");
        for extension in READ.iter().flat_map(|format| format.extensions) {
            assert!(page.contains(&format!("`.{extension}`")), "{extension}");
        }
    }
}
