//! Bounding box and bounding sphere of a scene, without visiting every vertex of every instance.

use glam::Vec3;

use super::{CompiledScene, Instance};
use crate::scene::desc::place::{box_corners, box_of};

/// Corners of the bounding box of a mesh, transformed to the world by an instance.
type TransformedBox = [Vec3; 8];

/// Returns the bounding box of the scene; a point at the origin for an empty scene.
pub(super) fn bounds(scene: &CompiledScene) -> [Vec3; 2] {
    let points = scene.triangles[..scene.world_triangles()]
        .iter()
        .flatten()
        .map(|p| (*p, *p));
    let balls = scene
        .spheres
        .iter()
        .map(|s| (s.center - s.radius, s.center + s.radius));
    let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let [mut low, mut high] = points
        .chain(balls)
        .fold(start, |[l, h], (low, high)| [l.min(low), h.max(high)]);
    let instances = instances(scene);
    for axis in 0..3 {
        high[axis] = farthest(scene, &instances, high[axis], &|p| p[axis]);
        low[axis] = -farthest(scene, &instances, -low[axis], &|p| -p[axis]);
    }
    if low.is_finite() && high.is_finite() {
        [low, high]
    } else {
        [Vec3::ZERO; 2]
    }
}

/// Returns the greatest distance of a surface from a point; zero for an empty scene.
pub(super) fn radius(scene: &CompiledScene, center: Vec3) -> f32 {
    let spheres = scene
        .spheres
        .iter()
        .map(|s| s.center.distance(center) + s.radius);
    let points = scene.triangles[..scene.world_triangles()]
        .iter()
        .flatten()
        .map(|p| p.distance(center));
    let start = spheres.chain(points).fold(0.0, f32::max);
    farthest(scene, &instances(scene), start, &|p| p.distance(center))
}

/// Returns all instances with their transformed bounding boxes.
fn instances(scene: &CompiledScene) -> Vec<(&Instance, TransformedBox)> {
    let boxes: Vec<[Vec3; 2]> = scene
        .instances
        .meshes
        .iter()
        .map(|mesh| {
            let rows = mesh.triangles.start as usize..mesh.triangles.end as usize;
            box_of(scene.triangles[rows].iter().flatten())
        })
        .collect();
    let transformed_box = |instance: &Instance| {
        box_corners(boxes[instance.mesh as usize]).map(|corner| instance.point(corner))
    };
    scene
        .instances
        .placements
        .iter()
        .map(|instance| (instance, transformed_box(instance)))
        .collect()
}

/// Returns the greatest value of a convex function over all vertices of all instances, or `start`
/// if that is greater. A convex function on a box is greatest at a corner, so instances are visited
/// in decreasing order of the bound from their boxes, until no other can exceed the maximum found.
fn farthest(
    scene: &CompiledScene,
    instances: &[(&Instance, TransformedBox)],
    start: f32,
    value: &dyn Fn(Vec3) -> f32,
) -> f32 {
    let bound = |corners: &TransformedBox| {
        corners
            .iter()
            .map(|p| value(*p))
            .fold(f32::NEG_INFINITY, f32::max)
    };
    let mut order: Vec<(f32, &Instance)> = instances
        .iter()
        .map(|(instance, corners)| (bound(corners), *instance))
        .collect();
    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = start;
    for (bound, instance) in order {
        if bound <= best {
            break;
        }
        let mesh = &scene.instances.meshes[instance.mesh as usize].triangles;
        let vertices = scene.triangles[mesh.start as usize..mesh.end as usize]
            .iter()
            .flatten();
        best = vertices
            .map(|p| value(instance.point(*p)))
            .fold(best, f32::max);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::compile;
    use super::*;
    use crate::scene::desc::{MaterialDesc, ShapeDesc};
    use crate::scene::fixtures::scene;

    #[test]
    fn the_bounding_sphere_contains_every_point_of_every_ball() {
        let balls = [(1.0, Vec3::ZERO), (2.0, Vec3::X * 6.0), (0.5, Vec3::Y)]
            .map(|(radius, center)| (ShapeDesc::Sphere { radius }, center));
        let (scene, _) = compile(&scene(&balls, MaterialDesc::new("m"))).unwrap();
        let ([low, high], radius) = scene.bounds_and_radius();
        assert_eq!(low, Vec3::new(-1.0, -2.0, -2.0));
        assert_eq!(high, Vec3::new(8.0, 2.0, 2.0));
        // The farthest points from the middle, (3.5, 0, 0), are (8, 0, 0) and (-1, 0, 0).
        assert!((radius - 4.5).abs() < 1e-5, "{radius}");
    }
}
