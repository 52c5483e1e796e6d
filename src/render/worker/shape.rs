//! What of the program's own types goes through the pipe.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::wire::{Garbled, Reader, Wire, structs, words};
use crate::film::Film;
use crate::film::layer::{LAYERS, Layer};
use crate::film::time::{TimeAxis, TimeCube, TimeFilter};
use crate::math::piecewise::Piecewise;
use crate::render::hierarchy::AccelSpec;
use crate::render::{BACKENDS, Job, OpenStats, RenderError, WaveStats};
use crate::scene::CompiledScene;
use crate::scene::compile::{
    Cone, DelayKind, DelayParam, DelayProfile, Delays, DirectionalLight, Distribution, Emitter, Environment, Instance,
    Instances, Interface, Lookup, MaskMode, Material, Model, Part, PointLight, SharedMesh, Sphere, Texture,
    TriangleAttributes, UvMap, Wrap,
};
use crate::scene::desc::{CameraDesc, Optics};
use crate::transport::camera::{FILTERS, FilterKind, FilterSpec};
use crate::transport::delay::Profile;
use crate::transport::flight::Timing;
use crate::transport::integrator::integrator;
use crate::transport::sampler::sampler;
use crate::value::Value;

structs! {
    TriangleAttributes { normals, uvs, material, emitter }
    Sphere { center, radius, material, emitter }
    Material {
        base_color, emission, model, roughness, metallic, opacity, ior, subsurface, specular_tint, anisotropic,
        anisotropic_direction, sheen, sheen_tint, clearcoat, clearcoat_gloss, smooth_below, normal_strength,
        bump_height, mask_threshold, mask_mode, shadow_terminator, base_color_texture, emission_texture, mask_texture,
        roughness_texture, metallic_texture, opacity_texture, anisotropic_texture, normal_texture, bump_texture, tiling,
        emitter_reflects, interface,
    }
    Interface { specular, eta, k, distribution, thin, nonlinear, internal_reflectance }
    Emitter { primitive, instance, area }
    Instances { meshes, places, materials }
    Instance { mesh, to_world, normal_to_world, materials, emitters, first }
    Cone { axis, beam, cutoff, beam_height, cutoff_height, smooth }
    PointLight { position, intensity, cone }
    DirectionalLight { direction, irradiance }
    Environment { map, radiance, rotation_rad }
    Texture { width, height, texels, lookup }
    Lookup { wrap, second, map }
    UvMap { scale, offset }
    CameraDesc { position, target, up, fov_deg, aperture, focus_distance, optics }
    Optics { f_number, focal_length, sensor_height }
    FilterSpec { kind, radius }
    Delays { rows, parts, profiles }
    Part { upto, material, profiles }
    DelayProfile { kind, params, tiling, table }
    DelayParam { value, offset, texture }
    Timing { axis, filter, camera, medium, emission, metres }
    TimeAxis { start, bin, bins }
    WaveStats { samples, render_s, device_s, idle_s, paths, rays, invalid, first_invalid }
    OpenStats { upload_s, pipeline_s, accel_build_s, accel_nodes, accel_bytes, accel_cost, device }
}

words! {
    Model: Model::ALL,
    Distribution: Distribution::ALL,
    MaskMode: MaskMode::ALL,
    Wrap: Wrap::ALL,
    DelayKind: DelayKind::ALL,
    FilterKind: FILTERS.map(|(kind, _)| kind),
    Layer: LAYERS.iter().map(|row| row.layer).collect::<Vec<_>>(),
}

impl Wire for CompiledScene {
    fn put(&self, to: &mut Vec<u8>) {
        let CompiledScene { content_hash, triangles, attributes, tangents, spheres, materials, delays, .. } = self;
        let CompiledScene { instances, textures, emitters, points, directionals, environment, camera, .. } = self;
        let CompiledScene { bounds, resolution, max_depth, colors, second_uvs, .. } = self;
        content_hash.put(to);
        triangles.put(to);
        attributes.put(to);
        tangents.put(to);
        colors.put(to);
        second_uvs.put(to);
        instances.put(to);
        spheres.put(to);
        materials.put(to);
        delays.put(to);
        put_textures(textures, to);
        emitters.put(to);
        points.put(to);
        directionals.put(to);
        environment.put(to);
        camera.put(to);
        bounds.put(to);
        resolution.put(to);
        max_depth.put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<CompiledScene, Garbled> {
        Ok(CompiledScene {
            content_hash: Wire::take(from)?,
            triangles: Wire::take(from)?,
            attributes: Wire::take(from)?,
            tangents: Wire::take(from)?,
            colors: Wire::take(from)?,
            second_uvs: Wire::take(from)?,
            instances: Wire::take(from)?,
            spheres: Wire::take(from)?,
            materials: Wire::take(from)?,
            delays: Wire::take(from)?,
            textures: take_textures(from)?,
            emitters: Wire::take(from)?,
            points: Wire::take(from)?,
            directionals: Wire::take(from)?,
            environment: Wire::take(from)?,
            camera: Wire::take(from)?,
            bounds: Wire::take(from)?,
            resolution: Wire::take(from)?,
            max_depth: Wire::take(from)?,
        })
    }
}

/// Textures; texels that several share go once, with the first of them.
fn put_textures(textures: &[Texture], to: &mut Vec<u8>) {
    textures.len().put(to);
    for (i, texture) in textures.iter().enumerate() {
        let shared = textures[..i].iter().position(|t| Arc::ptr_eq(&t.texels, &texture.texels));
        shared.put(to);
        match shared {
            Some(_) => texture.lookup.put(to),
            None => texture.put(to),
        }
    }
}

fn take_textures(from: &mut Reader<'_>) -> Result<Vec<Texture>, Garbled> {
    let mut textures: Vec<Texture> = Vec::new();
    for _ in 0..usize::take(from)? {
        let texture = match <Option<usize> as Wire>::take(from)? {
            Some(i) => Texture { lookup: Wire::take(from)?, ..textures.get(i).ok_or(Garbled)?.clone() },
            None => Wire::take(from)?,
        };
        textures.push(texture);
    }
    Ok(textures)
}

impl Wire for SharedMesh {
    fn put(&self, to: &mut Vec<u8>) {
        let SharedMesh { triangles, shining } = self;
        [triangles.start, triangles.end].put(to);
        shining.put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<SharedMesh, Garbled> {
        let [start, end] = Wire::take(from)?;
        Ok(SharedMesh { triangles: start..end, shining: Wire::take(from)? })
    }
}

impl Wire for Piecewise {
    fn put(&self, to: &mut Vec<u8>) {
        self.knots().collect::<Vec<_>>().put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<Piecewise, Garbled> {
        let knots: Vec<[f64; 3]> = Wire::take(from)?;
        Ok(Piecewise::of_knots(knots))
    }
}

impl Wire for Profile {
    fn put(&self, to: &mut Vec<u8>) {
        let (kind, params, table) = self.to_parts();
        kind.put(to);
        params.put(to);
        table.cloned().put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<Profile, Garbled> {
        let (kind, params) = (Wire::take(from)?, Wire::take(from)?);
        let table: Option<Piecewise> = Wire::take(from)?;
        if (kind == DelayKind::Table) != table.is_some() {
            return Err(Garbled);
        }
        Ok(Profile::of_parts(kind, params, || table))
    }
}

impl Wire for TimeFilter {
    fn put(&self, to: &mut Vec<u8>) {
        let (name, radius) = self.parts();
        name.to_owned().put(to);
        radius.put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<TimeFilter, Garbled> {
        let (name, radius) = (String::take(from)?, Wire::take(from)?);
        TimeFilter::named(&name, radius).ok_or(Garbled)
    }
}

impl Wire for TimeCube {
    fn put(&self, to: &mut Vec<u8>) {
        let TimeCube { axis, width, height, samples, sum, square } = self;
        axis.put(to);
        [*width, *height].put(to);
        samples.put(to);
        to.extend_from_slice(bytemuck::cast_slice(sum));
        to.extend_from_slice(bytemuck::cast_slice(square));
    }

    fn take(from: &mut Reader<'_>) -> Result<TimeCube, Garbled> {
        let (axis, [width, height]) = (TimeAxis::take(from)?, <[u32; 2]>::take(from)?);
        let samples = Wire::take(from)?;
        let slots = (width as usize).checked_mul(height as usize).and_then(|n| n.checked_mul(axis.slots()));
        let bytes = |each: usize| slots.and_then(|n| n.checked_mul(each)).ok_or(Garbled);
        let sum = bytemuck::pod_collect_to_vec(from.take(bytes(24)?)?);
        let square = bytemuck::pod_collect_to_vec(from.take(bytes(12)?)?);
        Ok(TimeCube { axis, width, height, samples, sum, square })
    }
}

impl Wire for Film {
    fn put(&self, to: &mut Vec<u8>) {
        let Film { width, height, samples, sum, sum2 } = self;
        [*width, *height].put(to);
        samples.put(to);
        for sums in [sum, sum2] {
            to.extend_from_slice(bytemuck::cast_slice(sums));
        }
    }

    fn take(from: &mut Reader<'_>) -> Result<Film, Garbled> {
        let [width, height] = Wire::take(from)?;
        let samples = Wire::take(from)?;
        let bytes = u64::from(width).checked_mul(u64::from(height)).and_then(|n| n.checked_mul(24)).ok_or(Garbled)?;
        let bytes = usize::try_from(bytes).map_err(|_| Garbled)?;
        let [sum, sum2] = [from.take(bytes)?, from.take(bytes)?];
        let copied = |sums: &[u8]| {
            let mut rows = vec![[0.0f64; 3]; bytes / 24];
            bytemuck::cast_slice_mut::<_, u8>(&mut rows).copy_from_slice(sums);
            rows
        };
        Ok(Film { width, height, samples, sum: copied(sum), sum2: copied(sum2) })
    }
}

impl Wire for BTreeMap<String, Value> {
    fn put(&self, to: &mut Vec<u8>) {
        Value::Map(self.clone()).to_json().to_string().put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<BTreeMap<String, Value>, Garbled> {
        let json = serde_json::from_str(&String::take(from)?).map_err(|_| Garbled)?;
        match Value::from_json(&json) {
            Value::Map(map) => Ok(map),
            _ => Err(Garbled),
        }
    }
}

impl Wire for Job {
    fn put(&self, to: &mut Vec<u8>) {
        let Job { integrator, params, resolution, max_depth, rr_start, filter, layers, timing, accel, .. } = self;
        let Job { sampler, seed, first_sample, threads, .. } = self;
        integrator.name.to_owned().put(to);
        params.put(to);
        resolution.put(to);
        max_depth.put(to);
        rr_start.put(to);
        filter.put(to);
        layers.put(to);
        timing.put(to);
        accel.identity().put(to);
        sampler.name.to_owned().put(to);
        seed.put(to);
        first_sample.put(to);
        threads.put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<Job, Garbled> {
        Ok(Job {
            integrator: integrator(&String::take(from)?).ok_or(Garbled)?,
            params: Wire::take(from)?,
            resolution: Wire::take(from)?,
            max_depth: Wire::take(from)?,
            rr_start: Wire::take(from)?,
            filter: Wire::take(from)?,
            layers: Wire::take(from)?,
            timing: Wire::take(from)?,
            accel: AccelSpec::from_identity(&Wire::take(from)?),
            sampler: sampler(&String::take(from)?).ok_or(Garbled)?,
            seed: Wire::take(from)?,
            first_sample: Wire::take(from)?,
            threads: Wire::take(from)?,
        })
    }
}

impl Wire for RenderError {
    fn put(&self, to: &mut Vec<u8>) {
        let (kind, backend, reason) = match self {
            RenderError::Unsupported { backend, reason } => (0u8, backend, reason),
            RenderError::Failed { backend, reason } => (1, backend, reason),
            RenderError::Lost { backend, reason } => (2, backend, reason),
        };
        kind.put(to);
        (*backend).to_owned().put(to);
        reason.put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<RenderError, Garbled> {
        let kind = u8::take(from)?;
        let (name, reason) = (String::take(from)?, String::take(from)?);
        let backend = BACKENDS.iter().find(|row| row.name == name).map_or("worker", |row| row.name);
        match kind {
            0 => Ok(RenderError::Unsupported { backend, reason }),
            1 => Ok(RenderError::Failed { backend, reason }),
            2 => Ok(RenderError::Lost { backend, reason }),
            _ => Err(Garbled),
        }
    }
}
