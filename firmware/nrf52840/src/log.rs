//! Log on RTT alone. The development kit's debugger reads it over the kit's own USB plug.

use core::convert::Infallible;

use echoloop_part::log::Log;

/// Log without a port.
pub(crate) static LOG: Log<Infallible> = Log::new();

defmt::timestamp!("{=u32}", echoloop_part::log::number());

#[defmt::global_logger]
struct Logger;

// SAFETY: each call goes to the log, which is consistent between `acquire` and `release`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: defmt is the caller.
        unsafe { LOG.acquire() };
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: defmt is the caller.
        unsafe { LOG.release() };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: defmt is the caller.
        unsafe { LOG.write(bytes) };
    }
}
