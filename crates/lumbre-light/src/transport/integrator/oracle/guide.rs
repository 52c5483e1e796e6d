//! Densities of the directions of guided camera subpaths.

use glam::Vec3;

use super::Rule;
use crate::transport::bsdf::Bsdf;
use crate::transport::integrator::Context;
use crate::transport::integrator::guided::directions;
use crate::transport::integrator::guided::sd_tree::SdTree;

/// A tree by which camera subpaths are guided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guide<'a> {
    tree: &'a SdTree,
    /// Fraction of directions that the BSDF samples where the tree guides.
    bsdf_fraction: f64,
}

impl<'a> Guide<'a> {
    /// Returns the tree that the samples of an iteration share.
    pub fn new(context: &Context<'a>) -> Guide<'a> {
        Guide {
            tree: &context.shared::<directions::Guide>().tree,
            bsdf_fraction: f64::from(context.settings.guiding.bsdf_fraction),
        }
    }

    /// Returns the density per solid angle with which a camera subpath continues in a unit direction
    /// from a position on a surface, whose BSDF samples that direction with the density
    /// `bsdf_pdf_w`.
    fn pdf_w(&self, position: Vec3, bsdf: &Bsdf, wi: Vec3, bsdf_pdf_w: f64) -> f64 {
        let leaf = self.tree.leaf_at(position);
        let directions = self.tree.directions(leaf);
        let Some(directions) = directions.filter(|_| bsdf.has_density()) else {
            return bsdf_pdf_w;
        };
        let tree_pdf_w = f64::from(directions.pdf_w(wi));
        self.bsdf_fraction * bsdf_pdf_w + (1.0 - self.bsdf_fraction) * tree_pdf_w
    }
}

impl Rule<'_> {
    /// Returns the density per solid angle with which a camera subpath that arrives at a position on
    /// a surface from the unit direction `wo` continues in `wi`, without a Dirac event.
    pub fn camera_pdf_w(&self, position: Vec3, bsdf: &Bsdf, [wo, wi]: [Vec3; 2]) -> f64 {
        let bsdf_pdf_w = f64::from(bsdf.pdf_w(wo, wi));
        match &self.guide {
            None => bsdf_pdf_w,
            Some(guide) => guide.pdf_w(position, bsdf, wi, bsdf_pdf_w),
        }
    }
}
