//! Parameters of a run, the keys of its configuration: key, unit, kind, bounds and help, each once.
//!
//! A row of [`section!`] makes a field, its documentation, its check and its line in the reference
//! of the keys. So the bounds that are printed are those that are checked.
//!
//! ```
//! use echoloop_parameters::{Bounds, section};
//!
//! section! {
//!     /// A lamp.
//!     #[derive(Default)]
//!     pub struct Lamp in "lamp" {
//!         power_w: f64, "W", Bounds::above(0.0, 60.0), "Power it takes.";
//!         blinks: u32, "", Bounds::between(0.0, 9.0), "Blinks a minute.";
//!     }
//! }
//!
//! assert_eq!(Lamp::KEYS[0].key, "lamp.power_w");
//! assert_eq!(Lamp::KEYS[0].bounds.to_string(), "above 0, at most 60");
//! let fault = Lamp { power_w: 80.0, blinks: 3 }.check_keys().expect_err("80 W are too many");
//! assert_eq!(fault.to_string(), "lamp.power_w = 80 must be above 0, at most 60");
//! ```

mod bounds;
mod choice;
mod parameter;
mod section;
mod value;

pub use bounds::{Bounds, Case, Range, Scale, Step};
pub use parameter::{Parameter, Refused};
pub use value::{Kind, Value};
