//! Attacks: damage by the thousand, seeded, each case with a verdict. A part runs with the tests;
//! `cargo xtask attack` runs as many as one likes.
//!
//! Another kind is a file of the folder `kind`, named in its module, with a test that calls
//! [`campaign::Campaign::run`]. What is done to bytes is in [`damage`].

mod campaign;
mod damage;
mod kind;
