//! Default scene of a mesh file: a framing camera, and smooth normals for meshes without any.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{BVec3, DVec3, Vec3};

use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, MaterialDesc, MeshDesc, SceneDesc, ShapeDesc,
};

/// Default resolution in pixels.
pub(crate) const DEFAULT_RESOLUTION: [u32; 2] = [1280, 720];
/// Default greatest number of path edges.
pub(crate) const DEFAULT_MAX_DEPTH: u32 = 5;

/// Number of vertices up to which a bounding box is computed from all vertices; beyond, bounding
/// boxes of meshes are transformed instead.
const MAX_VISITED: usize = 1 << 24;

/// Coordinate of a camera beyond which its target is farther than one unit away.
const FAR: f64 = 1e4;

/// Returns a scene of one mesh with its materials, viewed by a camera that frames it.
pub fn scene(path: &Path, mesh: MeshDesc, materials: Vec<MaterialDesc>) -> SceneDesc {
    let name = path
        .file_stem()
        .map_or_else(|| "mesh".to_owned(), |s| s.to_string_lossy().into_owned());
    let entities = vec![EntityDesc::new(name, ShapeDesc::Mesh(Arc::new(mesh)))];
    SceneDesc {
        resolution: DEFAULT_RESOLUTION,
        max_depth: DEFAULT_MAX_DEPTH,
        camera: framing_camera(bounds(&entities)),
        materials: materials.into(),
        entities: entities.into(),
        ..SceneDesc::default()
    }
}

/// Returns the bounding box of some entities in the world; `None` without any vertex.
pub fn bounds(entities: &[EntityDesc]) -> Option<[Vec3; 2]> {
    let mut bounds: Option<[Vec3; 2]> = None;
    visit_points(entities, |p| {
        bounds = Some(bounds.map_or([p; 2], |[low, high]| [low.min(p), high.max(p)]));
    });
    bounds
}

/// Calls `visit` for points in the world whose convex hull contains some entities: the vertices of
/// meshes, and the corners of boxes around spheres. Of many vertices in all, only the corners of
/// the bounding boxes of meshes are visited.
pub fn visit_points(entities: &[EntityDesc], mut visit: impl FnMut(Vec3)) {
    let mut visited = 0;
    // Bounding boxes of meshes in object space, by address.
    let mut boxes: BTreeMap<*const MeshDesc, [Vec3; 2]> = BTreeMap::new();
    for entity in entities {
        let world = entity.to_near_world();
        let mesh = match &entity.shape {
            ShapeDesc::Mesh(mesh) => mesh,
            ShapeDesc::Sphere { radius } => {
                let center = world.translation.as_vec3();
                corners([center - *radius, center + *radius]).for_each(&mut visit);
                continue;
            }
        };
        let mut visit = |p: Vec3| visit(world.transform_point3(p.as_dvec3()).as_vec3());
        visited += mesh.positions.len();
        if visited <= MAX_VISITED {
            mesh.positions.iter().copied().for_each(visit);
            continue;
        }
        let Some(first) = mesh.positions.first() else {
            continue;
        };
        let around = |[low, high]: [Vec3; 2], p: &Vec3| [low.min(*p), high.max(*p)];
        let own = || mesh.positions.iter().fold([*first; 2], around);
        let box_of_mesh = boxes.entry(Arc::as_ptr(mesh)).or_insert_with(own);
        corners(*box_of_mesh).for_each(&mut visit);
    }
}

/// Returns the corners of a box.
pub fn corners([low, high]: [Vec3; 2]) -> impl Iterator<Item = Vec3> {
    let is_low = |i: u32| BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0);
    (0..8).map(move |i| Vec3::select(is_low(i), low, high))
}

/// Returns a camera on the +z side of a box that sees all of it, or of the unit sphere if there is
/// no box.
pub fn framing_camera(bounds: Option<[Vec3; 2]>) -> CameraDesc {
    let fov_deg: f32 = 45.0;
    let (center, radius) = match bounds {
        None => (Vec3::ZERO, 1.0),
        Some([low, high]) => ((low + high) / 2.0, ((high - low).length() / 2.0).max(1e-6)),
    };
    let distance = 1.1 * radius / (fov_deg.to_radians() / 2.0).sin();
    CameraDesc::pinhole(center + Vec3::Z * distance, center, fov_deg)
}

/// Returns a point that a camera at `position` looks at in the unit direction `forward`: one unit
/// away, or farther away where the coordinates of the position are too large for `f32` to represent
/// such a difference precisely.
pub fn target(position: DVec3, forward: DVec3) -> DVec3 {
    let near = || position + forward;
    distant_target(position, forward).unwrap_or_else(near)
}

/// Returns the point that a camera far from the origin looks at: see [`target`]. `None` for a
/// camera near the origin.
pub fn distant_target(position: DVec3, forward: DVec3) -> Option<DVec3> {
    let extent = position.abs().max_element();
    (extent > FAR).then(|| position + extent * forward)
}

/// Returns smooth vertex normals: those of [`mean_normals`], or +y.
pub fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    mean_normals(positions, triangles)
        .map(|n| n.unwrap_or(Vec3::Y))
        .collect()
}

/// Returns the mean of the normals of adjacent triangles at every vertex, weighted by their angles
/// at the vertex [Thürmer & Wüthrich 1998]; `None` if they cancel, or no triangle has an area.
pub fn mean_normals(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
) -> impl Iterator<Item = Option<Vec3>> + use<> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for corners in triangles {
        let p = corners.map(|i| positions[i as usize].as_dvec3());
        let Some(n) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else {
            continue;
        };
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            sums[corners[k] as usize] += n * a.angle_between(b);
        }
    }
    sums.into_iter()
        .map(|n| n.try_normalize().map(|n| n.as_vec3()))
}
