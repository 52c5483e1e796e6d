//! Entities to world-space triangles, spheres and emitters.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::instance::{Instances, cofactor};
use super::share::{self, Part, Sharing};
use super::{
    CompiledScene, Emitter, Material, NONE, Sphere, TriangleAttributes, bounds, corners, lights, materials, tangents,
};
use crate::math::distribution::Alias;
use crate::scene::desc::{CameraDesc, EntityDesc, MAX_COORDINATE, MeshDesc, SceneDesc, ShapeDesc, content_hash};
use crate::scene::{Note, SceneError};
use crate::value::schema::SchemaError;

/// Greatest number of primitives in a scene: more would not fit the memory of the machines that this is for.
pub const MAX_PRIMITIVES: usize = 1 << 26;

/// A triangle whose height is below this part of its longest edge is left out: in `f32` its normal is noise.
const SLIVER: f64 = 1e-7;

/// A corner normal that points behind its triangle is tilted until its cosine with the geometric normal is this.
const GRAZING_COSINE: f32 = 1e-3;

/// Below this sine of the angle between the view and up, the camera's up direction says nothing.
const PARALLEL_SINE: f32 = 1e-5;

/// Flattens a description into arrays in world space.
///
/// The front of every triangle stays the front that its mesh says, also under transforms that mirror. Shading normals
/// are transformed by the inverse transpose and lie on the front side. Triangles without area are left out with a
/// [`Note`], names that no material has mean the first material, with a [`Note`].
///
/// # Errors
/// A camera that looks nowhere, a point beyond the range of coordinates, a mesh whose arrays do not belong together,
/// more primitives than [`MAX_PRIMITIVES`], more lights than [`Alias`] can choose among, or a material or light with values
/// that mean nothing.
pub fn compile(desc: &SceneDesc) -> Result<(CompiledScene, Vec<Note>), SceneError> {
    compile_sharing(desc, Sharing::Auto)
}

/// The same, with meshes that several entities have kept once or not.
///
/// # Errors
/// As [`compile`]; of a shared mesh the primitives count once, but its lights for every copy.
pub fn compile_sharing(desc: &SceneDesc, sharing: Sharing) -> Result<(CompiledScene, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let camera = checked_camera(&desc.camera, &mut notes)?;
    let (rows, textures, delays) = materials::rows(desc, &mut notes)?;
    let unbound = lights::compile(desc, &mut notes)?;
    let mut scene = CompiledScene {
        content_hash: content_hash(desc),
        triangles: Vec::new(),
        attributes: Vec::new(),
        instances: Instances::default(),
        tangents: Vec::new(),
        colors: Vec::new(),
        second_uvs: Vec::new(),
        spheres: Vec::new(),
        materials: rows,
        delays,
        textures,
        emitters: Vec::new(),
        points: unbound.points,
        directionals: unbound.directionals,
        environment: unbound.environment,
        camera,
        bounds: [Vec3::ZERO; 2],
        resolution: desc.resolution,
        max_depth: desc.max_depth,
    };
    let mut names = Names { desc, notes };
    let mut parts = parts(&mut scene, &mut names)?;
    let copies = share::split(&scene, &mut parts, sharing);
    let spheres = desc.entities.iter().filter(|e| matches!(e.shape, ShapeDesc::Sphere { .. })).count();
    let kept = parts.iter().map(|part| part.mesh.triangles.len()).chain([copies.triangles(), spheres]);
    let total = kept.fold(0usize, usize::saturating_add);
    if total > MAX_PRIMITIVES {
        let problem = format!("the scene has {total} triangles and spheres, more than {MAX_PRIMITIVES}");
        return Err(malformed(Path::new(""), "entities".to_owned(), problem));
    }
    scene.triangles.reserve_exact(total - spheres);
    scene.attributes.reserve_exact(total - spheres);
    for part in &parts {
        add_mesh(&mut scene, part, &mut names)?;
    }
    copies.place(&mut scene, &mut names.notes)?;
    for entity in &desc.entities {
        if let ShapeDesc::Sphere { radius } = entity.shape {
            add_sphere(&mut scene, entity, radius, &mut names)?;
        }
    }
    let mut notes = names.notes;
    scene.bounds = bounds::bounds(&scene);
    let lights = scene.emitters.len() + scene.points.len() + scene.directionals.len();
    if lights >= Alias::MAX_ITEMS {
        let problem = format!("{lights} triangles, spheres and other lights shine, more than {}", Alias::MAX_ITEMS - 1);
        return Err(malformed(Path::new(""), "entities".to_owned(), problem));
    }
    let whole = |message: &str| Note { file: PathBuf::new(), place: "scene".to_owned(), message: message.to_owned() };
    let dark = scene.emitters.is_empty() && scene.points.is_empty() && scene.directionals.is_empty();
    let surrounded = scene.environment.is_some();
    if scene.primitive_count() == 0 && !surrounded {
        notes.push(whole("it has no surfaces: the picture will be black"));
    } else if dark && !surrounded {
        notes.push(whole("nothing emits light: the picture will be black"));
    }
    Ok((scene, notes))
}

pub(super) fn in_range(p: Vec3) -> bool {
    p.is_finite() && p.abs().max_element() <= MAX_COORDINATE
}

pub(super) fn malformed(file: &Path, place: String, problem: String) -> SceneError {
    SceneError::Malformed { file: file.to_owned(), place, problem }
}

fn checked_camera(camera: &CameraDesc, notes: &mut Vec<Note>) -> Result<CameraDesc, SceneError> {
    let fail = |key: &str, problem: &str| {
        let path = format!("camera.{key}");
        Err(SchemaError { path, problem: problem.to_owned(), help: None, key: key.to_owned() }.into())
    };
    if ![camera.position, camera.target, camera.up].iter().all(|v| v.is_finite()) {
        return fail("position", "the camera's position, target and up must be finite");
    }
    let Some(view) = (camera.target - camera.position).try_normalize() else {
        return fail("target", "it is the same point as the camera's position, so the camera looks nowhere");
    };
    let mut camera = camera.clone();
    let up = camera.up.try_normalize();
    if up.is_none_or(|up| view.cross(up).length() < PARALLEL_SINE) {
        // On maps, which look straight down, north is up; elsewhere +y is.
        camera.up = if view.y.abs() > 0.9 { Vec3::NEG_Z } else { Vec3::Y };
        notes.push(Note {
            file: PathBuf::new(),
            place: "camera.up".to_owned(),
            message: format!("it says nothing about this direction of view: {} is used", camera.up),
        });
    }
    Ok(camera)
}

/// Finds materials by name and notes each unknown name once per mesh.
struct Names<'a> {
    desc: &'a SceneDesc,
    notes: Vec<Note>,
}

impl Names<'_> {
    fn row(&mut self, name: &str, file: &Path, place: &str) -> u32 {
        if let Some(i) = self.desc.material_row(name) {
            return i as u32;
        }
        self.notes.push(Note {
            file: file.to_owned(),
            place: place.to_owned(),
            message: format!("no material is named `{name}`: the first one is used"),
        });
        0
    }
}

/// The entities that have a mesh, with the rows of their materials.
fn parts<'a>(scene: &mut CompiledScene, names: &mut Names<'a>) -> Result<Vec<Part<'a>>, SceneError> {
    let mut checked = BTreeSet::new();
    let mut parts = Vec::new();
    let desc = names.desc;
    for entity in &desc.entities {
        let ShapeDesc::Mesh(mesh) = &entity.shape else { continue };
        let place = format!("entities.{}", entity.name);
        if checked.insert(Arc::as_ptr(mesh)) {
            check_arrays(mesh).map_err(|problem| malformed(&mesh.file, place.clone(), problem))?;
        }
        let rows: Vec<u32> = match &entity.material {
            Some(name) => vec![names.row(name, &mesh.file, &place); mesh.slots.len()],
            None => mesh.slots.iter().map(|slot| names.row(slot, &mesh.file, &place)).collect(),
        };
        let rows = overridden(scene, rows, entity);
        parts.push(Part { mesh, rows, place, to_world: entity.transform.to_world() });
    }
    Ok(parts)
}

fn add_mesh(scene: &mut CompiledScene, part: &Part, names: &mut Names) -> Result<(), SceneError> {
    let Part { mesh, rows, place, to_world } = part;
    let fail = |problem: String| malformed(&mesh.file, place.clone(), problem);
    let mirrors = part.mirrors();
    let to_world_normal = cofactor(to_world.matrix3) * if mirrors { -1.0 } else { 1.0 };
    let world: Vec<Vec3> = mesh.positions.iter().map(|p| to_world.transform_point3(p.as_dvec3()).as_vec3()).collect();
    if let Some(i) = world.iter().position(|p| !in_range(*p)) {
        return Err(fail(format!("its vertex {i} lies at {}, not within {MAX_COORDINATE:e} of the origin", world[i])));
    }
    let first = scene.triangles.len();
    let mut dropped = [0usize; 2];
    for (indices, slot) in mesh.triangles.iter().zip(&mesh.triangle_slot) {
        // A mirrored triangle keeps its front when its corners run the other way round.
        let indices = if mirrors { [indices[0], indices[2], indices[1]] } else { *indices };
        let material = rows[*slot as usize];
        let shines = scene.materials[material as usize].emission != Vec3::ZERO;
        let points = indices.map(|i| world[i as usize]);
        let Some((area, front)) = area_and_front(&points) else {
            dropped[usize::from(shines)] += 1;
            continue;
        };
        let normals = indices.map(|i| match mesh.normals.get(i as usize) {
            Some(n) => (to_world_normal * n.as_dvec3()).try_normalize().map_or(front, DVec3::as_vec3),
            None => front,
        });
        let emitter = if shines { push_emitter(scene, scene.triangles.len(), NONE, area) } else { NONE };
        scene.attributes.push(TriangleAttributes {
            normals: on_front_side(normals, front),
            uvs: indices.map(|i| mesh.uvs.get(i as usize).copied().unwrap_or(Vec2::ZERO)),
            material,
            emitter,
        });
        scene.triangles.push(points);
        corners::push(scene, mesh, indices);
    }
    let uses = scene.attributes[first..].iter().any(|a| scene.uses_tangents(a.material));
    tangents::add(scene, first, uses, !mesh.uvs.is_empty());
    note_dropped(dropped, part, &mut names.notes);
    Ok(())
}

/// Says how many triangles without area were left out, those that would shine apart.
pub(super) fn note_dropped(dropped: [usize; 2], part: &Part, notes: &mut Vec<Note>) {
    for (n, what) in dropped.into_iter().zip(["", " of a light"]) {
        if n > 0 {
            notes.push(Note {
                file: part.mesh.file.clone(),
                place: part.place.clone(),
                message: format!("triangles{what} without area: {n} left out"),
            });
        }
    }
}

fn check_arrays(mesh: &MeshDesc) -> Result<(), String> {
    let n = mesh.positions.len();
    let of = [
        ("normals", mesh.normals.len()),
        ("texture coordinates", mesh.uvs.len()),
        ("second texture coordinates", mesh.second_uvs.len()),
        ("colours", mesh.colors.len()),
    ];
    for (what, len) in of {
        if len != 0 && len != n {
            return Err(format!("the mesh has {n} positions and {len} {what}"));
        }
    }
    if mesh.triangle_slot.len() != mesh.triangles.len() {
        let (t, s) = (mesh.triangles.len(), mesh.triangle_slot.len());
        return Err(format!("the mesh has {t} triangles and {s} material slots for them"));
    }
    if let Some(i) = mesh.triangles.as_flattened().iter().find(|i| **i as usize >= n) {
        return Err(format!("a triangle names vertex {i} of {n}"));
    }
    match mesh.triangle_slot.iter().find(|s| **s as usize >= mesh.slots.len()) {
        Some(s) => Err(format!("a triangle names material slot {s} of {}", mesh.slots.len())),
        None => Ok(()),
    }
}

/// Area and unit geometric normal, unless the triangle is too thin to have them.
pub(super) fn area_and_front(points: &[Vec3; 3]) -> Option<(f32, Vec3)> {
    let [a, b, c] = points.map(Vec3::as_dvec3);
    let cross = (b - a).cross(c - a);
    let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    let area = (cross.length() / 2.0) as f32;
    let thin = cross.length() <= SLIVER * longest;
    let front = cross.try_normalize()?.as_vec3();
    (!thin && area > 0.0).then_some((area, front))
}

/// Corner normals on the side of `front`: all turned round if their mean lies behind, and single ones tilted.
pub(super) fn on_front_side(normals: [Vec3; 3], front: Vec3) -> [Vec3; 3] {
    let mean: Vec3 = normals.iter().sum();
    normals.map(|n| if mean.dot(front) < 0.0 { -n } else { n }).map(|n| {
        let cosine = n.dot(front);
        if cosine >= 0.0 { n } else { (n - (cosine - GRAZING_COSINE) * front).try_normalize().unwrap_or(front) }
    })
}

/// The rows with the entity's own direction of anisotropy, if it has one: copies appended to the scene's materials.
fn overridden(scene: &mut CompiledScene, rows: Vec<u32>, entity: &EntityDesc) -> Vec<u32> {
    let Some(direction) = entity.anisotropic_direction else { return rows };
    let mut copies = BTreeMap::new();
    let copy = |row: u32| {
        *copies.entry(row).or_insert_with(|| {
            let original = scene.materials[row as usize];
            scene.materials.push(Material { anisotropic_direction: direction, anisotropic_texture: NONE, ..original });
            scene.materials.len() as u32 - 1
        })
    };
    rows.into_iter().map(copy).collect()
}

pub(super) fn push_emitter(scene: &mut CompiledScene, primitive: usize, instance: u32, area: f32) -> u32 {
    scene.emitters.push(Emitter { primitive: primitive as u32, instance, area });
    scene.emitters.len() as u32 - 1
}

fn add_sphere(
    scene: &mut CompiledScene,
    entity: &EntityDesc,
    radius: f32,
    names: &mut Names,
) -> Result<(), SceneError> {
    let place = format!("entities.{}", entity.name);
    let fail = |problem: String| Err(malformed(Path::new(""), place.clone(), problem));
    let Some(scale) = entity.transform.sphere_scale() else {
        return fail("its frame makes it no sphere any more: only even scales are possible".to_owned());
    };
    let center = entity.transform.frame.transform_point3(entity.transform.translate);
    let radius = radius * scale;
    if !(radius > 0.0 && radius <= MAX_COORDINATE) {
        return fail(format!("a sphere needs a positive radius, found {radius}"));
    }
    if !in_range(center) {
        return fail(format!("its centre {center} does not lie within {MAX_COORDINATE:e} of the origin"));
    }
    let material = entity.material.as_deref().map_or(0, |name| names.row(name, Path::new(""), &place));
    let [material] = overridden(scene, vec![material], entity)[..] else { return Ok(()) };
    let area = 4.0 * std::f64::consts::PI * f64::from(radius).powi(2);
    let shines = scene.materials[material as usize].emission != Vec3::ZERO;
    let emitter = if shines && area as f32 > 0.0 {
        push_emitter(scene, scene.triangles.len() + scene.spheres.len(), NONE, area as f32)
    } else {
        if shines {
            names.notes.push(Note {
                file: PathBuf::new(),
                place,
                message: "the sphere is too small to shine: its light is left out".to_owned(),
            });
        }
        NONE
    };
    scene.spheres.push(Sphere { center, radius, material, emitter });
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;
    use crate::scene::desc::{MaterialDesc, Transform, mesh_hash};

    fn mesh(positions: Vec<Vec3>, normals: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Arc<MeshDesc> {
        let mut m = MeshDesc {
            file: PathBuf::from("m.obj"),
            positions,
            normals,
            uvs: vec![],
            colors: vec![],
            second_uvs: vec![],
            triangle_slot: vec![0; triangles.len()],
            triangles,
            slots: vec!["m".to_owned()],
            content_hash: [0; 32],
        };
        m.content_hash = mesh_hash(&m);
        Arc::new(m)
    }

    fn scene(shapes: Vec<(ShapeDesc, Transform)>, material: MaterialDesc) -> SceneDesc {
        SceneDesc {
            views: Vec::new(),
            resolution: [8, 8],
            max_depth: 5,
            camera: CameraDesc { position: Vec3::Z * 5.0, target: Vec3::ZERO, fov_deg: 45.0, ..CameraDesc::default() },
            materials: vec![material],
            entities: shapes
                .into_iter()
                .enumerate()
                .map(|(i, (shape, transform))| EntityDesc {
                    name: format!("e{i}"),
                    transform,
                    material: None,
                    anisotropic_direction: None,
                    shape,
                })
                .collect(),
            lights: vec![],
            environment: None,
        }
    }

    fn triangle() -> ShapeDesc {
        ShapeDesc::Mesh(mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![Vec3::Z; 3], vec![[0, 1, 2]]))
    }

    fn light() -> MaterialDesc {
        MaterialDesc { emission: Vec3::ONE, ..MaterialDesc::new("m") }
    }

    fn front(c: &CompiledScene, i: usize) -> Vec3 {
        area_and_front(&c.triangles[i]).unwrap().1
    }

    #[test]
    fn mirrored_and_turned_meshes_keep_their_front_with_their_normals() {
        let turn = |scale: [f32; 3], rotate: [f32; 3]| Transform {
            translate: Vec3::ONE,
            rotate_rad: Vec3::from_array(rotate),
            scale: Vec3::from_array(scale),
            ..Transform::default()
        };
        let half = std::f32::consts::FRAC_PI_2;
        let cases = [
            (turn([1.0; 3], [0.0; 3]), Vec3::Z),
            (turn([-1.0, 1.0, 1.0], [0.0; 3]), Vec3::Z),
            (turn([1.0, 1.0, -1.0], [0.0; 3]), Vec3::NEG_Z),
            (turn([-2.0, -2.0, -2.0], [0.0; 3]), Vec3::NEG_Z),
            (turn([1.0; 3], [half, 0.0, 0.0]), Vec3::NEG_Y),
            (turn([1.0; 3], [0.0, half, 0.0]), Vec3::X),
            // Rz first, then Rx, then the scale.
            (turn([1.0, 5.0, 1.0], [half, 0.0, half]), Vec3::NEG_Y),
        ];
        for (transform, expected) in cases {
            let (c, notes) = compile(&scene(vec![(triangle(), transform)], light())).unwrap();
            assert!(notes.is_empty());
            assert!((front(&c, 0) - expected).length() < 1e-6, "{transform:?}: {}", front(&c, 0));
            for n in c.attributes[0].normals {
                assert!((n - expected).length() < 1e-6, "{transform:?}: normal {n}");
            }
        }
    }

    #[test]
    fn a_frame_comes_after_everything_else() {
        let frame = Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2) * Affine3A::from_scale(Vec3::splat(2.0));
        let moved = Transform { translate: Vec3::X, ..Transform::framed(frame) };
        let ball = ShapeDesc::Sphere { radius: 0.5 };
        let (c, _) = compile(&scene(vec![(triangle(), moved), (ball.clone(), moved)], light())).unwrap();
        assert!((front(&c, 0) - Vec3::X).length() < 1e-6);
        assert!((c.triangles[0][0] - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-6, "{}", c.triangles[0][0]);
        assert!((c.spheres[0].center - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-6 && c.spheres[0].radius == 1.0);
        let stretched = Transform::framed(Affine3A::from_scale(Vec3::new(1.0, 2.0, 1.0)));
        let e = compile(&scene(vec![(ball, stretched)], light())).unwrap_err().to_string();
        assert!(e.contains("no sphere any more"), "{e}");
    }

    #[test]
    fn normals_follow_the_inverse_transpose() {
        let n = Vec3::new(1.0, 0.0, 1.0).normalize_or(Vec3::Z);
        let slope = mesh(vec![Vec3::ZERO, Vec3::Y, Vec3::new(-1.0, 0.0, 1.0)], vec![n; 3], vec![[0, 1, 2]]);
        let transform = Transform { scale: Vec3::new(4.0, 1.0, 1.0), ..Transform::default() };
        let (c, _) = compile(&scene(vec![(ShapeDesc::Mesh(slope), transform)], light())).unwrap();
        let expected = Vec3::new(0.25, 0.0, 1.0).normalize_or(Vec3::Z);
        assert!((c.attributes[0].normals[0] - expected).length() < 1e-6);
        assert!((front(&c, 0) - expected).length() < 1e-6);
    }

    #[test]
    fn corner_normals_never_point_behind_the_triangle() {
        let tilted = Vec3::new(1.0, 0.0, -0.5).normalize_or(Vec3::Z);
        let m = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![Vec3::Z, Vec3::Z, tilted], vec![[0, 1, 2]]);
        let (c, _) = compile(&scene(vec![(ShapeDesc::Mesh(m), Transform::default())], light())).unwrap();
        let n = c.attributes[0].normals[2];
        assert!(n.z > 0.0 && n.x > 0.9 && (n.length() - 1.0).abs() < 1e-6, "{n}");
        let m = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![Vec3::NEG_Z; 3], vec![[0, 1, 2]]);
        let (c, _) = compile(&scene(vec![(ShapeDesc::Mesh(m), Transform::default())], light())).unwrap();
        assert_eq!(c.attributes[0].normals, [Vec3::Z; 3]);
    }

    #[test]
    fn emitters_have_exact_areas_in_order_of_primitive() {
        let scaled = Transform { scale: Vec3::new(2.0, 3.0, 1.0), ..Transform::default() };
        let shapes = vec![
            (ShapeDesc::Sphere { radius: 0.5 }, Transform::default()),
            (triangle(), scaled),
            (triangle(), Transform::default()),
        ];
        let (c, _) = compile(&scene(shapes, light())).unwrap();
        assert_eq!(c.primitive_count(), 3);
        let areas: Vec<(u32, f32)> = c.emitters.iter().map(|e| (e.primitive, e.area)).collect();
        assert_eq!(areas, [(0, 3.0), (1, 0.5), (2, std::f32::consts::PI)]);
        assert_eq!((c.attributes[1].emitter, c.spheres[0].emitter), (1, 2));
        assert_eq!(c.bounds, [Vec3::new(-0.5, -0.5, -0.5), Vec3::new(2.0, 3.0, 0.5)]);
    }

    #[test]
    fn triangles_without_area_are_left_out_and_counted() {
        let m = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::Y], vec![], vec![[0, 1, 2], [0, 0, 1], [0, 1, 3]]);
        let (c, notes) = compile(&scene(vec![(ShapeDesc::Mesh(m), Transform::default())], light())).unwrap();
        assert_eq!((c.triangles.len(), c.emitters.len()), (1, 1));
        assert_eq!(notes.len(), 1);
        assert!(notes[0].to_string().contains("of a light without area: 2 left out"), "{}", notes[0]);
        let flat = Transform { scale: Vec3::ZERO, ..Transform::default() };
        let (c, notes) = compile(&scene(vec![(triangle(), flat)], light())).unwrap();
        assert_eq!(c.primitive_count(), 0);
        assert_eq!(notes.len(), 2);
    }

    #[test]
    fn darkness_and_unknown_names_are_noted() {
        let metal = MaterialDesc { metallic: 0.5, roughness: 0.3, ..MaterialDesc::new("other") };
        let (c, notes) = compile(&scene(vec![(triangle(), Transform::default())], metal)).unwrap();
        let all = notes.iter().map(Note::to_string).collect::<Vec<_>>().join("\n");
        assert!(all.contains("m.obj: entities.e0: no material is named `m`"), "{all}");
        assert!(all.contains("scene: nothing emits light"), "{all}");
        assert_eq!(c.attributes[0].material, 0);
        assert_eq!(notes.len(), 2);
    }

    #[test]
    fn an_entitys_direction_of_anisotropy_is_its_own() {
        let brushed = MaterialDesc { anisotropic: 0.8, ..MaterialDesc::new("m") };
        let mut s = scene(
            vec![
                (ShapeDesc::Sphere { radius: 1.0 }, Transform::default()),
                (ShapeDesc::Sphere { radius: 2.0 }, Transform::default()),
            ],
            brushed,
        );
        s.entities[1].anisotropic_direction = Some(Vec3::Y);
        let (c, _) = compile(&s).unwrap();
        let direction = |i: usize| c.materials[c.spheres[i].material as usize].anisotropic_direction;
        assert_eq!((direction(0), direction(1)), (Vec3::ZERO, Vec3::Y));
    }

    #[test]
    fn emitters_that_do_not_reflect_are_marked_and_everything_else_reflects() {
        let dark = MaterialDesc { emitter_reflects: false, ..MaterialDesc::new("m") };
        assert!(compile(&scene(vec![], dark.clone())).unwrap().0.materials[0].emitter_reflects);
        let lamp = MaterialDesc { emission: Vec3::ONE, ..dark };
        assert!(!compile(&scene(vec![], lamp)).unwrap().0.materials[0].emitter_reflects);
    }

    #[test]
    fn cameras_that_look_nowhere_are_errors_and_useless_ups_are_replaced() {
        let mut s = scene(vec![(triangle(), Transform::default())], light());
        s.camera.target = s.camera.position;
        assert!(compile(&s).unwrap_err().to_string().contains("camera.target"));
        s.camera.target = s.camera.position - Vec3::Y;
        let (c, notes) = compile(&s).unwrap();
        assert_eq!(c.camera.up, Vec3::NEG_Z);
        assert!(notes[0].to_string().starts_with("camera.up"), "{}", notes[0]);
        s.camera.up = Vec3::ZERO;
        s.camera.target = s.camera.position - Vec3::Z;
        let (c, _) = compile(&s).unwrap();
        assert!(c.camera.up.cross(Vec3::Z).length() > 0.9);
    }

    #[test]
    fn inconsistent_meshes_and_far_points_are_errors() {
        let breaks: [fn(&mut MeshDesc); 5] = [
            |m| m.triangles[0][1] = 3,
            |m| m.triangle_slot[0] = 1,
            |m| m.triangle_slot.clear(),
            |m| m.normals.truncate(1),
            |m| m.positions[0].x = f32::NAN,
        ];
        for change in breaks {
            let ShapeDesc::Mesh(m) = triangle() else { unreachable!() };
            let mut m = (*m).clone();
            change(&mut m);
            let s = scene(vec![(ShapeDesc::Mesh(Arc::new(m)), Transform::default())], light());
            let e = compile(&s).unwrap_err().to_string();
            assert!(e.contains("m.obj: entities.e0"), "{e}");
        }
        let far = Transform { translate: Vec3::X * 1e13, ..Transform::default() };
        assert!(compile(&scene(vec![(triangle(), far)], light())).is_err());
        assert!(compile(&scene(vec![(ShapeDesc::Sphere { radius: 1.0 }, far)], light())).is_err());
        assert!(compile(&scene(vec![(ShapeDesc::Sphere { radius: -1.0 }, Transform::default())], light())).is_err());
    }
}
