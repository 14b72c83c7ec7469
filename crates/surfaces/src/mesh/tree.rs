//! A tree of boxes around triangles.

use glam::DVec3;

use super::triangle::Triangle;

/// Most triangles in a leaf.
const LEAF: usize = 4;
/// Deeper than any tree: each level halves the number of triangles.
const DEEPEST: usize = 64;

/// Boxes around halves of the triangles, around halves of these, and so on.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Tree {
    nodes: Vec<Node>,
}

/// A box, and what is in it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Node {
    bounds: Bounds,
    /// First triangle of a leaf; otherwise the second of the two children. The first one follows its parent.
    first: u32,
    /// Number of triangles; 0 if the node is no leaf.
    count: u32,
}

/// A box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub low: DVec3,
    pub high: DVec3,
}

impl Bounds {
    /// Squared distance of a position \[length²\].
    #[inline]
    pub fn distance_squared(&self, position: DVec3) -> f64 {
        (self.low - position).max(position - self.high).max(DVec3::ZERO).length_squared()
    }
}

impl Tree {
    /// The tree of some triangles, which it sorts.
    pub fn new(triangles: &mut [Triangle]) -> Self {
        let mut tree = Self { nodes: Vec::with_capacity(triangles.len()) };
        if !triangles.is_empty() {
            tree.build(triangles, 0);
        }
        tree
    }

    fn build(&mut self, triangles: &mut [Triangle], first: usize) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for triangle in triangles.iter() {
            let (least, most) = triangle.bounds();
            (low, high) = (low.min(least), high.max(most));
        }
        let node = self.nodes.len();
        self.nodes.push(Node {
            bounds: Bounds { low, high },
            first: first as u32,
            count: triangles.len() as u32,
        });
        if triangles.len() <= LEAF {
            return;
        }
        let size = high - low;
        let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
        let middle = triangles.len() / 2;
        let center = |triangle: &Triangle| {
            let (low, high) = triangle.bounds();
            low[axis] + high[axis]
        };
        triangles.select_nth_unstable_by(middle, |a, b| center(a).total_cmp(&center(b)));
        let (left, right) = triangles.split_at_mut(middle);
        self.build(left, first);
        let second = self.nodes.len() as u32;
        self.build(right, first + middle);
        self.nodes[node].first = second;
        self.nodes[node].count = 0;
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds { low: DVec3::ZERO, high: DVec3::ZERO }, |node| node.bounds)
    }

    /// Calls `visit` for the triangles of each leaf as long as the `order` of its box, and of all boxes
    /// around it, is below a limit: the given one, then what the last visit has returned. A box whose order
    /// is not a number is left out. Of two boxes the one of lower order comes first.
    #[inline]
    pub fn visit(
        &self,
        mut limit: f64,
        mut order: impl FnMut(&Bounds) -> f64,
        mut visit: impl FnMut(std::ops::Range<usize>) -> f64,
    ) {
        let mut stack = [(0_u32, 0.0_f64); DEEPEST];
        let mut depth = 0;
        if let Some(root) = self.nodes.first() {
            stack[0] = (0, order(&root.bounds));
            depth = 1;
        }
        while depth > 0 {
            depth -= 1;
            let (index, nearest) = stack[depth];
            if nearest.is_nan() || nearest >= limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                limit = visit(node.first as usize..(node.first + node.count) as usize);
                continue;
            }
            let children = [index + 1, node.first];
            let [a, b] = children.map(|child| (child, order(&self.nodes[child as usize].bounds)));
            // The nearer one last: it is taken first.
            for child in if a.1 < b.1 { [b, a] } else { [a, b] } {
                if child.1 < limit {
                    stack[depth] = child;
                    depth += 1;
                }
            }
        }
    }
}
