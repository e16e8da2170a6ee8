//! Stack of a Thumb function, from its instructions.
//!
//! Rust keeps a frame pointer on these targets, so frame tables do not have the stack below it. Few
//! instructions lower the stack pointer; their sum over a function bounds its frame on every path.

/// Sum of all amounts that a function's code subtracts from the stack pointer; `None` when one of
/// them is unknown.
///
/// `code` lies at `address`; `is_data` is true for the addresses of constants in it; `word_at`
/// reads the image's memory.
pub(crate) fn frame(
    code: &[u8],
    address: u64,
    is_data: impl Fn(u64) -> bool,
    word_at: impl Fn(u64) -> Option<u32>,
) -> Option<u64> {
    let halfwords: Vec<u32> = code
        .chunks_exact(2)
        .map(|pair| u32::from(u16::from_le_bytes([pair[0], pair[1]])))
        .collect();
    let mut constants = [None; 8];
    let mut total = 0;
    let mut at = 0;
    while let Some(&first) = halfwords.get(at) {
        let here = address + 2 * at as u64;
        at += 1;
        if is_data(here) {
            continue;
        }
        if first >> 11 < 0b11101 {
            total += short(first, here, &mut constants, &word_at)?;
        } else {
            let second = halfwords.get(at).copied().unwrap_or(0);
            at += 1;
            total += long(first, second)?;
        }
    }
    Some(total)
}

/// 16-bit instructions: PUSH, SUB SP, LDR literal and ADD SP of it.
fn short(
    code: u32,
    here: u64,
    constants: &mut [Option<u32>; 8],
    word_at: &impl Fn(u64) -> Option<u32>,
) -> Option<u64> {
    match code {
        c if c & 0xfe00 == 0xb400 => Some(4 * u64::from((c & 0x1ff).count_ones())),
        c if c & 0xff80 == 0xb080 => Some(4 * u64::from(c & 0x7f)),
        c if c & 0xf800 == 0x4800 => {
            let literal = ((here + 4) & !3) + 4 * u64::from(c & 0xff);
            constants[(c >> 8 & 7) as usize] = word_at(literal);
            Some(0)
        }
        c if c & 0xff87 == 0x4485 => {
            let by = (*constants.get((c >> 3 & 15) as usize)?)? as i32;
            Some(u64::from(by.min(0).unsigned_abs())) // positive ones take the frame down again
        }
        _ => Some(0),
    }
}

/// 32-bit instructions: PUSH.W, STR and STRD with pre-decrement, VPUSH, VSTR of a system register
/// (MVE's predicate) with pre-decrement, SUB.W and SUBW of SP. Vectors are never stored so.
fn long(first: u32, second: u32) -> Option<u64> {
    let to_sp = second >> 8 & 0xf == 13;
    let immediate = (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xff;
    match first {
        0xe92d => Some(4 * u64::from(second.count_ones())),
        0xf84d if second & 0xfff == 0xd04 => Some(4),
        c if c & 0xfeef == 0xe86d => Some(4 * u64::from(second & 0xff)),
        c if c & 0xffbf == 0xed2d && second >> 9 & 7 == 5 => Some(4 * u64::from(second & 0xff)),
        c if c & 0xffbf == 0xed2d && second & 0x1f80 == 0xf80 => Some(4 * u64::from(second & 0x7f)),
        c if c & 0xfeaf == 0xec2d => None, // any other that lowers it and stores
        c if c & 0xfbef == 0xf1ad && to_sp => Some(expand(immediate).into()),
        c if c & 0xfbff == 0xf2ad && to_sp => Some(immediate.into()),
        c if c & 0xffef == 0xebad && to_sp => None, // by a register
        _ => Some(0),
    }
}

/// A modified constant (Armv7-M manual, A5.3.2).
fn expand(immediate: u32) -> u32 {
    let (kind, byte) = (immediate >> 8, immediate & 0xff);
    match kind {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | immediate & 0x7f).rotate_right(immediate >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame_of(halfwords: &[u16]) -> Option<u64> {
        let code: Vec<u8> = halfwords.iter().flat_map(|h| h.to_le_bytes()).collect();
        let word = |at: u64| {
            code.get(at as usize..at as usize + 4)
                .map(|b| u32::from_le_bytes(b.try_into().unwrap()))
        };
        let data = (halfwords.len() as u64 * 2).saturating_sub(4);
        frame(&code, 0, |at| halfwords.contains(&0x4800) && at >= data, word)
    }

    #[test]
    fn each_instruction_that_takes_stack_counts_what_it_takes() {
        for (halfwords, bytes) in [
            (&[0xb5f0][..], 20),            // push {r4-r7, lr}
            (&[0xb082], 8),                 // sub sp, #8
            (&[0xe92d, 0x0f00], 16),        // push.w {r8-r11}
            (&[0xf84d, 0xbd04], 4),         // str r11, [sp, #-4]!
            (&[0xe96d, 0x0102], 8),         // strd r0, r1, [sp, #-8]!
            (&[0xed2d, 0x8b04], 16),        // vpush {d8, d9}
            (&[0xed6d, 0x8f82], 8),         // vstr vpr, [sp, #-8]!
            (&[0xed8d, 0x1f04], 0),         // vstrw.32 q0, [sp, #16]
            (&[0xed0d, 0x3e10], 0),         // vstrb.8 q1, [sp, #-16]
            (&[0xecbd, 0x8b10], 0),         // vpop {d8-d15}
            (&[0xf043, 0xe001], 0),         // dls lr, r3
            (&[0xf5ad, 0x5d00], 8192),      // sub.w sp, sp, #8192
            (&[0xf5ad, 0x7d02], 520),       // sub.w sp, sp, #520
            (&[0xf6ad, 0x5d4c], 3404),      // subw sp, sp, #3404
            (&[0xb002, 0xbdf0, 0x4770], 0), // add sp, #8; pop; bx lr
        ] {
            assert_eq!(frame_of(halfwords), Some(bytes), "{halfwords:04x?}");
        }
    }

    #[test]
    fn a_frame_from_a_constant_is_read_there() {
        // ldr r0, [pc, #0]; add sp, r0; −1024 as a word
        assert_eq!(frame_of(&[0x4800, 0x4485, 0xfc00, 0xffff]), Some(1024));
    }

    #[test]
    fn a_frame_of_unknown_size_is_none() {
        assert_eq!(frame_of(&[0xebad, 0x0d00]), None); // sub.w sp, sp, r0
        assert_eq!(frame_of(&[0xed2d, 0x5e04]), None); // stc p14, c5, [sp, #-16]!
    }
}
