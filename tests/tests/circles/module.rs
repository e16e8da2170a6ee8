//! One module: what it defines, imports and uses.

use std::collections::{BTreeMap, BTreeSet};

/// A path in the code, from its first segment on: `["crate", "pose", "Pose"]`.
pub(crate) type Path = Vec<String>;

/// What a name stands for where a module defines it.
#[derive(Clone, Debug)]
pub(crate) enum Definition {
    /// A function, a type, a constant, a trait, a macro.
    Item,
    /// A module, by its index.
    Module(usize),
    /// Another name, of this crate or not.
    Import(Path),
}

/// One module: a file, or a part of one.
#[derive(Debug, Default)]
pub(crate) struct Module {
    /// Index of its file.
    pub(crate) file: usize,
    /// Index of the module around it; none around the crate's root.
    pub(crate) parent: Option<usize>,
    /// Every name it defines. One name may be a module, a function and a type at once.
    pub(crate) defined: BTreeMap<String, Vec<Definition>>,
    /// Paths of which everything is imported.
    pub(crate) globs: Vec<Path>,
    /// Paths that its code uses.
    pub(crate) uses: Vec<Path>,
    /// Macros that it defines: a function of that name is another thing.
    pub(crate) own_macros: BTreeSet<String>,
    /// Macros that its code calls.
    pub(crate) macros: Vec<Path>,
}

impl Module {
    /// Adds what a name stands for.
    pub(crate) fn define(&mut self, name: &impl ToString, definition: Definition) {
        self.defined.entry(name.to_string()).or_default().push(definition);
    }
}
