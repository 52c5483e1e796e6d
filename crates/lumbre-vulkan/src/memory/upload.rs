//! Converts a compiled scene and a job to the buffers of `shaders/scene.glsl`.

use std::sync::Arc;

use ash::vk;
use glam::Vec3;

use super::buffer::Buffer;
use super::delay_tables::{DelayRows, double_words};
use super::job_params::job_params;
use super::subpaths::SubpathRoom;
use super::texel_blocks::Texels;
use super::texel_words::{Place, TexelLayout, environment_map};
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout;
use crate::layout::{EnvironmentRow, LightChoice};
use crate::pipelines::compute::BoundResource;
use lumbre_light::film::layer::LayerLayout;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{self, Model, NONE, RoughnessTexels};
use lumbre_light::scene::desc::TextureFilter;
use lumbre_light::transport::light::{LightSampling, Lights};

/// Material models that have shaders.
pub const MODELS: &[Model] = &Model::ALL;

/// Returns the models of a scene as a bit mask of their numbers in GLSL.
pub fn models(scene: &CompiledScene) -> u32 {
    scene
        .materials
        .iter()
        .fold(0, |bits, m| bits | 1 << m.model as u32)
}

/// Buffers of a scene that do not depend on the job: shared by all runs that render it.
pub struct SceneBuffers {
    /// Corners of the triangles, from which acceleration structures are built.
    pub triangles: Buffer,
    surfaces: [Buffer; 5],
    texels: Texels,
    lights: [Buffer; 3],
    instances: [Buffer; 2],
}

/// Buffers that depend on the job.
pub struct JobBuffers {
    job: Buffer,
    others: [Buffer; 7],
}

impl SceneBuffers {
    /// Copies a scene to a device.
    ///
    /// # Errors
    /// Returns an error if an array or the whole scene is larger than the device can hold, or a
    /// material model has no shader.
    pub fn new(device: &Arc<Device>, scene: &CompiledScene) -> Result<SceneBuffers, VulkanError> {
        if let Some(material) = scene.materials.iter().find(|m| !MODELS.contains(&m.model)) {
            let needed = format!(
                "materials of the model `{}`: it has no shader",
                material.model.name()
            );
            return Err(VulkanError::Lacks {
                device: device.info.line(),
                needed,
            });
        }
        let plain = vk::BufferUsageFlags::empty();
        let triangles: Vec<layout::Triangle> = scene.triangles.iter().map(triangle).collect();
        let build = if device.accel.is_some() {
            vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
                | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
        } else {
            plain
        };
        let layout = TexelLayout::new(scene);
        Texels::check_count(device, layout.count)?;
        let textures = textures(scene, &layout);
        let tangents: Vec<layout::Tangents> = scene.tangents.iter().map(tangents).collect();
        let attributes: Vec<layout::TriangleAttributes> = (0..scene.triangles.len())
            .map(|i| attributes(scene, i))
            .collect();
        let spheres: Vec<layout::Sphere> = scene.spheres.iter().map(sphere).collect();
        let material = |(row, m): (usize, &compile::Material)| {
            let parts = scene.delays.rows.get(row).copied().unwrap_or_default();
            layout::Material {
                parts,
                ..material(m)
            }
        };
        let materials: Vec<layout::Material> =
            scene.materials.iter().enumerate().map(material).collect();
        let emitters: Vec<layout::Emitter> = scene.emitters.iter().map(emitter).collect();
        let points: Vec<layout::PointLight> = scene.points.iter().map(point_light).collect();
        let directionals: Vec<layout::DirectionalLight> =
            scene.directionals.iter().map(directional_light).collect();
        let instance_materials = &scene.instances.materials;
        Ok(SceneBuffers {
            triangles: Buffer::with(device, "triangles", &triangles, build)?,
            surfaces: [
                Buffer::with(device, "triangle attributes", &attributes, plain)?,
                Buffer::with(device, "tangents", &tangents, plain)?,
                Buffer::with(device, "spheres", &spheres, plain)?,
                Buffer::with(device, "materials", &materials, plain)?,
                Buffer::with(device, "textures", &textures, plain)?,
            ],
            texels: Texels::new(device, &layout.words(scene))?,
            lights: [
                Buffer::with(device, "emitters", &emitters, plain)?,
                Buffer::with(device, "point lights", &points, plain)?,
                Buffer::with(device, "directional lights", &directionals, plain)?,
            ],
            instances: [
                Buffer::with(device, "mesh placements", &placements(scene), plain)?,
                Buffer::with(device, "instance materials", instance_materials, plain)?,
            ],
        })
    }

    /// Returns the binary logarithm of the number of words of a block if texels are stored in
    /// blocks; the specialisation constant `TEXEL_SHIFT`.
    pub fn texel_shift(&self) -> Option<u32> {
        self.texels.shift
    }
}

impl JobBuffers {
    /// Copies the data that a job needs besides its scene.
    ///
    /// # Errors
    /// Returns an error if there is no memory for it.
    pub fn new(
        device: &Arc<Device>,
        scene: &CompiledScene,
        job: &lumbre_render::Job,
        layers: &LayerLayout,
        room: &SubpathRoom,
    ) -> Result<JobBuffers, VulkanError> {
        let plain = vk::BufferUsageFlags::empty();
        let sampling = LightSampling::new(job.integrator, &job.settings.params);
        let lights = Lights::with_select(scene, sampling);
        let (rows, cells) = environment_tables(&lights);
        let delays = DelayRows::new(scene, job.settings.timing.as_ref());
        let params = job_params(scene, job, &lights, layers, room, delays.emission);
        Ok(JobBuffers {
            job: Buffer::with(
                device,
                "job",
                &[params],
                vk::BufferUsageFlags::UNIFORM_BUFFER,
            )?,
            others: [
                Buffer::with(
                    device,
                    "light selection table",
                    &light_choices(&lights),
                    plain,
                )?,
                Buffer::with(device, "environment rows", &rows, plain)?,
                Buffer::with(device, "environment cells", &cells, plain)?,
                Buffer::with(device, "splat films", &splat_slots(layers), plain)?,
                Buffer::with(device, "material components", &delays.components, plain)?,
                Buffer::with(device, "delay profiles", &delays.profiles, plain)?,
                Buffer::with(device, "delay table knots", &delays.knots, plain)?,
            ],
        })
    }
}

/// Returns the first bindings of every descriptor set, in the order of `shaders/scene.glsl`.
pub fn bindings<'a>(scene: &'a SceneBuffers, job: &'a JobBuffers) -> Vec<BoundResource<'a>> {
    let scene_buffers = [&scene.triangles]
        .into_iter()
        .chain(&scene.surfaces)
        .chain([&scene.texels.bound]);
    let scene_buffers = scene_buffers.chain(&scene.lights).chain(&scene.instances);
    let stored = scene_buffers.chain(&job.others).map(BoundResource::Storage);
    [BoundResource::Uniform(&job.job)]
        .into_iter()
        .chain(stored)
        .collect()
}

fn placements(scene: &CompiledScene) -> Vec<layout::Placement> {
    let place = |p: &compile::Instance| {
        let [xx, xy, xz, yx, yy, yz, zx, zy, zz, tx, ty, tz] =
            p.to_world.to_cols_array().map(double_words);
        layout::Placement {
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
            first: p.flattened_start,
        }
    };
    scene.instances.placements.iter().map(place).collect()
}

fn triangle([a, b, c]: &[Vec3; 3]) -> layout::Triangle {
    layout::Triangle {
        a: (*a).into(),
        b: (*b).into(),
        c: (*c).into(),
    }
}

fn attributes(scene: &CompiledScene, triangle: usize) -> layout::TriangleAttributes {
    let t = &scene.attributes[triangle];
    let [na, nb, nc] = scene.normals.at(triangle as u32).map(Into::into);
    let [ta, tb, tc] = scene.corner_uvs(triangle as u32).map(Into::into);
    layout::TriangleAttributes {
        na,
        nb,
        nc,
        ta,
        tb,
        tc,
        material: t.material,
        emitter: t.emitter,
    }
}

fn tangents(t: &[glam::Vec4; 3]) -> layout::Tangents {
    layout::Tangents {
        a: t[0].into(),
        b: t[1].into(),
        c: t[2].into(),
    }
}

fn emitter(e: &compile::Emitter) -> layout::Emitter {
    layout::Emitter {
        primitive: e.primitive,
        instance: e.instance,
        area: e.area,
    }
}

fn point_light(p: &compile::PointLight) -> layout::PointLight {
    let (rotation, right, up, even) = match p.map.map(|map| map.mapping) {
        None => (0.0, Vec3::ZERO, Vec3::ZERO, false),
        Some(compile::MapSpace::Sphere { rotation_rad }) => {
            (rotation_rad, Vec3::ZERO, Vec3::ZERO, false)
        }
        Some(compile::MapSpace::Plane { right, up, even }) => (0.0, right, up, even),
    };
    let (sin, cos) = rotation.sin_cos();
    layout::PointLight {
        position: p.position.into(),
        intensity: p.intensity.into(),
        axis: p.cone.axis.into(),
        beam: p.cone.beam,
        cutoff: p.cone.cutoff,
        beam_height: p.cone.beam_height,
        cutoff_height: p.cone.cutoff_height,
        is_smooth: u32::from(p.cone.smooth),
        map: p.map.map_or(NONE, |map| map.texture),
        turn: [sin, cos],
        right: right.into(),
        up: up.into(),
        is_even: u32::from(even),
    }
}

fn directional_light(d: &compile::DirectionalLight) -> layout::DirectionalLight {
    layout::DirectionalLight {
        direction: d.direction.into(),
        irradiance: d.irradiance.into(),
    }
}

fn sphere(s: &compile::Sphere) -> layout::Sphere {
    layout::Sphere {
        center: s.center.into(),
        radius: s.radius,
        material: s.material,
        emitter: s.emitter,
    }
}

fn material(m: &compile::Material) -> layout::Material {
    let transmittance = m.interface.transmittance.unwrap_or_default();
    let knots = |first: usize| std::array::from_fn(|i| transmittance[first + i]);
    layout::Material {
        base_color: m.base_color.into(),
        emission: m.emission.into(),
        model: m.model as u32,
        roughness: m.roughness,
        metallic: m.metallic,
        opacity: m.opacity,
        transmittance: m.transmittance.into(),
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
        one_sided: m.one_sided.into(),
        normal_strength: m.normal_strength,
        bump_height: m.bump_height,
        mask_threshold: m.mask_threshold,
        mask_mode: m.mask_mode as u32,
        shadow_terminator: m.shadow_terminator.into(),
        base_color_texture: m.base_color_texture,
        emission_texture: m.emission_texture,
        mask_texture: m.mask_texture,
        roughness_texture: m.roughness_texture,
        metallic_texture: m.metallic_texture,
        opacity_texture: m.opacity_texture,
        transmittance_texture: m.transmittance_texture,
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
        formulas: m.formulas as u32,
        alpha_texels: (m.roughness_texels == RoughnessTexels::Alpha).into(),
        rough_body: m.interface.transmittance.is_some().into(),
        transmittance_grazing: knots(0),
        transmittance_middle: knots(4),
        transmittance_steep: knots(8),
        nonlinear: m.interface.nonlinear.into(),
        internal_reflectance: m.interface.internal_reflectance,
        parts: [0; 2],
    }
}

/// Returns the rows of all textures, the environment map's last.
fn textures(scene: &CompiledScene, layout: &TexelLayout) -> Vec<layout::Texture> {
    let row = |(t, place): (&compile::Texture, &Place)| {
        let map = t.lookup.map.unwrap_or_default();
        layout::Texture {
            first: place.first as u32,
            table: place.table.map_or(NONE, |first| first as u32),
            width: t.width,
            height: t.height,
            wrap: t.lookup.wrap.map(|wrap| wrap as u32),
            nearest: (t.lookup.filter == TextureFilter::Nearest).into(),
            second: t.lookup.second.into(),
            moved: t.lookup.map.is_some().into(),
            map_u: map.matrix2.x_axis.into(),
            map_v: map.matrix2.y_axis.into(),
            map_origin: map.translation.into(),
        }
    };
    let all = scene.textures.iter().chain(environment_map(scene));
    all.zip(&layout.places).map(row).collect()
}

/// Returns for each film its index among those that receive splats, or NONE.
fn splat_slots(layers: &LayerLayout) -> Vec<u32> {
    let mut next = 0..;
    layers
        .films()
        .iter()
        .map(|film| {
            if film.splats {
                next.next().unwrap_or(NONE)
            } else {
                NONE
            }
        })
        .collect()
}

fn light_choices(lights: &Lights) -> Vec<LightChoice> {
    let Some(alias) = &lights.choice else {
        return Vec::new();
    };
    let pmf = |i: usize| alias.pmf.get(i).copied().unwrap_or(0.0);
    let row = |(i, (own, above)): (usize, &(u32, u32))| LightChoice {
        own: *own,
        above: *above,
        pmf: pmf(i),
    };
    alias.columns.iter().enumerate().map(row).collect()
}

fn environment_tables(lights: &Lights) -> (Vec<EnvironmentRow>, Vec<f32>) {
    let Some(map) = lights
        .environment_light
        .as_ref()
        .and_then(|s| s.map.as_ref())
    else {
        return (Vec::new(), Vec::new());
    };
    let columns = f64::from(map.directions.texture.width);
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
    (
        map.grid
            .marginal
            .iter()
            .zip(map.row_cos.windows(2))
            .map(row)
            .collect(),
        map.grid.conditional.clone(),
    )
}
