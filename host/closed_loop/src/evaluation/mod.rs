//! The error of a pair of scans (Eq. 4), summaries of many, and comparisons of two.

pub mod compare;
pub mod difficulty;
pub mod gain;
pub mod objective;
pub mod scan_cloud;
pub mod summary;
