//! From a compiled scene and a job to the buffers of `shaders/scene.glsl`.

use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;
use glam::Vec3;

use super::buffer::Buffer;
use super::delays::{DelayRows, words};
use super::device::Device;
use super::error::VulkanError;
use super::layout::{self, EnvironmentRow, LightChoice};
use super::pipeline::Bound;
use super::texels::Texels;
use crate::film::layer::{Layer, Layout};
use crate::film::time::TimeFilter;
use crate::render;
use crate::scene::CompiledScene;
use crate::scene::compile::{self, MaskMode, Model, NONE};
use crate::transport::camera::{Camera, FilterKind};
use crate::transport::integrator::Settings;
use crate::transport::light::{Lights, Select};
use crate::transport::mis::Heuristic;

/// The models that have shaders, by their number there.
pub const MODELS: &[Model] = &[Model::Disney, Model::Lambert, Model::Conductor, Model::Plastic, Model::Dielectric];

/// The models of a scene as shaders count them, one bit each.
pub fn models(scene: &CompiledScene) -> u32 {
    scene.materials.iter().fold(0, |bits, m| bits | 1 << number(m.model))
}

/// Scenes with models that have none are refused before.
fn number(model: Model) -> u32 {
    MODELS.iter().position(|known| *known == model).unwrap_or(0) as u32
}

/// What of a scene does not depend on the job: shared by everything that renders it.
pub struct SceneBuffers {
    /// Corners of the triangles, which acceleration structures are built from.
    pub triangles: Buffer,
    surfaces: [Buffer; 5],
    texels: Texels,
    lights: [Buffer; 3],
    copies: [Buffer; 2],
}

/// What depends on the job too.
pub struct JobBuffers {
    job: Buffer,
    others: [Buffer; 7],
}

impl SceneBuffers {
    /// Copies a scene to a device.
    ///
    /// # Errors
    /// When an array or the whole is larger than the device holds, or a material has a model without a shader.
    pub fn new(device: &Arc<Device>, scene: &CompiledScene) -> Result<SceneBuffers, VulkanError> {
        if let Some(material) = scene.materials.iter().find(|m| !MODELS.contains(&m.model)) {
            let needed = format!("a shader for materials of the model `{}`", material.model.word());
            return Err(VulkanError::Lacks { device: device.info.line(), needed });
        }
        let plain = vk::BufferUsageFlags::empty();
        let triangles: Vec<layout::Triangle> = scene.triangles.iter().map(triangle).collect();
        let build = if device.accel.is_some() {
            vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
                | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
        } else {
            plain
        };
        let (textures, texels) = textures(device, scene)?;
        let tangents: Vec<layout::Tangents> = scene
            .tangents
            .iter()
            .map(|t| layout::Tangents { a: t[0].into(), b: t[1].into(), c: t[2].into() })
            .collect();
        let attributes: Vec<layout::TriangleAttributes> = scene.attributes.iter().map(attributes).collect();
        let spheres: Vec<layout::Sphere> = scene.spheres.iter().map(sphere).collect();
        let material = |(row, m): (usize, &compile::Material)| {
            let parts = scene.delays.rows.get(row).copied().unwrap_or_default();
            layout::Material { parts, ..material(m) }
        };
        let materials: Vec<layout::Material> = scene.materials.iter().enumerate().map(material).collect();
        let emitters: Vec<layout::Emitter> = scene
            .emitters
            .iter()
            .map(|e| layout::Emitter { primitive: e.primitive, instance: e.instance, area: e.area })
            .collect();
        let points: Vec<layout::PointLight> = scene
            .points
            .iter()
            .map(|p| layout::PointLight {
                position: p.position.into(),
                intensity: p.intensity.into(),
                axis: p.cone.axis.into(),
                beam: p.cone.beam,
                cutoff: p.cone.cutoff,
                beam_height: p.cone.beam_height,
                cutoff_height: p.cone.cutoff_height,
                is_smooth: u32::from(p.cone.smooth),
            })
            .collect();
        let directionals: Vec<layout::DirectionalLight> = scene
            .directionals
            .iter()
            .map(|d| layout::DirectionalLight { direction: d.direction.into(), irradiance: d.irradiance.into() })
            .collect();
        Ok(SceneBuffers {
            triangles: Buffer::with(device, "triangles", &triangles, build)?,
            surfaces: [
                Buffer::with(device, "attributes of triangles", &attributes, plain)?,
                Buffer::with(device, "tangents", &tangents, plain)?,
                Buffer::with(device, "spheres", &spheres, plain)?,
                Buffer::with(device, "materials", &materials, plain)?,
                Buffer::with(device, "textures", &textures, plain)?,
            ],
            texels: Texels::new(device, &texels)?,
            lights: [
                Buffer::with(device, "emitters", &emitters, plain)?,
                Buffer::with(device, "point lights", &points, plain)?,
                Buffer::with(device, "directional lights", &directionals, plain)?,
            ],
            copies: [
                Buffer::with(device, "places of copies", &places(scene), plain)?,
                Buffer::with(device, "materials of copies", &scene.instances.materials, plain)?,
            ],
        })
    }

    /// Where texels lie in blocks, the binary logarithm of how many make one: shaders need it as `TEXEL_SHIFT`.
    pub fn texel_shift(&self) -> Option<u32> {
        self.texels.shift
    }
}

impl JobBuffers {
    /// Copies what a job needs besides its scene.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub fn new(
        device: &Arc<Device>,
        scene: &CompiledScene,
        job: &render::Job,
        layers: &Layout,
    ) -> Result<JobBuffers, VulkanError> {
        let plain = vk::BufferUsageFlags::empty();
        let lights = Lights::with_select(scene, Select::of(&job.params));
        let (rows, cells) = environment(&lights);
        let delays = DelayRows::new(scene, job.timing.as_ref());
        let constants = layout::Job { time_emission: delays.emission, ..constants(scene, job, &lights, layers) };
        Ok(JobBuffers {
            job: Buffer::with(device, "job", &[constants], plain)?,
            others: [
                Buffer::with(device, "choice of lights", &choices(&lights), plain)?,
                Buffer::with(device, "rows of the environment", &rows, plain)?,
                Buffer::with(device, "cells of the environment", &cells, plain)?,
                Buffer::with(device, "splat films", &slots(layers), plain)?,
                Buffer::with(device, "parts of materials", &delays.parts, plain)?,
                Buffer::with(device, "profiles in time", &delays.profiles, plain)?,
                Buffer::with(device, "knots of tables", &delays.knots, plain)?,
            ],
        })
    }
}

/// The first bindings of every descriptor set, in the order of `shaders/scene.glsl`.
pub fn bound<'a>(scene: &'a SceneBuffers, job: &'a JobBuffers) -> Vec<Bound<'a>> {
    let of_scene = [&scene.triangles].into_iter().chain(&scene.surfaces).chain([&scene.texels.bound]);
    let of_scene = of_scene.chain(&scene.lights).chain(&scene.copies);
    [&job.job].into_iter().chain(of_scene).chain(&job.others).map(Bound::Storage).collect()
}

fn places(scene: &CompiledScene) -> Vec<layout::Place> {
    let place = |p: &compile::Instance| {
        let [xx, xy, xz, yx, yy, yz, zx, zy, zz, tx, ty, tz] = p.to_world.to_cols_array().map(words);
        layout::Place {
            xx,
            xy,
            xz,
            yx,
            yy,
            yz,
            zx,
            zy,
            zz,
            tx,
            ty,
            tz,
            normal_x: p.normal_to_world.x_axis.into(),
            normal_y: p.normal_to_world.y_axis.into(),
            normal_z: p.normal_to_world.z_axis.into(),
            start: scene.instances.meshes[p.mesh as usize].triangles.start,
            materials: p.materials,
            emitters: p.emitters,
            first: p.first,
        }
    };
    scene.instances.places.iter().map(place).collect()
}

fn triangle([a, b, c]: &[Vec3; 3]) -> layout::Triangle {
    layout::Triangle { a: (*a).into(), b: (*b).into(), c: (*c).into() }
}

fn attributes(t: &compile::TriangleAttributes) -> layout::TriangleAttributes {
    let [na, nb, nc] = t.normals.map(Into::into);
    let [ta, tb, tc] = t.uvs.map(Into::into);
    layout::TriangleAttributes { na, nb, nc, ta, tb, tc, material: t.material, emitter: t.emitter }
}

fn sphere(s: &compile::Sphere) -> layout::Sphere {
    layout::Sphere { center: s.center.into(), radius: s.radius, material: s.material, emitter: s.emitter }
}

fn material(m: &compile::Material) -> layout::Material {
    layout::Material {
        base_color: m.base_color.into(),
        emission: m.emission.into(),
        model: number(m.model),
        roughness: m.roughness,
        metallic: m.metallic,
        opacity: m.opacity,
        ior: m.ior,
        subsurface: m.subsurface,
        specular_tint: m.specular_tint,
        anisotropic: m.anisotropic,
        anisotropic_direction: m.anisotropic_direction.into(),
        sheen: m.sheen,
        sheen_tint: m.sheen_tint,
        clearcoat: m.clearcoat,
        clearcoat_gloss: m.clearcoat_gloss,
        smooth_below: m.smooth_below,
        normal_strength: m.normal_strength,
        bump_height: m.bump_height,
        mask_threshold: m.mask_threshold,
        mask_mode: match m.mask_mode {
            MaskMode::Threshold => 0,
            MaskMode::Blend => 1,
        },
        shadow_terminator: m.shadow_terminator.into(),
        base_color_texture: m.base_color_texture,
        emission_texture: m.emission_texture,
        mask_texture: m.mask_texture,
        roughness_texture: m.roughness_texture,
        metallic_texture: m.metallic_texture,
        opacity_texture: m.opacity_texture,
        anisotropic_texture: m.anisotropic_texture,
        normal_texture: m.normal_texture,
        bump_texture: m.bump_texture,
        tiling_scale: m.tiling.scale,
        tiling_offset: m.tiling.offset.into(),
        emitter_reflects: m.emitter_reflects.into(),
        specular: m.interface.specular.into(),
        eta: m.interface.eta.into(),
        k: m.interface.k.into(),
        distribution: m.interface.distribution as u32,
        thin: m.interface.thin.into(),
        nonlinear: m.interface.nonlinear.into(),
        internal_reflectance: m.interface.internal_reflectance,
        parts: [0; 2],
    }
}

fn map_of(scene: &CompiledScene) -> Option<&compile::Texture> {
    scene.environment.as_ref().and_then(|e| e.map.as_deref())
}

/// All textures, the environment's map last, each with the index of its first texel; and behind the last texel. Textures
/// may share texels, which are there once.
fn placed(scene: &CompiledScene) -> (Vec<(&compile::Texture, u64)>, u64) {
    let (mut known, mut rows, mut end) = (BTreeMap::new(), Vec::new(), 0);
    for t in scene.textures.iter().chain(map_of(scene)) {
        let first = *known.entry(Arc::as_ptr(&t.texels).cast::<()>()).or_insert(end);
        end = end.max(first + t.texels.len() as u64);
        rows.push((t, first));
    }
    (rows, end)
}

/// Textures and their texels; behind those what triangles have at their corners: colours, and second coordinates.
fn textures(device: &Device, scene: &CompiledScene) -> Result<(Vec<layout::Texture>, Vec<[f32; 3]>), VulkanError> {
    let (placed, behind) = placed(scene);
    let corners = scene.colors.as_flattened().len() + scene.second_uvs.as_flattened().len();
    Texels::countable(device, behind + corners as u64)?;
    let (mut rows, mut texels) = (Vec::new(), Vec::new());
    for (t, first) in placed {
        let map = t.lookup.map.unwrap_or_default();
        rows.push(layout::Texture {
            first: first as u32,
            width: t.width,
            height: t.height,
            wrap: t.lookup.wrap.map(|wrap| wrap as u32),
            second: t.lookup.second.into(),
            moved: t.lookup.map.is_some().into(),
            map_u: map.matrix2.x_axis.into(),
            map_v: map.matrix2.y_axis.into(),
            map_origin: map.translation.into(),
        });
        if first == texels.len() as u64 {
            texels.extend_from_slice(&t.texels);
        }
    }
    texels.extend(scene.colors.as_flattened().iter().map(Vec3::to_array));
    texels.extend(scene.second_uvs.as_flattened().iter().map(|uv| [uv.x, uv.y, 0.0]));
    Ok((rows, texels))
}

/// Of every film its place among those on which splats land, or NONE.
fn slots(layers: &Layout) -> Vec<u32> {
    let mut next = 0..;
    layers.films().iter().map(|film| if film.splats { next.next().unwrap_or(NONE) } else { NONE }).collect()
}

fn choices(lights: &Lights) -> Vec<LightChoice> {
    let Some(alias) = &lights.choice else { return Vec::new() };
    let pmf = |i: usize| alias.pmf.get(i).copied().unwrap_or(0.0);
    let row = |(i, (own, above)): (usize, &(u32, u32))| LightChoice { own: *own, above: *above, pmf: pmf(i) };
    alias.columns.iter().enumerate().map(row).collect()
}

fn environment(lights: &Lights) -> (Vec<EnvironmentRow>, Vec<f32>) {
    let Some(map) = lights.surroundings.as_ref().and_then(|s| s.map.as_ref()) else { return (Vec::new(), Vec::new()) };
    let columns = f64::from(map.texture.width);
    let row = |(marginal, edges): (&f32, &[f64])| {
        let (upper, lower) = (edges[0], edges[1]);
        EnvironmentRow {
            marginal: *marginal,
            upper: upper as f32,
            step: (lower - upper) as f32,
            upper_rest: (1.0 - upper.abs()) as f32,
            density: (columns / (std::f64::consts::TAU * (upper - lower))) as f32,
        }
    };
    (map.grid.marginal.iter().zip(map.row_cos.windows(2)).map(row).collect(), map.grid.conditional.clone())
}

fn constants(scene: &CompiledScene, job: &render::Job, lights: &Lights, layers: &Layout) -> layout::Job {
    let first = |place: Option<usize>| place.map_or(NONE, |i| i as u32);
    let camera = Camera::new(&scene.camera, job.resolution, job.filter);
    let settings = Settings::new(&job.params);
    let surroundings = lights.surroundings.as_ref();
    let map = surroundings.and_then(|s| s.map.as_ref());
    let timing = job.timing.as_ref();
    let axis = timing.map(|t| t.axis);
    let behind = placed(scene).1 as u32;
    let (filter, radius) = match timing.map_or(TimeFilter::None, |t| t.filter) {
        TimeFilter::None => (0, 0.0),
        TimeFilter::Box(radius) => (1, radius),
        TimeFilter::Gauss(sigma) => (2, sigma),
    };
    layout::Job {
        camera_position: camera.position.into(),
        camera_right: camera.right.into(),
        camera_up: camera.up.into(),
        camera_forward: camera.forward.into(),
        camera_half: camera.half,
        resolution: job.resolution,
        lens_radius: camera.lens_radius,
        focus_distance: camera.focus_distance,
        filter_kind: match job.filter.kind {
            FilterKind::Box => 0,
            FilterKind::Tent => 1,
            FilterKind::Gauss => 2,
            FilterKind::BlackmanHarris => 3,
            FilterKind::AntialiasingRadius => 4,
        },
        filter_radius: job.filter.radius,
        max_depth: job.max_depth,
        rr_start: job.rr_start.unwrap_or(NONE),
        mis: match settings.mis {
            Some(Heuristic::Power) => 0,
            Some(Heuristic::Balance) => 1,
            Some(Heuristic::Uniform) => 2,
            None => NONE,
        },
        all_lights: settings.all_lights.into(),
        one_strategy: settings.one.unwrap_or([NONE; 2]),
        keep_strategy: settings.keep.into(),
        sampler_kind: u32::from(job.sampler.name == "sobol"),
        seed: [job.seed as u32, (job.seed >> 32) as u32],
        triangle_count: scene.triangles.len() as u32,
        sphere_count: scene.spheres.len() as u32,
        has_tangents: u32::from(!scene.tangents.is_empty()),
        first_color: if scene.colors.is_empty() { NONE } else { behind },
        first_second_uv: match scene.second_uvs.is_empty() {
            true => NONE,
            false => behind + scene.colors.as_flattened().len() as u32,
        },
        light_count: lights.count() as u32,
        light_first: lights.first,
        alias_shift: lights.choice.as_ref().map_or(NONE, |alias| alias.shift),
        ball_center: lights.ball.center.into(),
        ball_radius: lights.ball.radius,
        has_environment: surroundings.is_some().into(),
        environment_texture: if map.is_some() { scene.textures.len() as u32 } else { NONE },
        environment_radiance: surroundings.map_or([0.0; 3], |s| s.radiance.into()),
        environment_turn: map.map_or([0.0, 1.0], |m| m.turn),
        film_count: layers.films().len() as u32,
        light_films: layers.films().iter().filter(|film| film.layer.row().splats).count() as u32,
        splat_films: layers.films().iter().filter(|film| film.splats).count() as u32,
        layer_depth: first(layers.depth(1)),
        layer_strategies: first(layers.strategy(0, 2)),
        layer_bounces: first(layers.whole(Layer::Bounces)),
        layer_rays: first(layers.whole(Layer::Rays)),
        layer_albedo: first(layers.whole(Layer::Albedo)),
        layer_normal: first(layers.whole(Layer::Normal)),
        layer_distance: first(layers.whole(Layer::Distance)),
        time_start: words(axis.map_or(0.0, |a| a.start)),
        time_bin: words(axis.map_or(1.0, |a| a.bin)),
        time_bins: axis.map_or(0, |a| a.bins),
        time_filter: filter,
        time_radius: words(radius),
        time_camera: timing.is_none_or(|t| t.camera).into(),
        time_medium: timing.map_or(1.0, |t| t.medium),
        time_emission: NONE,
    }
}
