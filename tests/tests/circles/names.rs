//! Which module defines what a path names.

use crate::module::Definition;
use crate::source::Crate;

/// Where a path leads.
#[derive(Clone, Debug, PartialEq)]
enum Target {
    /// To what a module defines under a name.
    Item(usize, String),
    Module(usize),
}

/// A module and a name that is being looked up in it: a second time is a circle of imports.
type Seen = Vec<(usize, String)>;

/// What a path in a module names: the defining modules, each with the name there. Empty for other
/// crates' names; a path to a module itself names nothing in it.
pub(crate) fn definitions(source: &Crate, module: usize, path: &[String]) -> Vec<(usize, String)> {
    let found = resolve(source, module, path, &mut Seen::new()).into_iter();
    let items = found.filter_map(|target| match target {
        Target::Item(module, name) => Some((module, name)),
        Target::Module(_) => None,
    });
    items.collect()
}

/// What a called macro is defined by: macros by example are seen in the modules below, too.
pub(crate) fn macro_definitions(
    source: &Crate,
    module: usize,
    path: &[String],
) -> Vec<(usize, String)> {
    let up = std::iter::successors(Some(module), |&at| source.modules[at].parent);
    let is_macro = |(at, name): &(usize, String)| source.modules[*at].own_macros.contains(name);
    let mut found = up.map(|at| {
        let all = definitions(source, at, path).into_iter();
        all.filter(is_macro).collect::<Vec<_>>()
    });
    found.find(|all| !all.is_empty()).unwrap_or_default()
}

fn resolve(source: &Crate, module: usize, path: &[String], seen: &mut Seen) -> Vec<Target> {
    let Some((first, mut rest)) = path.split_first() else { return Vec::new() };
    let mut found = match first.as_str() {
        "crate" => vec![Target::Module(0)],
        "self" => vec![Target::Module(module)],
        "super" => source.modules[module].parent.map(Target::Module).into_iter().collect(),
        name => lookup(source, module, name, seen),
    };
    while let Some((name, after)) = rest.split_first() {
        let step = |target| match target {
            Target::Module(at) if name == "super" => {
                source.modules[at].parent.map(Target::Module).into_iter().collect()
            }
            Target::Module(at) => lookup(source, at, name, seen),
            item => vec![item], // a variant, a method or a constant of it
        };
        found = found.into_iter().flat_map(step).collect();
        rest = after;
    }
    found
}

fn lookup(source: &Crate, module: usize, name: &str, seen: &mut Seen) -> Vec<Target> {
    let place = (module, name.to_owned());
    if seen.contains(&place) {
        return Vec::new();
    }
    seen.push(place);
    let here = &source.modules[module];
    let mut found = Vec::new();
    for definition in here.defined.get(name).into_iter().flatten() {
        match definition {
            Definition::Item => found.push(Target::Item(module, name.to_owned())),
            Definition::Module(at) => found.push(Target::Module(*at)),
            Definition::Import(path) => found.extend(resolve(source, module, path, seen)),
        }
    }
    if !here.defined.contains_key(name) {
        for glob in &here.globs {
            for target in resolve(source, module, glob, seen) {
                if let Target::Module(at) = target {
                    found.extend(lookup(source, at, name, seen));
                }
            }
        }
    }
    seen.pop();
    found.dedup();
    found
}
