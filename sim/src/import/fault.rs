//! Faults of a mesh file, found before its name is known.

use crate::scene::MeshFault;

/// Fault of a mesh file; the caller adds its name.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    /// The file does not follow its format.
    Format(String),
    /// The file follows its format, but the mesh cannot be scanned.
    Mesh(MeshFault),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Self::Format(what)
    }
}

impl From<MeshFault> for Fault {
    fn from(fault: MeshFault) -> Self {
        Self::Mesh(fault)
    }
}
