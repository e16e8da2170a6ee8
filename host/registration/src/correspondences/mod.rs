//! Questions about matches that all global methods share.
//!
//! | question | file |
//! |---|---|
//! | do two matches keep their distance? | `length_bounds`; of all pairs, `columns` |
//! | how far off does a motion leave a match? | `residuals` |
//! | what do all matches say about a motion found? | `refit` |

mod columns;
mod length_bounds;
mod refit;
mod residuals;

pub(crate) use columns::{Centroids, Columns};
pub(crate) use length_bounds::{LengthBounds, length_difference_m};
pub(crate) use refit::{Refit, Refitted, Until};
pub(crate) use residuals::{Inliers, Residuals, within};
