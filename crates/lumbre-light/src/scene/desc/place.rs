//! Places in double precision: what single precision leaves of a point, and the origin of scenes
//! that lie far from theirs.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3, Vec3};

use super::{MAX_COORDINATE, SceneDesc, ShapeDesc, Transform};

/// Greatest coordinate of a scene relative to its size up to which it is compiled where it is.
const FAR: f64 = 8.0;

/// Greatest coordinate of a mesh relative to its size up to which its positions are stored as they
/// are.
const FAR_MESH: f64 = 4096.0;

/// Number of vertices of a mesh that tell whether its scene can be far.
const SOME_VERTICES: usize = 64;

/// Returns a point in single precision, and what that leaves of it.
pub fn split(point: DVec3) -> (Vec3, Vec3) {
    let rounded = point.as_vec3();
    (rounded, (point - rounded.as_dvec3()).as_vec3())
}

/// Returns a map of single precision in double precision.
pub fn double(map: Affine3A) -> DAffine3 {
    DAffine3::from_mat3_translation(map.matrix3.as_dmat3(), map.translation.as_dvec3())
}

/// Returns the point of a description that becomes the origin of its compiled scene: the origin, or
/// for a scene that lies far from it a point near its middle.
pub fn origin(desc: &SceneDesc) -> DVec3 {
    // The box of some points is no larger than the scene, which reaches no further than its size
    // beyond them. So few vertices tell for most scenes that they are near.
    let [low, high] = bounds(desc, SOME_VERTICES);
    let size = (high - low).max_element();
    if low.abs().max(high.abs()).max_element() <= (FAR - 1.0) * size {
        return DVec3::ZERO;
    }
    middle_of_far_box(bounds(desc, usize::MAX), FAR)
}

/// Returns the box of the spheres of a scene, and of about as many vertices of each mesh.
fn bounds(desc: &SceneDesc, vertices: usize) -> [DVec3; 2] {
    let mut boxes: BTreeMap<*const _, [Vec3; 2]> = BTreeMap::new();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for entity in &desc.entities {
        let to_world = entity.to_world();
        match &entity.shape {
            ShapeDesc::Sphere { radius } => {
                let radius = f64::from(*radius * entity.transform.sphere_scale().unwrap_or(1.0));
                low = low.min(to_world.translation - radius);
                high = high.max(to_world.translation + radius);
            }
            ShapeDesc::Mesh(mesh) => {
                let own = boxes.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                    let step = (mesh.positions.len() / vertices).max(1);
                    box_of(mesh.positions.iter().step_by(step))
                });
                for corner in box_corners(*own) {
                    let corner = to_world.transform_point3(corner.as_dvec3());
                    (low, high) = (low.min(corner), high.max(corner));
                }
            }
        }
    }
    [low, high]
}

/// Moves a scene.
pub fn shift(desc: &mut SceneDesc, by: DVec3) {
    for entity in &mut desc.entities {
        let Transform {
            frame, translate, ..
        } = &mut entity.transform;
        // The greater of the two carries the place: it is the one that becomes small.
        let own = frame.matrix3 * *translate;
        if own.length_squared() > frame.translation.length_squared()
            && frame.matrix3.determinant() != 0.0
        {
            *translate = frame.matrix3.inverse() * (own + by);
        } else {
            frame.translation += by;
        }
    }
    let views = desc.views.iter_mut().map(|(_, camera)| camera);
    for camera in std::iter::once(&mut desc.camera).chain(views) {
        let [position, target] = camera.places();
        *camera = camera.clone().placed(position + by, target + by);
    }
    for light in &mut desc.lights {
        if let Some(position) = light.position() {
            light.place(position + by);
        }
    }
}

/// Returns the greatest coordinate of a mesh as it is stored, in single precision.
pub fn farthest_stored(desc: &SceneDesc) -> f32 {
    let positions = desc.entities.iter().flat_map(|entity| match &entity.shape {
        ShapeDesc::Mesh(mesh) => mesh.positions.as_slice(),
        ShapeDesc::Sphere { .. } => &[],
    });
    positions.fold(0.0, |most, p| most.max(p.abs().max_element()))
}

/// Returns the point from which the positions of a mesh count: zero, or a point near its middle if
/// it lies far from zero for its size. Zero if a position is not finite.
pub fn mesh_origin(positions: impl IntoIterator<Item = DVec3>) -> DVec3 {
    let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let points = positions.into_iter();
    let bounds = points.fold(start, |[low, high], p| [low.min(p), high.max(p)]);
    middle_of_far_box(bounds, FAR_MESH)
}

/// Returns a point near the middle of a box whose greatest coordinate exceeds `far` times its size,
/// else zero. Points out of range are an error elsewhere, which states where they are.
///
/// The point is a multiple of a power of two about as large as the box, so that it is subtracted
/// from single-precision coordinates without rounding.
fn middle_of_far_box([low, high]: [DVec3; 2], far: f64) -> DVec3 {
    let size = (high - low).max_element();
    let extent = low.abs().max(high.abs()).max_element();
    if !(size > 0.0 && extent > far * size && extent <= f64::from(MAX_COORDINATE)) {
        return DVec3::ZERO;
    }
    let step = size.log2().floor().exp2();
    ((low + (high - low) * 0.5) / step).round() * step
}

/// Returns the bounding box of points.
pub fn box_of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> [Vec3; 2] {
    let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let points = points.into_iter();
    points.fold(start, |[low, high], p| [low.min(*p), high.max(*p)])
}

/// Returns the corners of a box.
pub fn box_corners([low, high]: [Vec3; 2]) -> [Vec3; 8] {
    let pick = |i: usize, bit: usize| if i & bit == 0 { low } else { high };
    std::array::from_fn(|i| Vec3::new(pick(i, 1).x, pick(i, 2).y, pick(i, 4).z))
}
