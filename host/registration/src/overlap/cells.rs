//! Cells of equal angles into which the directions around a sensor fall.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Point3;

use super::is_echo;

/// Cells over the whole sphere, row after row from straight down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Angle of a cell, rad.
    pub(super) step_rad: f32,
}

impl Cells {
    /// Cells of an angle of which a turn is a multiple.
    pub(super) fn of_step(step_rad: f32) -> Self {
        let [columns, rows] = [TAU, PI].map(|angle| (angle / step_rad).round() as usize);
        Self { columns, rows, step_rad }
    }

    /// Cells no larger than an angle.
    pub(super) fn within(step_rad: f32) -> Self {
        let columns = (TAU / step_rad).ceil() as usize;
        let step_rad = TAU / columns as f32;
        Self { columns, rows: (PI / step_rad).ceil() as usize, step_rad }
    }

    pub(super) fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Index of the cell of an azimuth and an elevation: see [`direction`].
    pub(super) fn at(&self, [azimuth, elevation]: &[f32; 2]) -> usize {
        let column = ((azimuth / self.step_rad) as usize).min(self.columns - 1);
        let row = ((elevation / self.step_rad) as usize).min(self.rows - 1);
        row * self.columns + column
    }

    /// Row and column of a cell.
    pub(super) fn place(&self, at: usize) -> (usize, usize) {
        (at / self.columns, at % self.columns)
    }

    /// Indices of a cell of a row and of those beside it, all the way round: the first column is
    /// beside the last.
    pub(super) fn beside(&self, row: usize, column: usize) -> [usize; 3] {
        let columns = [column + self.columns - 1, column, column + 1];
        columns.map(|column| row * self.columns + column % self.columns)
    }
}

/// What a sensor at the origin saw: a direction and how far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Index of the point.
    pub(super) point: usize,
    /// See [`direction`].
    pub(super) direction: [f32; 2],
    pub(super) range_m: f32,
}

impl Seen {
    /// Of all points that are echoes: their directions take most of the time.
    pub(super) fn all(points: &[Point3<f32>]) -> Vec<Self> {
        let echoes = points.iter().enumerate().filter(|(_, point)| is_echo(point));
        let seen = |(at, point): (usize, &Point3<f32>)| Self {
            point: at,
            direction: direction(point),
            range_m: point.coords.norm(),
        };
        echoes.map(seen).collect()
    }
}

/// Azimuth, from 0 to 2 π, and elevation above straight down, rad.
pub(super) fn direction(point: &Point3<f32>) -> [f32; 2] {
    [point.y.atan2(point.x) + PI, point.z.atan2(point.x.hypot(point.y)) + FRAC_PI_2]
}
