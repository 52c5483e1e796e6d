//! Building of the tree from the top, by splits of groups of lights.

use super::bounds::LightBounds;
use super::{CHILDREN, LIGHT, Node};
use crate::scene::compile::NONE;

/// Number of intervals of a group's extent between which it may be split.
const BINS: usize = 12;

/// A light: its index and bounds.
type Item = (u32, LightBounds);

/// A group of lights that becomes a child.
struct Group<'a> {
    items: &'a mut [Item],
    bounds: LightBounds,
}

impl<'a> Group<'a> {
    /// Returns a group of lights; `None` without any.
    fn new(items: &'a mut [Item]) -> Option<Group<'a>> {
        let (first, rest) = items.split_first()?;
        let bounds = rest.iter().fold(first.1, |all, (_, own)| all.union(own));
        Some(Group { items, bounds })
    }
}

/// Builds the nodes over lights, the root first, and sets the place of each light.
pub fn nodes(mut items: Vec<Item>, places: &mut [u32]) -> Vec<Node> {
    let mut nodes: Vec<Node> = Vec::new();
    let mut waiting: Vec<(Group, u32)> = Vec::new();
    waiting.extend(Group::new(&mut items).map(|root| (root, NONE)));
    while let Some((group, parent)) = waiting.pop() {
        let index = nodes.len() as u32;
        if let Some(child) = child_of(&mut nodes, parent) {
            *child = index;
        }
        let mut node = Node::without_children(parent);
        for (i, group) in children(group).into_iter().enumerate() {
            let place = index * CHILDREN as u32 + i as u32;
            node.set_child(i, &group.bounds);
            if let [(light, _)] = group.items {
                node.child[i] = *light | LIGHT;
                places[*light as usize] = place;
            } else {
                waiting.push((group, place));
            }
        }
        nodes.push(node);
    }
    nodes
}

/// Returns the child at a place; `None` for the root.
fn child_of(nodes: &mut [Node], place: u32) -> Option<&mut u32> {
    let (node, child) = (place as usize / CHILDREN, place as usize % CHILDREN);
    Some(&mut nodes.get_mut(node)?.child[child])
}

/// Splits a group into up to [`CHILDREN`] groups: always that with the greatest cost.
fn children(group: Group) -> Vec<Group> {
    let mut groups = vec![group];
    while groups.len() < CHILDREN {
        let several = groups.iter().enumerate().filter(|(_, g)| g.items.len() > 1);
        let widest = several.max_by(|(_, a), (_, b)| a.bounds.cost().total_cmp(&b.bounds.cost()));
        let Some((widest, _)) = widest else { break };
        let Group { items, bounds } = groups.swap_remove(widest);
        let middle = split(items, &bounds);
        let (left, right) = items.split_at_mut(middle);
        groups.extend([Group::new(left), Group::new(right)].into_iter().flatten());
    }
    groups
}

/// Orders two or more lights so that a split at the returned index has about the least cost [Conty
/// Estevez and Kulla 2018, section 4.4]: groups of lights between planes, of all three axes.
fn split(items: &mut [Item], bounds: &LightBounds) -> usize {
    let extent = bounds.corners[1] - bounds.corners[0];
    let longest = extent.max_element();
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| extent[*axis] > 0.0) {
        let mut bins: [Option<LightBounds>; BINS] = [None; BINS];
        for (_, own) in items.iter() {
            let bin = &mut bins[bin(bounds, axis, own)];
            *bin = join(bin.as_ref(), Some(own));
        }
        let mut right: [Option<LightBounds>; BINS] = [None; BINS];
        for i in (1..BINS).rev() {
            right[i - 1] = join(right[i].as_ref(), bins[i].as_ref());
        }
        let mut left: Option<LightBounds> = None;
        for (i, right) in right.iter().enumerate() {
            left = join(left.as_ref(), bins[i].as_ref());
            if let (Some(left), Some(right)) = (&left, right) {
                // Thin boxes are worse than their area says.
                let cost = (left.cost() + right.cost()) * longest / extent[axis];
                if best.is_none_or(|(least, ..): (f32, _, _)| cost < least) {
                    best = Some((cost, axis, i));
                }
            }
        }
    }
    let Some((_, axis, last)) = best else {
        return items.len() / 2;
    };
    // Stable, so that the tree depends on the order of lights alone.
    items.sort_by_key(|(_, own)| bin(bounds, axis, own) > last);
    items.partition_point(|(_, own)| bin(bounds, axis, own) <= last)
}

/// Returns the interval in which the centre of a light lies.
fn bin(bounds: &LightBounds, axis: usize, own: &LightBounds) -> usize {
    let [low, high] = bounds.corners.map(|corner| corner[axis]);
    let at = (own.center()[axis] - low) / (high - low);
    ((at * BINS as f32) as usize).min(BINS - 1)
}

/// Returns the union of two groups, each of which may be empty.
fn join(a: Option<&LightBounds>, b: Option<&LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (one, None) | (None, one) => one.copied(),
    }
}

impl Node {
    /// Returns a node without children.
    fn without_children(parent: u32) -> Node {
        Node {
            center: [[0.0; CHILDREN]; 3],
            radius2: [1.0; CHILDREN],
            axis: [[0.0; CHILDREN]; 3],
            cos_spread: [1.0; CHILDREN],
            sin_spread: [0.0; CHILDREN],
            cos_emission: [2.0; CHILDREN],
            power: [0.0; CHILDREN],
            child: [NONE; CHILDREN],
            parent,
            round: true,
        }
    }

    /// Sets the properties of child `i`.
    fn set_child(&mut self, i: usize, bounds: &LightBounds) {
        let (center, axis) = (bounds.center(), bounds.directions.axis);
        for k in 0..3 {
            self.center[k][i] = center[k];
            self.axis[k][i] = axis[k];
        }
        self.radius2[i] = bounds.radius2();
        (self.sin_spread[i], self.cos_spread[i]) = bounds.directions.spread.sin_cos();
        self.cos_emission[i] = bounds.cos_emission();
        self.power[i] = bounds.power;
        self.round &= bounds.is_round();
    }
}
