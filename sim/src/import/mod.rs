//! Import of meshes: PLY, OBJ, glTF and STL files become scenes.

mod fan;
mod fault;
mod gltf;
mod ground;
mod obj;
mod ply;
mod referenced_files;
mod semantic;
mod stl;

use std::path::{Path, PathBuf};

use echoloop_files::{folder_of, read_data};
use thiserror::Error;

use fault::Fault;

use crate::scene::{MATERIALS, Mesh, MeshFault, Scene, Surface};
pub use ground::Plane;
use referenced_files::ReferencedFiles;
pub use referenced_files::{Libraries, surfaces as library_surfaces};
pub use semantic::{Seen, Tags, parse_semantic};

/// Ground under an imported place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Ground {
    /// A plane fitted to the lowest points of the place, unless it has ground.
    #[default]
    Auto,
    /// No ground is added.
    None,
    /// A given plane.
    Plane(Plane),
}

/// Options of the import.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportOptions {
    /// Ground under the place.
    pub ground: Ground,
    /// Metres per unit of the file.
    pub scale: f32,
    /// True when the file's y axis points up, instead of z. A glTF's does by definition.
    pub y_up: bool,
    /// Surface of faces without one.
    pub default_surface: Surface,
    /// Largest coordinate a place may have, metres.
    pub max_reach_m: f32,
    /// Files that a mesh may open.
    pub libraries: Libraries,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            ground: Ground::Auto,
            scale: 1.0,
            y_up: false,
            default_surface: Surface::Unknown,
            max_reach_m: 5000.0,
            libraries: Libraries::Beside,
        }
    }
}

/// Reason why a file is not a scene.
#[derive(Debug, Error)]
pub enum ImportError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// No format has its extension.
    #[error("{} is not a .ply, .obj, .gltf, .glb or .stl file", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file does not follow its format.
    #[error("{} is not a {format} mesh: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// "PLY", "OBJ", "glTF" or "STL".
        format: &'static str,
        /// The fault: expected, found, and where.
        what: String,
    },
    /// The file follows its format, but its mesh cannot be scanned.
    #[error("{} cannot be scanned: {fault}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// The fault of the mesh.
        fault: MeshFault,
    },
}

/// Reads a PLY or STL (text or binary), OBJ, glTF or GLB file as a scene.
///
/// # Errors
///
/// [`ImportError`], which names the file and what is wrong with it.
pub fn load_scene(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    Format::of(path)?;
    let bytes =
        read_data(path).map_err(|source| ImportError::Unreadable { path: path.into(), source })?;
    parse_scene(path, &bytes, options)
}

/// As [`load_scene`], from the bytes of a file; `path` gives the format and the folder of the
/// libraries.
///
/// # Errors
///
/// As for [`load_scene`].
pub fn parse_scene(
    path: &Path,
    bytes: &[u8],
    options: &ImportOptions,
) -> Result<Scene, ImportError> {
    let kind = Format::of(path)?;
    let mut files = ReferencedFiles::new(folder_of(path), options.libraries);
    let default = options.default_surface;
    let (format, mesh) = match kind {
        Format::Ply => ("PLY", ply::read(bytes, default)),
        Format::Obj => ("OBJ", obj::read(bytes, &mut |names| files.open(names), default)),
        Format::Gltf => ("glTF", gltf::read(bytes, &mut |uri| files.buffer(uri), default)),
        Format::Stl => ("STL", stl::read(bytes, default)),
    };
    let y_up = options.y_up || matches!(kind, Format::Gltf);
    let name = path
        .file_stem()
        .map_or_else(|| "imported".into(), |stem| stem.to_string_lossy().into_owned());
    mesh.and_then(|mesh| finish_scene(mesh, name, y_up, options)).map_err(|fault| match fault {
        Fault::Format(what) => ImportError::Malformed { path: path.into(), format, what },
        Fault::Mesh(fault) => ImportError::Unusable { path: path.into(), fault },
    })
}

/// Paths that [`load_scene`] reads with a mesh, in order: material libraries of an OBJ, buffers of
/// a glTF.
#[must_use]
pub fn library_files(path: &Path, libraries: Libraries) -> Vec<PathBuf> {
    let mut files = ReferencedFiles::new(folder_of(path), libraries);
    match Format::of(path) {
        Ok(Format::Obj) => {
            let bytes = read_data(path).unwrap_or_default();
            let names = obj::libraries(&String::from_utf8_lossy(&bytes)).collect::<Vec<_>>();
            names.iter().flat_map(|names| files.files(names)).collect()
        }
        Ok(Format::Gltf) => {
            let uris = gltf::files(&read_data(path).unwrap_or_default());
            uris.iter().filter_map(|uri| files.buffer_file(uri).ok()).collect()
        }
        _ => Vec::new(),
    }
}

/// Formats that are read.
#[derive(Clone, Copy)]
enum Format {
    Ply,
    Obj,
    Gltf,
    Stl,
}

impl Format {
    fn of(path: &Path) -> Result<Self, ImportError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "ply" => Ok(Self::Ply),
            "obj" => Ok(Self::Obj),
            "gltf" | "glb" => Ok(Self::Gltf),
            "stl" => Ok(Self::Stl),
            _ => Err(ImportError::UnknownFormat { path: path.into() }),
        }
    }
}

/// Scales the mesh to metres with z up, checks it and adds its ground.
fn finish_scene(
    mut mesh: Mesh,
    name: String,
    y_up: bool,
    options: &ImportOptions,
) -> Result<Scene, Fault> {
    for vertex in &mut mesh.vertices {
        let [x, y, z] = vertex.map(|v| v * options.scale);
        *vertex = if y_up { [x, -z, y] } else { [x, y, z] };
    }
    mesh.check(MATERIALS.len(), options.max_reach_m)?;
    let (low, high) = mesh.bounds().ok_or(MeshFault::NoFaces)?;
    let plane = match options.ground {
        Ground::Plane(plane) if !plane.is_ground(options.max_reach_m) => {
            return Err(MeshFault::Ground { plane: [plane.a, plane.b, plane.c] }.into());
        }
        Ground::Plane(plane) => Some(plane),
        Ground::None => None,
        Ground::Auto => (!ground::has_ground(&mesh)).then(|| ground::fit(&mesh)),
    };
    // A single house is seen from outside, a town from its streets.
    let small = (high[0] - low[0]).min(high[1] - low[1]) < 60.0;
    let margin = if plane.is_some() && small { 15.0 } else { 0.0 };
    if let Some(plane) = plane {
        mesh.append(&plane.mesh(low, high));
    }
    let area = ([low[0] - margin, low[1] - margin], [high[0] + margin, high[1] + margin]);
    Ok(Scene::new(name, mesh, area))
}

#[cfg(test)]
mod tests;
