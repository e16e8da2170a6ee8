//! Log messages (defmt) to the debugger, by RTT, and to USART2, for who has none.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

use rtt_target::{UpChannel, rtt_init};
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::serial::Tx;

use crate::link::send;

#[defmt::global_logger]
struct Logger;

/// Where the frames go: nowhere until [`start`].
struct Sinks {
    debugger: Option<UpChannel>,
    port: Option<Tx<USART2>>,
}

impl Sinks {
    /// A debugger that does not read, or is not there, never holds the program up.
    fn send(&mut self, bytes: &[u8]) {
        if let Some(debugger) = &mut self.debugger {
            debugger.write(bytes);
        }
        if let Some(port) = &mut self.port {
            bytes.iter().for_each(|&byte| send(port, byte));
        }
    }
}

struct Log(UnsafeCell<(defmt::Encoder, Sinks)>);

// SAFETY: defmt calls the logger's functions between `acquire` and `release` only. Nothing logs
// from an interrupt, and there is one core, so they never overlap.
unsafe impl Sync for Log {}

static LOG: Log =
    Log(UnsafeCell::new((defmt::Encoder::new(), Sinks { debugger: None, port: None })));

/// Messages so far, in place of a clock: the same conversation writes the same log.
static MESSAGES: AtomicU32 = AtomicU32::new(0);

defmt::timestamp!("{=u32}", {
    let number = MESSAGES.load(Ordering::Relaxed);
    // One core, and no interrupt logs: nobody comes in between.
    MESSAGES.store(number.wrapping_add(1), Ordering::Relaxed);
    number
});

/// Opens both ways. rtt-target panics when it is called twice: a function of its own, which the
/// board's start calls once, so that the check for panics can tell.
#[inline(never)]
pub fn start(port: Tx<USART2>) {
    // probe-rs decodes a channel of this name.
    let channels = rtt_init! { up: { 0: { size: 1024, name: "defmt" } } };
    // SAFETY: as for `Log`: no message is under way.
    unsafe { (*LOG.0.get()).1 = Sinks { debugger: Some(channels.up.0), port: Some(port) } };
}

// SAFETY: as for `Log`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: as for `Log`.
        let (encoder, sinks) = unsafe { &mut *LOG.0.get() };
        encoder.start_frame(|bytes| sinks.send(bytes));
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: as for `Log`.
        let (encoder, sinks) = unsafe { &mut *LOG.0.get() };
        encoder.end_frame(|bytes| sinks.send(bytes));
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: as for `Log`.
        let (encoder, sinks) = unsafe { &mut *LOG.0.get() };
        encoder.write(bytes, |bytes| sinks.send(bytes));
    }
}
