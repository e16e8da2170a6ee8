//! Reading files that anybody may have written: bounded memory, short refusals, PLY, and columns of
//! numbers.
//!
//! ```
//! use std::path::Path;
//!
//! use echoloop_files::{MOST_TEXT, one_line, read_text};
//!
//! let text = read_text(Path::new("Cargo.toml"), MOST_TEXT)?; // refused if longer than 512 kB
//! println!("{}", one_line(&text)); // cannot move the cursor of a terminal
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! | to | take |
//! |---|---|
//! | read a whole file within a bound | [`read_data`], [`read_text`], [`text_from`] |
//! | find files beside a file | [`folder_of`] |
//! | refuse text with a line that is too long | [`check_lines`] |
//! | name a file and its fault | [`FileError`] |
//! | quote a file in a message | [`one_line`], [`printable`] |
//! | write to standard error | [`say`] |
//! | read PLY, an element at a time | [`ply`] |
//! | keep numbers of each point | [`Coordinates`], [`Column`], [`attribute`] |
//!
//! A file may have any size, end anywhere, and hold the escape sequences of a terminal. So a reader
//! takes at most 8 times the file's size plus 64 MB, and a message repeats at most [`MAX_LINE`]
//! printable characters of a file.

pub mod attribute;
mod bytes;
mod column;
mod coordinates;
mod error;
pub mod ply;
mod printable;
pub mod stderr;

pub use attribute::Attribute;
pub use bytes::{MOST_TEXT, check_lines, folder_of, read_data, read_text, text_from};
pub use column::{Column, NumberType, padded};
pub use coordinates::Coordinates;
pub use error::FileError;
pub use printable::{MAX_LINE, one_line, one_line_of, printable};
pub use stderr::say;
