//! Quadtrees over directions: piecewise constant densities that adapt to the light that arrives.
//!
//! A direction is a point of the unit square in cylindrical coordinates,
//! `((z + 1) / 2, azimuth / (2 pi))`. This map preserves area: a density per area of the square is
//! `4 pi` times a density per solid angle, everywhere on the sphere [Müller et al. 2017].

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::math::trig::sin_cos;

/// Greatest number of levels of a quadtree. The paper has 20; directions in single precision
/// distinguish no more.
const MAX_LEVELS: u32 = 12;

/// Fraction of a quadtree's mass above which a cell is divided: `rho` of the paper.
pub const MASS_OF_CELL: f64 = 0.01;

/// Greatest number below one: the end of an interval that numbers are stretched to.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// A square with four cells. Cell `x + 2 y` has the lower or upper half of both coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Fraction of the square's mass in each cell; their sum is one, or all are zero.
    mass: [f32; 4],
    /// Index of the node that divides a cell, or 0. No cell is divided by the first node.
    child: [u32; 4],
}

/// The quadtree whose root is the node with an index.
#[derive(Clone, Copy)]
pub struct DirectionTree<'a> {
    /// The nodes of this tree and possibly others.
    pub nodes: &'a [Node],
    /// Index of the root.
    pub root: u32,
}

/// A cell without children.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Index of its node.
    pub node: u32,
    /// Number of the cell in the node, below 4.
    pub quadrant: usize,
}

/// A square of the unit square, or one around it.
#[derive(Clone, Copy)]
struct Square {
    /// Corner with the least coordinates.
    corner: [f32; 2],
    /// Length of a side.
    side: f32,
}

impl Square {
    /// Returns one of its quarters.
    fn quarter(self, quadrant: usize) -> Square {
        let side = 0.5 * self.side;
        let [x, y] = self.corner;
        let corner = [
            x + side * (quadrant % 2) as f32,
            y + side * (quadrant / 2) as f32,
        ];
        Square { corner, side }
    }

    /// Returns the area that two squares have in common.
    fn overlap(self, other: Square) -> f32 {
        let length = |axis: usize| {
            let end = (self.corner[axis] + self.side).min(other.corner[axis] + other.side);
            (end - self.corner[axis].max(other.corner[axis])).max(0.0)
        };
        length(0) * length(1)
    }
}

/// Returns the point of the unit square of a unit direction.
pub fn point_of(direction: Vec3) -> [f32; 2] {
    let turn = direction.y.atan2(direction.x) / TAU;
    let azimuth = if turn < 0.0 { turn + 1.0 } else { turn };
    [0.5 * (direction.z + 1.0), azimuth].map(|x| x.clamp(0.0, BELOW_ONE))
}

/// Returns the unit direction of a point of the unit square.
pub fn direction_of([x, y]: [f32; 2]) -> Vec3 {
    let z = 2.0 * x - 1.0;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos(TAU * y);
    Vec3::new(r * cos, r * sin, z)
}

/// Returns the cell of a square that contains a point, and the point relative to that cell.
fn descend([x, y]: [f32; 2]) -> (usize, [f32; 2]) {
    let upper = [x, y].map(|x| x >= 0.5);
    let quadrant = usize::from(upper[0]) + 2 * usize::from(upper[1]);
    let within = |x: f32, upper| 2.0 * x - f32::from(u8::from(upper));
    (quadrant, [within(x, upper[0]), within(y, upper[1])])
}

impl Node {
    /// Returns a node without children whose cells have the same mass.
    pub fn uniform() -> Node {
        Node {
            mass: [0.25; 4],
            child: [0; 4],
        }
    }
}

impl DirectionTree<'_> {
    /// Returns the side of the cell that contains a point of the unit square.
    fn side_at(&self, mut point: [f32; 2]) -> f32 {
        let (mut node, mut side) = (self.root, 0.5);
        loop {
            let (quadrant, within) = descend(point);
            let child = self.nodes[node as usize].child[quadrant];
            if child == 0 {
                return side;
            }
            (node, point, side) = (child, within, 0.5 * side);
        }
    }

    /// Distributes a value over a square around a point of the unit square that is as large as the
    /// cell there [Müller 2019]: `add` gets every cell with its share. Azimuths wrap around; the
    /// square is moved inside at the poles.
    pub fn distribute(&self, [x, y]: [f32; 2], value: f32, add: &mut impl FnMut(Cell, f32)) {
        let side = self.side_at([x, y]);
        let square = Square {
            corner: [(x - 0.5 * side).clamp(0.0, 1.0 - side), y - 0.5 * side],
            side,
        };
        let whole = Square {
            corner: [0.0; 2],
            side: 1.0,
        };
        let density = value / (side * side);
        self.spread(self.root, whole, square, density, add);
        let [left, low] = square.corner;
        for turn in [-1.0, 1.0] {
            let corner = [left, low + turn];
            if corner[1] < 1.0 && corner[1] + side > 0.0 {
                self.spread(self.root, whole, Square { corner, side }, density, add);
            }
        }
    }

    /// Adds a density to the cells of a node where they overlap a square.
    fn spread(
        &self,
        node: u32,
        of_node: Square,
        square: Square,
        density: f32,
        add: &mut impl FnMut(Cell, f32),
    ) {
        for quadrant in 0..4 {
            let quarter = of_node.quarter(quadrant);
            let area = quarter.overlap(square);
            if area > 0.0 {
                match self.nodes[node as usize].child[quadrant] {
                    0 => add(Cell { node, quadrant }, area * density),
                    child => self.spread(child, quarter, square, density, add),
                }
            }
        }
    }

    /// Returns the density per solid angle of [`DirectionTree::sample`].
    pub fn pdf_w(&self, direction: Vec3) -> f32 {
        let mut point = point_of(direction);
        let mut pdf = 0.25 / PI;
        let mut node = &self.nodes[self.root as usize];
        loop {
            let (quadrant, within) = descend(point);
            pdf *= 4.0 * node.mass[quadrant];
            let child = node.child[quadrant];
            if child == 0 || pdf == 0.0 {
                return pdf;
            }
            (node, point) = (&self.nodes[child as usize], within);
        }
    }

    /// Samples a unit direction by two numbers in `[0, 1)`.
    pub fn sample(&self, mut u: [f32; 2]) -> Vec3 {
        let (mut corner, mut size) = ([0.0; 2], 1.0);
        let mut node = &self.nodes[self.root as usize];
        loop {
            let m = node.mass;
            let x = choose(&mut u[0], [m[0] + m[2], m[1] + m[3]]);
            let y = choose(&mut u[1], [m[x], m[x + 2]]);
            size *= 0.5;
            corner = [corner[0] + size * x as f32, corner[1] + size * y as f32];
            let child = node.child[x + 2 * y];
            if child == 0 {
                return direction_of([corner[0] + size * u[0], corner[1] + size * u[1]]);
            }
            node = &self.nodes[child as usize];
        }
    }

    /// Appends a tree to `nodes` whose cells hold at most [`MASS_OF_CELL`] times `relax` of the mass
    /// of this one, and no node that is not needed for that. Returns the index of its root.
    pub fn append_refined(&self, relax: f64, nodes: &mut Vec<Node>) -> u32 {
        self.refine(
            Some(self.root),
            1.0,
            MAX_LEVELS,
            MASS_OF_CELL * relax,
            nodes,
        )
    }

    /// Appends the refinement of a node that has a fraction of the tree's mass; `None` is one whose
    /// cells have equal mass.
    fn refine(
        &self,
        from: Option<u32>,
        mass: f64,
        levels: u32,
        greatest: f64,
        nodes: &mut Vec<Node>,
    ) -> u32 {
        let old = from.map_or(Node::uniform(), |index| self.nodes[index as usize]);
        let index = nodes.len();
        nodes.push(Node {
            mass: old.mass,
            child: [0; 4],
        });
        for (quadrant, share) in old.mass.into_iter().enumerate() {
            let cell = mass * f64::from(share);
            if levels > 1 && cell > greatest {
                let from = Some(old.child[quadrant]).filter(|child| *child != 0);
                let child = self.refine(from, cell, levels - 1, greatest, nodes);
                nodes[index].child[quadrant] = child;
            }
        }
        index as u32
    }
}

/// Chooses 0 or 1 with probabilities proportional to `mass` by the number `u`, which is stretched to
/// `[0, 1)` for the next choice. A choice without mass is never made unless neither has any.
fn choose(u: &mut f32, [first, second]: [f32; 2]) -> usize {
    let threshold = if first + second > 0.0 {
        first / (first + second)
    } else {
        0.5
    };
    let (choice, stretched) = if *u < threshold {
        (0, *u / threshold)
    } else {
        (1, (*u - threshold) / (1.0 - threshold))
    };
    *u = stretched.min(BELOW_ONE);
    choice
}

/// Sets the masses of the tree with the root `root` from values of its cells, by [`Node`] and
/// quadrant, per level: `mass_of` maps the value of a cell and its area on the unit square to its
/// mass. Returns the mass of the whole tree.
pub fn set_masses(
    nodes: &mut [Node],
    root: u32,
    area: f64,
    value: &impl Fn(Cell) -> f64,
    mass_of: fn(f64, f64) -> f64,
) -> f64 {
    let mut masses = [0.0; 4];
    for (quadrant, mass) in masses.iter_mut().enumerate() {
        let child = nodes[root as usize].child[quadrant];
        *mass = if child == 0 {
            let cell = Cell {
                node: root,
                quadrant,
            };
            mass_of(value(cell), 0.25 * area)
        } else {
            set_masses(nodes, child, 0.25 * area, value, mass_of)
        };
    }
    let whole: f64 = masses.iter().sum();
    let scale = if whole > 0.0 { 1.0 / whole } else { 0.0 };
    nodes[root as usize].mass = masses.map(|mass| (mass * scale) as f32);
    whole
}
