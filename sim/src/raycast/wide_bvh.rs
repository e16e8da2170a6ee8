//! Hierarchy of nodes with eight children, whose boxes are tested together.

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// Children of a node: the lanes of a vector of `f32`.
pub(super) const WIDTH: usize = 8;

/// Node with the boxes of its children.
#[derive(Clone)]
#[repr(align(32))]
pub(super) struct WideNode {
    /// Least and greatest coordinates: `[axis][side][child]`.
    pub(super) bounds: [[[f32; WIDTH]; 2]; 3],
    pub(super) children: [Child; WIDTH],
    /// Number of children in use.
    pub(super) used: u32,
}

/// Content of a box: a node or a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Child {
    /// Index of the node, or of the first triangle of a leaf.
    pub(super) first: u32,
    /// Number of triangles of a leaf; 0 for a node.
    pub(super) count: u32,
}

impl WideNode {
    pub(super) const EMPTY: Self = Self {
        bounds: [[[0.0; WIDTH]; 2]; 3],
        children: [Child { first: 0, count: 0 }; WIDTH],
        used: 0,
    };

    fn push(&mut self, node: &Bvh2Node, child: Child) {
        let bounds = node.aabb();
        for axis in 0..3 {
            self.bounds[axis][0][self.used as usize] = bounds.min[axis];
            self.bounds[axis][1][self.used as usize] = bounds.max[axis];
        }
        self.children[self.used as usize] = child;
        self.used += 1;
    }
}

/// Collapses a binary hierarchy to nodes of up to eight children, the root first: the child with
/// the largest box is opened until there are eight (Wald, Benthin and Boulos 2008).
pub(super) fn widen(bvh: &Bvh2) -> Vec<WideNode> {
    let mut nodes = Vec::with_capacity(bvh.nodes.len() / 6 + 1);
    let mut pending = Vec::new();
    if !bvh.nodes.is_empty() {
        nodes.push(WideNode::EMPTY);
        pending.push((0, 0));
    }
    while let Some((at, narrow)) = pending.pop() {
        let (open, count) = open_children(bvh, narrow);
        for &child in &open[..count] {
            let node = &bvh.nodes[child as usize];
            let mut what = Child { first: node.first_index, count: node.prim_count };
            if !node.is_leaf() {
                what.first = nodes.len() as u32;
                pending.push((nodes.len(), child));
                nodes.push(WideNode::EMPTY);
            }
            nodes[at].push(node, what);
        }
    }
    nodes
}

/// Up to eight descendants that together hold the triangles of a node.
fn open_children(bvh: &Bvh2, root: u32) -> ([u32; WIDTH], usize) {
    let (mut open, mut count) = ([root; WIDTH], 1);
    while count < WIDTH {
        let area = |at: usize| {
            let node = &bvh.nodes[open[at] as usize];
            if node.is_leaf() { f32::NEG_INFINITY } else { node.aabb().half_area() }
        };
        let largest = (1..count).fold(0, |best, at| if area(at) > area(best) { at } else { best });
        let node = &bvh.nodes[open[largest] as usize];
        if node.is_leaf() {
            break;
        }
        (open[largest], open[count]) = (node.first_index, node.first_index + 1);
        count += 1;
    }
    (open, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use obvhs::BvhBuildParams;
    use obvhs::aabb::Aabb;
    use obvhs::bvh2::builder::build_bvh2;

    fn of(count: usize) -> (Bvh2, Vec<WideNode>) {
        let cube = |k: usize| {
            let low = [(k * 37 % 101) as f32, (k * 53 % 97) as f32, (k * 71 % 89) as f32];
            Aabb::new(low.into(), low.map(|x| x + 1.0).into())
        };
        let boxes: Vec<Aabb> = (0..count).map(cube).collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut Default::default());
        let nodes = widen(&bvh);
        (bvh, nodes)
    }

    #[test]
    fn every_triangle_is_in_one_leaf_and_every_node_but_the_root_in_one_node() {
        for count in [0, 1, 2, 7, 8, 9, 1000] {
            let (_, nodes) = of(count);
            let (mut triangles, mut inner) = (vec![0; count], vec![0; nodes.len()]);
            for node in &nodes {
                for child in &node.children[..node.used as usize] {
                    match child.count {
                        0 => inner[child.first as usize] += 1,
                        n => (child.first..child.first + n)
                            .for_each(|slot| triangles[slot as usize] += 1),
                    }
                }
            }
            assert_eq!(triangles, vec![1; count]);
            assert_eq!(inner.first().copied().unwrap_or(0), 0);
            assert!(inner.iter().skip(1).all(|&n| n == 1));
        }
    }

    #[test]
    fn a_large_hierarchy_is_wide_and_has_boxes_that_hold_their_children() {
        let (_, nodes) = of(1000);
        let used: u32 = nodes.iter().map(|node| node.used).sum();
        assert_eq!(nodes[0].used as usize, WIDTH);
        assert!(used as usize > 3 * nodes.len(), "{used} in {}", nodes.len());
        for node in &nodes {
            for k in 0..node.used as usize {
                let child = node.children[k];
                if child.count > 0 {
                    continue;
                }
                let inner = &nodes[child.first as usize];
                for (outer, inside) in node.bounds.iter().zip(&inner.bounds) {
                    let used = ..inner.used as usize;
                    assert!(inside[0][used].iter().all(|&low| low >= outer[0][k]));
                    assert!(inside[1][used].iter().all(|&high| high <= outer[1][k]));
                }
            }
        }
    }
}
