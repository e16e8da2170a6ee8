//! Split of a place into parts for training and for test viewpoints.

/// Part of the viewpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Split {
    /// Viewpoints of the optimiser: a quarter of the place.
    Train = 0,
    /// Viewpoints of the test: the rest.
    Test = 1,
}

/// Square cells: one in four of every row is for training, in a column that changes from row to
/// row.
///
/// Both splits keep half the gap from the borders of the cells, so any training viewpoint is at
/// least [`Territory::gap_m`] from any test viewpoint.
pub(super) struct Territory {
    low: [f64; 2],
    cell_m: f64,
    gap_m: f64,
    split: Split,
}

impl Territory {
    pub(super) fn new((low, high): ([f32; 2], [f32; 2]), split: Split) -> Self {
        let side = f64::from((high[0] - low[0]).min(high[1] - low[1])).max(1.0);
        let cell_m = (side / 4.0).min(34.0);
        Self { low: low.map(f64::from), cell_m, gap_m: (0.4 * cell_m).min(10.0), split }
    }

    /// Least distance between viewpoints of different splits: 10 m, or less in a place under 100 m
    /// wide.
    #[cfg(test)]
    pub(super) fn gap_m(&self) -> f64 {
        self.gap_m
    }

    /// True when this split may use a point: nothing within half a gap belongs to the other.
    pub(super) fn owns(&self, at: [f64; 2]) -> bool {
        let half = 0.5 * self.gap_m;
        let corners = [-half, half].map(|dx| [-half, half].map(|dy| [at[0] + dx, at[1] + dy]));
        corners.as_flattened().iter().all(|p| self.trains(*p) == (self.split == Split::Train))
    }

    fn trains(&self, at: [f64; 2]) -> bool {
        const COLUMN: [i64; 4] = [0, 2, 1, 3];
        let [i, j] = [0, 1].map(|axis| ((at[axis] - self.low[axis]) / self.cell_m).floor() as i64);
        i.rem_euclid(4) == COLUMN[j.rem_euclid(4) as usize]
    }
}
