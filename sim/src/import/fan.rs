//! Polygons as fans of triangles from their first corner.

/// Corners of a polygon so far.
#[derive(Default)]
pub(super) struct Fan {
    first: u32,
    last: u32,
    /// Number of corners.
    pub(super) count: usize,
}

impl Fan {
    /// Adds a corner; returns the triangle that it completes.
    pub(super) fn push(&mut self, corner: u32) -> Option<[u32; 3]> {
        let triangle = (self.count >= 2).then_some([self.first, self.last, corner]);
        if self.count == 0 {
            self.first = corner;
        }
        (self.last, self.count) = (corner, self.count + 1);
        triangle
    }
}
