//! The box and the ball around everything, without looking at every corner of every copy.

use glam::Vec3;

use super::{CompiledScene, Instance};

/// Where a copy of a mesh lies at most: the corners of the mesh's box in the world.
type Around = [Vec3; 8];

/// The box around everything; a point at the origin for nothing.
pub(super) fn bounds(scene: &CompiledScene) -> [Vec3; 2] {
    let points = scene.triangles[..scene.world_triangles()].iter().flatten().map(|p| (*p, *p));
    let balls = scene.spheres.iter().map(|s| (s.center - s.radius, s.center + s.radius));
    let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let [mut low, mut high] = points.chain(balls).fold(start, |[l, h], (low, high)| [l.min(low), h.max(high)]);
    let copies = copies(scene);
    for axis in 0..3 {
        high[axis] = farthest(scene, &copies, high[axis], &|p| p[axis]);
        low[axis] = -farthest(scene, &copies, -low[axis], &|p| -p[axis]);
    }
    if low.is_finite() && high.is_finite() { [low, high] } else { [Vec3::ZERO; 2] }
}

/// The greatest distance of a surface from a point; zero for nothing.
pub(super) fn radius(scene: &CompiledScene, center: Vec3) -> f32 {
    let spheres = scene.spheres.iter().map(|s| s.center.distance(center) + s.radius);
    let points = scene.triangles[..scene.world_triangles()].iter().flatten().map(|p| p.distance(center));
    let start = spheres.chain(points).fold(0.0, f32::max);
    farthest(scene, &copies(scene), start, &|p| p.distance(center))
}

fn copies(scene: &CompiledScene) -> Vec<(&Instance, Around)> {
    let boxes: Vec<[Vec3; 2]> = scene
        .instances
        .meshes
        .iter()
        .map(|mesh| {
            let rows = mesh.triangles.start as usize..mesh.triangles.end as usize;
            let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
            scene.triangles[rows].iter().flatten().fold(start, |[low, high], p| [low.min(*p), high.max(*p)])
        })
        .collect();
    let around = |place: &Instance| {
        let [low, high] = boxes[place.mesh as usize];
        let pick = |i: usize, bit: usize| if i & bit == 0 { low } else { high };
        std::array::from_fn(|i| place.point(Vec3::new(pick(i, 1).x, pick(i, 2).y, pick(i, 4).z)))
    };
    scene.instances.places.iter().map(|place| (place, around(place))).collect()
}

/// The greatest value of a convex function over all corners of all copies, or `start` if that is greater. A convex function
/// is nowhere in a box greater than at a corner of it, so copies are asked in the order of what their boxes allow, until
/// none can add to what was found.
fn farthest(scene: &CompiledScene, copies: &[(&Instance, Around)], start: f32, value: &dyn Fn(Vec3) -> f32) -> f32 {
    let most = |around: &Around| around.iter().map(|p| value(*p)).fold(f32::NEG_INFINITY, f32::max);
    let mut order: Vec<(f32, &Instance)> = copies.iter().map(|(place, around)| (most(around), *place)).collect();
    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = start;
    for (most, place) in order {
        if most <= best {
            break;
        }
        let mesh = &scene.instances.meshes[place.mesh as usize].triangles;
        let corners = scene.triangles[mesh.start as usize..mesh.end as usize].iter().flatten();
        best = corners.map(|p| value(place.point(*p))).fold(best, f32::max);
    }
    best
}
