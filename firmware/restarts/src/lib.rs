//! Number of restarts since the power came on, counted in memory that neither a restart nor
//! start-up changes.
//!
//! ```
//! let restarts = echoloop_restarts::count().expect("the first call");
//! assert_eq!(restarts, 0, "the power has just come on");
//! assert_eq!(echoloop_restarts::count(), None, "this start has been counted");
//! ```
//!
//! The linker script must keep `.uninit` in RAM and outside the sections that start-up fills, as
//! cortex-m-rt's and riscv-rt's do.
#![no_std]
#![warn(clippy::undocumented_unsafe_blocks)]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// Words that neither start-up nor a restart changes.
#[repr(transparent)]
struct Survivors(UnsafeCell<MaybeUninit<[u32; 2]>>);

// SAFETY: only `count` touches it, and only its first call; there is one core, and no handler
// calls it.
unsafe impl Sync for Survivors {}

#[cfg_attr(target_os = "none", unsafe(link_section = ".uninit.restarts"))]
static SURVIVORS: Survivors = Survivors(UnsafeCell::new(MaybeUninit::zeroed()));

/// First word when the second one is a count; any other value means that the power has just come
/// on.
const COUNTING: u32 = 0x5741_5443;

/// True when this start has been counted.
static COUNTED: AtomicBool = AtomicBool::new(false);

/// Number of restarts since the power came on, including this start if it is one; `None` on later
/// calls. Must not be called from an interrupt.
pub fn count() -> Option<u32> {
    // A load and a store instead of a swap, which a Cortex-M0 does not have; nothing comes in
    // between.
    if COUNTED.load(Ordering::Relaxed) {
        return None;
    }
    COUNTED.store(true, Ordering::Relaxed);
    let words = SURVIVORS.0.get().cast::<u32>();
    // SAFETY: two aligned words of a static that nothing else accesses. The reads are volatile, so
    // that any content of uninitialised memory is a value.
    unsafe {
        let restarts = match words.read_volatile() {
            COUNTING => words.add(1).read_volatile().wrapping_add(1),
            _ => 0,
        };
        words.write_volatile(COUNTING);
        words.add(1).write_volatile(restarts);
        Some(restarts)
    }
}
