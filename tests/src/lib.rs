//! Twins and vectors shared by the cross-crate tests.
