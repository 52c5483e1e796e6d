//! Connections that are listed, and the light that they bring to the pixels of their own samples.

use glam::Vec3;

use super::vertices::HitLight;
use crate::cpu::wavefront::light::{Details, TileLight};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::state::CameraEndRecord;
use lumbre_light::transport::integrator::bdpt::store::VertexId;

/// Pending connection of a camera vertex to a sampled point on a light (`s = 1`).
#[derive(Clone, Copy)]
pub(super) struct LightConnection {
    /// Index into [`OwnContributions`].
    pub index: u32,
    pub path: u32,
    /// Index of the camera vertex.
    pub z: u32,
    /// Position in the sample's random numbers.
    pub taken: u32,
}

/// Light vertex and camera vertex that are to be connected or merged.
#[derive(Clone, Copy)]
pub(super) struct VertexPair {
    /// Index into [`OwnContributions`]; of a drawn pair, that of the candidate.
    pub index: u32,
    /// The light vertex.
    pub y: VertexId,
    /// Index of the camera vertex.
    pub z: u32,
}

/// Vertex pairs whose BSDFs at the camera vertices have been evaluated.
#[derive(Default)]
pub(super) struct EvaluatedPairs {
    pub pairs: Vec<VertexPair>,
    pub ends: Vec<CameraEndRecord>,
}

/// Pending connection of a light vertex, or of the start of a light subpath, to the lens.
#[derive(Clone, Copy)]
pub(super) struct LensConnection {
    pub path: u32,
    /// The light vertex; unused for a start.
    pub y: VertexId,
    /// Number of light vertices.
    pub s: u32,
    /// Position in the sample's random numbers.
    pub taken: u32,
}

/// Contributions of samples to their own pixels, in the order in which they are added.
#[derive(Default)]
pub(super) struct OwnContributions {
    /// Path and value of each contribution.
    pub values: Vec<(u32, Vec3)>,
    /// Optical length of each contribution; empty without a time axis.
    pub lengths: Vec<f64>,
    /// Details of each contribution for layers; empty without layers.
    pub details: Vec<Details>,
}

/// Optional columns of [`OwnContributions`].
#[derive(Clone, Copy)]
pub(super) struct Columns {
    pub timed: bool,
    pub layered: bool,
}

impl OwnContributions {
    /// Appends a contribution of a path; it is black until its connection is evaluated. Returns its
    /// index.
    pub fn push(&mut self, columns: Columns, path: usize, [s, t]: [u32; 2]) -> u32 {
        self.values.push((path as u32, Vec3::ZERO));
        if columns.timed {
            self.lengths.push(0.0);
        }
        if columns.layered {
            let unweighted = Vec3::ZERO;
            let length = 0.0;
            self.details.push(Details {
                unweighted,
                s,
                t,
                length,
            });
        }
        self.values.len() as u32 - 1
    }

    /// Sets a contribution.
    #[inline]
    pub fn set(&mut self, index: u32, value: Vec3, unweighted: Vec3, length: f64) {
        let index = index as usize;
        self.values[index].1 = value;
        if let Some(to) = self.lengths.get_mut(index) {
            *to = length;
        }
        if let Some(to) = self.details.get_mut(index) {
            to.unweighted = unweighted;
            to.length = length;
        }
    }

    /// Sets the number of light vertices of a contribution.
    pub fn set_strategy(&mut self, index: u32, s: u32) {
        if let Some(to) = self.details.get_mut(index as usize) {
            to.s = s;
        }
    }

    /// Appends light that a path hit.
    pub fn push_hit(&mut self, columns: Columns, path: usize, hit: &HitLight) {
        let index = self.push(columns, path, [0, hit.t]);
        self.set(index, hit.value, hit.unweighted, hit.length);
    }

    /// Adds all contributions to the light of their paths, in order, and removes them.
    pub fn add_to(&mut self, context: &Context, light: &mut TileLight) {
        for (i, (path, value)) in self.values.drain(..).enumerate() {
            let details = self.details.get(i).copied();
            let unweighted = details.map_or(Vec3::ZERO, |details| details.unweighted);
            if value == Vec3::ZERO && unweighted == Vec3::ZERO {
                continue;
            }
            let timing = context.timing.map(|timing| {
                let position = timing.axis.bin_position(self.lengths[i]);
                (timing, position)
            });
            light.add(timing, path, value, details);
        }
        self.lengths.clear();
        self.details.clear();
    }
}
