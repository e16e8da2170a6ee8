//! A crate's modules, read from its files.

use syn::{Expr, ExprLit, Item, ItemMod, Lit, Meta};

use crate::module::{Definition, Module};
use crate::uses::{self, is_for_tests};

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
        children: &str,
        read: &dyn Fn(&str) -> Option<String>,
    ) -> Result<usize, String> {
        let below = join(children, &child.ident.to_string());
        if let Some((_, items)) = &child.content {
            return self.add_module(self.modules[parent].file, items, below, Some(parent), read);
        }
        if let Some(told) = told_path(child) {
            let path = join(folder(&self.files[self.modules[parent].file]), &told);
            return self.add_file(&path, folder(&path).to_owned(), Some(parent), read);
        }
        let (beside, within) = (format!("{below}.rs"), format!("{below}/mod.rs"));
        let path = if read(&beside).is_some() { beside } else { within };
        self.add_file(&path, below, Some(parent), read)
    }
}

/// Where `#[path = "…"]` says that a module's file lies, from the folder of the file around it.
fn told_path(child: &ItemMod) -> Option<String> {
    child.attrs.iter().find_map(|attribute| match &attribute.meta {
        Meta::NameValue(told) if told.path.is_ident("path") => match &told.value {
            Expr::Lit(ExprLit { lit: Lit::Str(path), .. }) => Some(path.value()),
            _ => None,
        },
        _ => None,
    })
}

fn folder(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

fn join(folder: &str, name: &str) -> String {
    match name.strip_prefix("../") {
        Some(rest) => join(self::folder(folder), rest),
        None if folder.is_empty() => name.to_owned(),
        None => format!("{folder}/{name}"),
    }
}
