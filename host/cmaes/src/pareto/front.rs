//! Dominance, ranks and crowding of points with two objectives.

/// Two values, smaller is better.
pub type Objectives = [f64; 2];

/// True when `a` is as good as `b` in both objectives and better in one. A point with a value that
/// is not finite counts as infinite in both.
pub fn dominates(a: Objectives, b: Objectives) -> bool {
    let ([a0, a1], [b0, b1]) = (finite_or_infinite(a), finite_or_infinite(b));
    a0 <= b0 && a1 <= b1 && (a0 < b0 || a1 < b1)
}

/// The values, both infinite unless both are finite.
fn finite_or_infinite(values: Objectives) -> Objectives {
    if values.iter().all(|value| value.is_finite()) { values } else { [f64::INFINITY; 2] }
}

/// Rank of each point: 0 when no point dominates it, 1 when only points of rank 0 do, and so on.
/// Points of one rank are a front.
///
/// Points taken by the first objective are behind a front if and only if the last point of that
/// front is as good in the second (Jensen 2003): n log n steps for two objectives.
pub fn ranks(values: &[Objectives]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    let key = |i: usize| finite_or_infinite(values[i]);
    order.sort_by(|&a, &b| {
        let ([a0, a1], [b0, b1]) = (key(a), key(b));
        a0.total_cmp(&b0).then(a1.total_cmp(&b1))
    });
    let mut ranks = vec![0; values.len()];
    let mut last: Vec<Objectives> = Vec::new();
    for i in order {
        let own = key(i);
        let rank = last.partition_point(|&ahead| ahead == own || ahead[1] <= own[1]);
        // Equals share a front: neither dominates the other.
        let rank = last[..rank].iter().position(|&ahead| ahead == own).unwrap_or(rank);
        ranks[i] = rank;
        match last.get_mut(rank) {
            Some(ahead) => *ahead = own,
            None => last.push(own),
        }
    }
    ranks
}

/// Crowding distance of each point of a front (Sec. III-B): sum of the sides of the box between its
/// neighbours, each relative to the front's extent; infinite at the ends.
fn crowding(front: &[Objectives]) -> Vec<f64> {
    let mut distance = vec![0.0; front.len()];
    for objective in [0, 1] {
        let value = |i: usize| finite_or_infinite(front[i])[objective];
        let mut order: Vec<usize> = (0..front.len()).collect();
        order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
        let (Some(&first), Some(&last)) = (order.first(), order.last()) else { return distance };
        let extent = value(last) - value(first);
        for three in order.windows(3) {
            let side = (value(three[2]) - value(three[0])) / extent;
            distance[three[1]] += if side.is_finite() { side } else { 0.0 };
        }
        distance[first] = f64::INFINITY;
        distance[last] = f64::INFINITY;
    }
    distance
}

/// Indices of all points, best first: by rank, then by crowding distance, the largest first. Equal
/// points stay in their order.
pub fn sorted_by_crowding(values: &[Objectives]) -> Vec<usize> {
    let ranks = ranks(values);
    let mut order = Vec::new();
    for rank in 0..=ranks.iter().copied().max().unwrap_or(0) {
        let own: Vec<usize> = (0..values.len()).filter(|&i| ranks[i] == rank).collect();
        let front: Vec<Objectives> = own.iter().map(|&i| values[i]).collect();
        let distance = crowding(&front);
        let mut places: Vec<usize> = (0..own.len()).collect();
        places.sort_by(|&a, &b| distance[b].total_cmp(&distance[a]));
        order.extend(places.into_iter().map(|place| own[place]));
    }
    order
}

/// Area that the points dominate, up to the reference point; points that do not dominate it do not
/// count.
pub fn hypervolume(values: &[Objectives], reference: Objectives) -> f64 {
    let mut inside: Vec<Objectives> =
        values.iter().copied().filter(|&v| v[0] < reference[0] && v[1] < reference[1]).collect();
    inside.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let (mut area, mut height) = (0.0, reference[1]);
    for [x, y] in inside {
        area += (reference[0] - x) * (height - y).max(0.0);
        height = height.min(y);
    }
    area
}

#[cfg(test)]
mod tests {
    use echoloop_random::Generator;

    use super::*;

    /// Ranks by definition: fronts peeled off one after the other.
    fn peeled(values: &[Objectives]) -> Vec<usize> {
        let mut ranks = vec![usize::MAX; values.len()];
        for rank in 0..values.len() {
            let left: Vec<usize> = (0..values.len()).filter(|&i| ranks[i] == usize::MAX).collect();
            let free = |&i: &usize| !left.iter().any(|&j| dominates(values[j], values[i]));
            let own: Vec<usize> = left.iter().copied().filter(free).collect();
            own.into_iter().for_each(|i| ranks[i] = rank);
        }
        ranks
    }

    #[test]
    fn ranks_are_the_fronts_peeled_off_one_after_the_other_with_ties_and_without_numbers() {
        let mut random = Generator::new(5, 0);
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        for round in 0..2_000 {
            let levels = [2, 4, 10, 1_000][round % 4];
            let mut value = || match random.index(40) {
                0 => random.pick(&odd),
                _ => random.index(levels) as f64,
            };
            let values: Vec<Objectives> = (0..round % 17).map(|_| [value(), value()]).collect();
            assert_eq!(ranks(&values), peeled(&values), "{values:?}");
        }
    }

    #[test]
    fn crowding_distance_is_infinite_at_the_ends_and_the_box_between_neighbours_inside() {
        let front = [[0.0, 4.0], [1.0, 3.0], [2.0, 2.0], [4.0, 0.0]];
        assert_eq!(crowding(&front), [f64::INFINITY, 1.0, 1.5, f64::INFINITY]);
        assert_eq!(crowding(&[]), []);
        assert_eq!(crowding(&[[1.0, 1.0]; 3])[1], 0.0, "all the same have no extent");
        let values = [[1.0, 3.0], [5.0, 5.0], [0.0, 4.0], [4.0, 0.0], [2.0, 2.0]];
        assert_eq!(sorted_by_crowding(&values), [2, 3, 4, 0, 1]);
    }

    #[test]
    fn the_hypervolume_is_the_area_of_the_union_of_boxes() {
        assert_eq!(hypervolume(&[], [1.0, 1.0]), 0.0);
        assert_eq!(hypervolume(&[[0.0, 0.0]], [2.0, 3.0]), 6.0);
        let stairs = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [3.0, 0.0], [0.5, f64::NAN]];
        assert_eq!(hypervolume(&stairs, [2.0, 2.0]), 3.0);
    }
}
