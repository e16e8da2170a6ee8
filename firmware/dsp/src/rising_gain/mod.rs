//! A receiver gain that rises with range: the ramp itself, and detection of echoes before its end.

pub mod near;
pub mod ramp;
