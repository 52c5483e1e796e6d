//! Follows camera paths one after the other: the techniques with one lane.

use super::state::{Path, PathState, TerminatorState};
use super::{CameraPaths, PathLight, PathSink, ShadowRay};
use crate::transport::arrival::{Arrival, HitState};
use crate::transport::contribution::Contribution;
use crate::transport::integrator::Context;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;

/// Computes one sample of one pixel: see [`SampleFn`](crate::transport::integrator::SampleFn).
pub fn sample<T: CameraPaths>(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    follow::<T>(context, pixel, *sampler, sink, |_, _| ());
}

/// Follows one path of a pixel to its end, and returns the number of rays. `leaves` is called with
/// the number of the edge that led to a vertex, and the path, for every vertex from which the path
/// continues.
pub fn follow<T: CameraPaths>(
    context: &Context,
    pixel: [u32; 2],
    sampler: Sampler,
    sink: &mut dyn FnMut(Contribution),
    mut leaves: impl FnMut(u32, &PathState<f32>),
) -> u32 {
    let mut sink = SingleSink {
        context,
        pixel,
        sink,
        rays: 0,
    };
    let mut path = Path::<f32>::from_camera(context, pixel.map(|n| n as f32), sampler);
    path.terminator = context
        .classes
        .have_terminators()
        .then(TerminatorState::none);
    for edge in 1..=context.max_depth {
        let ray = Ray {
            origin: path.state.origin,
            dir: path.state.dir,
        };
        sink.rays += 1;
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
            T::escape::<f32, 1>(context, edge, &path, true, &mut sink);
            break;
        };
        if context.ends_unlit(edge, &hit) {
            break;
        }
        let hit = HitState::new(context.scene, &ray, &hit, || path.next_auxiliary());
        let class = &context.classes[context.classes.index_of(context.scene, &hit)];
        let arrival = Arrival::<f32, 1>::new(class, ray, &hit);
        if !T::scatter::<f32, 1>(context, edge, &arrival, &mut path, true, &mut sink) {
            break;
        }
        leaves(edge, &path.state);
    }
    sink.rays
}

/// Sink of one path, which traces shadow rays at once.
struct SingleSink<'a> {
    context: &'a Context<'a>,
    pixel: [u32; 2],
    sink: &'a mut dyn FnMut(Contribution),
    /// Number of rays so far, with those of the path's edges.
    rays: u32,
}

impl PathSink<f32> for SingleSink<'_> {
    fn add(&mut self, lanes: bool, light: &PathLight<f32>) {
        if lanes {
            (self.sink)(Contribution {
                pixel: self.pixel,
                value: light.value(),
                unweighted: light.unweighted,
                s: light.s,
                t: light.t,
                length: light.length,
            });
        }
    }

    fn add_unless_occluded(&mut self, lanes: bool, ray: &ShadowRay<f32>, light: &PathLight<f32>) {
        if !lanes {
            return;
        }
        self.rays += u32::from(needs_ray(ray.distance));
        if unoccluded(self.context, ray) {
            self.add(true, light);
        }
    }
}

/// Returns whether a shadow ray of this length has to be traced. Coincident points are mutually
/// visible.
#[inline]
pub fn needs_ray(distance: f32) -> bool {
    distance > 0.0 || distance.is_nan()
}

/// Returns whether nothing blocks a shadow ray.
pub fn unoccluded(context: &Context, ray: &ShadowRay<f32>) -> bool {
    let ShadowRay {
        origin,
        dir,
        distance,
    } = *ray;
    !needs_ray(distance) || !context.trace.occluded(&Ray { origin, dir }, distance)
}
