//! A bounding volume hierarchy over the occluder, four children to a node, laid out for the device.
//!
//! Each node holds the boxes of its children: a ray waits for memory once where it would wait twice in a binary tree. A child is
//! either the index of a node, or a leaf: [`LEAF`] set, the number of primitives in the next four bits, the first primitive in
//! the lowest 27. Where there are fewer than four, the others are leaves of no primitives in boxes that no ray reaches.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use crate::engine::vulkan::shaders::glsl::shared::bvh as glsl;
use crate::scene::proxy::Occluder;
use crate::scene::similarity::Similarity;
use crate::{Error, Result};

/// Marks a child that is a leaf.
pub(crate) const LEAF: u32 = glsl::LEAF;
/// Where a leaf keeps its number of primitives.
pub(crate) const COUNT_SHIFT: u32 = glsl::COUNT_SHIFT;
/// A leaf without primitives.
pub(crate) const EMPTY: u32 = LEAF;
/// Most entries of a traversal's stack.
pub(crate) const STACK: u32 = glsl::STACK;
/// Children of a node.
pub(crate) const WIDTH: usize = 4;

/// Most levels of the binary tree that nodes are made from, by recursion.
const MAX_DEPTH: u32 = 96;

/// Most primitives of a leaf.
const LEAF_SIZE: u32 = glsl::LEAF_SIZE;
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
    /// Four children and the sides of their boxes: seven vec4 of std430.
    pub struct Node {
        /// Lowest x of the children.
        pub lo_x: [f32; 4],
        /// Lowest y.
        pub lo_y: [f32; 4],
        /// Lowest z.
        pub lo_z: [f32; 4],
        /// Highest x.
        pub hi_x: [f32; 4],
        /// Highest y.
        pub hi_y: [f32; 4],
        /// Highest z.
        pub hi_z: [f32; 4],
        /// The children.
        pub children: [u32; 4],
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
    /// Centre, in the frame of the hierarchy.
    pub centre: [f32; 3],
    /// Radius, in lengths of that frame.
    pub radius: f32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Index of the primitive in the occluder.
    pub index: u32,
}

/// The primitives in the order of the leaves.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitives {
    /// The triangles of a mesh.
    Triangles(Vec<Triangle>),
    /// The discs of a point cloud.
    Discs(Vec<Disc>),
}

/// The hierarchy, in the normalised frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// Nodes, parents before children; the root comes first and always exists.
    pub nodes: Vec<Node>,
    /// Primitives in the order of the leaves.
    pub primitives: Primitives,
    /// Entries that a traversal's stack needs at most.
    pub stack: u32,
}

impl Bvh {
    /// Builds the hierarchy over `occluder`, mapped by `to_internal` to the frame that rays are cast in.
    ///
    /// The builder (locally ordered clustering with reinsertion) runs on one thread and gives the same binary tree every time; a
    /// scene that would make it slow, or need a deeper stack than there is, is split at medians instead. Then each node takes up
    /// descendants in place of its largest children, until it has four. Boxes hold the primitives as rounded to f32.
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
        let clusters = clustered(&boxes).map(|tree| Tree::new(&boxes, &tree)).filter(|tree| tree.stack <= STACK);
        let Tree { nodes, order, stack, .. } = clusters.unwrap_or_else(|| Tree::new(&boxes, &split_at_medians(&boxes)));
        Ok(Self { nodes, primitives: in_order(&internal, &order), stack })
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
    /// Farther away than any ray reaches, and nowhere an infinity that could become a NaN.
    const AWAY: Self = Self { lo: Vec3::splat(1e30), hi: Vec3::splat(1e30) };

    /// Wider than the exact bounds by eight units in the last place of the largest coordinate.
    fn around((lo, hi): (DVec3, DVec3)) -> Self {
        let margin =
            lo.abs().max(hi.abs()).max_element() * f64::from(4.0 * f32::EPSILON) + f64::from(f32::MIN_POSITIVE);
        Self { lo: (lo - margin).as_vec3(), hi: (hi + margin).as_vec3() }
    }

    /// Around several primitives.
    fn of(boxes: &[Self], items: &[u32]) -> Self {
        items.iter().fold(Self::NOTHING, |all, i| all.union(boxes[*i as usize]))
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
    collapse(&mut tree, LEAF_SIZE, 1.0);
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

/// The tree whose nodes are halved at the median of the longest side of their primitives' centres: as deep as a balanced one, at most 26
/// levels for all the primitives that can be addressed.
fn split_at_medians(boxes: &[Bounds]) -> Bvh2 {
    let mut tree = Bvh2 { primitive_indices: (0..boxes.len() as u32).collect(), ..Bvh2::default() };
    if !boxes.is_empty() {
        tree.nodes.push(Bvh2Node::default());
        split(&mut tree, boxes, 0, (0, boxes.len()));
    }
    tree
}

/// Makes `node` that of the `count` primitives from `start` on.
fn split(tree: &mut Bvh2, boxes: &[Bounds], node: usize, (start, count): (usize, usize)) {
    let items = &mut tree.primitive_indices[start..start + count];
    let bounds = Bounds::of(boxes, items).aabb();
    if count <= LEAF_SIZE as usize {
        tree.nodes[node] = Bvh2Node::new(bounds, count as u32, start as u32);
        return;
    }
    let middle = |i: u32| 0.5 * boxes[i as usize].lo + 0.5 * boxes[i as usize].hi;
    let (lo, hi) = items
        .iter()
        .map(|i| middle(*i))
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let axis = (hi - lo).max_position();
    let half = count / 2;
    items.select_nth_unstable_by(half, |a, b| middle(*a)[axis].total_cmp(&middle(*b)[axis]).then(a.cmp(b)));
    let first = tree.nodes.len();
    tree.nodes[node] = Bvh2Node::new(bounds, 0, first as u32);
    tree.nodes.extend([Bvh2Node::default(); 2]);
    split(tree, boxes, first, (start, half));
    split(tree, boxes, first + 1, (start + half, count - half));
}

/// The nodes as they are laid out.
struct Tree<'a> {
    /// Of each primitive.
    boxes: &'a [Bounds],
    nodes: Vec<Node>,
    /// Primitives in leaf order.
    order: Vec<u32>,
    /// Entries that a traversal's stack needs at most.
    stack: u32,
}

/// A child of a node, and what a traversal of it needs of the stack.
#[derive(Clone, Copy)]
struct Child {
    code: u32,
    bounds: Bounds,
    stack: u32,
}

impl<'a> Tree<'a> {
    /// Lays out a binary tree over `boxes`.
    fn new(boxes: &'a [Bounds], tree: &Bvh2) -> Self {
        let mut wide = Self { boxes, nodes: Vec::new(), order: Vec::with_capacity(boxes.len()), stack: 0 };
        let root: &[usize] = if tree.nodes.is_empty() { &[] } else { &[0] };
        wide.stack = wide.node(tree, root).stack;
        wide
    }

    /// Lays out a node above `parts` of the tree, of which the largest are taken apart. Recursion is as deep as the tree.
    fn node(&mut self, tree: &Bvh2, parts: &[usize]) -> Child {
        let mut parts = parts.to_vec();
        while parts.len() < WIDTH {
            let inner = (0..parts.len()).filter(|i| !tree.nodes[parts[*i]].is_leaf());
            let area = |i: &usize| tree.nodes[parts[*i]].aabb().half_area();
            let Some(at) = inner.max_by(|i, j| area(i).total_cmp(&area(j))) else { break };
            let first = tree.nodes[parts[at]].first_index as usize;
            parts.splice(at..=at, [first, first + 1]);
        }
        let slot = self.nodes.len();
        self.nodes.push(Node::zeroed());
        let mut children = [Child { code: EMPTY, bounds: Bounds::AWAY, stack: 0 }; WIDTH];
        let (mut bounds, mut stack) = (Bounds::NOTHING, 0);
        for (child, part) in children.iter_mut().zip(&parts) {
            let node = &tree.nodes[*part];
            let start = node.first_index as usize;
            *child = match node.is_leaf() {
                true => self.leaf(&tree.primitive_indices[start..start + node.prim_count as usize]),
                false => self.node(tree, &[*part]),
            };
            bounds = bounds.union(child.bounds);
            stack = stack.max(child.stack);
        }
        self.nodes[slot] = Node {
            lo_x: children.map(|child| child.bounds.lo.x),
            lo_y: children.map(|child| child.bounds.lo.y),
            lo_z: children.map(|child| child.bounds.lo.z),
            hi_x: children.map(|child| child.bounds.hi.x),
            hi_y: children.map(|child| child.bounds.hi.y),
            hi_z: children.map(|child| child.bounds.hi.z),
            children: children.map(|child| child.code),
        };
        // There are fewer nodes than primitives, or one. While a child is traversed, the others wait.
        Child { code: slot as u32, bounds, stack: stack + (parts.len() as u32).saturating_sub(1) }
    }

    fn leaf(&mut self, items: &[u32]) -> Child {
        let code = LEAF | (items.len() as u32) << COUNT_SHIFT | self.order.len() as u32;
        self.order.extend_from_slice(items);
        Child { code, bounds: Bounds::of(self.boxes, items), stack: 0 }
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

    /// Boxes of the primitives below a child, checked on the way; every primitive is counted. Returns how many entries of the stack the
    /// child takes.
    fn check(bvh: &Bvh, exact: &[(DVec3, DVec3)], child: u32, (lo, hi): (DVec3, DVec3), seen: &mut [u32]) -> u32 {
        if child & LEAF == 0 {
            let node = bvh.nodes[child as usize];
            let boxes = [0, 1, 2, 3].map(|i| {
                let corner = |x: [f32; 4], y: [f32; 4], z: [f32; 4]| Vec3::new(x[i], y[i], z[i]).as_dvec3();
                (corner(node.lo_x, node.lo_y, node.lo_z), corner(node.hi_x, node.hi_y, node.hi_z))
            });
            let used: Vec<_> = node.children.into_iter().zip(boxes).filter(|(child, _)| *child != EMPTY).collect();
            let deepest = used.iter().map(|(child, (l, h))| {
                assert!(l.cmpge(lo).all() && h.cmple(hi).all());
                check(bvh, exact, *child, (*l, *h), seen)
            });
            return deepest.max().unwrap_or(0) + (used.len() as u32).saturating_sub(1);
        }
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
        0
    }

    fn check_all(bvh: &Bvh, occluder: &Occluder) {
        let exact: Vec<_> = (0..occluder.len()).map(|i| occluder.primitive_bounds(i)).collect();
        let mut seen = vec![0; occluder.len()];
        let stack = check(bvh, &exact, 0, (DVec3::NEG_INFINITY, DVec3::INFINITY), &mut seen);
        assert!(seen.iter().all(|n| *n == 1), "every primitive is in exactly one leaf");
        assert!(stack == bvh.stack && stack <= STACK);
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
            let tree = Tree::new(&boxes, &split_at_medians(&boxes));
            let primitives = in_order(&occluder, &tree.order);
            let bvh = Bvh { nodes: tree.nodes, primitives, stack: tree.stack };
            check_all(&bvh, &occluder);
            // Eight halvings, two to a node, each of which leaves three children waiting.
            assert!(bvh.stack <= 12);
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
        assert!(!root.children.contains(&EMPTY));
        let sides = [root.lo_x, root.lo_y, root.lo_z, root.hi_x, root.hi_y, root.hi_z];
        assert!(sides.as_flattened().iter().all(|side| side.abs() <= 1.001));
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
        assert_eq!((size_of::<Node>(), size_of::<Triangle>(), size_of::<Disc>()), (112, 48, 32));
    }
}
