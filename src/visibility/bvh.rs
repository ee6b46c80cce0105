//! A binary bounding volume hierarchy over the occluder, laid out for the device.
//!
//! Each node holds the boxes of both its children. A child is either the index of a node, or a leaf: [`LEAF`] set, the
//! number of primitives in the next four bits, the first primitive in the lowest 27. An empty child is a leaf of no
//! primitives, so a hierarchy of one primitive, or of none, is traversed like any other.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use crate::scene::proxy::Occluder;
use crate::scene::similarity::Similarity;
use crate::vulkan::shaders::glsl::shared::bvh as glsl;
use crate::{Error, Result};

/// Marks a child that is a leaf.
pub(crate) const LEAF: u32 = glsl::LEAF;
/// Where a leaf keeps its number of primitives.
pub(crate) const COUNT_SHIFT: u32 = glsl::COUNT_SHIFT;
/// A leaf without primitives.
pub(crate) const EMPTY: u32 = LEAF;
/// Most levels of inner nodes, and entries of a traversal's stack.
pub(crate) const MAX_DEPTH: u32 = glsl::STACK;

/// Most primitives of a leaf.
const LEAF_SIZE: u32 = 4;
/// Most primitives that the encoding can address.
const MAX_PRIMITIVES: usize = 1 << COUNT_SHIFT;

crate::specialisation! {
    /// Constants of stages that trace (`shared/bvh.glsl`).
    pub(crate) struct TraversalConstants {
        /// Whether the primitives are discs.
        discs: bool,
    }
}

crate::gpu_struct! {
    /// Two children with their boxes: four vec4 of std430.
    pub struct Node {
        /// Lowest corner of the first child.
        pub lo0: [f32; 3],
        /// The first child.
        pub child0: u32,
        /// Highest corner of the first child.
        pub hi0: [f32; 3],
        /// The second child.
        pub child1: u32,
        /// Lowest corner of the second child.
        pub lo1: [f32; 3],
        /// Padding, zero.
        pub pad0: u32,
        /// Highest corner of the second child.
        pub hi1: [f32; 3],
        /// Padding, zero.
        pub pad1: u32,
    }
}

/// A triangle: three vec4 of std430.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// First corner.
    pub v0: [f32; 3],
    /// Index of the primitive in the occluder.
    pub index: u32,
    /// Second corner minus the first.
    pub e1: [f32; 3],
    /// Padding, zero.
    pub pad0: u32,
    /// Third corner minus the first.
    pub e2: [f32; 3],
    /// Padding, zero.
    pub pad1: u32,
}

/// A disc: two vec4 of std430.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Disc {
    /// Centre.
    pub centre: [f32; 3],
    /// Radius.
    pub radius: f32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Index of the primitive in the occluder.
    pub index: u32,
}

/// The primitives in the order of the leaves.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitives {
    /// Triangles.
    Triangles(Vec<Triangle>),
    /// Discs.
    Discs(Vec<Disc>),
}

/// The hierarchy, in the normalised frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// Nodes, parents before children; the root comes first and always exists.
    pub nodes: Vec<Node>,
    /// Primitives in the order of the leaves.
    pub primitives: Primitives,
    /// Levels of inner nodes, at most [`MAX_DEPTH`]: entries that a traversal's stack needs.
    pub max_depth: u32,
}

impl Bvh {
    /// Builds the hierarchy over `occluder`, mapped by `to_internal` to the frame that rays are cast in.
    ///
    /// The builder (locally ordered clustering with reinsertion) runs on one thread and gives the same tree every time; a
    /// scene that would make it deeper than [`MAX_DEPTH`], or slow, is split at medians instead. Boxes hold the primitives as
    /// rounded to f32.
    ///
    /// # Errors
    /// [`Error::Request`] for more than 2^27 primitives, or coordinates that are beyond f32.
    pub fn new(occluder: &Occluder, to_internal: &Similarity) -> Result<Self> {
        let n = occluder.len();
        if n > MAX_PRIMITIVES {
            return Err(Error::request(format!("surface: {n} primitives; thin it to at most {MAX_PRIMITIVES}")));
        }
        let internal = occluder.transformed(to_internal);
        let boxes: Vec<Bounds> = (0..n).map(|i| Bounds::around(internal.primitive_bounds(i))).collect();
        if boxes.iter().any(|b| !(b.lo.is_finite() && b.hi.is_finite())) {
            return Err(Error::request(
                "surface: it reaches beyond what single precision holds; crop it to the region",
            ));
        }
        let mut tree = Tree { boxes: &boxes, nodes: Vec::new(), order: Vec::with_capacity(n), max_depth: 0 };
        match clustered(&boxes) {
            Some(clusters) => tree.adopt(&clusters),
            None => tree.split_at_medians(),
        }
        let Tree { nodes, order, max_depth, .. } = tree;
        Ok(Self { nodes, primitives: in_order(&internal, &order), max_depth })
    }
}

/// The primitives in leaf order, rounded to f32.
fn in_order(occluder: &Occluder, order: &[u32]) -> Primitives {
    let single = |p: DVec3| p.as_vec3().to_array();
    match occluder {
        Occluder::Triangles(triangles) => {
            let triangle = |&index: &u32| {
                let [a, b, c] = triangles[index as usize];
                Triangle { v0: single(a), index, e1: single(b - a), pad0: 0, e2: single(c - a), pad1: 0 }
            };
            Primitives::Triangles(order.iter().map(triangle).collect())
        }
        Occluder::Discs(discs) => {
            let disc = |&index: &u32| {
                let disc = discs[index as usize];
                let radius = disc.radius as f32;
                Disc { centre: single(disc.centre), radius, normal: single(disc.normal), index }
            };
            Primitives::Discs(order.iter().map(disc).collect())
        }
    }
}

/// A box in f32 that holds a primitive however its coordinates are rounded.
#[derive(Clone, Copy)]
struct Bounds {
    lo: Vec3,
    hi: Vec3,
}

impl Bounds {
    const NOTHING: Self = Self { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    /// Wider than the exact bounds by eight units in the last place of the largest coordinate.
    fn around((lo, hi): (DVec3, DVec3)) -> Self {
        let margin =
            lo.abs().max(hi.abs()).max_element() * f64::from(4.0 * f32::EPSILON) + f64::from(f32::MIN_POSITIVE);
        Self { lo: (lo - margin).as_vec3(), hi: (hi + margin).as_vec3() }
    }

    fn bits(&self) -> [u32; 6] {
        [self.lo.x, self.lo.y, self.lo.z, self.hi.x, self.hi.y, self.hi.z].map(f32::to_bits)
    }

    fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }
}

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        Aabb::new(self.lo.into(), self.hi.into())
    }
}

/// Most boxes that may coincide for clustering to be used.
const MAX_EQUAL: usize = 64;

/// The tree by locally ordered clustering and reinsertion, unless there is nothing to cluster or the tree is too deep.
/// Where many boxes coincide, clustering takes quadratic time for a tree as deep as there are boxes: not attempted.
fn clustered(boxes: &[Bounds]) -> Option<Bvh2> {
    let mut keys: Vec<[u32; 6]> = boxes.iter().map(Bounds::bits).collect();
    keys.sort_unstable();
    let most_equal = keys.chunk_by(|a, b| a == b).map(<[_]>::len).max()?;
    if most_equal > MAX_EQUAL {
        return None;
    }
    // The parameters of the library's medium build, which would walk the whole tree recursively in debug builds.
    let indices = (0..boxes.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        boxes,
        indices,
        SortPrecision::U64,
        3,
    );
    let mut optimiser = ReinsertionOptimizer::default();
    optimiser.run(&mut tree, 0.05, None);
    collapse(&mut tree, LEAF_SIZE, 3.0);
    optimiser.run(&mut tree, 0.1, None);
    let mut open = vec![(0, 0)];
    while let Some((node, depth)) = open.pop() {
        let node = &tree.nodes[node];
        if !node.is_leaf() {
            if depth == MAX_DEPTH {
                return None;
            }
            let first = node.first_index as usize;
            open.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    Some(tree)
}

/// The nodes as they are laid out.
struct Tree<'a> {
    /// Of each primitive.
    boxes: &'a [Bounds],
    nodes: Vec<Node>,
    /// Primitives in leaf order.
    order: Vec<u32>,
    max_depth: u32,
}

impl Tree<'_> {
    /// Lays out the library's tree.
    fn adopt(&mut self, tree: &Bvh2) {
        let root = &tree.nodes[0];
        if root.is_leaf() {
            self.root_of_leaf(&tree.primitive_indices);
        } else {
            self.adopt_children(tree, root.first_index as usize, 1);
        }
    }

    /// Lays out the node whose children are `first` and its sibling. Recursion is as deep as the tree: [`MAX_DEPTH`].
    fn adopt_children(&mut self, tree: &Bvh2, first: usize, depth: u32) -> (u32, Bounds) {
        let slot = self.open_node(depth);
        let [left, right] = [first, first + 1].map(|child| {
            let node = &tree.nodes[child];
            let start = node.first_index as usize;
            if node.is_leaf() {
                self.leaf(&tree.primitive_indices[start..start + node.prim_count as usize])
            } else {
                self.adopt_children(tree, start, depth + 1)
            }
        });
        self.close_node(slot, left, right)
    }

    /// Splits all primitives at the median of the longest side of their centres, again and again.
    fn split_at_medians(&mut self) {
        let mut items: Vec<u32> = (0..self.boxes.len() as u32).collect();
        if items.len() <= LEAF_SIZE as usize {
            self.root_of_leaf(&items);
        } else {
            self.split(&mut items, 1);
        }
    }

    /// Halves `items`: the depth is that of a balanced tree, at most 26 for all the primitives that can be addressed.
    fn split(&mut self, items: &mut [u32], depth: u32) -> (u32, Bounds) {
        if items.len() <= LEAF_SIZE as usize {
            return self.leaf(items);
        }
        let slot = self.open_node(depth);
        let boxes = self.boxes;
        let middle = |i: u32| 0.5 * boxes[i as usize].lo + 0.5 * boxes[i as usize].hi;
        let (lo, hi) = items
            .iter()
            .map(|i| middle(*i))
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let axis = (hi - lo).max_position();
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |a, b| middle(*a)[axis].total_cmp(&middle(*b)[axis]).then(a.cmp(b)));
        let (low, high) = items.split_at_mut(half);
        let (left, right) = (self.split(low, depth + 1), self.split(high, depth + 1));
        self.close_node(slot, left, right)
    }

    /// The root of a tree that is a single leaf.
    fn root_of_leaf(&mut self, items: &[u32]) {
        let slot = self.open_node(1);
        let leaf = self.leaf(items);
        self.close_node(slot, leaf, (EMPTY, Bounds { lo: Vec3::ZERO, hi: Vec3::ZERO }));
    }

    fn open_node(&mut self, depth: u32) -> usize {
        self.max_depth = self.max_depth.max(depth);
        self.nodes.push(Node::zeroed());
        self.nodes.len() - 1
    }

    fn close_node(&mut self, slot: usize, left: (u32, Bounds), right: (u32, Bounds)) -> (u32, Bounds) {
        self.nodes[slot] = Node {
            lo0: left.1.lo.to_array(),
            child0: left.0,
            hi0: left.1.hi.to_array(),
            child1: right.0,
            lo1: right.1.lo.to_array(),
            pad0: 0,
            hi1: right.1.hi.to_array(),
            pad1: 0,
        };
        // There are fewer nodes than primitives, or one.
        (slot as u32, left.1.union(right.1))
    }

    fn leaf(&mut self, items: &[u32]) -> (u32, Bounds) {
        let code = LEAF | (items.len() as u32) << COUNT_SHIFT | self.order.len() as u32;
        self.order.extend_from_slice(items);
        let bounds = items.iter().fold(Bounds::NOTHING, |all, i| all.union(self.boxes[*i as usize]));
        (code, if items.is_empty() { Bounds { lo: Vec3::ZERO, hi: Vec3::ZERO } } else { bounds })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{self, Orientation, Proxy};
    use crate::scene::{random, samples};

    fn scattered(n: u32, seed: u64, size: f64) -> Occluder {
        let p = |i: u32, k: u32| {
            let [x, y, z, _] = random::uniforms(seed, k, i);
            DVec3::new(x, y, z)
        };
        Occluder::Triangles((0..n).map(|i| [0, 1, 2].map(|k| p(i, 9) + size * p(i, k))).collect())
    }

    /// Boxes of the primitives below a child, checked on the way; every primitive is counted.
    fn check(
        bvh: &Bvh,
        exact: &[(DVec3, DVec3)],
        child: u32,
        lo: [f32; 3],
        hi: [f32; 3],
        seen: &mut [u32],
        depth: u32,
    ) {
        let (lo, hi) = (Vec3::from(lo).as_dvec3(), Vec3::from(hi).as_dvec3());
        if child & LEAF == 0 {
            let node = bvh.nodes[child as usize];
            check(bvh, exact, node.child0, node.lo0, node.hi0, seen, depth + 1);
            check(bvh, exact, node.child1, node.lo1, node.hi1, seen, depth + 1);
            for (l, h) in [(node.lo0, node.hi0), (node.lo1, node.hi1)] {
                let empty = l == [0.0; 3] && h == [0.0; 3];
                assert!(empty || Vec3::from(l).as_dvec3().cmpge(lo).all() && Vec3::from(h).as_dvec3().cmple(hi).all());
            }
            return;
        }
        assert!(depth <= bvh.max_depth);
        let (first, count) = (child & ((1 << COUNT_SHIFT) - 1), child >> COUNT_SHIFT & 15);
        assert!(count <= LEAF_SIZE);
        for slot in first..first + count {
            let index = match &bvh.primitives {
                Primitives::Triangles(triangles) => triangles[slot as usize].index,
                Primitives::Discs(discs) => discs[slot as usize].index,
            } as usize;
            seen[index] += 1;
            assert!(exact[index].0.cmpge(lo).all() && exact[index].1.cmple(hi).all());
        }
    }

    fn check_all(bvh: &Bvh, occluder: &Occluder) {
        let exact: Vec<_> = (0..occluder.len()).map(|i| occluder.primitive_bounds(i)).collect();
        let mut seen = vec![0; occluder.len()];
        check(bvh, &exact, 0, [f32::NEG_INFINITY; 3], [f32::INFINITY; 3], &mut seen, 0);
        assert!(seen.iter().all(|n| *n == 1), "every primitive is in exactly one leaf");
        assert!(bvh.max_depth <= MAX_DEPTH);
    }

    /// A primitive outside its box, or in no leaf, lets rays through the wall that it is.
    #[test]
    fn every_primitive_is_in_one_leaf_within_all_boxes_above() {
        for n in [0, 1, 2, 3, 4, 5, 9, 100, 3000] {
            let occluder = scattered(n, u64::from(n), 0.1);
            let bvh = Bvh::new(&occluder, &Similarity::IDENTITY).unwrap();
            check_all(&bvh, &occluder);
        }
        let disc = |i: u32| {
            let [x, y, z, r] = random::uniforms(5, 0, i);
            let [u, v, ..] = random::uniforms(5, 1, i);
            proxy::Disc { centre: DVec3::new(x, y, z), normal: random::direction(u, v), radius: 0.1 * r + 0.01 }
        };
        let discs = Occluder::Discs((0..500).map(disc).collect());
        check_all(&Bvh::new(&discs, &Similarity::IDENTITY).unwrap(), &discs);
    }

    /// The fallback takes over when a tree is too deep; it must hold all primitives as well, and be balanced.
    #[test]
    fn the_median_split_builds_a_valid_balanced_tree() {
        for n in [0, 1, 4, 5, 1000] {
            let occluder = scattered(n, 77, 0.05);
            let boxes: Vec<Bounds> = (0..n as usize).map(|i| Bounds::around(occluder.primitive_bounds(i))).collect();
            let mut tree = Tree { boxes: &boxes, nodes: Vec::new(), order: Vec::new(), max_depth: 0 };
            tree.split_at_medians();
            let primitives = in_order(&occluder, &tree.order);
            let bvh = Bvh { nodes: tree.nodes, primitives, max_depth: tree.max_depth };
            check_all(&bvh, &occluder);
            assert!(bvh.max_depth <= 9);
        }
    }

    /// Identical, nested and exponentially shrinking primitives are where trees degenerate: the stack bound must hold.
    #[test]
    fn hard_scenes_stay_within_the_stack() {
        let same = Occluder::Triangles(vec![[DVec3::ZERO, DVec3::X, DVec3::Y]; 2000]);
        let shrinking = |k: i32| [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| (p + 1.0) * 0.9f64.powi(k));
        let nested = Occluder::Triangles((0..700).map(shrinking).collect());
        for occluder in [same, nested] {
            check_all(&Bvh::new(&occluder, &Similarity::IDENTITY).unwrap(), &occluder);
        }
    }

    /// Plans must repeat bit for bit, and so must the tree; the frame's scale must reach the device's copy.
    #[test]
    fn trees_repeat_and_are_in_the_internal_frame() {
        let proxy = Proxy::new(&samples::object(), Orientation::Trusted).unwrap();
        let there = Similarity::to_unit_sphere(proxy.sphere.0, proxy.sphere.1);
        let bvh = Bvh::new(&proxy.occluder, &there).unwrap();
        assert_eq!(bvh, Bvh::new(&proxy.occluder, &there).unwrap());
        check_all(&bvh, &proxy.occluder.transformed(&there));
        let root = bvh.nodes[0];
        let hi = Vec3::from(root.hi0).max(Vec3::from(root.hi1));
        let lo = Vec3::from(root.lo0).min(Vec3::from(root.lo1));
        assert!(hi.max_element() <= 1.001 && lo.min_element() >= -1.001);
    }

    /// What f32 cannot hold would become infinite boxes that every ray enters, or none does.
    #[test]
    fn coordinates_beyond_single_precision_are_refused() {
        let far = Occluder::Triangles(vec![[DVec3::ZERO, DVec3::X * 1e60, DVec3::Y]]);
        assert!(Bvh::new(&far, &Similarity::IDENTITY).is_err());
    }

    /// The shader reads these bytes: sizes and offsets are part of the contract.
    #[test]
    fn layouts_are_those_of_std430() {
        assert_eq!((size_of::<Node>(), size_of::<Triangle>(), size_of::<Disc>()), (64, 48, 32));
    }
}
