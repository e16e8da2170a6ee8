//! Log on RTT alone. The development kit's debugger reads it over the kit's own USB plug.

use core::convert::Infallible;

use echoloop_part::log::Log;

/// Log without a port.
pub(crate) static LOG: Log<Infallible> = Log::new();

echoloop_part::logger!(LOG);
