//! Attacks: thousands of seeded cases of damage, each with a verdict. The tests run some of them,
//! `cargo xtask attack` any number.
//!
//! A new kind is a file in the folder `kind`, declared in its module, with a test that calls
//! [`campaign::Campaign::run`]. [`damage`] has the accidents to bytes.

mod campaign;
mod damage;
mod kind;
