//! Consistent overhead byte stuffing (COBS), by iterators: without an index there is no bounds
//! check that could panic.
//!
//! A code byte n means: n − 1 bytes as they are, then a zero. The zero is left out after code 255
//! and after the last one.

use core::cell::Cell;

/// Writes `source` to `target` without zeros and returns the number of bytes; `None` when it does
/// not fit.
pub(crate) fn encode(source: &[u8], target: &mut [u8]) -> Option<usize> {
    let room = target.len();
    let mut target = target.iter_mut();
    let mut code = target.next()?;
    *code = 1;
    for &byte in source {
        if *code == u8::MAX {
            code = target.next()?;
            *code = 1;
        }
        if byte == 0 {
            code = target.next()?;
            *code = 1;
        } else {
            *target.next()? = byte;
            *code = code.wrapping_add(1); // never beyond 255: a full block has just ended, above
        }
    }
    Some(room.wrapping_sub(target.len()))
}

/// Undoes [`encode`] in place and returns the number of bytes; `None` for bytes that [`encode`]
/// never makes, such as a zero.
pub(crate) fn decode_in_place(bytes: &mut [u8]) -> Option<usize> {
    let cells = Cell::from_mut(bytes).as_slice_of_cells();
    let mut source = cells.iter().map(Cell::get);
    let mut target = cells.iter();
    while let Some(code) = source.next() {
        if code == 0 {
            return None;
        }
        for _ in 1..code {
            let byte = source.next().filter(|&byte| byte != 0)?;
            target.next()?.set(byte);
        }
        if code != u8::MAX && source.len() > 0 {
            target.next()?.set(0);
        }
    }
    Some(cells.len().wrapping_sub(target.len()))
}
