//! The runner: order of the cells, and the cells that are skipped.

/// Cells of a campaign that have no record yet.
#[derive(Clone, Debug)]
pub struct Unfinished<'a, C> {
    /// The cells, in the order they are run.
    pub cells: Vec<&'a C>,
    /// Number of cells that have a record.
    pub done: usize,
    all: usize,
}

impl<'a, C> Unfinished<'a, C> {
    /// Those of some cells. `is_done` is true for a cell with a record, and `None` where the record
    /// cannot be used: it is kept, and the cell is not run.
    pub fn of(cells: &'a [C], is_done: impl Fn(&C) -> Option<bool>) -> Self {
        let states: Vec<_> = cells.iter().map(is_done).collect();
        let left = cells.iter().zip(&states).filter(|(_, state)| **state == Some(false));
        let done = states.iter().filter(|state| **state == Some(true)).count();
        Self { cells: left.map(|(cell, _)| cell).collect(), done, all: cells.len() }
    }

    /// Runs them one after the other. `run` gets the index of a cell, and its place, as `3 of 9`.
    /// It keeps the record, or the reason of a failure.
    ///
    /// # Errors
    ///
    /// The first of `run`, which ends the campaign: an interruption, or a record that cannot be
    /// written.
    pub fn run<E>(&self, mut run: impl FnMut(usize, &str) -> Result<(), E>) -> Result<(), E> {
        let place = |index| format!("{} of {}", self.done + index + 1, self.all);
        (0..self.cells.len()).try_for_each(|index| run(index, &place(index)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_without_a_record_are_run_in_sequence_until_an_error_ends_the_campaign() {
        // Even numbers have a record; that of 5 cannot be used.
        let is_done = |cell: &u32| (*cell != 5).then_some(cell.is_multiple_of(2));
        let unfinished = Unfinished::of(&[1, 2, 3, 5, 7], is_done);
        assert_eq!((&*unfinished.cells, unfinished.done), (&[&1, &3, &7][..], 1));
        let mut seen = Vec::new();
        let ended = unfinished.run(|index, place| {
            seen.push(place.to_owned());
            if index == 1 { Err("full disk") } else { Ok(()) }
        });
        assert_eq!((ended, seen), (Err("full disk"), vec!["2 of 5".into(), "3 of 5".into()]));
    }
}
