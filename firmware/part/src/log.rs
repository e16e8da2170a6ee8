//! Log messages (defmt) to the debugger, by RTT, and to a serial port, for use without a debugger.
//!
//! An image calls [`logger!`](crate::logger) with its [`Log`].

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

use rtt_target::{UpChannel, rtt_init};

use crate::link::Port;

/// Log, which drops its frames until [`start`](Self::start).
pub struct Log<P>(UnsafeCell<(defmt::Encoder, Sinks<P>)>);

// SAFETY: defmt calls the logger's functions between `acquire` and `release` only. Nothing logs
// from an interrupt, and there is one core, so they never overlap.
unsafe impl<P> Sync for Log<P> {}

struct Sinks<P> {
    debugger: Option<UpChannel>,
    port: Option<P>,
}

impl<P: Port> Sinks<P> {
    /// Sends bytes to both. A debugger that does not read, or is missing, never holds the program
    /// up.
    fn send(&mut self, bytes: &[u8]) {
        if let Some(debugger) = &mut self.debugger {
            debugger.write(bytes);
        }
        if let Some(port) = &mut self.port {
            bytes.iter().for_each(|&byte| port.send(byte));
        }
    }
}

impl<P: Port> Log<P> {
    /// Log that is not started.
    pub const fn new() -> Self {
        Self(UnsafeCell::new((defmt::Encoder::new(), Sinks { debugger: None, port: None })))
    }

    /// Sends the following messages to the debugger, and to a port if there is one. Must be called
    /// once, and not from an interrupt.
    pub fn start(&self, port: Option<P>) {
        let debugger = Some(debugger());
        // SAFETY: no message is under way, as for `Sync`.
        unsafe { (*self.0.get()).1 = Sinks { debugger, port } };
    }

    /// Begins a message.
    ///
    /// # Safety
    ///
    /// Only defmt's logger may call it.
    pub unsafe fn acquire(&self) {
        // SAFETY: as for `Sync`.
        let (encoder, sinks) = unsafe { &mut *self.0.get() };
        encoder.start_frame(|bytes| sinks.send(bytes));
    }

    /// Continues the message.
    ///
    /// # Safety
    ///
    /// Only defmt's logger may call it.
    pub unsafe fn write(&self, bytes: &[u8]) {
        // SAFETY: as for `Sync`.
        let (encoder, sinks) = unsafe { &mut *self.0.get() };
        encoder.write(bytes, |bytes| sinks.send(bytes));
    }

    /// Ends the message.
    ///
    /// # Safety
    ///
    /// Only defmt's logger may call it.
    pub unsafe fn release(&self) {
        // SAFETY: as for `Sync`.
        let (encoder, sinks) = unsafe { &mut *self.0.get() };
        encoder.end_frame(|bytes| sinks.send(bytes));
    }
}

impl<P: Port> Default for Log<P> {
    fn default() -> Self {
        Self::new()
    }
}

/// Opens the debugger's channel. rtt-target panics when it is called twice. This is a function of
/// its own, called once at the board's start, so that the check for panics can recognise it.
#[inline(never)]
fn debugger() -> UpChannel {
    // probe-rs decodes a channel of this name.
    rtt_init! { up: { 0: { size: 1024, name: "defmt" } } }.up.0
}

/// Number of messages so far, used as timestamp instead of a clock: the same conversation writes
/// the same log.
pub fn number() -> u32 {
    static MESSAGES: AtomicU32 = AtomicU32::new(0);
    let number = MESSAGES.load(Ordering::Relaxed);
    // There is one core and no interrupt logs, so nothing comes in between.
    MESSAGES.store(number.wrapping_add(1), Ordering::Relaxed);
    number
}

/// Makes a [`Log`] the image's logger, with [`number`] as timestamp.
#[macro_export]
macro_rules! logger {
    ($log:ident) => {
        defmt::timestamp!("{=u32}", $crate::log::number());

        #[defmt::global_logger]
        struct Logger;

        // SAFETY: each call goes to the log, which is consistent between `acquire` and `release`.
        unsafe impl defmt::Logger for Logger {
            fn acquire() {
                // SAFETY: defmt is the caller.
                unsafe { $log.acquire() };
            }

            unsafe fn flush() {}

            unsafe fn release() {
                // SAFETY: defmt is the caller.
                unsafe { $log.release() };
            }

            unsafe fn write(bytes: &[u8]) {
                // SAFETY: defmt is the caller.
                unsafe { $log.write(bytes) };
            }
        }
    };
}
