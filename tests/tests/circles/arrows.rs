//! Which file uses which, and which of these arrows lie on a circle.

use std::collections::{BTreeMap, BTreeSet};

use crate::names::{definitions, macro_definitions};
use crate::source::Crate;

/// A file that uses names which another defines.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arrow {
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) names: Vec<String>,
}

/// For each file and each other that it uses, the names.
type Arrows = BTreeMap<(usize, usize), BTreeSet<String>>;

/// The arrows that lie on an import circle, by file.
pub(crate) fn circles(source: &Crate) -> Vec<Arrow> {
    let arrows = arrows(source);
    let reached = reached(&arrows, source.files.len());
    let on_circle = arrows.into_iter().filter(|((from, to), _)| reached[*to][*from]);
    let named = on_circle.map(|((from, to), names)| Arrow {
        from: source.files[from].clone(),
        to: source.files[to].clone(),
        names: names.into_iter().collect(),
    });
    named.collect()
}

fn arrows(source: &Crate) -> Arrows {
    let mut arrows = Arrows::new();
    for (index, module) in source.modules.iter().enumerate() {
        let paths = module.uses.iter().flat_map(|path| definitions(source, index, path));
        let macros = module.macros.iter().flat_map(|path| macro_definitions(source, index, path));
        for (definer, name) in paths.chain(macros) {
            let (from, to) = (module.file, source.modules[definer].file);
            if from != to {
                arrows.entry((from, to)).or_default().insert(name);
            }
        }
    }
    arrows
}

/// For each file, which others it needs, by whatever way.
fn reached(arrows: &Arrows, files: usize) -> Vec<Vec<bool>> {
    let mut reached = vec![vec![false; files]; files];
    for &(from, to) in arrows.keys() {
        reached[from][to] = true;
    }
    // Warshall: after step k, every way whose inner files are among the first k is known.
    for via in 0..files {
        let onward = reached[via].clone();
        for row in reached.iter_mut().filter(|row| row[via]) {
            row.iter_mut().zip(&onward).for_each(|(known, more)| *known |= more);
        }
    }
    reached
}
