//! BSDFs of materials in memory, prepared once per scene, in the form that vectors load.

use super::clearcoat::Clearcoat;
use super::local::LocalBsdf;
use super::material::{BsdfClass, MaterialConstants};
use super::model::BsdfModel;
use super::numbers::{Numbers, PackedClass};
use super::{Bsdf, Orientation};
use crate::math::real::{Outlined, Real, Vector};
use crate::math::simd::{F32x8, Lanes, map_array};
use crate::scene::compile::{KNOTS, Material};
use crate::transport::surface::{ShadingParameters, TexturedParameters};

/// A material's BSDF with the values of its parameters, without those of textures.
#[derive(Clone, Copy, Debug)]
pub struct PackedBsdf {
    /// [`NUMBERS`] numbers: the material's constants if its parameters vary, else the BSDF itself.
    rows: [F32x8; 3],
    /// Traits of the material.
    pub class: PackedClass,
}

impl PackedBsdf {
    /// Packs the BSDF of a material. `tinted` states whether vertex colours change its base colour.
    pub fn new(m: &Material, tinted: bool) -> PackedBsdf {
        let varies = tinted || TexturedParameters::new(m).any();
        let (class, constants) = (BsdfClass::of(m), MaterialConstants::new(m));
        let model = BsdfModel::new(&class, &constants, &ShadingParameters::of(m));
        let mut class = PackedClass {
            bsdf: class,
            varies,
            has_density: true,
            smooth: false,
            lobes: [false; 7],
        };
        let numbers = if varies {
            constant_numbers(&class.bsdf, &constants)
        } else {
            let packed = model.packed();
            class.has_density = model.traits().has_density;
            (class.smooth, class.lobes) = (packed.smooth, packed.lobes);
            class.bsdf.anisotropic = packed.anisotropic;
            packed.numbers
        };
        let row = |k: usize| F32x8(std::array::from_fn(|i| numbers.get(8 * k + i)));
        PackedBsdf {
            rows: [row(0), row(1), row(2)],
            class,
        }
    }
}

impl<R: Real> Bsdf<R> {
    /// Builds the BSDFs of materials of one class. `parameters` are those at the points; there must
    /// be some exactly if the parameters of the class [vary](PackedClass::varies).
    #[inline(always)]
    pub fn unpack<const N: usize>(
        at: &Orientation<R>,
        class: &PackedClass,
        packed: [&PackedBsdf; N],
        parameters: Option<&ShadingParameters<R>>,
    ) -> Bsdf<R>
    where
        R: Lanes<N>,
    {
        R::outline(Unpacking {
            at,
            class,
            packed,
            parameters,
        })
    }
}

/// Outlined computation of [`Bsdf::unpack`].
struct Unpacking<'a, R: Real, const N: usize> {
    at: &'a Orientation<R>,
    class: &'a PackedClass,
    packed: [&'a PackedBsdf; N],
    parameters: Option<&'a ShadingParameters<R>>,
}

impl<R: Lanes<N>, const N: usize> Outlined for Unpacking<'_, R, N> {
    type Output = Bsdf<R>;

    #[inline(always)]
    fn run(self) -> Bsdf<R> {
        debug_assert_eq!(self.parameters.is_some(), self.class.varies);
        let numbers = load_numbers::<R, N>(self.packed);
        let model = match self.parameters {
            Some(parameters) => {
                let constants = load_constants(&self.class.bsdf, &numbers);
                BsdfModel::new(&self.class.bsdf, &constants, parameters)
            }
            None => BsdfModel::load(self.class, &numbers),
        };
        Bsdf::with_model(self.at, self.class.bsdf.one_sided, model)
    }
}

/// Loads the numbers of all lanes.
#[inline(always)]
fn load_numbers<R: Lanes<N>, const N: usize>(packed: [&PackedBsdf; N]) -> Numbers<R> {
    let [a0, a1, a2, a3, a4, a5, a6, a7] = R::transpose_load(map_array(packed, |p| &p.rows[0]));
    let [b0, b1, b2, b3, b4, b5, b6, b7] = R::transpose_load(map_array(packed, |p| &p.rows[1]));
    let [c0, c1, c2, c3, c4, c5, c6, c7] = R::transpose_load(map_array(packed, |p| &p.rows[2]));
    Numbers([
        a0, a1, a2, a3, a4, a5, a6, a7, b0, b1, b2, b3, b4, b5, b6, b7, c0, c1, c2, c3, c4, c5, c6,
        c7,
    ])
}

/// Returns the constants of a material as numbers, which [`load_constants`] loads.
fn constant_numbers(class: &BsdfClass, m: &MaterialConstants) -> Numbers<f32> {
    let common = [m.ior, m.aspect, m.smooth_below, m.internal_reflectance];
    if class.rough_body {
        return Numbers::of(&[&common, m.specular.as_ref(), &m.transmittance]);
    }
    Numbers::of(&[
        &common,
        m.specular.as_ref(),
        &[m.subsurface, m.specular_tint, m.sheen, m.sheen_tint],
        &[m.coat.strength, m.coat.alpha, m.coat.ln_alpha2],
        m.eta.as_ref(),
        m.k.as_ref(),
    ])
}

/// Builds the constants of [`constant_numbers`]; those that the class has no use for are zero.
#[inline(always)]
fn load_constants<R: Real>(class: &BsdfClass, n: &Numbers<R>) -> MaterialConstants<R::Vec3> {
    let zero = R::splat(0.0);
    let mut constants = MaterialConstants {
        ior: n.get(0),
        aspect: n.get(1),
        smooth_below: n.get(2),
        internal_reflectance: n.get(3),
        specular: n.vector(4),
        subsurface: zero,
        specular_tint: zero,
        sheen: zero,
        sheen_tint: zero,
        coat: Clearcoat {
            strength: zero,
            alpha: zero,
            ln_alpha2: zero,
            formulas: class.formulas,
        },
        eta: R::Vec3::splat(zero),
        k: R::Vec3::splat(zero),
        transmittance: [zero; KNOTS],
    };
    if class.rough_body {
        constants.transmittance = n.array(7);
        return constants;
    }
    MaterialConstants {
        subsurface: n.get(7),
        specular_tint: n.get(8),
        sheen: n.get(9),
        sheen_tint: n.get(10),
        coat: Clearcoat {
            strength: n.get(11),
            alpha: n.get(12),
            ln_alpha2: n.get(13),
            ..constants.coat
        },
        eta: n.vector(14),
        k: n.vector(17),
        ..constants
    }
}
