//! Ambient occlusion: how much of the hemisphere above a visible point is open.

use lumbre_light::math::frame::Frame;
use lumbre_light::math::real::{Double, Vector};
use lumbre_light::math::simd::Lanes;
use lumbre_light::math::warp;
use lumbre_light::transport::integrator::camera_path::{
    self, Arrival, CameraPaths, Path, PathLight, PathSink, ShadowRay, edge_counts,
};
use lumbre_light::transport::integrator::{Context, IntegratorRow};
use lumbre_light::transport::vertex::towards;
use lumbre_light::value::schema::{Field, Table, Ty};

/// Parameter `distance`: up to where surfaces occlude.
pub const DISTANCE: Field = Field::optional(
    "distance",
    Ty::Num {
        min: 1e-6,
        max: 1e6,
    },
    "1",
    "distance up to which surfaces occlude, in scene units",
);

/// Default of [`DISTANCE`].
const DISTANCE_DEFAULT: f32 = 1.0;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "ao",
    long_name: "ambient occlusion, biased",
    revision: 1,
    doc: "The share of directions, weighted by their cosine, in which nothing is nearer than \
          `distance` to the point that is seen.",
    params: Table {
        name: "AoParams",
        doc: "Parameters of `ao`.",
        fields: &[DISTANCE],
    },
    splats: false,
    bias: Some("it shows how open surfaces are, and no light"),
    sharing: None,
    sample: camera_path::sample::<Ao>,
};

/// Ambient occlusion.
pub struct Ao;

impl CameraPaths for Ao {
    #[inline(always)]
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask {
        let surface = arrival.surface(context.scene);
        // Optical lengths exist only if the film has a time axis.
        let counts = edge_counts(context, edge);
        let optical = path.arrive(context, counts, arrival, &surface, lanes);
        if edge == context.max_depth {
            return R::Mask::default();
        }
        // A direction with the density cos / pi about the normal on the side of the camera.
        let frame = Frame::from_normal(towards(surface.n_shading, -path.state.dir));
        let local = warp::cosine_hemisphere::<R>(path.sampler.next_2d());
        let ray = surface.spawn(frame.to_world(local));
        let ray = ShadowRay {
            origin: ray.origin,
            dir: ray.dir,
            distance: R::splat(context.number(&DISTANCE, DISTANCE_DEFAULT)),
        };
        let [zero, one] = [0.0, 1.0].map(R::splat);
        let open = PathLight {
            unweighted: R::Vec3::splat(one),
            weight: one,
            // The ray is one more edge: `s + t` is the number of edges plus one.
            s: 0,
            t: edge + 2,
            // The length up to the point, its delay included.
            length: match &optical {
                None => R::Double::splat(0.0),
                Some(optical) => optical.after_segment(one, zero),
            },
        };
        sink.add_unless_occluded(lanes, &ray, &open);
        R::Mask::default()
    }

    #[inline(always)]
    fn escape<R: Lanes<N>, const N: usize>(
        _: &Context,
        _: u32,
        _: &Path<R>,
        _: R::Mask,
        _: &mut impl PathSink<R>,
    ) {
    }
}
