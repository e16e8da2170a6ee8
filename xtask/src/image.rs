//! Size, worst-case stack and reachable panics of an image, from its ELF file.
//!
//! The worst-case stack is that of the deepest path through the graph of calls. Frame sizes come
//! from the instructions on Arm ([`thumb`]) and from `.eh_frame` on RISC-V. The graph comes from
//! the relocations that the linker was asked to keep: a function has an edge to every function its
//! code names, called or only pointed to. A table of constants that names a function, or a frame of
//! unknown size, is an error, as then there is no bound.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use gimli::{
    BaseAddresses, CfaRule, CieOrFde, EhFrame, EndianSlice, LittleEndian, UnwindContext,
    UnwindSection,
};

use object::{
    Object, ObjectSection, ObjectSymbol, RelocationFlags, RelocationTarget, SectionFlags,
    SectionKind, SymbolKind,
};

use crate::thumb;

/// Size of an image on its board.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Size {
    /// Bytes of code, constants and initial values.
    pub(crate) flash: u64,
    /// Bytes of statics.
    pub(crate) statics: u64,
    /// Worst-case stack, exception entry and handler included.
    pub(crate) stack: u64,
    /// Path with that stack, outermost first, with each frame.
    pub(crate) deepest: Vec<(String, u64)>,
    /// Labels of assembly, each counted as [`LABEL_FRAME`].
    pub(crate) unknown: Vec<String>,
}

/// A region of a memory map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) origin: u64,
    pub(crate) length: u64,
}

impl Region {
    fn holds(&self, address: u64, size: u64) -> bool {
        self.origin <= address && address + size <= self.origin + self.length
    }
}

/// Flash and RAM of a board: flash may lie in several regions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Map {
    pub(crate) flash: Vec<Region>,
    pub(crate) ram: Region,
}

impl Map {
    /// Bytes of flash.
    pub(crate) fn flash_bytes(&self) -> u64 {
        self.flash.iter().map(|region| region.length).sum()
    }

    /// True when an image fits the board.
    pub(crate) fn fits(&self, size: &Size) -> bool {
        size.flash <= self.flash_bytes() && size.statics + size.stack <= self.ram.length
    }
}

/// Memory map at the beginning of a linker script: `RAM`, and all regions whose names begin with
/// `FLASH`.
pub(crate) fn regions(script: &str) -> Result<Map> {
    let named = |name: &'static str| {
        let lines = script.lines().map(str::trim_start);
        lines.filter(move |line| line.starts_with(name) && line.contains("ORIGIN"))
    };
    let what = "the memory map names no FLASH and RAM with ORIGIN and LENGTH";
    let flash = named("FLASH").map(region).collect::<Option<Vec<Region>>>().context(what)?;
    let ram = named("RAM").next().and_then(region);
    match ram {
        Some(ram) if !flash.is_empty() => Ok(Map { flash, ram }),
        _ => bail!(what),
    }
}

fn region(line: &str) -> Option<Region> {
    let value = |key: &str| {
        let text = line.split_once(key)?.1.split_once('=')?.1;
        number(text.split(',').next()?.trim())
    };
    Some(Region { origin: value("ORIGIN")?, length: value("LENGTH")? })
}

/// A number of a linker script: hexadecimal, or with K or M.
fn number(text: &str) -> Option<u64> {
    if let Some(digits) = text.strip_prefix("0x") {
        return u64::from_str_radix(digits, 16).ok();
    }
    let (digits, unit) = match text.strip_suffix(['K', 'M']) {
        Some(digits) if text.ends_with('K') => (digits, 1 << 10),
        Some(digits) => (digits, 1 << 20),
        None => (text, 1),
    };
    digits.parse::<u64>().ok()?.checked_mul(unit)
}

/// Panics that an image can reach, each with the calls that lead to it; empty when no input reaches
/// one.
///
/// Roots are the entry point, the vectors, and functions named by a table of constants. Calls by
/// the functions `by_constants` are not followed.
pub(crate) fn panics(elf: &[u8], by_constants: &[&str]) -> Result<Vec<String>> {
    let file = object::File::parse(elf)?;
    let functions = functions(&file)?;
    let constants = file.sections().filter(|s| s.kind() != SectionKind::Text && is_allocated(s));
    let named = references(&file, constants)?;
    let entry = clean(&file, file.entry());
    let named = named.iter().map(|reference| reference.to).chain([entry]);
    let roots = named.filter_map(|to| holder(&functions, to));
    let callers = reached(&functions, roots, by_constants);
    let found = callers.keys().filter(|&&index| is_panic(&functions[index].name));
    Ok(found.map(|&index| path_to(&functions, &callers, index)).collect())
}

fn is_panic(name: &str) -> bool {
    name.contains("panicking") || name.contains("rust_begin_unwind")
}

/// Functions reached from the roots other than through those named, each with its first caller.
fn reached(
    functions: &[Function],
    roots: impl Iterator<Item = usize>,
    by_constants: &[&str],
) -> BTreeMap<usize, Option<usize>> {
    let mut callers = BTreeMap::new();
    let mut ahead: Vec<(usize, Option<usize>)> = roots.map(|root| (root, None)).collect();
    while let Some((index, caller)) = ahead.pop() {
        if by_constants.contains(&functions[index].name.as_str()) {
            continue;
        }
        if let Entry::Vacant(place) = callers.entry(index) {
            place.insert(caller);
            ahead.extend(functions[index].calls.iter().map(|&callee| (callee, Some(index))));
        }
    }
    callers
}

fn path_to(
    functions: &[Function],
    callers: &BTreeMap<usize, Option<usize>>,
    index: usize,
) -> String {
    let up = std::iter::successors(Some(index), |at| callers.get(at).copied().flatten());
    let names: Vec<&str> = up.map(|at| functions[at].name.as_str()).collect();
    names.join(" ← ")
}

fn is_thumb(file: &object::File<'_>) -> bool {
    matches!(file.architecture(), object::Architecture::Arm)
}

fn is_allocated(section: &object::Section<'_, '_>) -> bool {
    match section.flags() {
        SectionFlags::Elf { sh_flags } => {
            sh_flags & u64::from(object::elf::SHF_ALLOC) != 0 && section.size() > 0
        }
        _ => false,
    }
}

struct Function {
    name: String,
    start: u64,
    end: u64,
    /// A label of hand-written assembly: start-up and traps.
    is_label: bool,
    frame: Option<u64>,
    calls: BTreeSet<usize>,
}

/// Frame counted for a label of assembly, which is in no frame table: a few lines that save
/// registers.
const LABEL_FRAME: u64 = 64;

/// Greatest frame of exception entry: 26 words with the floating-point registers, and a word to
/// align.
const EXCEPTION_FRAME: u64 = 4 * 27;

/// RISC-V's trap handlers; Arm's are in its vectors.
const TRAPS: [&str; 2] = ["_start_trap", "_default_start_trap"];

/// Measures an image in which `nested` exceptions can interrupt each other.
///
/// # Errors
///
/// When the file is no such image, a section of it lies outside of the map, or there is no bound as
/// a function calls itself.
pub(crate) fn measure(elf: &[u8], map: &Map, nested: u64) -> Result<Size> {
    let file = object::File::parse(elf)?;
    let (mut in_flash, mut statics) = (0, 0);
    for section in file.sections().filter(is_allocated) {
        let stored = section.file_range().is_some_and(|(_, size)| size > 0);
        let name = section.name().unwrap_or("?").to_owned();
        let (address, bytes) = (section.address(), section.size());
        if map.ram.holds(address, bytes) {
            if name != ".stack" && name != ".heap" {
                statics += bytes;
            }
            if stored {
                in_flash += bytes; // initial values
            }
        } else if map.flash.iter().any(|region| region.holds(address, bytes)) {
            in_flash += bytes;
        } else {
            bail!(
                "section {name}, {bytes} bytes at {address:#x}, lies outside flash and RAM of the \
                 memory map"
            );
        }
    }
    let functions = functions(&file)?;
    check_bounded(&file, &functions)?;
    let entry =
        holder(&functions, clean(&file, file.entry())).context("the entry point is no function")?;
    let (program, path) = deepest(&functions, &[entry])?;
    let (handler, _) = deepest(&functions, &handlers(&file, &functions, entry)?)?;
    let exceptions = (EXCEPTION_FRAME + handler) * nested;
    let frame = |f: &Function| f.frame.unwrap_or(LABEL_FRAME);
    let mut deepest: Vec<(String, u64)> =
        path.iter().map(|&i| (functions[i].name.clone(), frame(&functions[i]))).collect();
    deepest.push(("exceptions and their handlers".into(), exceptions));
    let unknown = functions.iter().filter(|f| f.frame.is_none()).map(|f| f.name.clone()).collect();
    Ok(Size { flash: in_flash, statics, stack: program + exceptions, deepest, unknown })
}

/// Fails where the stack has no bound: a frame has no known size, or no relocation shows a call.
fn check_bounded(file: &object::File<'_>, functions: &[Function]) -> Result<()> {
    if let Some(function) = functions.iter().find(|f| f.frame.is_none() && !f.is_label) {
        bail!("there is no bound on the stack: the frame of {} has no known size", function.name);
    }
    let constants = file
        .sections()
        .filter(|s| s.kind() != SectionKind::Text && is_allocated(s) && !is_vectors(s));
    for reference in references(file, constants)? {
        // RISC-V's trap handler calls its labels through tables; the frame that Arm's hardware
        // pushes makes up for theirs.
        if let Some(function) = functions.iter().find(|f| f.start == reference.to && !f.is_label) {
            bail!("there is no bound on the stack: a table of constants names {}", function.name);
        }
    }
    Ok(())
}

fn handlers(file: &object::File<'_>, functions: &[Function], entry: usize) -> Result<Vec<usize>> {
    let vectors = references(file, file.sections().filter(is_vectors))?;
    let named = vectors.iter().filter_map(|reference| holder(functions, reference.to));
    let is_trap = |&index: &usize| TRAPS.contains(&functions[index].name.as_str());
    let traps = (0..functions.len()).filter(is_trap);
    Ok(named.filter(|&index| index != entry).chain(traps).collect())
}

fn is_vectors(section: &object::Section<'_, '_>) -> bool {
    section.name() == Ok(".vector_table")
}

/// Address of code, without the bit for Thumb.
fn clean(file: &object::File<'_>, address: u64) -> u64 {
    if is_thumb(file) { address & !1 } else { address }
}

/// Every function, with its frame and its calls.
fn functions(file: &object::File<'_>) -> Result<Vec<Function>> {
    let mut functions = named_functions(file);
    if is_thumb(file) {
        thumb_frames(file, &mut functions)
    } else {
        tabled_frames(file, &mut functions)?
    }
    let calls = references(file, file.sections().filter(|s| s.kind() == SectionKind::Text))?;
    if calls.is_empty() {
        bail!("the image holds no relocations: link it with --emit-relocs");
    }
    for Reference { from, to, is_call } in calls {
        let ends = holder(&functions, from).zip(holder(&functions, to));
        let Some((caller, callee)) = ends else { continue };
        // Jumps within a function are no calls of it.
        if caller != callee || (is_call && to == functions[callee].start) {
            functions[caller].calls.insert(callee);
        }
    }
    Ok(functions)
}

fn named_functions(file: &object::File<'_>) -> Vec<Function> {
    let is_code = |s: &object::Symbol<'_, '_>| {
        let section = s.section_index().and_then(|index| file.section_by_index(index).ok());
        section.is_some_and(|text| {
            text.kind() == SectionKind::Text && s.address() < text.address() + text.size()
        })
    };
    let is_label =
        |s: &object::Symbol<'_, '_>| s.kind() != SymbolKind::Text && s.is_global() && is_code(s);
    let mut by_start: BTreeMap<u64, Function> = BTreeMap::new();
    for symbol in file
        .symbols()
        .filter(|s| !s.is_undefined() && (s.kind() == SymbolKind::Text || is_label(s)))
    {
        let start = clean(file, symbol.address());
        let function = by_start.entry(start).or_insert_with(|| Function {
            name: format!("{:#}", rustc_demangle::demangle(symbol.name().unwrap_or("?"))),
            start,
            end: start,
            is_label: true,
            frame: None,
            calls: BTreeSet::new(),
        });
        function.end = function.end.max(start + symbol.size());
        function.is_label &= is_label(&symbol);
    }
    let mut functions: Vec<Function> = by_start.into_values().collect();
    let mut next = u64::MAX;
    for function in functions.iter_mut().rev() {
        function.end = if function.end == function.start { next } else { function.end.min(next) };
        next = function.start;
    }
    functions
}

/// Index of the function at an address.
fn holder(functions: &[Function], address: u64) -> Option<usize> {
    let after = functions.partition_point(|f| f.start <= address);
    let index = after.checked_sub(1)?;
    (address < functions[index].end).then_some(index)
}

/// A place in an image that names another.
struct Reference {
    from: u64,
    to: u64,
    is_call: bool,
}

/// References of some sections.
fn references<'data, 'file>(
    file: &'file object::File<'data>,
    sections: impl Iterator<Item = object::Section<'data, 'file>>,
) -> Result<Vec<Reference>> {
    let mut found = Vec::new();
    for section in sections {
        for (from, relocation) in section.relocations() {
            let RelocationTarget::Symbol(index) = relocation.target() else { continue };
            let symbol = file.symbol_by_index(index)?;
            let to = match symbol.kind() {
                SymbolKind::Section if relocation.has_implicit_addend() => word(&section, from)?,
                SymbolKind::Section => symbol.address().wrapping_add_signed(relocation.addend()),
                _ => symbol.address(),
            };
            found.push(Reference { from, to: clean(file, to), is_call: is_call(&relocation) });
        }
    }
    Ok(found)
}

fn is_call(relocation: &object::Relocation) -> bool {
    const CALLS: [u32; 3] =
        [object::elf::R_ARM_THM_PC22, object::elf::R_RISCV_CALL, object::elf::R_RISCV_CALL_PLT];
    matches!(relocation.flags(), RelocationFlags::Elf { r_type } if CALLS.contains(&r_type))
}

/// Word at an address: an address in a constant pool, already linked.
fn word(section: &object::Section<'_, '_>, at: u64) -> Result<u64> {
    let bytes = section.data_range(at, 4)?.and_then(|bytes| bytes.try_into().ok());
    Ok(bytes.map_or(0, u32::from_le_bytes).into())
}

/// Frames of Thumb code, from its instructions.
fn thumb_frames(file: &object::File<'_>, functions: &mut [Function]) {
    // Mapping symbols: where constants begin ($d) and code goes on ($t).
    let marks: BTreeMap<u64, bool> = file
        .symbols()
        .filter_map(|s| match s.name().ok()?.get(..2)? {
            "$d" => Some((s.address(), true)),
            "$t" => Some((s.address(), false)),
            _ => None,
        })
        .collect();
    let is_data = |at: u64| marks.range(..=at).next_back().is_some_and(|(_, &data)| data);
    let bytes = |at: u64, length: u64| {
        let mut text = file.sections().filter(|s| s.kind() == SectionKind::Text);
        text.find_map(|section| section.data_range(at, length).ok().flatten())
    };
    let word_at = |at| bytes(at, 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    for function in functions {
        let code = bytes(function.start, function.end.saturating_sub(function.start));
        function.frame = code.and_then(|code| thumb::frame(code, function.start, is_data, word_at));
    }
}

/// Frames of other code, from its tables: the greatest distance between the stack pointers of a
/// function and of its caller.
fn tabled_frames(file: &object::File<'_>, functions: &mut [Function]) -> Result<()> {
    let section = file.section_by_name(".eh_frame").context("no .eh_frame")?;
    let data = section.uncompressed_data()?;
    let mut frames = EhFrame::new(&data, LittleEndian);
    frames.set_address_size(4);
    let frames = deepest_rows(&frames, &BaseAddresses::default().set_eh_frame(section.address()))?;
    for function in functions {
        function.frame = frames.get(&function.start).copied();
    }
    Ok(())
}

fn deepest_rows(
    section: &EhFrame<EndianSlice<'_, LittleEndian>>,
    bases: &BaseAddresses,
) -> Result<BTreeMap<u64, u64>> {
    let mut context = UnwindContext::new();
    let mut frames = BTreeMap::new();
    let mut entries = section.entries(bases);
    while let Some(entry) = entries.next()? {
        let CieOrFde::Fde(partial) = entry else { continue };
        let fde = partial.parse(EhFrame::cie_from_offset)?;
        let mut rows = fde.rows(section, bases, &mut context)?;
        let mut deepest = 0;
        while let Some(row) = rows.next_row()? {
            if let CfaRule::RegisterAndOffset { offset, .. } = row.cfa() {
                deepest = deepest.max(u64::try_from(*offset).unwrap_or(0));
            }
        }
        let frame: &mut u64 = frames.entry(fde.initial_address()).or_default();
        *frame = (*frame).max(deepest);
    }
    Ok(frames)
}

/// Greatest stack below any of the roots, and its path.
fn deepest(functions: &[Function], roots: &[usize]) -> Result<(u64, Vec<usize>)> {
    let mut known: Vec<Option<(u64, Option<usize>)>> = vec![None; functions.len()];
    let mut best: Option<(u64, usize)> = None;
    for &index in roots {
        let depth = descend(functions, index, &mut known, &mut Vec::new())?;
        best = best.max(Some((depth, index)));
    }
    let Some((depth, mut at)) = best else { return Ok((0, Vec::new())) };
    let mut path = vec![at];
    while let Some((_, Some(next))) = known[at] {
        path.push(next);
        at = next;
    }
    Ok((depth, path))
}

fn descend(
    functions: &[Function],
    at: usize,
    known: &mut [Option<(u64, Option<usize>)>],
    above: &mut Vec<usize>,
) -> Result<u64> {
    if let Some((depth, _)) = known[at] {
        return Ok(depth);
    }
    if above.contains(&at) {
        let names: Vec<&str> = above.iter().map(|&i| functions[i].name.as_str()).collect();
        bail!(
            "there is no bound on the stack: {} calls itself, by way of {names:?}",
            functions[at].name
        );
    }
    above.push(at);
    let mut below = (0, None);
    for &callee in &functions[at].calls {
        let depth = descend(functions, callee, known, above)?;
        if depth > below.0 {
            below = (depth, Some(callee));
        }
    }
    above.pop();
    let depth = functions[at].frame.unwrap_or(LABEL_FRAME) + below.0;
    known[at] = Some((depth, below.1));
    Ok(depth)
}

/// Bytes of an image.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_maps_are_read_as_linkers_write_them() {
        let map = "MEMORY\n{\n  FLASH : ORIGIN = 0x10000000, LENGTH = 4M\n  \
                   RAM   : ORIGIN = 0x38000000, LENGTH = 16K\n}";
        let flash = Region { origin: 0x1000_0000, length: 4 << 20 };
        let ram = Region { origin: 0x3800_0000, length: 16 << 10 };
        assert_eq!(regions(map).unwrap(), Map { flash: vec![flash], ram });
        let two = map.replace("FLASH", "FLASH_A : ORIGIN = 0, LENGTH = 1K\n  FLASH");
        let first = Region { origin: 0, length: 1 << 10 };
        assert_eq!(regions(&two).unwrap(), Map { flash: vec![first, flash], ram });
        assert!(regions("RAM : ORIGIN = 0, LENGTH = 1K").is_err());
        assert!(regions("FLASH : ORIGIN = 0, LENGTH = 1K").is_err());
    }

    #[test]
    fn an_image_of_one_byte_too_many_in_flash_or_ram_does_not_fit() {
        let region = |origin, length| Region { origin, length };
        let map = Map { flash: vec![region(0, 16), region(64, 100)], ram: region(256, 100) };
        let size = |flash, statics, stack| {
            let (deepest, unknown) = (Vec::new(), Vec::new());
            Size { flash, statics, stack, deepest, unknown }
        };
        assert!(map.fits(&size(116, 40, 60)));
        assert!(!map.fits(&size(117, 40, 60)));
        assert!(!map.fits(&size(116, 41, 60)) && !map.fits(&size(116, 40, 61)));
        let [_, code] = map.flash[..] else { panic!("two regions") };
        assert!(code.holds(64, 100) && !code.holds(64, 101) && !code.holds(63, 10));
    }

    fn function(name: &str, frame: u64, calls: &[usize]) -> Function {
        let calls = calls.iter().copied().collect();
        Function { name: name.into(), start: 0, end: 0, is_label: false, frame: Some(frame), calls }
    }

    #[test]
    fn the_deepest_path_counts_not_the_longest() {
        let functions = [
            function("Reset", 8, &[1, 2]),
            function("a", 16, &[3]),
            function("b", 200, &[]),
            function("c", 16, &[]),
        ];
        assert_eq!(deepest(&functions, &[0]).unwrap(), (208, vec![0, 2]));
    }

    #[test]
    fn a_panic_is_found_with_the_calls_that_lead_to_it_and_one_that_nothing_calls_is_not() {
        let functions = [
            function("Reset", 0, &[1]),
            function("a", 0, &[2]),
            function("core::panicking::panic", 0, &[]),
            function("b", 0, &[2]),
        ];
        let callers = reached(&functions, [0].into_iter(), &[]);
        assert!(
            is_panic(&functions[2].name) && callers.contains_key(&2) && !callers.contains_key(&3)
        );
        assert_eq!(path_to(&functions, &callers, 2), "core::panicking::panic ← a ← Reset");
    }

    #[test]
    fn a_panic_that_constants_decide_counts_when_anything_else_reaches_it_too() {
        let functions = |of_main: &[usize]| {
            [
                function("Reset", 0, of_main),
                function("clock", 0, &[2]),
                function("search", 0, &[3]),
                function("core::panicking::panic", 0, &[]),
            ]
        };
        let found = |of_main| reached(&functions(of_main), [0].into_iter(), &["clock"]);
        assert!(!found(&[1]).contains_key(&3));
        assert!(found(&[1, 2]).contains_key(&3));
    }

    #[test]
    fn a_function_that_calls_itself_has_no_bound() {
        let functions =
            [function("Reset", 8, &[1]), function("a", 8, &[2]), function("b", 8, &[1])];
        assert!(deepest(&functions, &[0]).unwrap_err().to_string().contains("a calls itself"));
        let directly = [function("Reset", 8, &[1]), function("a", 8, &[1])];
        assert!(deepest(&directly, &[0]).unwrap_err().to_string().contains("a calls itself"));
    }
}
