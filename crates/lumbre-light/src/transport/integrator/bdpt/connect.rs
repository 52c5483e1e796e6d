//! The connections of bidirectional path tracing: the light that each strategy finds, and the MIS
//! terms of all other strategies relative to its own.

use glam::Vec3;

use super::directions::SubpathDirections;
use super::state::{CameraEnd, LightStart, Vertex, VertexState};
use super::weights::{LightEnd, MisPartials, others_interior, others_s1, others_s1_t1, others_t1};
use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::transport::bsdf::{BsdfValue, TransportMode};
use crate::transport::camera::FilterSpec;
use crate::transport::camera::lens::Projection;
use crate::transport::integrator::camera_path::ShadowRay;
use crate::transport::integrator::{Context, Settings};
use crate::transport::light::LightPoint;
use crate::transport::sampler::Sampler;
use crate::transport::time_settings::Timing;
use crate::transport::vertex::{self, EdgeEnd};

/// Light found by one strategy in each lane.
#[derive(Clone, Copy)]
pub struct Connection<R: Real = f32, const N: usize = 1> {
    /// Lanes whose shadow ray is traced.
    pub lanes: R::Mask,
    /// Lanes that find light unless their shadow ray hits something. Rounding may leave others
    /// without a density.
    pub found: R::Mask,
    /// Rays between the connected points; `None` if subpaths hit the light.
    pub ray: Option<ShadowRay<R>>,
    /// Radiance, not yet weighted.
    pub unweighted: R::Vec3,
    /// Sum of the MIS terms of all other strategies over that of this one: the weight is `1 / (1 +
    /// others)`.
    pub others: R::Double,
    /// Optical length of the path; 0 without a time axis.
    pub length: R::Double,
    /// Unit direction of the connecting edge towards the light.
    pub wi: R::Vec3,
    /// The point of the light, if it is not the start of the light subpath.
    pub point: Option<LightPoint<R, N>>,
}

impl<R: Real, const N: usize> Connection<R, N> {
    /// Returns the MIS weight of one of `count` samples of the strategy, or 1 if strategies are not
    /// weighted.
    #[inline(always)]
    pub fn weight(&self, settings: &Settings, count: f64) -> R::Double {
        let one = R::Double::splat(1.0);
        if settings.unweighted() {
            return one;
        }
        let others = if count == 1.0 {
            self.others
        } else {
            self.others / settings.heuristic().term(R::Double::splat(count))
        };
        one / (one + others)
    }

    /// Returns the unweighted radiance of one of `count` samples.
    #[inline(always)]
    pub fn share(&self, count: f64) -> R::Vec3 {
        if count == 1.0 {
            self.unweighted
        } else {
            self.unweighted / R::splat(count as f32)
        }
    }
}

/// Lens points, and the pixels that receive light through them.
#[derive(Clone, Copy)]
pub struct LensPoints<R: Real = f32, const N: usize = 1> {
    /// The projection of the connected points.
    pub at: Projection<R::Vec3>,
    /// Column and row of the pixels.
    pub pixels: [[u32; 2]; N],
}

/// Returns where a value is not black.
#[inline(always)]
fn nonzero<R: Real>(value: R::Vec3) -> R::Mask {
    !value.same(R::Vec3::broadcast(Vec3::ZERO))
}

/// Connects with `s = 1`, `t >= 2`: camera vertices and light points sampled from there. `None` if
/// no lane finds light.
#[inline(always)]
pub fn connect_s1<R: Lanes<N>, const N: usize>(
    context: &Context,
    directions: impl SubpathDirections,
    z: &Vertex<R>,
    sampler: &mut Sampler<R>,
    lanes: R::Mask,
) -> Option<Connection<R, N>> {
    let lanes = lanes & z.out.same_side;
    let [choice, u, v] = sampler.next_three();
    let lights = context
        .lights
        .select_for::<R, N>(z.state.position, choice, lanes);
    let d = lights.sample_direct(context.scene, z.state.position, [u, v]);
    let mut lanes = lanes & d.arrives();
    if let Some(offset) = &z.terminator {
        lanes = lanes & !offset.excludes(&d);
    }
    if !lanes.any() {
        return None;
    }
    let mut at_z = z
        .bsdf
        .values::<true>(&z.out, d.wi, TransportMode::Radiance, lanes);
    let unweighted = z.state.throughput * at_z.f * z.state.cos(d.wi) * d.radiance / d.pdf_w;
    let lanes = lanes & nonzero::<R>(unweighted);
    if !lanes.any() {
        return None;
    }
    at_z.pdf_w = directions.pdf_w::<R, N>(context, z, d.wi, at_z.pdf_w, lanes);
    let (from, at) = (z.state.point(), [d.point.position, d.point.normal]);
    let end = LightEnd::new(&lights, at, -d.wi, from);
    let length = match context.timing {
        None => R::Double::splat(0.0),
        Some(_) => {
            let ratio = z.bsdf.index_ratio(z.out.wo, d.wi);
            let optical = z.state.optical();
            optical.direct_arrival(context, z.state.position, &d, ratio)
        }
    };
    Some(Connection {
        lanes,
        // Rounding may place a point at the rim of a sphere on its hidden side, where no strategy
        // has a density.
        found: lanes & end.direct.gt(R::Double::splat(0.0)),
        ray: Some(ShadowRay::between(
            z.state.end(),
            d.point.end(),
            d.wi,
            d.is_infinite(),
        )),
        unweighted,
        others: others_s1(context.settings.heuristic(), &z.endpoint(), &end, &at_z),
        length,
        wi: d.wi,
        point: Some(d.point),
    })
}

/// Evaluates camera vertices towards light vertices at `y`: the first half of a connection with `s
/// >= 2`, `t >= 2`. Returns the lanes in which light may pass.
#[inline(always)]
pub fn camera_end<R: Lanes<N>, const N: usize>(
    context: &Context,
    directions: impl SubpathDirections,
    z: &Vertex<R>,
    y: R::Vec3,
    lanes: R::Mask,
) -> (R::Mask, CameraEnd<R>) {
    let from = z.state.towards_light(&z.terminator, y);
    let edge = y - from.position;
    let wi = edge / edge.length_squared().sqrt();
    let lanes = lanes & z.out.same_side & wi.is_finite();
    let BsdfValue {
        f,
        pdf_w,
        reverse_pdf_w,
    } = z
        .bsdf
        .values::<true>(&z.out, wi, TransportMode::Radiance, lanes);
    let ratio = match context.timing {
        None => R::splat(1.0),
        Some(_) => z.bsdf.index_ratio(z.out.wo, wi),
    };
    let lanes = lanes & nonzero::<R>(f);
    let end = CameraEnd {
        f,
        pdf_w: directions.pdf_w::<R, N>(context, z, wi, pdf_w, lanes),
        reverse_pdf_w,
        ratio,
    };
    (lanes, end)
}

/// Connects with `s >= 2`, `t >= 2`: light vertices and camera vertices, which are lifted where
/// necessary and were [evaluated](camera_end). `None` if no lane finds light.
#[inline(always)]
pub fn connect<R: Lanes<N>, const N: usize>(
    context: &Context,
    directions: impl SubpathDirections,
    y: &Vertex<R>,
    (z, z_partials): (&VertexState<R>, MisPartials<R::Double>),
    at_z: &CameraEnd<R>,
    lanes: R::Mask,
) -> Option<Connection<R, N>> {
    let edge = y.state.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    let lanes = lanes & y.out.same_side;
    let mut at_y = y
        .bsdf
        .values::<true>(&y.out, -wi, TransportMode::Importance, lanes);
    let unweighted =
        y.state.throughput * at_y.f * y.state.cos(-wi) * at_z.f * z.cos(wi) * z.throughput
            / distance2;
    let lanes = lanes & nonzero::<R>(unweighted);
    if !lanes.any() {
        return None;
    }
    at_y.reverse_pdf_w = directions.back_pdf_w::<R, N>(context, y, at_y.reverse_pdf_w);
    let length = match context.timing {
        None => R::Double::splat(0.0),
        Some(_) => {
            let optical = z.optical();
            let near = optical.after_segment(at_z.ratio, distance2.sqrt());
            let ratio = y.bsdf.index_ratio(y.out.wo, -wi);
            let far = y.state.optical();
            near + far.from_light(ratio, optical.index * at_z.ratio)
        }
    };
    let to = [
        wi.dot(y.state.n_geometric).abs() / distance2,
        wi.dot(z.n_geometric).abs() / distance2,
    ];
    let at_z = BsdfValue {
        f: at_z.f,
        pdf_w: at_z.pdf_w,
        reverse_pdf_w: at_z.reverse_pdf_w,
    };
    let infinite = R::Mask::default();
    Some(Connection {
        lanes,
        found: lanes,
        ray: Some(ShadowRay::between(z.end(), y.state.end(), wi, infinite)),
        unweighted,
        others: others_interior(
            context.settings.heuristic(),
            [&y.endpoint(), &z.endpoint(z_partials)],
            [&at_y, &at_z],
            to,
        ),
        length,
        wi,
        point: None,
    })
}

/// Connects with `s >= 2`, `t = 1`: light vertices and the lens. `emitted` is the time of emission.
/// `None` if no lane finds light.
#[inline(always)]
pub fn connect_t1<R: Lanes<N>, const N: usize>(
    context: &Context,
    directions: impl SubpathDirections,
    (y, emitted): (&Vertex<R>, R),
    sampler: &mut Sampler<R>,
    lanes: R::Mask,
) -> Option<(Connection<R, N>, LensPoints<R, N>)> {
    let [lens_u, filter_u] = lens_numbers(context, sampler);
    let at = context.camera.project(y.state.position, lens_u);
    let lanes = lanes & y.out.same_side;
    let (lanes, pixels, weight) = context.camera.choose_pixels(&at, filter_u, lanes);
    if !lanes.any() {
        return None;
    }
    let importance = weight * at.pdf_w / (at.distance * at.distance);
    let mut at_y = y
        .bsdf
        .values::<true>(&y.out, -at.dir, TransportMode::Importance, lanes);
    let unweighted = y.state.throughput * at_y.f * y.state.cos(-at.dir) * importance;
    let lanes = lanes & nonzero::<R>(unweighted);
    if !lanes.any() {
        return None;
    }
    at_y.reverse_pdf_w = directions.back_pdf_w::<R, N>(context, y, at_y.reverse_pdf_w);
    let [position, n] = y.state.point();
    let spread = vertex::area_factor(at.lens, position, n);
    let h = context.settings.heuristic();
    let length = match context.timing {
        None => R::Double::splat(0.0),
        Some(timing) => {
            let ratio = y.bsdf.index_ratio(y.out.wo, -at.dir);
            let optical = y.state.optical();
            camera_length(timing, emitted, at.distance)
                + optical.from_light(ratio, R::splat(timing.medium))
        }
    };
    let lens = EdgeEnd::free(at.lens);
    let infinite = R::Mask::default();
    let connection = Connection {
        lanes,
        found: lanes,
        ray: Some(ShadowRay::between(y.state.end(), lens, at.dir, infinite)),
        unweighted,
        others: others_t1(h, &y.endpoint(), &at_y, [at.pdf_w, spread]),
        length,
        wi: at.dir,
        point: None,
    };
    Some((connection, LensPoints { at, pixels }))
}

/// Connects with `s = 1`, `t = 1`: the starts of light subpaths and the lens. Point lights and
/// directional lights are not connected: nothing that starts at the camera could find them, and a
/// picture does not show them. `None` if no lane finds light.
#[inline(always)]
pub fn connect_s1_t1<R: Lanes<N>, const N: usize>(
    context: &Context,
    start: &LightStart<R>,
    sampler: &mut Sampler<R>,
    lanes: R::Mask,
) -> Option<(Connection<R, N>, LensPoints<R, N>)> {
    let [lens_u, filter_u] = lens_numbers(context, sampler);
    let camera = context.camera;
    let indices = R::store_words(start.light);
    let lights = context.lights.with_indices::<R, N>(indices, lanes);
    let point = start.point(&lights);
    let (emitters, distant) = (lights.are_emitters(), lights.are_environments());
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let black = R::Vec3::broadcast(Vec3::ZERO);
    let mut at = camera.project(point.position, lens_u);
    let mut area = at.distance * at.distance;
    if distant.any() {
        at = Projection::select(distant, camera.project_distant(-start.dir, lens_u), at);
        area = R::select(distant, one, area);
    }
    let wanted = lanes & (emitters | distant);
    let (lanes, pixels, weight) = camera.choose_pixels(&at, filter_u, wanted);
    if !lanes.any() {
        return None;
    }
    let importance = weight * at.pdf_w / area;
    let cos = R::select(distant, one, point.normal.dot(-at.dir));
    let light_end = [point.position, point.normal];
    let end = LightEnd::new(&lights, light_end, -at.dir, [at.lens, black]);
    let radiance = lights.emitted(context.scene, &point, -at.dir);
    let unweighted = radiance * cos * (importance.double() / end.start).single();
    let lanes = lanes & cos.gt(zero) & nonzero::<R>(unweighted);
    if !lanes.any() {
        return None;
    }
    // Rays to the environment start at the lens.
    let lens = EdgeEnd::free(at.lens);
    let from = EdgeEnd::select(distant, lens, point.end());
    let length = match context.timing {
        None => R::Double::splat(0.0),
        Some(timing) => {
            let front = context.lights.front_distance(at.lens, at.dir);
            let far = R::select(distant, front, at.distance);
            camera_length(timing, start.emitted, far)
        }
    };
    let connection = Connection {
        lanes,
        found: lanes,
        ray: Some(ShadowRay::between(from, lens, at.dir, distant)),
        unweighted,
        others: others_s1_t1(context.settings.heuristic(), &end, at.pdf_w),
        length,
        wi: at.dir,
        point: None,
    };
    Some((connection, LensPoints { at, pixels }))
}

/// Takes the numbers that choose lens point and pixel; zeros if neither needs any.
#[inline(always)]
fn lens_numbers<R: Real>(context: &Context, sampler: &mut Sampler<R>) -> [[R; 2]; 2] {
    if context.camera.has_lens() || context.camera.filter() != FilterSpec::PIXEL {
        [sampler.next_2d(), sampler.next_2d()]
    } else {
        // The numbers are not computed.
        let _ = [sampler.next_2d(), sampler.next_2d()];
        [[R::splat(0.0); 2]; 2]
    }
}

/// Returns the optical length of light emitted at `emitted` after the segment of `distance` to the
/// camera.
#[inline(always)]
fn camera_length<R: Real>(timing: &Timing, emitted: R, distance: R) -> R::Double {
    let segment = if timing.camera {
        R::splat(timing.medium) * distance
    } else {
        R::splat(0.0)
    };
    emitted.double() + segment.double()
}
