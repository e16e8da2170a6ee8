//! Restarts since the power came on, counted in memory that neither a restart nor start-up touches.
//!
//! ```
//! let restarts = echoloop_restarts::count().expect("the first call");
//! assert_eq!(restarts, 0, "the power has just come on");
//! assert_eq!(echoloop_restarts::count(), None, "this start has been counted");
//! ```
//!
//! The linker's script must keep `.uninit` in RAM and out of what start-up fills, as cortex-m-rt's
//! and riscv-rt's do.
#![no_std]
#![warn(clippy::undocumented_unsafe_blocks)]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// Words that neither start-up nor a restart touches.
#[repr(transparent)]
struct Survivors(UnsafeCell<MaybeUninit<[u32; 2]>>);

// SAFETY: only `count` touches it, and only its first call; there is one core, and no handler
// calls it.
unsafe impl Sync for Survivors {}

#[cfg_attr(target_os = "none", unsafe(link_section = ".uninit.restarts"))]
static SURVIVORS: Survivors = Survivors(UnsafeCell::new(MaybeUninit::zeroed()));

/// Says that the second word counts.
const COUNTING: u32 = 0x5741_5443;

/// Whether this start has been counted.
static COUNTED: AtomicBool = AtomicBool::new(false);

/// Restarts since the power came on, this start included when it is one; `None` on later calls. Not
/// to be called from an interrupt.
pub fn count() -> Option<u32> {
    // A load and a store: a Cortex-M0 has no swap, and nothing comes in between.
    if COUNTED.load(Ordering::Relaxed) {
        return None;
    }
    COUNTED.store(true, Ordering::Relaxed);
    let words = SURVIVORS.0.get().cast::<u32>();
    // SAFETY: two aligned words of a static that nothing else accesses; volatile, so that whatever
    // they hold is a value.
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
