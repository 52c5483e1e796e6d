//! Encodings of the program's own types for the worker pipe.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::wire::{CorruptMessage, Reader, Wire, indices, structs};
use crate::hierarchy::AccelSpec;
use crate::{Job, OpenStats, RenderError, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::layer::{LAYERS, Layer};
use lumbre_light::film::time::{TimeAxis, TimeCube, TimeFilter};
use lumbre_light::math::piecewise::Piecewise;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Blend, Cone, DelayKind, DelayParam, DelayProfile, Delays, DirectionalLight, Distribution,
    Emitter, Environment, Instance, Instances, Interface, Lookup, MaskMode, Material,
    MaterialComponent, Model, PointLight, SharedMesh, Sphere, Texture, TriangleAttributes, UvMap,
    Wrap,
};
use lumbre_light::scene::desc::{CameraDesc, Optics};
use lumbre_light::transport::camera::{FILTERS, FilterKind, FilterSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::path_time::Timing;
use lumbre_light::transport::sampler::sampler;
use lumbre_light::value::Value;

structs! {
    TriangleAttributes { normals, uvs, material, emitter }
    Sphere { center, radius, material, emitter }
    Material {
        base_color, emission, model, roughness, metallic, opacity, ior, subsurface, specular_tint,
        anisotropic,
        anisotropic_direction, sheen, sheen_tint, clearcoat, clearcoat_gloss, smooth_below,
        one_sided, normal_strength,
        bump_height, mask_threshold, mask_mode, shadow_terminator, base_color_texture,
        emission_texture, mask_texture, roughness_texture, metallic_texture, opacity_texture,
        anisotropic_texture, normal_texture, bump_texture, tiling,
        emitter_reflects, interface,
    }
    Interface { specular, eta, k, distribution, thin, nonlinear, internal_reflectance }
    Emitter { primitive, instance, area }
    Instances { meshes, placements, materials }
    Instance { mesh, to_world, normal_to_world, materials, emitters, flattened_start }
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
    Delays { rows, components, profiles, blends }
    Blend { material, parts, texture, tiling }
    MaterialComponent { cumulative_weight, material, profiles }
    DelayProfile { kind, params, tiling, table }
    DelayParam { value, offset, texture }
    Timing { axis, filter, camera, medium, emission, metres }
    TimeAxis { start, bin, bins }
    WaveStats { samples, render_s, device_s, idle_s, paths, rays, invalid, first_invalid }
    OpenStats { upload_s, pipeline_s, accel_build_s, accel_nodes, accel_bytes, accel_cost, device }
}

indices! {
    Model: Model::ALL,
    Distribution: Distribution::ALL,
    MaskMode: MaskMode::ALL,
    Wrap: Wrap::ALL,
    DelayKind: DelayKind::ALL,
    FilterKind: FILTERS.map(|(kind, _)| kind),
    Layer: LAYERS.iter().map(|row| row.layer).collect::<Vec<_>>(),
}

impl Wire for CompiledScene {
    fn write_to(&self, to: &mut Vec<u8>) {
        let CompiledScene {
            content_hash,
            triangles,
            attributes,
            tangents,
            spheres,
            materials,
            delays,
            ..
        } = self;
        let CompiledScene {
            instances,
            textures,
            emitters,
            points,
            directionals,
            environment,
            camera,
            ..
        } = self;
        let CompiledScene {
            bounds,
            resolution,
            max_depth,
            colors,
            second_uvs,
            ..
        } = self;
        content_hash.write_to(to);
        triangles.write_to(to);
        attributes.write_to(to);
        tangents.write_to(to);
        colors.write_to(to);
        second_uvs.write_to(to);
        instances.write_to(to);
        spheres.write_to(to);
        materials.write_to(to);
        delays.write_to(to);
        write_textures(textures, to);
        emitters.write_to(to);
        points.write_to(to);
        directionals.write_to(to);
        environment.write_to(to);
        camera.write_to(to);
        bounds.write_to(to);
        resolution.write_to(to);
        max_depth.write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<CompiledScene, CorruptMessage> {
        Ok(CompiledScene {
            content_hash: Wire::read_from(from)?,
            triangles: Wire::read_from(from)?,
            attributes: Wire::read_from(from)?,
            tangents: Wire::read_from(from)?,
            colors: Wire::read_from(from)?,
            second_uvs: Wire::read_from(from)?,
            instances: Wire::read_from(from)?,
            spheres: Wire::read_from(from)?,
            materials: Wire::read_from(from)?,
            delays: Wire::read_from(from)?,
            textures: read_textures(from)?,
            emitters: Wire::read_from(from)?,
            points: Wire::read_from(from)?,
            directionals: Wire::read_from(from)?,
            environment: Wire::read_from(from)?,
            camera: Wire::read_from(from)?,
            bounds: Wire::read_from(from)?,
            resolution: Wire::read_from(from)?,
            max_depth: Wire::read_from(from)?,
        })
    }
}

/// Writes textures; texels that several textures share are sent once, with the first of them.
fn write_textures(textures: &[Texture], to: &mut Vec<u8>) {
    textures.len().write_to(to);
    for (i, texture) in textures.iter().enumerate() {
        let shared = textures[..i]
            .iter()
            .position(|t| Arc::ptr_eq(&t.texels, &texture.texels));
        shared.write_to(to);
        match shared {
            Some(_) => texture.lookup.write_to(to),
            None => texture.write_to(to),
        }
    }
}

fn read_textures(from: &mut Reader<'_>) -> Result<Vec<Texture>, CorruptMessage> {
    let mut textures: Vec<Texture> = Vec::new();
    for _ in 0..usize::read_from(from)? {
        let texture = match <Option<usize> as Wire>::read_from(from)? {
            Some(i) => Texture {
                lookup: Wire::read_from(from)?,
                ..textures.get(i).ok_or(CorruptMessage)?.clone()
            },
            None => Wire::read_from(from)?,
        };
        textures.push(texture);
    }
    Ok(textures)
}

impl Wire for SharedMesh {
    fn write_to(&self, to: &mut Vec<u8>) {
        let SharedMesh {
            triangles,
            emissive,
        } = self;
        [triangles.start, triangles.end].write_to(to);
        emissive.write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<SharedMesh, CorruptMessage> {
        let [start, end] = Wire::read_from(from)?;
        Ok(SharedMesh {
            triangles: start..end,
            emissive: Wire::read_from(from)?,
        })
    }
}

impl Wire for Piecewise {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.knots().collect::<Vec<_>>().write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Piecewise, CorruptMessage> {
        let knots: Vec<[f64; 3]> = Wire::read_from(from)?;
        Ok(Piecewise::from_knots(knots))
    }
}

impl Wire for Profile {
    fn write_to(&self, to: &mut Vec<u8>) {
        let (kind, params, table) = self.to_parts();
        kind.write_to(to);
        params.write_to(to);
        table.cloned().write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Profile, CorruptMessage> {
        let (kind, params) = (Wire::read_from(from)?, Wire::read_from(from)?);
        let table: Option<Piecewise> = Wire::read_from(from)?;
        if (kind == DelayKind::Table) != table.is_some() {
            return Err(CorruptMessage);
        }
        Ok(Profile::from_parts(kind, params, || table))
    }
}

impl Wire for TimeFilter {
    fn write_to(&self, to: &mut Vec<u8>) {
        let (name, radius) = self.name_and_size();
        name.to_owned().write_to(to);
        radius.write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<TimeFilter, CorruptMessage> {
        let (name, radius) = (String::read_from(from)?, Wire::read_from(from)?);
        TimeFilter::from_name(&name, radius).ok_or(CorruptMessage)
    }
}

impl Wire for TimeCube {
    fn write_to(&self, to: &mut Vec<u8>) {
        let TimeCube {
            axis,
            width,
            height,
            samples,
            sum,
            square,
        } = self;
        axis.write_to(to);
        [*width, *height].write_to(to);
        samples.write_to(to);
        to.extend_from_slice(bytemuck::cast_slice(sum));
        to.extend_from_slice(bytemuck::cast_slice(square));
    }

    fn read_from(from: &mut Reader<'_>) -> Result<TimeCube, CorruptMessage> {
        let (axis, [width, height]) = (TimeAxis::read_from(from)?, <[u32; 2]>::read_from(from)?);
        let samples = Wire::read_from(from)?;
        let slots = (width as usize)
            .checked_mul(height as usize)
            .and_then(|n| n.checked_mul(axis.slots()));
        let bytes = |each: usize| {
            slots
                .and_then(|n| n.checked_mul(each))
                .ok_or(CorruptMessage)
        };
        let sum = bytemuck::pod_collect_to_vec(from.read_bytes(bytes(24)?)?);
        let square = bytemuck::pod_collect_to_vec(from.read_bytes(bytes(12)?)?);
        Ok(TimeCube {
            axis,
            width,
            height,
            samples,
            sum,
            square,
        })
    }
}

impl Wire for Film {
    fn write_to(&self, to: &mut Vec<u8>) {
        let Film {
            width,
            height,
            samples,
            sum,
            sum2,
        } = self;
        [*width, *height].write_to(to);
        samples.write_to(to);
        for sums in [sum, sum2] {
            to.extend_from_slice(bytemuck::cast_slice(sums));
        }
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Film, CorruptMessage> {
        let [width, height] = Wire::read_from(from)?;
        let samples = Wire::read_from(from)?;
        let bytes = u64::from(width)
            .checked_mul(u64::from(height))
            .and_then(|n| n.checked_mul(24))
            .ok_or(CorruptMessage)?;
        let bytes = usize::try_from(bytes).map_err(|_| CorruptMessage)?;
        let [sum, sum2] = [from.read_bytes(bytes)?, from.read_bytes(bytes)?];
        let copied = |sums: &[u8]| {
            let mut rows = vec![[0.0f64; 3]; bytes / 24];
            bytemuck::cast_slice_mut::<_, u8>(&mut rows).copy_from_slice(sums);
            rows
        };
        Ok(Film {
            width,
            height,
            samples,
            sum: copied(sum),
            sum2: copied(sum2),
        })
    }
}

impl Wire for BTreeMap<String, Value> {
    fn write_to(&self, to: &mut Vec<u8>) {
        serde_json::to_string(self).unwrap_or_default().write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<BTreeMap<String, Value>, CorruptMessage> {
        let json = serde_json::from_str(&String::read_from(from)?).map_err(|_| CorruptMessage)?;
        match Value::from_json(&json) {
            Value::Map(map) => Ok(map),
            _ => Err(CorruptMessage),
        }
    }
}

impl Wire for Job {
    fn write_to(&self, to: &mut Vec<u8>) {
        let Job {
            integrator,
            params,
            resolution,
            max_depth,
            rr_start,
            filter,
            layers,
            timing,
            accel,
            ..
        } = self;
        let Job {
            sampler,
            seed,
            first_sample,
            threads,
            ..
        } = self;
        integrator.name.to_owned().write_to(to);
        params.write_to(to);
        resolution.write_to(to);
        max_depth.write_to(to);
        rr_start.write_to(to);
        filter.write_to(to);
        layers.write_to(to);
        timing.write_to(to);
        accel.identity().write_to(to);
        sampler.name.to_owned().write_to(to);
        seed.write_to(to);
        first_sample.write_to(to);
        threads.write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Job, CorruptMessage> {
        Ok(Job {
            integrator: integrator(&String::read_from(from)?).ok_or(CorruptMessage)?,
            params: Wire::read_from(from)?,
            resolution: Wire::read_from(from)?,
            max_depth: Wire::read_from(from)?,
            rr_start: Wire::read_from(from)?,
            filter: Wire::read_from(from)?,
            layers: Wire::read_from(from)?,
            timing: Wire::read_from(from)?,
            accel: AccelSpec::from_identity(&Wire::read_from(from)?),
            sampler: sampler(&String::read_from(from)?).ok_or(CorruptMessage)?,
            seed: Wire::read_from(from)?,
            first_sample: Wire::read_from(from)?,
            threads: Wire::read_from(from)?,
        })
    }
}

impl Wire for RenderError {
    fn write_to(&self, to: &mut Vec<u8>) {
        let (kind, reason) = match self {
            RenderError::Unsupported { reason, .. } => (0u8, reason.as_str()),
            RenderError::Failed { reason, .. } => (1, reason.as_str()),
            RenderError::Lost { reason, .. } => (2, reason.as_str()),
            RenderError::Cancelled { .. } => (3, ""),
        };
        kind.write_to(to);
        reason.to_owned().write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<RenderError, CorruptMessage> {
        let kind = u8::read_from(from)?;
        let reason = String::read_from(from)?;
        // The receiver knows the backend of its run.
        let backend = "worker";
        match kind {
            0 => Ok(RenderError::Unsupported { backend, reason }),
            1 => Ok(RenderError::Failed { backend, reason }),
            2 => Ok(RenderError::Lost { backend, reason }),
            3 => Ok(RenderError::Cancelled { backend }),
            _ => Err(CorruptMessage),
        }
    }
}
