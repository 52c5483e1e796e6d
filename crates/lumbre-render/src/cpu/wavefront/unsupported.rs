//! Replaces the vectorised path tracer in builds for processors other than x86-64.
//! [`Wavefront::new`] always returns `None`, so all paths are scalar.

use std::ops::Range;

use super::bvh::accel::Accel;
use super::films::row_film::RowFilm;
use crate::Job;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::ray::{Hit, Ray};

/// Vectorised path tracer, which cannot be created in this build.
pub enum Wavefront {}

/// Tracer of rays in small scenes, which cannot be created in this build.
pub enum SmallScene {}

impl SmallScene {
    /// Cannot be called, since the type has no values.
    pub fn closest(&self, _: &[(Ray, f32)], _: &mut Vec<Option<Hit>>) {
        match *self {}
    }

    /// Cannot be called, since the type has no values.
    pub fn occluded(&self, _: &[(Ray, f32)], _: &mut Vec<bool>) {
        match *self {}
    }
}

impl Wavefront {
    /// Cannot be called, since the type has no values.
    pub fn small_scene(&self) -> Option<&SmallScene> {
        match *self {}
    }

    /// Returns `None`: no job can be vectorised in this build.
    pub fn new(_: &CompiledScene, _: &Job, _: &Accel) -> Option<Wavefront> {
        None
    }

    /// Cannot be called, since the type has no values.
    pub fn render_row(&self, _: &Context, _: &Job, _: u32, _: Range<u64>, _: &mut RowFilm) {
        match *self {}
    }
}
