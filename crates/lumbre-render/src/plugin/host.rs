//! The functions of this program that a technique in a shared library calls during a sample.

use std::ffi::c_void;
use std::ptr;
use std::slice;

use glam::Vec3;

use super::abi::{ABI, CBsdfSample, CHost, CLightSample, CRay, CSample, CSurface, CVertex};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::arrival::{Arrival, HitState};
use lumbre_light::transport::bsdf::{Bsdf, Outgoing, TransportMode};
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::camera_path::{ShadowRay, unoccluded};
use lumbre_light::transport::ray::Ray;
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::transport::surface::Surface;
use lumbre_light::transport::vertex::EdgeEnd;

/// A sample in progress: what [`CSample`] points to.
pub struct SampleState<'a> {
    context: &'a Context<'a>,
    pixel: [u32; 2],
    sampler: &'a mut Sampler,
    /// Number of auxiliary numbers that were taken, for components of composed materials.
    auxiliary_taken: u32,
    sink: &'a mut dyn FnMut(Contribution),
    /// The vertices of the sample; boxes, since the library keeps pointers to them.
    #[expect(clippy::vec_box, reason = "the library keeps pointers to the vertices")]
    vertices: Vec<Box<VertexState<'a>>>,
}

/// A point of a surface that a ray met: what [`CVertex`] points to.
struct VertexState<'a> {
    surface: Surface<'a>,
    bsdf: Bsdf,
    out: Outgoing,
    /// Unit direction to the origin of the ray.
    wo: Vec3,
}

impl<'a> SampleState<'a> {
    /// Starts a sample of a pixel.
    pub fn new(
        context: &'a Context<'a>,
        pixel: [u32; 2],
        sampler: &'a mut Sampler,
        sink: &'a mut dyn FnMut(Contribution),
    ) -> SampleState<'a> {
        SampleState {
            context,
            pixel,
            sampler,
            auxiliary_taken: 0,
            sink,
            vertices: Vec::new(),
        }
    }

    /// Returns the functions for this sample, with the values of parameters.
    pub fn host(&self, parameters: &[f64]) -> CHost {
        CHost {
            abi: ABI,
            max_depth: self.context.max_depth,
            rr_start: self.context.rr_start.unwrap_or(0),
            parameters: parameters.as_ptr(),
            camera_ray,
            closest,
            occluded,
            next_1d,
            next_2d,
            bsdf_sample,
            bsdf_evaluate,
            leave,
            light_sample,
            light_pdf,
            emission,
            environment,
            add,
        }
    }

    /// Returns the pointer that the library passes to the functions.
    pub fn pointer(&mut self) -> CSample {
        ptr::from_mut(self).cast()
    }

    /// Returns the next auxiliary number.
    fn next_auxiliary(&mut self) -> f32 {
        let mut numbers = self.sampler.auxiliary_after(self.auxiliary_taken);
        let number = numbers.next_1d();
        self.auxiliary_taken = numbers.taken();
        number
    }

    /// Traces a ray to the nearest surface.
    fn hit(&mut self, ray: &Ray) -> Option<(&VertexState<'a>, CSurface)> {
        let context = self.context;
        let hit = context.trace.closest(ray, f32::INFINITY)?;
        let hit = HitState::new(context.scene, ray, &hit, || self.next_auxiliary());
        let class = &context.classes[context.classes.index_of(context.scene, &hit)];
        let arrival = Arrival::<f32, 1>::new(class, *ray, &hit);
        let surface = arrival.surface(context.scene);
        let parameters = arrival.parameters(context.scene, &surface);
        let bsdf = arrival.bsdf(context.classes, &surface, parameters.as_ref());
        let wo = -ray.dir;
        let described = CSurface {
            position: surface.position.to_array(),
            normal: surface.n_shading.to_array(),
            emits: i32::from(class.surface.emits),
            ends: i32::from(surface.ends_paths()),
            has_density: i32::from(bsdf.has_density()),
        };
        self.vertices.push(Box::new(VertexState {
            surface,
            bsdf,
            out: bsdf.outgoing(wo),
            wo,
        }));
        Some((self.vertices.last()?, described))
    }
}

/// Returns the state of a sample.
///
/// # Safety
/// The pointer must be the one that the library received for the sample in progress, and no other
/// reference to the state may be in use.
unsafe fn state<'s>(sample: CSample) -> &'s mut SampleState<'s> {
    // SAFETY: `sample` points to the state that this thread lends for the call of `sample`, which the
    // caller guarantees.
    unsafe { &mut *sample.cast::<SampleState<'s>>() }
}

/// Returns a vertex, if there is one.
///
/// # Safety
/// The pointer must be null or one that [`closest`] returned during the same sample.
unsafe fn vertex<'s>(vertex: CVertex) -> Option<&'s VertexState<'s>> {
    // SAFETY: vertices stay where they are until the sample ends, which the caller guarantees.
    unsafe { vertex.cast::<VertexState<'s>>().as_ref() }
}

/// Reads a vector.
///
/// # Safety
/// The pointer must be that of three floats.
unsafe fn read(vector: *const f32) -> Vec3 {
    // SAFETY: the caller guarantees three floats.
    Vec3::from_slice(unsafe { slice::from_raw_parts(vector, 3) })
}

/// Writes a vector.
///
/// # Safety
/// The pointer must be that of three floats.
unsafe fn write(to: *mut f32, vector: Vec3) {
    // SAFETY: the caller guarantees three floats.
    unsafe { slice::from_raw_parts_mut(to, 3) }.copy_from_slice(&vector.to_array());
}

unsafe extern "C" fn camera_ray(sample: CSample, ray: *mut CRay) {
    // SAFETY: the library passes its sample and a ray to write, as the header requires.
    let (state, ray) = unsafe { (state(sample), &mut *ray) };
    let context = state.context;
    let filter_u = state.sampler.next_2d();
    let lens_u = if context.camera.has_lens() {
        state.sampler.next_2d()
    } else {
        [0.0; 2]
    };
    let pixel = state.pixel.map(|n| n as f32);
    let [origin, dir]: [Vec3; 2] = context.camera.ray(pixel, filter_u, lens_u);
    *ray = CRay {
        origin: origin.to_array(),
        dir: dir.to_array(),
    };
}

unsafe extern "C" fn closest(sample: CSample, ray: *const CRay, surface: *mut CSurface) -> CVertex {
    // SAFETY: the library passes its sample, a ray and a surface to write, as the header requires.
    let (state, ray, surface) = unsafe { (state(sample), &*ray, &mut *surface) };
    let ray = Ray {
        origin: ray.origin.into(),
        dir: ray.dir.into(),
    };
    match state.hit(&ray) {
        None => ptr::null(),
        Some((vertex, described)) => {
            *surface = described;
            ptr::from_ref(vertex).cast::<c_void>()
        }
    }
}

unsafe extern "C" fn occluded(sample: CSample, from: CVertex, to: *const CLightSample) -> i32 {
    // SAFETY: the library passes its sample, one of its vertices and a light sample.
    let (state, from, to) = unsafe { (state(sample), vertex(from), &*to) };
    let Some(VertexState { surface, .. }) = from else {
        return 1;
    };
    let ray = ShadowRay::<f32>::between(
        surface.end(),
        EdgeEnd {
            position: to.position.into(),
            normal: to.normal.into(),
            extent: to.extent,
        },
        to.wi.into(),
        !to.distance.is_finite(),
    );
    i32::from(!unoccluded(state.context, &ray))
}

unsafe extern "C" fn next_1d(sample: CSample) -> f32 {
    // SAFETY: the library passes its sample.
    unsafe { state(sample) }.sampler.next_1d()
}

unsafe extern "C" fn next_2d(sample: CSample, numbers: *mut f32) {
    // SAFETY: the library passes its sample, and two floats to write.
    let (state, numbers) = unsafe { (state(sample), slice::from_raw_parts_mut(numbers, 2)) };
    numbers.copy_from_slice(&state.sampler.next_2d());
}

unsafe extern "C" fn bsdf_sample(sample: CSample, at: CVertex, sampled: *mut CBsdfSample) -> i32 {
    // SAFETY: the library passes its sample, one of its vertices, and a BSDF sample to write.
    let (state, at, sampled) = unsafe { (state(sample), vertex(at), &mut *sampled) };
    let [choice, u, v] = state.sampler.next_three();
    let Some(VertexState { bsdf, out, .. }) = at else {
        return 0;
    };
    let (exists, s, _) = bsdf.samples::<false>(out, choice, [u, v], TransportMode::Radiance);
    if exists {
        *sampled = CBsdfSample {
            wi: s.wi.to_array(),
            weight: s.weight.to_array(),
            pdf: s.pdf_w,
            eta: s.eta,
            delta: i32::from(s.delta),
        };
    }
    i32::from(exists)
}

unsafe extern "C" fn bsdf_evaluate(
    _sample: CSample,
    at: CVertex,
    wi: *const f32,
    value: *mut f32,
) -> f32 {
    // SAFETY: the library passes one of its vertices and a direction.
    let (at, wi) = unsafe { (vertex(at), read(wi)) };
    let (mut f, mut pdf) = (Vec3::ZERO, 0.0);
    if let Some(VertexState {
        bsdf, out, surface, ..
    }) = at
        && out.same_side
    {
        let evaluated = bsdf.values::<false>(out, wi, TransportMode::Radiance, true);
        f = evaluated.f * wi.dot(surface.n_shading).abs();
        pdf = evaluated.pdf_w;
    }
    // SAFETY: the library passes three floats to write.
    unsafe { write(value, f) };
    pdf
}

unsafe extern "C" fn leave(_sample: CSample, at: CVertex, wi: *const f32, ray: *mut CRay) {
    // SAFETY: the library passes one of its vertices, a direction, and a ray to write.
    let (at, wi, ray) = unsafe { (vertex(at), read(wi), &mut *ray) };
    if let Some(at) = at {
        let Ray { origin, dir } = at.surface.spawn(wi);
        *ray = CRay {
            origin: origin.to_array(),
            dir: dir.to_array(),
        };
    }
}

unsafe extern "C" fn light_sample(sample: CSample, at: CVertex, sampled: *mut CLightSample) -> i32 {
    // SAFETY: the library passes its sample, one of its vertices, and a light sample to write.
    let (state, at, sampled) = unsafe { (state(sample), vertex(at), &mut *sampled) };
    let [choice, u, v] = state.sampler.next_three();
    let context = state.context;
    let Some(VertexState { surface, .. }) = at else {
        return 0;
    };
    if context.lights.count() == 0 {
        return 0;
    }
    let lights = context
        .lights
        .select_for::<f32, 1>(surface.position, choice, true);
    let direct = lights.sample_direct_one(context.scene, surface.position, [u, v]);
    let pdf = direct.pdf_w * lights.chosen;
    if pdf <= 0.0 {
        return 0;
    }
    *sampled = CLightSample {
        wi: direct.wi.to_array(),
        distance: direct.distance,
        radiance: direct.radiance.to_array(),
        pdf,
        position: direct.point.position.to_array(),
        normal: direct.point.normal.to_array(),
        extent: direct.point.extent,
        delta: i32::from(direct.delta),
    };
    1
}

unsafe extern "C" fn light_pdf(sample: CSample, from: CVertex, hit: CVertex) -> f32 {
    // SAFETY: the library passes its sample and two of its vertices.
    let (state, from, hit) = unsafe { (state(sample), vertex(from), vertex(hit)) };
    match (from, hit) {
        (Some(from), Some(hit)) if hit.surface.emitter != NONE => {
            let lights = state
                .context
                .lights
                .with_indices::<f32, 1>([hit.surface.emitter], true);
            let (at, n) = (hit.surface.position, hit.surface.n_geometric);
            lights.pdf_direct_w(from.surface.position, at, n)
        }
        _ => 0.0,
    }
}

unsafe extern "C" fn emission(sample: CSample, at: CVertex, radiance: *mut f32) {
    // SAFETY: the library passes its sample and one of its vertices.
    let (state, at) = unsafe { (state(sample), vertex(at)) };
    let textures = &state.context.scene.textures;
    let emitted = at.map_or(Vec3::ZERO, |at| at.surface.emitted(textures, at.wo));
    // SAFETY: the library passes three floats to write.
    unsafe { write(radiance, emitted) };
}

unsafe extern "C" fn environment(sample: CSample, dir: *const f32, radiance: *mut f32) -> f32 {
    // SAFETY: the library passes its sample and a direction.
    let (state, dir) = unsafe { (state(sample), read(dir)) };
    let lights = state.context.lights;
    let light: Vec3 = lights.environment::<Vec3, 1>(dir);
    // SAFETY: the library passes three floats to write.
    unsafe { write(radiance, light) };
    if light == Vec3::ZERO {
        return 0.0;
    }
    lights.pdf_environment_w::<Vec3, 1>(dir)
}

unsafe extern "C" fn add(sample: CSample, value: *const f32, s: u32, t: u32) {
    // SAFETY: the library passes its sample and a colour.
    let (state, value) = unsafe { (state(sample), read(value)) };
    // Films of depths have a place for every depth that the job allows.
    let depth = s.saturating_add(t).saturating_sub(1);
    if t == 0 || depth == 0 || depth > state.context.max_depth {
        return;
    }
    (state.sink)(Contribution {
        pixel: state.pixel,
        value,
        unweighted: value,
        s,
        t,
        length: 0.0,
    });
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use lumbre_light::scene::desc::{CameraDesc, SceneDesc};
    use lumbre_light::transport::arrival::SurfaceClasses;
    use lumbre_light::transport::camera::{Camera, FilterSpec};
    use lumbre_light::transport::integrator::Settings;
    use lumbre_light::transport::light::Lights;
    use lumbre_light::transport::ray::{Hit, Trace};

    use super::*;

    /// Intersector of an empty scene.
    struct Nothing;

    impl Trace for Nothing {
        fn closest(&self, _: &Ray, _: f32) -> Option<Hit> {
            None
        }

        fn occluded(&self, _: &Ray, _: f32) -> bool {
            false
        }
    }

    #[test]
    fn the_surfaces_of_a_path_get_different_auxiliary_numbers() {
        let desc = SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera: CameraDesc {
                position: Vec3::Z,
                target: Vec3::ZERO,
                ..CameraDesc::default()
            },
            ..SceneDesc::default()
        };
        let (scene, _) = lumbre_light::scene::compile(&desc).unwrap();
        let params = BTreeMap::new();
        let context = Context {
            scene: &scene,
            camera: &Camera::new(&scene.camera, [1, 1], FilterSpec::PIXEL),
            lights: &Lights::new(&scene),
            classes: &SurfaceClasses::new(&scene),
            trace: &Nothing,
            max_depth: 5,
            rr_start: None,
            settings: &Settings::new(&params),
            params: &params,
            timing: None,
            shared: None,
        };
        let mut sampler = Sampler::new(1, [0, 0], 2);
        let mut sink = |_: Contribution| {};
        let mut state = SampleState::new(&context, [0, 0], &mut sampler, &mut sink);
        let numbers: BTreeSet<u32> = (0..32).map(|_| state.next_auxiliary().to_bits()).collect();
        assert_eq!(numbers.len(), 32);
    }
}
