//! Crossover and mutation: new points from old ones.

use echoloop_random::Generator;

/// Probability of a crossover, and of a coordinate to take part in it (Deb and Agrawal 1995).
const CROSSOVER: f64 = 0.9;
const TAKES_PART: f64 = 0.5;

/// Distribution indices of crossover and of mutation: the larger, the nearer to the parents.
const ETA_CROSSOVER: f64 = 15.0;
const ETA_MUTATION: f64 = 20.0;

/// Child of two points of the unit cube; it lies inside the cube.
pub(super) fn child(a: &[f64], b: &[f64], random: &mut Generator) -> Vec<f64> {
    let crosses = random.chance(CROSSOVER);
    let mutates = 1.0 / a.len() as f64;
    let coordinate = |(&a, &b): (&f64, &f64)| {
        let x = if crosses && random.chance(TAKES_PART) { crossed(a, b, random) } else { a };
        if random.chance(mutates) { mutated(x, random) } else { x }
    };
    a.iter().zip(b).map(coordinate).collect()
}

/// Simulated binary crossover: one of the two children, at random. Its distance from the middle is
/// distributed as that of a one-point crossover of binary digits.
fn crossed(a: f64, b: f64, random: &mut Generator) -> f64 {
    let u = random.unit();
    let power = 1.0 / (ETA_CROSSOVER + 1.0);
    let beta = if u <= 0.5 {
        libm::pow(2.0 * u, power)
    } else {
        libm::pow(0.5 / (1.0 - u).max(f64::MIN_POSITIVE), power)
    };
    let half = 0.5 * beta * (b - a);
    let side = if random.chance(0.5) { half } else { -half };
    (f64::midpoint(a, b) + side).clamp(0.0, 1.0)
}

/// Polynomial mutation: a step whose distribution ends at the walls of the cube.
fn mutated(x: f64, random: &mut Generator) -> f64 {
    let u = random.unit();
    let power = ETA_MUTATION + 1.0;
    let step = if u < 0.5 {
        let rest = 2.0 * u + (1.0 - 2.0 * u) * libm::pow(1.0 - x, power);
        libm::pow(rest, 1.0 / power) - 1.0
    } else {
        let rest = 2.0 * (1.0 - u) + (2.0 * u - 1.0) * libm::pow(x, power);
        1.0 - libm::pow(rest, 1.0 / power)
    };
    (x + step).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 20_000;

    fn mean(values: impl Iterator<Item = f64>) -> f64 {
        values.sum::<f64>() / N as f64
    }

    #[test]
    fn children_keep_the_parents_middle_and_lie_mostly_near_them() {
        let mut random = Generator::new(3, 0);
        let children: Vec<f64> = (0..N).map(|_| crossed(0.3, 0.5, &mut random)).collect();
        assert!((mean(children.iter().copied()) - 0.4).abs() < 0.002);
        let near = |x: &&f64| (**x - 0.3).abs() < 0.02 || (**x - 0.5).abs() < 0.02;
        let share = children.iter().filter(near).count() as f64 / N as f64;
        assert!(share > 0.9, "{share}");
    }

    #[test]
    fn a_mutation_stays_in_the_cube_and_is_mostly_small_but_may_be_large() {
        let mut random = Generator::new(4, 0);
        for x in [0.0, 0.1, 0.5, 1.0] {
            let mutants: Vec<f64> = (0..N).map(|_| mutated(x, &mut random)).collect();
            assert!(mutants.iter().all(|x| (0.0..=1.0).contains(x)));
            let moved = mean(mutants.iter().map(|y| (y - x).abs()));
            assert!((0.015..0.06).contains(&moved), "{x}: {moved}");
            let largest = mutants.iter().map(|y| (y - x).abs()).fold(0.0, f64::max);
            assert!(largest > 0.2, "{x}: {largest}");
        }
    }
}
