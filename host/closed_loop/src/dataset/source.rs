//! `scene.source`: a kind of place, one of the nine towns, a road network, a mesh, or recorded
//! scans.

use std::path::{Path, PathBuf};

use echoloop_files::one_line;
use echoloop_parameters::Refused;
use echoloop_sim::import::{ImportError, load_scene};
use echoloop_sim::scene::{Scene, SceneKind, Town, TownError, build_town, generate, load_town};
use thiserror::Error;

use crate::config::SceneConfig;

/// Reason that there is no scene.
#[derive(Debug, Error)]
pub enum SourceError {
    /// Neither a name nor a file.
    #[error(
        "scene.source = {0:?} is neither structured, semi-structured, unstructured, one of the \
         nine towns ({towns}), the three of a kind (structured-towns) nor a file that exists",
        towns = Town::ALL.map(Town::name).join(", ")
    )]
    Unknown(String),
    /// Recorded scans have no surfaces.
    #[error("scene.source = {0:?} is a folder of recorded scans, which have no surfaces to scan")]
    Recorded(String),
    /// The mesh cannot be used.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The town cannot be built.
    #[error(transparent)]
    Town(#[from] TownError),
    /// A key of `[scene]` is out of bounds.
    #[error(transparent)]
    Config(#[from] Refused),
}

/// Origin of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Place generated from a seed.
    Kind(SceneKind),
    /// One of the nine towns.
    Town(Town),
    /// All three towns of a kind; pairs are shared out among them.
    Towns(SceneKind),
    /// Town built along the roads of an OpenDRIVE file.
    Roads(PathBuf),
    /// Mesh file.
    Mesh(PathBuf),
    /// Folder of recorded scans, without surfaces to scan.
    Recording(PathBuf),
}

impl Source {
    /// Reads `scene.source`: a name, else an existing folder, else a file, which need not exist.
    pub fn of(source: &str) -> Self {
        if let Some(kind) = SceneKind::named(source) {
            return Self::Kind(kind);
        }
        if let Some(town) = Town::named(source) {
            return Self::Town(town);
        }
        if let Some(kind) = source.strip_suffix("-towns").and_then(SceneKind::named) {
            return Self::Towns(kind);
        }
        let path = PathBuf::from(source);
        if path.is_dir() {
            return Self::Recording(path);
        }
        let is_network = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("xodr"));
        if is_network { Self::Roads(path) } else { Self::Mesh(path) }
    }

    /// True of a folder of recorded scans.
    pub fn is_recording(source: &str) -> bool {
        matches!(Self::of(source), Self::Recording(_))
    }

    /// Files that the scene is read from.
    pub fn files(&self) -> Vec<PathBuf> {
        let data = data_folder();
        let of_town = |town: Town| town.file(data.as_deref());
        match self {
            Self::Kind(_) | Self::Recording(_) => Vec::new(),
            Self::Town(town) => of_town(*town).into_iter().collect(),
            Self::Towns(kind) => Town::of_kind(*kind).into_iter().filter_map(of_town).collect(),
            Self::Roads(path) | Self::Mesh(path) => vec![path.clone()],
        }
    }

    /// The first of [`Source::files`].
    pub fn file(&self) -> Option<PathBuf> {
        self.files().into_iter().next()
    }

    /// Seeds among which the pairs are shared out: `towns` for a generated kind, 1 to 3 for the
    /// towns of a kind, else one.
    pub fn seeds(&self, towns: &[u64]) -> Vec<u64> {
        match self {
            Self::Kind(_) => towns.to_vec(),
            Self::Towns(_) => vec![1, 2, 3],
            _ => towns[..towns.len().min(1)].to_vec(),
        }
    }

    /// Makes or loads the scene; `town` is one of [`Source::seeds`].
    pub fn scene(&self, config: &SceneConfig, town: u64) -> Result<Scene, SourceError> {
        match self {
            Self::Kind(kind) => Ok(generate(*kind, town)),
            Self::Town(town) => Ok(build_town(*town, data_folder().as_deref())?),
            Self::Towns(kind) => {
                let [first, second, third] = Town::of_kind(*kind);
                let of_kind = match town {
                    2 => second,
                    3 => third,
                    _ => first,
                };
                Self::Town(of_kind).scene(config, town)
            }
            Self::Roads(path) => Ok(load_town(path, config.dressing()?, town)?),
            Self::Mesh(path) => {
                let looks_like_a_file = path.extension().is_some() || path.exists();
                if !looks_like_a_file {
                    return Err(SourceError::Unknown(one_line(&config.source)));
                }
                Ok(load_scene(path, &config.import()?)?)
            }
            Self::Recording(_) => Err(SourceError::Recorded(one_line(&config.source))),
        }
    }
}

/// Folder of CARLA's road networks, which some of the nine towns need.
fn data_folder() -> Option<PathBuf> {
    std::env::var_os("ECHOLOOP_DATA").map(|folder| Path::new(&folder).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_kind_or_a_town_and_anything_else_a_file() {
        assert_eq!(Source::of("structured"), Source::Kind(SceneKind::Structured));
        assert_eq!(Source::of("rocky-valley"), Source::Town(Town::RockyValley));
        assert_eq!(Source::of("a/Town04.XODR"), Source::Roads("a/Town04.XODR".into()));
        assert_eq!(Source::of("yard.obj"), Source::Mesh("yard.obj".into()));
        assert_eq!(Source::of("structured-towns"), Source::Towns(SceneKind::Structured));
        assert_eq!(Source::of("rocky-valley").files(), Vec::<PathBuf>::new());
        assert_eq!(Source::of("yard.obj").files(), [PathBuf::from("yard.obj")]);
        assert_eq!(Source::of("structured").seeds(&[4, 9]), [4, 9]);
        assert_eq!(Source::of("unstructured-towns").seeds(&[4]), [1, 2, 3]);
        assert_eq!(Source::of("yard.obj").seeds(&[4, 9]), [4]);
    }
}
