//! What readers of files share, whoever wrote the file.
//!
//! | item | for |
//! |---|---|
//! | [`read_data`], [`read_text`], [`text_from`] | a whole file, within a bound |
//! | [`folder_of`] | files beside a file |
//! | [`check_lines`] | text whose lines are read one by one |
//! | [`shown`], [`printable`] | what a message may repeat of a file |
//! | [`say`] | messages on standard error |
//! | [`ply`] | PLY, an element at a time |
//! | [`Column`], [`attribute`] | what files say of a point beside its place |
//!
//! A reader takes no more memory than 8 times its file and 64 MB, and says what is wrong with a
//! file in few words: a file may be of any size, end anywhere and hold escapes of a terminal.

pub mod attribute;
mod bytes;
mod column;
pub mod ply;
mod shown;
pub mod stderr;

pub use attribute::Attribute;
pub use bytes::{MOST_TEXT, check_lines, folder_of, read_data, read_text, text_from};
pub use column::{Column, Kind, eight};
pub use shown::{MOST_SHOWN, printable, shown, shown_most};
pub use stderr::say;
