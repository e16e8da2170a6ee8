//! Log: defmt's frames on a serial port of their own, never the link's.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

use crate::board::log_port;
use crate::uart::Port;

#[defmt::global_logger]
struct Logger;

struct Encoder(UnsafeCell<defmt::Encoder>);

// SAFETY: defmt calls the logger's functions between `acquire` and `release` only. Nothing logs
// from an interrupt, and there is one core, so they never overlap.
unsafe impl Sync for Encoder {}

static ENCODER: Encoder = Encoder(UnsafeCell::new(defmt::Encoder::new()));

/// Number of messages so far, used as timestamp instead of a clock: the same conversation writes
/// the same log.
static MESSAGES: AtomicU32 = AtomicU32::new(0);

defmt::timestamp!("{=u32}", {
    let number = MESSAGES.load(Ordering::Relaxed);
    // There is one core and no handler, so nothing comes in between.
    MESSAGES.store(number.wrapping_add(1), Ordering::Relaxed);
    number
});

fn send(bytes: &[u8]) {
    let mut port = log_port();
    for &byte in bytes {
        port.send(byte);
    }
}

// SAFETY: as for `Encoder`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: as for `Encoder`.
        unsafe { (*ENCODER.0.get()).start_frame(send) };
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: as for `Encoder`.
        unsafe { (*ENCODER.0.get()).end_frame(send) };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: as for `Encoder`.
        unsafe { (*ENCODER.0.get()).write(bytes, send) };
    }
}
