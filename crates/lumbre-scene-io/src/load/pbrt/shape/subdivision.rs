//! Loop subdivision [Loop 1987], with the rules of pbrt for boundaries and the limit surface.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use crate::load::default_scene;
use lumbre_light::scene::shape::Shape;

/// An edge: the new vertex on it, the sum of the vertices opposite of it, and the number of its
/// faces.
struct Edge {
    vertex: u32,
    opposite: DVec3,
    faces: u32,
}

/// Neighbours of a vertex: their sum and number, and those along the boundary.
#[derive(Clone, Copy, Default)]
struct Ring {
    sum: DVec3,
    count: u32,
    boundary_sum: DVec3,
    boundary_count: u32,
}

impl Ring {
    /// Returns the vertex moved by the weight of each neighbour, or along the boundary by another
    /// one.
    fn moved(&self, p: DVec3, weight: impl Fn(u32) -> f64, boundary: f64) -> DVec3 {
        if self.boundary_count > 0 {
            let kept = 1.0 - boundary * f64::from(self.boundary_count);
            return p * kept + self.boundary_sum * boundary;
        }
        if self.count == 0 {
            return p;
        }
        let weight = weight(self.count);
        p * (1.0 - weight * f64::from(self.count)) + self.sum * weight
    }
}

/// Returns the weight of each of `n` neighbours in a step.
fn beta(n: u32) -> f64 {
    if n == 3 {
        3.0 / 16.0
    } else {
        3.0 / (8.0 * f64::from(n))
    }
}

/// Returns the weight of each of `n` neighbours in the limit.
fn gamma(n: u32) -> f64 {
    1.0 / (f64::from(n) + 3.0 / (8.0 * beta(n)))
}

/// Returns the edges of a mesh, with new vertices numbered from `first` on.
fn edges(positions: &[DVec3], triangles: &[[u32; 3]], first: u32) -> BTreeMap<[u32; 2], Edge> {
    let mut edges: BTreeMap<[u32; 2], Edge> = BTreeMap::new();
    for t in triangles {
        for k in 0..3 {
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            let next = first + edges.len() as u32;
            let edge = edges.entry([a.min(b), a.max(b)]).or_insert(Edge {
                vertex: next,
                opposite: DVec3::ZERO,
                faces: 0,
            });
            edge.opposite += positions[c as usize];
            edge.faces += 1;
        }
    }
    edges
}

/// Returns the neighbours of every vertex.
fn rings(positions: &[DVec3], edges: &BTreeMap<[u32; 2], Edge>) -> Vec<Ring> {
    let mut rings = vec![Ring::default(); positions.len()];
    for ([a, b], edge) in edges {
        for (own, other) in [(*a, *b), (*b, *a)] {
            let (ring, p) = (&mut rings[own as usize], positions[other as usize]);
            ring.sum += p;
            ring.count += 1;
            if edge.faces != 2 {
                ring.boundary_sum += p;
                ring.boundary_count += 1;
            }
        }
    }
    rings
}

/// Returns the limit of a mesh at the vertices after some levels of subdivision, shaded smoothly.
/// As in pbrt, whose vertex normals run the other way round, the front is the side from which the
/// corners of the control mesh run clockwise.
pub(super) fn subdivide(control: Vec<Vec3>, triangles: Vec<[u32; 3]>, levels: u32) -> Shape {
    let mut positions: Vec<DVec3> = control.iter().map(|p| p.as_dvec3()).collect();
    let mut triangles = triangles;
    for _ in 0..levels {
        let first = positions.len() as u32;
        let edges = edges(&positions, &triangles, first);
        let mut next: Vec<DVec3> = rings(&positions, &edges)
            .iter()
            .zip(&positions)
            .map(|(ring, p)| ring.moved(*p, beta, 1.0 / 8.0))
            .collect();
        next.resize(positions.len() + edges.len(), DVec3::ZERO);
        for ([a, b], edge) in &edges {
            let ends = positions[*a as usize] + positions[*b as usize];
            next[edge.vertex as usize] = if edge.faces == 2 {
                ends * (3.0 / 8.0) + edge.opposite / 8.0
            } else {
                ends / 2.0
            };
        }
        let middle = |a: u32, b: u32| edges.get(&[a.min(b), a.max(b)]).map_or(a, |e| e.vertex);
        triangles = triangles
            .iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(*a, *b), middle(*b, *c), middle(*c, *a));
                [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
            })
            .collect();
        positions = next;
    }
    let edges = edges(&positions, &triangles, 0);
    let limit: Vec<Vec3> = rings(&positions, &edges)
        .iter()
        .zip(&positions)
        .map(|(ring, p)| ring.moved(*p, gamma, 1.0 / 5.0).as_vec3())
        .collect();
    triangles.iter_mut().for_each(|t| t.swap(1, 2));
    Shape {
        normals: default_scene::smooth_normals(&limit, &triangles),
        positions: limit,
        triangles,
        ..Shape::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octahedron_becomes_round_and_a_flat_mesh_stays_flat() {
        let corners = [
            Vec3::X,
            Vec3::NEG_X,
            Vec3::Y,
            Vec3::NEG_Y,
            Vec3::Z,
            Vec3::NEG_Z,
        ];
        let mut faces = Vec::new();
        for (x, y, z) in [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4)] {
            faces.extend([[x, y, z], [y, x, 5]]);
        }
        let round = subdivide(corners.to_vec(), faces, 4);
        assert_eq!(round.triangles.len(), 8 * 256);
        // The limit of a vertex of valence 4: 1 - 4 gamma, gamma = 1 / (4 + 4) with beta = 3 / 32.
        assert!(
            (round.positions[0] - Vec3::X * 0.5).length() < 1e-6,
            "{}",
            round.positions[0]
        );
        let inwards = |(p, n): (&Vec3, &Vec3)| p.dot(*n) < 0.0;
        assert!(round.positions.iter().zip(&round.normals).all(inwards));
        let square = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let flat = subdivide(square, vec![[0, 1, 2], [0, 2, 3]], 2);
        assert_eq!(flat.triangles.len(), 32);
        assert!(flat.normals.iter().all(|n| n.distance(Vec3::NEG_Z) < 1e-5));
        // A corner of a boundary: 3/5 of itself and 1/5 of each neighbour, which are at 1/4 after
        // two levels of 3/4 + 1/8 + 1/8.
        assert!(flat.positions[0].z == 0.0 && flat.positions[0].x > 0.0);
    }
}
