//! What can be wrong with a file, before anybody knows its name.

use crate::scene::MeshFault;

/// What a reader has to say against a file, before it is named.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    /// It does not follow its format.
    Format(String),
    /// It follows it, yet is no mesh to scan.
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
