//! Keys of a configuration: name, unit, bound and one sentence, each once.
//!
//! A row of [`section!`] makes a field, its documentation, its check and its line of what is
//! printed. So no bound can be said in one way and enforced in another.
//!
//! ```
//! use echoloop_parameters::{Must, section};
//!
//! section! {
//!     /// A lamp.
//!     #[derive(Default)]
//!     pub struct Lamp in "lamp" {
//!         power_w: f64, "W", Must::above(0.0, 60.0), "What it takes.";
//!         blinks: u32, "", Must::between(0.0, 9.0), "How often it blinks.";
//!     }
//! }
//!
//! assert_eq!(Lamp::KEYS[0].name, "lamp.power_w");
//! assert_eq!(Lamp::KEYS[0].must.to_string(), "above 0, at most 60");
//! let fault = Lamp { power_w: 80.0, blinks: 3 }.check_keys().expect_err("80 W are too many");
//! assert_eq!(fault.to_string(), "lamp.power_w = 80 must be above 0, at most 60");
//! ```

mod key;
mod must;
mod section;
mod value;

pub use key::{Key, Refused};
pub use must::{Case, Must, Range};
pub use value::{Kind, Value};
