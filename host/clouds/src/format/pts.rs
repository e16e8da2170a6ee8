//! PTS, as Leica's programs write it: a line with the count of points, then a point a line.

use std::fmt::Write;

use nalgebra::Point3;

use super::text;
use crate::Cloud;

/// Reads x, y, z of each point; more numbers of a line are ignored.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let end = bytes.iter().position(|&byte| byte == b'\n').unwrap_or(bytes.len());
    let (first, rest) = bytes.split_at(end);
    let count: Option<usize> = str::from_utf8(first).ok().and_then(|line| line.trim().parse().ok());
    let count = count.ok_or("expected the count of points in the first line of a PTS file")?;
    let points = text::parse_text(rest)?;
    match points.len() == count {
        true => Ok(points),
        false => {
            Err(format!("expected {count} points as the first line says, found {}", points.len()))
        }
    }
}

/// The points alone, each number with as many digits as tell it from all others.
pub(super) fn bytes(cloud: &Cloud) -> Vec<u8> {
    let mut out = format!("{}\n", cloud.points.len());
    for p in &cloud.points {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{} {} {}", p.x, p.y, p.z);
    }
    out.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_cloud_reads_back_and_a_wrong_count_is_refused() {
        let cloud = Cloud::new(vec![[0.1, -2.0, 3e7].into(), [1.0, 0.0, 1e-30].into()]);
        let file = bytes(&cloud);
        assert_eq!(parse(&file), Ok(cloud.points));
        assert_eq!(parse(b"1\r\n1 2 3 -700 9 9 9\r\n"), Ok(vec![[1.0, 2.0, 3.0].into()]));
        for (file, expected) in [
            (&file[..file.len() - 40], "expected 2 points"),
            (b"2\n1 2 3\n", "expected 2 points as the first line says, found 1"),
            (b"x y z\n1 2 3\n", "expected the count of points"),
            (b"", "expected the count of points"),
        ] {
            assert!(parse(file).is_err_and(|problem| problem.contains(expected)), "{expected}");
        }
    }
}
