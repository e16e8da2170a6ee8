//! What an item defines and which paths its code names.

use std::collections::BTreeSet;

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, ImplItem, Item, ItemUse, Macro, PatIdent, UseTree, Visibility};

use crate::module::{Definition, Module, Path};

/// Adds to a module what one of its items defines, imports and uses.
pub(crate) fn collect(item: &Item, module: &mut Module) {
    Collector { module, variables: vec![BTreeSet::new()] }.visit_item(item);
}

/// The attributes of an item.
pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::ExternCrate(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::ForeignMod(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::TraitAlias(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Union(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
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

/// The name that an item defines, if it defines one.
fn name(item: &Item) -> Option<&syn::Ident> {
    Some(match item {
        Item::Const(i) => &i.ident,
        Item::Enum(i) => &i.ident,
        Item::Fn(i) => &i.sig.ident,
        Item::Macro(i) => i.ident.as_ref()?,
        Item::Static(i) => &i.ident,
        Item::Struct(i) => &i.ident,
        Item::Trait(i) => &i.ident,
        Item::TraitAlias(i) => &i.ident,
        Item::Type(i) => &i.ident,
        Item::Union(i) => &i.ident,
        _ => return None,
    })
}

struct Collector<'a> {
    module: &'a mut Module,
    /// Variables of the functions around, which hide the module's functions of that name.
    variables: Vec<BTreeSet<String>>,
}

impl<'ast> Visit<'ast> for Collector<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if is_for_tests(attributes(item)) {
            return;
        }
        if let Some(name) = name(item) {
            self.module.define(name, Definition::Item);
            if matches!(item, Item::Macro(_)) {
                self.module.own_macros.insert(name.to_string());
            }
        }
        visit::visit_item(self, item);
    }

    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        self.variables.push(Variables::bound_in(|all| all.visit_item_fn(function)));
        visit::visit_item_fn(self, function);
        self.variables.pop();
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        let attributes = match item {
            ImplItem::Const(i) => &i.attrs,
            ImplItem::Fn(i) => &i.attrs,
            ImplItem::Type(i) => &i.attrs,
            _ => return,
        };
        if !is_for_tests(attributes) {
            self.variables.push(Variables::bound_in(|all| all.visit_impl_item(item)));
            visit::visit_impl_item(self, item);
            self.variables.pop();
        }
    }

    fn visit_trait_item(&mut self, item: &'ast syn::TraitItem) {
        self.variables.push(Variables::bound_in(|all| all.visit_trait_item(item)));
        visit::visit_trait_item(self, item);
        self.variables.pop();
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        if item.leading_colon.is_none() {
            let is_private = matches!(item.vis, Visibility::Inherited);
            self.import(&item.tree, Vec::new(), is_private);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            self.name(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_pat_ident(&mut self, pattern: &'ast PatIdent) {
        if !is_variable(&pattern.ident) {
            self.name(vec![pattern.ident.to_string()]); // a constant to compare with
        }
        visit::visit_pat_ident(self, pattern);
    }

    fn visit_macro(&mut self, call: &'ast Macro) {
        let path = call.path.segments.iter().map(|segment| segment.ident.to_string());
        self.module.macros.push(path.collect());
        self.tokens(call.tokens.clone());
    }

    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

impl Collector<'_> {
    /// Records a path, unless it names a variable.
    fn name(&mut self, path: Path) {
        let is_hidden = |name: &String| self.variables.iter().any(|all| all.contains(name));
        if !matches!(&path[..], [one] if is_hidden(one)) {
            self.module.uses.push(path);
        }
    }

    /// Records what a `use` brings; a private one is a use of it.
    fn import(&mut self, tree: &UseTree, mut path: Path, is_private: bool) {
        match tree {
            UseTree::Path(step) => {
                path.push(step.ident.to_string());
                self.import(&step.tree, path, is_private);
            }
            UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.import(tree, path.clone(), is_private));
            }
            UseTree::Glob(_) => self.module.globs.push(path),
            UseTree::Name(last) => self.import_as(&last.ident, &last.ident, path, is_private),
            UseTree::Rename(last) => self.import_as(&last.rename, &last.ident, path, is_private),
        }
    }

    fn import_as(&mut self, to: &syn::Ident, from: &syn::Ident, mut path: Path, is_private: bool) {
        let here = if from == "self" { path.last().cloned() } else { None };
        if from != "self" {
            path.push(from.to_string());
        }
        if is_private {
            self.module.uses.push(path.clone());
        }
        let name = here.filter(|_| to == "self").unwrap_or_else(|| to.to_string());
        self.module.define(&name, Definition::Import(path));
    }

    /// Paths among the tokens that a macro is given: of several segments, of a type or a constant,
    /// or of a function that is called.
    fn tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(_)
                    if !is_punct(at.checked_sub(1).and_then(|i| tokens.get(i)), '.') =>
                {
                    let (path, after) = path_at(&tokens, at);
                    let counts =
                        path.len() > 1 || !starts_small(&path[0]) || is_call(tokens.get(after));
                    if counts {
                        self.name(path);
                    }
                    at = after;
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
    }
}

/// The path that begins at a token, and where it ends.
fn path_at(tokens: &[TokenTree], mut at: usize) -> (Path, usize) {
    let mut path = Vec::new();
    while let Some(TokenTree::Ident(ident)) = tokens.get(at) {
        path.push(ident.to_string());
        at += 1;
        let goes_on = is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':');
        if !goes_on || !matches!(tokens.get(at + 2), Some(TokenTree::Ident(_))) {
            break;
        }
        at += 2;
    }
    (path, at)
}

fn is_punct(token: Option<&TokenTree>, what: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == what)
}

fn is_call(token: Option<&TokenTree>) -> bool {
    matches!(token, Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Parenthesis)
}

fn starts_small(name: &str) -> bool {
    name.starts_with(|first: char| first.is_lowercase() || first == '_')
}

fn is_variable(name: &syn::Ident) -> bool {
    starts_small(&name.to_string())
}

/// The variables that a function binds anywhere.
struct Variables(BTreeSet<String>);

impl Variables {
    fn bound_in(visit: impl FnOnce(&mut Self)) -> BTreeSet<String> {
        let mut all = Self(BTreeSet::new());
        visit(&mut all);
        all.0
    }
}

impl<'ast> Visit<'ast> for Variables {
    fn visit_pat_ident(&mut self, pattern: &'ast PatIdent) {
        if is_variable(&pattern.ident) {
            self.0.insert(pattern.ident.to_string());
        }
        visit::visit_pat_ident(self, pattern);
    }
}
