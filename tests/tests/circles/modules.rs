//! A crate's modules, read from its files: what each defines, imports and uses.

use std::collections::BTreeMap;

use syn::{Attribute, Item, ItemMod};

use crate::uses;

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
    /// Macros that its code calls.
    pub(crate) macros: Vec<Path>,
}

/// A crate: its files and its modules, the root first.
#[derive(Debug, Default)]
pub(crate) struct Crate {
    /// Paths of the files, as they were asked for.
    pub(crate) files: Vec<String>,
    /// Every module that is not for tests only.
    pub(crate) modules: Vec<Module>,
}

impl Crate {
    /// Reads a crate from its root file on; `read` has the text of a file, if there is one.
    ///
    /// # Errors
    ///
    /// Names the file that is missing or is no Rust.
    pub(crate) fn read(root: &str, read: &dyn Fn(&str) -> Option<String>) -> Result<Self, String> {
        let mut source = Self::default();
        source.add_file(root, folder(root).to_owned(), None, read)?;
        Ok(source)
    }

    /// Adds a file as a module whose children lie in a folder.
    fn add_file(
        &mut self,
        path: &str,
        children: String,
        parent: Option<usize>,
        read: &dyn Fn(&str) -> Option<String>,
    ) -> Result<usize, String> {
        let text = read(path).ok_or_else(|| format!("there is no {path}"))?;
        let parsed = syn::parse_file(&text).map_err(|error| format!("{path}: {error}"))?;
        self.files.push(path.to_owned());
        self.add_module(self.files.len() - 1, &parsed.items, children, parent, read)
    }

    fn add_module(
        &mut self,
        file: usize,
        items: &[Item],
        children: String,
        parent: Option<usize>,
        read: &dyn Fn(&str) -> Option<String>,
    ) -> Result<usize, String> {
        let index = self.modules.len();
        self.modules.push(Module { file, parent, ..Module::default() });
        for item in items.iter().filter(|item| !is_for_tests(uses::attributes(item))) {
            if let Item::Mod(child) = item {
                let at = self.add_child(index, child, &children, read)?;
                self.modules[index].define(&child.ident, Definition::Module(at));
            } else {
                uses::collect(item, &mut self.modules[index]);
            }
        }
        Ok(index)
    }

    fn add_child(
        &mut self,
        parent: usize,
        child: &ItemMod,
        folder: &str,
        read: &dyn Fn(&str) -> Option<String>,
    ) -> Result<usize, String> {
        let below = join(folder, &child.ident.to_string());
        if let Some((_, items)) = &child.content {
            return self.add_module(self.modules[parent].file, items, below, Some(parent), read);
        }
        let (beside, within) = (format!("{below}.rs"), format!("{below}/mod.rs"));
        let path = if read(&beside).is_some() { beside } else { within };
        self.add_file(&path, below, Some(parent), read)
    }
}

impl Module {
    /// Adds what a name stands for.
    pub(crate) fn define(&mut self, name: &impl ToString, definition: Definition) {
        self.defined.entry(name.to_string()).or_default().push(definition);
    }
}

/// Whether attributes say that something is compiled for tests only.
pub(crate) fn is_for_tests(attributes: &[Attribute]) -> bool {
    let only_tests = |attribute: &Attribute| {
        let condition = attribute.parse_args::<syn::Ident>();
        attribute.path().is_ident("cfg") && condition.is_ok_and(|ident| ident == "test")
    };
    attributes.iter().any(only_tests)
}

fn folder(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

fn join(folder: &str, name: &str) -> String {
    if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") }
}
