//! In place of [`streams`](super::streams) where no processor has its vectors: no job is done so.

use std::ops::Range;

use super::accel::Accel;
use super::row::RowSums;
use crate::render::Job;
use crate::scene::CompiledScene;
use crate::transport::integrator::Context;
use crate::transport::ray::{Hit, Ray};

/// What there is none of.
pub enum Streams {}

/// What there is none of.
pub enum Few {}

impl Few {
    /// Never called.
    pub fn closest(&self, _: &[(Ray, f32)], _: &mut Vec<Option<Hit>>) {
        match *self {}
    }

    /// Never called.
    pub fn occluded(&self, _: &[(Ray, f32)], _: &mut Vec<bool>) {
        match *self {}
    }
}

impl Streams {
    /// Never called.
    pub fn few(&self) -> Option<&Few> {
        match *self {}
    }

    /// `None`.
    pub fn of(_: &CompiledScene, _: &Job, _: &Accel) -> Option<Streams> {
        None
    }

    /// Never called.
    pub fn row(&self, _: &Context, _: &Job, _: u32, _: Range<u64>, _: &mut RowSums) {
        match *self {}
    }
}
