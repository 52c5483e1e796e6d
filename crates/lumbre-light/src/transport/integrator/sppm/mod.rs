//! Stochastic progressive photon mapping [Hachisuka & Jensen 2009], in the form of
//! [Knaus & Zwicker 2011] where every iteration is a photon map of its own.
//!
//! Before the samples of iteration `i`, counted from 1, photons start at the lights and are stored
//! where they arrive at surfaces ([`photons`]). A camera path per pixel then ends at the first vertex
//! that scatters light widely and gathers the photons within the radius
//!
//! `r_i = r_1 i^((alpha - 1) / 2)`
//!
//! of that vertex ([`PhotonMap`]), so that the radiance is
//! `sum of f(wo, wi) flux / (photons pi r_i^2)` [Jensen 1996]. The film averages the iterations.
//! Iterations are independent, and each is an unbiased estimate of a picture whose irradiance is
//! blurred over disks of radius `r_i`: its bias is proportional to `r_i^2` away from edges, its
//! variance to `1 / r_i^2`. Both errors of the average vanish for `0 < alpha < 1`.
//!
//! # Which vertex gathers
//! A light path has one vertex at which its photon is gathered, so that nothing counts twice. From
//! the camera on, an event with directions `wo` and `wi` is sampled, and the camera path continues,
//! if it is a Dirac event, if the density of sampling `wi` exceeds [`MAX_GATHER_PDF_W`], or if the
//! edge leaves from a point that is lifted against the shadow terminator, which no photon reaches.
//! All other events are gathered. A vertex may do both, for different directions: plastic gathers
//! the photons of its diffuse lobe and samples a narrow highlight. Light that a camera path hits
//! counts fully, since all its events were sampled.
//!
//! A mask with values between 0 and 1 accepts photons and camera paths each with its probability,
//! and counts once: the flux of a photon is divided by it.
//!
//! Light that no camera path can hit is the exception: of point and directional lights, the first
//! vertex on the way from the light that is not a Dirac event always gathers. At lifted points
//! such light is lost.
//!
//! Direct light is gathered like all other: photons find it behind glass, where sampling a light
//! fails, and from any number of lights; shadows are blurred by the radius of their iteration.

pub mod photons;

use self::photons::{Photon, PhotonRecord};
use super::camera_path::{self, CameraPaths, Path, PathLight, PathSink, edge_counts};
use super::iteration::Sharing;
use super::iteration::photon_map::{PhotonMap, cosine_ratio, point_bytes, same_surface};
use super::{Context, IntegratorRow, nee, settings};
use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::simd::{Lanes, active_lanes, store_vectors};
use crate::transport::arrival::Arrival;
use crate::transport::bsdf::{Bsdf, Outgoing, TransportMode};
use crate::transport::light::SELECT_FIELD;
use crate::transport::path_time::OpticalLength;
use crate::transport::surface::Surface;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "sppm",
    long_name: "stochastic progressive photon mapping, consistent but biased",
    revision: 4,
    doc: "Photons from the lights are gathered where camera paths meet the first surface that is \
          not nearly specular, within a radius that shrinks from sample to sample [Hachisuka & \
          Jensen 2009; Knaus & Zwicker 2011].",
    params: Table {
        name: "SppmParams",
        doc: "Parameters of `sppm`.",
        fields: &[
            settings::PHOTONS,
            settings::RADIUS,
            settings::ALPHA,
            SELECT_FIELD,
        ],
    },
    splats: false,
    bias: Some(
        "it blurs light over the radius within which photons are gathered, and pixels that \
         gather the same photons have common noise",
    ),
    sharing: Some(Sharing {
        prepare: photons::prepare,
        begin: photons::begin,
        vertex_bytes: point_bytes::<PhotonRecord>(),
        batch: None,
        fixed_bytes: |_| 0,
        constant_from: None,
        recorded: None,
    }),
    sample: camera_path::sample::<Sppm>,
};

/// Greatest density per solid angle of sampled directions for which photons are gathered instead of
/// continuing the camera path. It is that of the mirror direction on a GGX surface of roughness 0.4.
pub const MAX_GATHER_PDF_W: f32 = 4.0;

/// Stochastic progressive photon mapping.
pub struct Sppm;

impl CameraPaths for Sppm {
    #[inline(always)]
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        mut lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask {
        let surface = arrival.surface(context.scene);
        if let Some(terminator) = &path.terminator {
            lanes = lanes & terminator.allows(surface.position);
        }
        let counts = edge_counts(context, edge);
        let optical = path.arrive(context, counts, arrival, &surface, lanes);
        if arrival.class.surface.emits {
            let length = optical.map_or(R::Double::splat(0.0), |optical| optical.arrival());
            nee::add_emission::<R, N, false>(context, edge, path, &surface, length, lanes, sink);
        }
        lanes = lanes & !surface.ends_paths();
        if edge == context.max_depth || !lanes.any() {
            return R::Mask::default();
        }
        let parameters = arrival.parameters(context.scene, &surface);
        let bsdf = arrival.bsdf(context.classes, &surface, parameters.as_ref());
        let out = bsdf.outgoing(-path.state.dir);
        let gathering = lanes & bsdf.has_density() & out.same_side;
        if gathering.any() {
            let point = GatherPoint {
                surface: &surface,
                bsdf: &bsdf,
                out: &out,
                optical: optical.as_ref(),
                edge,
            };
            point.gather(context, path.state.throughput, gathering, sink);
        }
        let [choice, u, v] = path.sampler.next_three();
        let (sampled, s, _) = bsdf.samples::<false>(&out, choice, [u, v], TransportMode::Radiance);
        let continues = s.delta | !gathers(&surface, s.wi, s.pdf_w);
        let lanes = lanes & sampled & continues;
        path.continue_from(context, edge, &surface, optical, &s, lanes)
    }

    #[inline(always)]
    fn escape<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        path: &Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        nee::escape::<R, N, false>(context, edge, path, lanes, sink);
    }
}

/// Returns whether light from the unit direction `wi` is gathered rather than found by continuing
/// camera paths, which sample it with the density `pdf_w`.
#[inline(always)]
fn gathers<R: Lanes<N>, const N: usize>(surface: &Surface<R, N>, wi: R::Vec3, pdf_w: R) -> R::Mask {
    let wide = pdf_w.le(R::splat(MAX_GATHER_PDF_W));
    match surface.terminator_into(wi) {
        Some(offset) => wide & !offset.exists,
        None => wide,
    }
}

/// Vertices of camera paths that gather photons.
struct GatherPoint<'a, R: Real, const N: usize> {
    surface: &'a Surface<'a, R, N>,
    bsdf: &'a Bsdf<R>,
    out: &'a Outgoing<R>,
    /// Optical length of the camera path; `None` without a time axis.
    optical: Option<&'a OpticalLength<R>>,
    /// Number of the edge that led here.
    edge: u32,
}

impl<R: Lanes<N>, const N: usize> GatherPoint<'_, R, N> {
    /// Adds the light of the photons near each vertex, by number of edges and then in the order of
    /// the map: the same order for any number of lanes.
    #[inline(always)]
    fn gather(
        &self,
        context: &Context,
        throughput: R::Vec3,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        let map: &PhotonMap<PhotonRecord> = context.shared();
        let max_edges = context.max_depth - self.edge;
        let positions = store_vectors::<R, N>(self.surface.position);
        let normals = store_vectors::<R, N>(self.surface.n_geometric);
        let mut near: [Vec<(u32, &PhotonRecord)>; N] = std::array::from_fn(|_| Vec::new());
        for i in active_lanes(lanes.bits()) {
            map.for_each_near::<R, N>([positions[i], normals[i]], |record| {
                let photon = PhotonRecord::load::<f32, 1>([record]);
                if photon.edges <= max_edges && same_surface(photon.normal, normals[i]) {
                    near[i].push((photon.edges, record));
                }
            });
            near[i].sort_by_key(|(edges, _)| *edges);
        }
        let none = PhotonRecord::default();
        let throughput = throughput * R::splat(map.scale());
        let mut rest = near.each_ref().map(Vec::as_slice);
        for edges in 1..=max_edges {
            loop {
                let (mut some, mut records) = ([0.0; N], [&none; N]);
                for i in 0..N {
                    if let Some(((_, record), after)) =
                        rest[i].split_first().filter(|((e, _), _)| *e == edges)
                    {
                        (some[i], records[i], rest[i]) = (1.0, *record, after);
                    }
                }
                let lanes = R::load(&some).gt(R::splat(0.0));
                if !lanes.any() {
                    break;
                }
                let photons = PhotonRecord::load::<R, N>(records);
                self.add(&photons, edges, throughput, lanes, sink);
            }
        }
    }

    /// Adds the light of one photon in each lane.
    #[inline(always)]
    fn add(
        &self,
        photon: &Photon<R>,
        edges: u32,
        throughput: R::Vec3,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        let wi = photon.wi;
        let value = self
            .bsdf
            .values::<false>(self.out, wi, TransportMode::Radiance, lanes);
        let unhittable = photon.unhittable.gt(R::splat(0.0));
        let lanes = lanes & (unhittable | gathers(self.surface, wi, value.pdf_w));
        let Surface {
            n_shading,
            n_geometric,
            ..
        } = *self.surface;
        let cosines = cosine_ratio(n_shading, n_geometric, wi);
        let unweighted = throughput * value.f * photon.flux * cosines;
        let lanes = lanes & !unweighted.same(R::Vec3::broadcast(glam::Vec3::ZERO));
        if !lanes.any() {
            return;
        }
        let length = match self.optical {
            None => R::Double::splat(0.0),
            Some(optical) => {
                let ratio = self.bsdf.index_ratio(self.out.wo, wi);
                let near = optical.after_segment(ratio, R::splat(0.0));
                near + photon
                    .optical()
                    .from_light(R::splat(1.0), optical.index * ratio)
            }
        };
        let light = PathLight {
            unweighted,
            weight: R::splat(1.0),
            s: edges,
            t: self.edge + 1,
            length,
        };
        sink.add(lanes, &light);
    }
}
