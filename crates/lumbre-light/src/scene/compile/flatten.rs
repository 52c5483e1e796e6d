//! Compilation of a description: camera, materials, meshes, spheres and lights, with the checks
//! that concern the scene as a whole.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::instancing::{self, Sharing};
use super::mesh::{add_mesh, in_range, mesh_entities, push_emitter, with_own_direction};
use super::resolver::MaterialResolver;
use super::{CompiledScene, NONE, Sphere, bounds, lights, materials};
use crate::math::distribution::AliasTable;
use crate::scene::desc::{
    CameraDesc, CameraKind, EntityDesc, MAX_COORDINATE, SceneDesc, ShapeDesc, VIEW_HEIGHT_RANGE,
    content_hash, place,
};
use crate::scene::{Note, SceneError, note};
use crate::value::schema::SchemaError;

/// Greatest number of primitives in a scene: more would exceed the memory of the machines that this
/// program targets.
pub const MAX_PRIMITIVES: usize = 1 << 26;

/// Least sine of the angle between the view direction and the camera's up direction.
const PARALLEL_SINE: f32 = 1e-5;

/// Compiles a description to arrays in world space.
///
/// The front of every triangle is the front in its mesh, also under transforms that mirror. Shading
/// normals are transformed by the inverse transpose and lie on the front side. Triangles without
/// area are left out with a [`Note`]; unknown material names are replaced by the first material,
/// with a [`Note`].
///
/// # Errors
/// Fails for a camera without a view direction, a point beyond the range of coordinates, a mesh
/// with inconsistent arrays, more primitives than [`MAX_PRIMITIVES`], more lights than
/// [`AliasTable`] supports, and invalid values of materials or lights.
pub fn compile(desc: &SceneDesc) -> Result<(CompiledScene, Vec<Note>), SceneError> {
    compile_sharing(desc, Sharing::Auto)
}

/// Compiles a description like [`compile`], with a given policy for meshes that several entities
/// use.
///
/// # Errors
/// Fails like [`compile`]. The primitives of a shared mesh count once, its lights for every
/// instance.
pub fn compile_sharing(
    desc: &SceneDesc,
    sharing: Sharing,
) -> Result<(CompiledScene, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let mut scene = without_surfaces(desc, &mut notes)?;
    let mut resolver = MaterialResolver::new(desc, notes);
    let mut entities = mesh_entities(&mut scene, &mut resolver)?;
    let instances = instancing::extract_instances(&scene, &mut entities, sharing);
    let spheres = desc
        .entities
        .iter()
        .filter(|e| matches!(e.shape, ShapeDesc::Sphere { .. }))
        .count();
    let total = entities
        .iter()
        .map(|entity| entity.mesh.triangles.len())
        .chain([instances.triangles(), spheres])
        .fold(0usize, usize::saturating_add);
    if total > MAX_PRIMITIVES {
        let problem = format!(
            "the scene has {total} triangles and spheres; at most {MAX_PRIMITIVES} are supported"
        );
        return Err(SceneError::malformed("", "entities", problem));
    }
    scene.triangles.reserve_exact(total - spheres);
    scene.attributes.reserve_exact(total - spheres);
    scene.normals.reserve_exact(total - spheres);
    for entity in &entities {
        add_mesh(&mut scene, entity, &mut resolver.notes)?;
    }
    instances.add_to(&mut scene, &mut resolver.notes)?;
    for (index, entity) in desc.entities.iter().enumerate() {
        if let ShapeDesc::Sphere { radius } = entity.shape {
            add_sphere(&mut scene, entity, radius, &mut resolver)?;
            scene.entities.spheres.push(index as u32);
        }
    }
    let mut notes = resolver.notes;
    scene.bounds = bounds::bounds(&scene);
    note_scale(&scene, desc, &mut notes);
    check_lights(&scene, &mut notes)?;
    Ok((scene, note::summed_up(notes)))
}

/// Returns the compiled scene before any surface is added.
fn without_surfaces(desc: &SceneDesc, notes: &mut Vec<Note>) -> Result<CompiledScene, SceneError> {
    let (materials, mut textures, delays) = materials::compile(desc, notes)?;
    let lights = lights::compile(desc, &mut textures, notes)?;
    let mut scene = CompiledScene {
        content_hash: content_hash(desc),
        materials,
        delays,
        textures,
        resolution: desc.resolution,
        max_depth: desc.max_depth,
        ..lights
    };
    scene.camera = scene.placed_camera(&desc.camera, notes)?;
    Ok(scene)
}

/// Size of a scene, the diagonal of its bounding box, below which products of lengths and densities
/// can leave the range of single precision.
const SMALL_SCENE: f32 = 1e-7;

/// Greatest coordinate of a scene relative to its size above which the precision of its coordinates
/// shows.
const FAR_SCENE: f32 = 1e3;

/// Notes a scene that is too small, or whose vertices are too far from the origin for its size.
fn note_scale(scene: &CompiledScene, desc: &SceneDesc, notes: &mut Vec<Note>) {
    let [low, high] = scene.bounds;
    let [near, far] = scene.bounds.map(|corner| scene.described(corner).abs());
    let (size, extent) = ((high - low).length(), near.max(far).max_element());
    if scene.primitive_count() == 0 || !size.is_finite() || size == 0.0 {
        return;
    }
    let coarse = || place::farthest_stored(desc) > FAR_SCENE * size;
    let message = if extent > FAR_SCENE * size && coarse() {
        format!(
            "the scene measures {size:.3e} units but lies up to {extent:.3e} from the origin, where \
             the single precision of its vertices is too coarse: shapes may be wrong; move it to \
             the origin"
        )
    } else if size < SMALL_SCENE {
        format!(
            "the scene measures only {size:.3e} units, where densities leave the range of single \
             precision; scale it up"
        )
    } else {
        return;
    };
    notes.push(Note::new("", "entities", message));
}

/// Checks the number of lights, and notes a scene that will render black.
fn check_lights(scene: &CompiledScene, notes: &mut Vec<Note>) -> Result<(), SceneError> {
    let lights = scene.emitters.len() + lights::count(scene);
    if lights >= AliasTable::MAX_ITEMS {
        let problem = format!(
            "the scene has {lights} emissive triangles, spheres and other lights; at most {} are \
             supported",
            AliasTable::MAX_ITEMS - 1
        );
        return Err(SceneError::malformed("", "entities", problem));
    }
    if scene.environment.is_some() {
        return Ok(());
    }
    let message = if scene.primitive_count() == 0 {
        "the scene has no surfaces, so the image will be black"
    } else if lights == 0 {
        "nothing emits light, so the image will be black; add a light, an environment or an \
         emissive material"
    } else {
        return Ok(());
    };
    notes.push(Note::new("", "scene", message));
    Ok(())
}

/// Returns a camera as [`compile`] does: with a usable up direction. Nothing else of a compiled
/// scene depends on the camera.
///
/// # Errors
/// Fails if position, target or up are not finite, position and target coincide, the picture of an
/// orthographic camera has no usable height, or a camera of a kind without a lens has one.
pub fn compile_camera(
    camera: &CameraDesc,
    notes: &mut Vec<Note>,
) -> Result<CameraDesc, SceneError> {
    let fail = |key: &str, problem: &str| {
        let path = format!("camera.{key}");
        Err(SchemaError::new(path, key, problem).into())
    };
    if ![camera.position, camera.target, camera.up]
        .iter()
        .all(|v| v.is_finite())
    {
        return fail(
            "position",
            "the camera's position, target and up must be finite",
        );
    }
    let [least, most] = VIEW_HEIGHT_RANGE;
    if camera.kind == CameraKind::Orthographic
        && !(least..=most).contains(&f64::from(camera.view_height))
    {
        return fail(
            "view_height",
            &format!(
                "the height of the picture must be between {least:e} and {most:e}, found {}",
                camera.view_height
            ),
        );
    }
    if let Some([problem, help]) = camera.lens_problem() {
        return fail("kind", &format!("{problem}; {help}"));
    }
    if let Some(problem) = camera.window_problem() {
        return fail("window", &problem);
    }
    let Some(view) = (camera.target - camera.position).try_normalize() else {
        return fail(
            "target",
            "the target is equal to the camera's position, so there is no view direction",
        );
    };
    let mut camera = camera.clone();
    let up = camera.up.try_normalize();
    if up.is_none_or(|up| view.cross(up).length() < PARALLEL_SINE) {
        // Views straight down have -z up, as north on a map; all others have +y up.
        camera.up = if view.y.abs() > 0.9 {
            Vec3::NEG_Z
        } else {
            Vec3::Y
        };
        notes.push(Note::new(
            "",
            "camera.up",
            format!(
                "the up direction is zero or parallel to the view direction; {} is used instead",
                camera.up
            ),
        ));
    }
    Ok(camera)
}

/// Appends a sphere, and its emitter if it emits light.
///
/// # Errors
/// Fails for a transform that makes it an ellipsoid, and for a radius or centre out of range.
fn add_sphere(
    scene: &mut CompiledScene,
    entity: &EntityDesc,
    radius: f32,
    resolver: &mut MaterialResolver,
) -> Result<(), SceneError> {
    let place = format!("entities.{}", entity.name);
    let fail = |problem: String| Err(SceneError::malformed("", place.clone(), problem));
    let Some(scale) = entity.transform.sphere_scale() else {
        return fail(
            "the transform makes the sphere an ellipsoid; only uniform scales are supported"
                .to_owned(),
        );
    };
    let center = if scene.origin == DVec3::ZERO {
        let frame = entity.transform.frame;
        let translate = entity.transform.translate.as_vec3();
        frame.as_affine3a().transform_point3(translate)
    } else {
        scene.placed_map(entity).translation.as_vec3()
    };
    let radius = radius * scale;
    if !(radius > 0.0 && radius <= MAX_COORDINATE) {
        return fail(format!("a sphere needs a positive radius, found {radius}"));
    }
    if !in_range(center) {
        return fail(format!(
            "the centre is {center}; coordinates must be within {MAX_COORDINATE:e} of the origin"
        ));
    }
    let material = entity
        .material
        .as_deref()
        .map_or(0, |name| resolver.index(name, Path::new(""), &place));
    let [material] = with_own_direction(scene, vec![material], entity)[..] else {
        return Ok(());
    };
    let emits = scene.materials[material as usize].emission != Vec3::ZERO;
    let emitter = match emits.then(|| push_sphere_emitter(scene, radius)) {
        None => NONE,
        Some(Some(emitter)) => emitter,
        Some(None) => {
            resolver.notes.push(Note::new(
                "",
                place,
                "the sphere is too small to emit light; its emission is ignored",
            ));
            NONE
        }
    };
    scene.spheres.push(Sphere {
        center,
        radius,
        material,
        emitter,
    });
    Ok(())
}

/// Appends the emitter of the next sphere and returns its index, or `None` if its area is zero.
fn push_sphere_emitter(scene: &mut CompiledScene, radius: f32) -> Option<u32> {
    let area = (4.0 * std::f64::consts::PI * f64::from(radius).powi(2)) as f32;
    let primitive = scene.triangles.len() + scene.spheres.len();
    (area > 0.0).then(|| push_emitter(scene, primitive, NONE, area))
}

#[cfg(test)]
mod tests;
