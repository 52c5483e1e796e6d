//! The pixel inspector: what a pixel shows, the steps of one of its samples, and the lobe of the
//! material there.

use std::sync::Arc;

use glam::Vec3;

use super::session::{LoadedScene, Slot};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::arrival::shares_at;
use lumbre_light::transport::bsdf::Bsdf;
use lumbre_light::transport::surface::Surface;
use lumbre_render::Job;
use lumbre_render::lobe::Lobe;
use lumbre_render::path_trace::{PathEvent, SampleAt};

/// The pixel that is inspected, and a sample of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Slot of the picture.
    pub slot: Slot,
    /// Number of the request of the picture.
    pub request: u64,
    /// Column and row.
    pub pixel: [u32; 2],
    /// Index of the sample.
    pub sample: u64,
}

/// State of the inspector while it is open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inspector {
    /// Index of the sample that is traced.
    pub sample: u64,
    /// Whether the window with steps and lobe is open.
    pub window: bool,
    /// Number of lines of the steps that are scrolled away.
    pub scroll: usize,
    /// Latest answer of the inspector.
    pub found: Option<Arc<Inspection>>,
}

/// A question of the inspector.
pub struct Query {
    /// Pixel that is inspected.
    pub target: Target,
    /// Scene in which the pixel is inspected.
    pub scene: Arc<LoadedScene>,
    /// Job of the picture, with its camera.
    pub job: Arc<Job>,
}

/// The surface at the centre of a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceFacts {
    /// Name of the material.
    pub material: String,
    /// Name of the model of the material.
    pub model: &'static str,
    /// Kind and number of the primitive, and the number of its instance.
    pub primitive: String,
    /// Position in scene units.
    pub position: [f32; 3],
    /// Distance from the camera in scene units.
    pub distance: f32,
    /// Index of the light that the surface is, with the radiance emitted to the camera.
    pub light: Option<(u32, [f32; 3])>,
    /// Lobe of the material: of a composed one, the sum of its parts' lobes, without their normal and
    /// bump maps.
    pub lobe: Option<Lobe>,
}

/// Everything that was found out about a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Inspection {
    /// The pixel and the sample.
    pub target: Target,
    /// The surface at its centre; `None` if there is none, or if the backend has no scene.
    pub surface: Option<SurfaceFacts>,
    /// Steps of the sample, a line for each.
    pub steps: Vec<String>,
    /// Light of the sample for this pixel by number of path edges.
    pub depths: Vec<(u32, [f32; 3])>,
    /// Number of rays of the sample.
    pub rays: usize,
}

/// Finds out about a pixel. The picture is not affected.
pub fn inspect(query: &Query) -> Inspection {
    let Query { target, scene, job } = query;
    let mut found = Inspection {
        target: *target,
        surface: None,
        steps: Vec::new(),
        depths: Vec::new(),
        rays: 0,
    };
    let Some(prepared) = &scene.prepared else {
        return found;
    };
    let camera = job.camera(prepared.scene());
    let (ray, hit) = prepared.center_hit(camera, job.resolution, target.pixel);
    found.surface = hit.map(|hit| {
        let compiled = prepared.scene();
        let surface = Surface::at(compiled, &ray, &hit);
        let material = compiled.material_of(hit.primitive, hit.instance);
        let wo = -ray.dir;
        let shares = shares_at(compiled, &ray, &hit);
        let mut lobes = Vec::new();
        for share in &shares {
            let mut part = Surface::at(compiled, &ray, &hit);
            part.materials = [&compiled.materials[share.material as usize]];
            let bsdf = Bsdf::new(&part, &compiled.textures);
            let lobe = Lobe::new(&bsdf, surface.n_shading, wo);
            lobes.push((f64::from(share.probability), lobe));
        }
        let lobe = Lobe::composed(&lobes);
        let instance = if hit.instance == NONE {
            String::new()
        } else {
            format!(" of instance {}", hit.instance)
        };
        let emitted = surface.emitted(&compiled.textures, wo);
        SurfaceFacts {
            material: scene.material_name(material),
            model: surface.materials[0].model.name(),
            primitive: format!(
                "{}{instance}",
                compiled.primitive_name(hit.primitive, hit.instance)
            ),
            position: compiled.described(surface.position).to_array(),
            distance: hit.t,
            light: (surface.emitter != NONE).then_some((surface.emitter, emitted.to_array())),
            lobe,
        }
    });
    let sample = SampleAt {
        pixel: target.pixel,
        sample: target.sample,
    };
    let events = prepared.paths(job, &[sample]).pop();
    let events = events.unwrap_or_default();
    found.rays = events
        .iter()
        .filter(|event| !matches!(event, PathEvent::Light(_)))
        .count();
    found.depths = depths(&events, target.pixel);
    found.steps = events
        .iter()
        .map(|event| event.line(prepared.scene(), target.pixel))
        .collect();
    found
}

/// Adds up the light of a sample for its pixel by number of path edges.
fn depths(events: &[PathEvent], pixel: [u32; 2]) -> Vec<(u32, [f32; 3])> {
    let mut sums: Vec<(u32, Vec3)> = Vec::new();
    for event in events {
        let PathEvent::Light(light) = event else {
            continue;
        };
        if light.pixel != pixel || light.value == Vec3::ZERO {
            continue;
        }
        match sums.iter_mut().find(|(depth, _)| *depth == light.depth()) {
            Some((_, sum)) => *sum += light.value,
            None => sums.push((light.depth(), light.value)),
        }
    }
    sums.sort_by_key(|(depth, _)| *depth);
    sums.into_iter()
        .map(|(depth, sum)| (depth, sum.to_array()))
        .collect()
}
