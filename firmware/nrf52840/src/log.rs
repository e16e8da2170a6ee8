//! The log: RTT alone. The development kit's debugger reads it over the kit's own USB plug.

use core::convert::Infallible;

use echoloop_part::log::Log;

/// No port beside it.
pub(crate) static LOG: Log<Infallible> = Log::new();

defmt::timestamp!("{=u32}", echoloop_part::log::number());

#[defmt::global_logger]
struct Logger;

// SAFETY: each is the log's own, which is whole between `acquire` and `release`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: defmt calls.
        unsafe { LOG.acquire() };
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: defmt calls.
        unsafe { LOG.release() };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: defmt calls.
        unsafe { LOG.write(bytes) };
    }
}
