//! Replacement of the vectorised path tracer on processors without x86-64 vectors: it is never
//! created.

use std::ops::Range;

use super::bvh::accel::Accel;
use super::films::row_film::RowFilm;
use crate::render::Job;
use crate::scene::CompiledScene;
use crate::transport::integrator::Context;
use crate::transport::ray::{Hit, Ray};

/// Vectorised path tracer; has no values here.
pub enum Wavefront {}

/// Tracer of many rays at once; has no values here.
pub enum SmallScene {}

impl SmallScene {
    /// Unreachable without a value.
    pub fn closest(&self, _: &[(Ray, f32)], _: &mut Vec<Option<Hit>>) {
        match *self {}
    }

    /// Unreachable without a value.
    pub fn occluded(&self, _: &[(Ray, f32)], _: &mut Vec<bool>) {
        match *self {}
    }
}

impl Wavefront {
    /// Unreachable without a value.
    pub fn small_scene(&self) -> Option<&SmallScene> {
        match *self {}
    }

    /// Returns `None`, since no job can use it.
    pub fn new(_: &CompiledScene, _: &Job, _: &Accel) -> Option<Wavefront> {
        None
    }

    /// Unreachable without a value.
    pub fn render_row(&self, _: &Context, _: &Job, _: u32, _: Range<u64>, _: &mut RowFilm) {
        match *self {}
    }
}
