//! What a run is: its configuration, its pairs of scans, the search and the judgement.

pub mod config;
pub mod dataset;
pub mod evaluate;
pub mod journal;
pub mod objective;
pub mod params;
pub mod preset;
pub mod run;
pub mod scan_cloud;
pub mod seed;
pub mod tune;
