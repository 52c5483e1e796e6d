//! BSDFs of materials in memory, prepared once per scene, in the form that vectors load.

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::conductor::Conductor;
use super::diffuse::Diffuse;
use super::disney::{Disney, LobeEstimate};
use super::facets::Facets;
use super::ggx::Ggx;
use super::glass::Glass;
use super::ideal::Ideal;
use super::interface::InterfaceBsdf;
use super::material::{BsdfClass, MaterialConstants};
use super::model::BsdfModel;
use super::plastic::Plastic;
use super::translucent::Translucent;
use super::{Bsdf, Orientation};
use crate::math::real::{Mask, Outlined, Real, Vector};
use crate::math::simd::{F32x8, Lanes, map_array};
use crate::scene::compile::{Material, Model};
use crate::transport::surface::{ShadingParameters, TexturedParameters};

/// Numbers of a packed BSDF.
const NUMBERS: usize = 24;

/// A material's BSDF with the values of its parameters, without those of textures.
#[derive(Clone, Copy, Debug)]
pub struct PackedBsdf {
    /// [`NUMBERS`] numbers: the material's constants if its parameters vary, else the BSDF itself.
    rows: [F32x8; 3],
    /// Traits of the material.
    pub class: PackedClass,
}

/// Traits of a material. Materials that are equal in them share lanes; materials that differ in
/// lobes alone may, but those lanes take branches of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedClass {
    /// Traits that all lanes must share.
    pub bsdf: BsdfClass,
    /// Whether base colour, roughness, metallic or opacity vary over surfaces: by textures or by
    /// vertex colours.
    pub varies: bool,
    /// Whether any lobe has a density; `true` if that depends on parameters that vary.
    pub has_density: bool,
    /// Whether the microfacets are Dirac lobes; `false` if parameters vary.
    smooth: bool,
    /// Presence of the opaque, metallic, refractive, clearcoat, subsurface and sheen lobes, and
    /// whether the refractive one is a Dirac lobe; all `false` if parameters vary.
    lobes: [bool; 7],
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
        if !varies {
            class.has_density = model.has_density();
            (class.smooth, class.lobes) = model_lobes(&model);
            class.bsdf.anisotropic = is_anisotropic(&model);
        }
        let numbers = if varies {
            constant_numbers(&constants)
        } else {
            model_numbers(&model)
        };
        let row = |k: usize| F32x8(std::array::from_fn(|i| numbers[8 * k + i]));
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
                BsdfModel::new(&self.class.bsdf, &load_constants(&numbers), parameters)
            }
            None => load_model(self.class, &numbers),
        };
        Bsdf::with_model(self.at, self.class.bsdf.one_sided, model)
    }
}

/// Loads the numbers of all lanes.
#[inline(always)]
fn load_numbers<R: Lanes<N>, const N: usize>(packed: [&PackedBsdf; N]) -> [R; NUMBERS] {
    let [a0, a1, a2, a3, a4, a5, a6, a7] = R::transpose_load(map_array(packed, |p| &p.rows[0]));
    let [b0, b1, b2, b3, b4, b5, b6, b7] = R::transpose_load(map_array(packed, |p| &p.rows[1]));
    let [c0, c1, c2, c3, c4, c5, c6, c7] = R::transpose_load(map_array(packed, |p| &p.rows[2]));
    [
        a0, a1, a2, a3, a4, a5, a6, a7, b0, b1, b2, b3, b4, b5, b6, b7, c0, c1, c2, c3, c4, c5, c6,
        c7,
    ]
}

/// Returns the vector that starts at number `at`.
#[inline(always)]
fn vector<R: Real>(n: &[R; NUMBERS], at: usize) -> R::Vec3 {
    R::Vec3::new(n[at], n[at + 1], n[at + 2])
}

/// Returns an array that starts with the numbers of the given groups, followed by zeros.
fn concatenated(groups: &[&[f32]]) -> [f32; NUMBERS] {
    let mut numbers = [0.0; NUMBERS];
    for (to, from) in numbers.iter_mut().zip(groups.iter().copied().flatten()) {
        *to = *from;
    }
    numbers
}

/// Returns the constants of a material as numbers, which [`load_constants`] loads.
fn constant_numbers(m: &MaterialConstants) -> [f32; NUMBERS] {
    concatenated(&[
        &[m.ior, m.aspect, m.smooth_below, m.internal_reflectance],
        &[m.subsurface, m.specular_tint, m.sheen, m.sheen_tint],
        &[m.coat.strength, m.coat.alpha, m.coat.ln_alpha2],
        m.specular.as_ref(),
        m.eta.as_ref(),
        m.k.as_ref(),
    ])
}

/// Builds the constants of [`constant_numbers`].
#[inline(always)]
fn load_constants<R: Real>(n: &[R; NUMBERS]) -> MaterialConstants<R::Vec3> {
    MaterialConstants {
        ior: n[0],
        aspect: n[1],
        smooth_below: n[2],
        internal_reflectance: n[3],
        subsurface: n[4],
        specular_tint: n[5],
        sheen: n[6],
        sheen_tint: n[7],
        coat: Clearcoat {
            strength: n[8],
            alpha: n[9],
            ln_alpha2: n[10],
        },
        specular: vector(n, 11),
        eta: vector(n, 14),
        k: vector(n, 17),
    }
}

/// Returns a BSDF as numbers, which [`load_model`] loads.
fn model_numbers(model: &BsdfModel<Vec3>) -> [f32; NUMBERS] {
    match model {
        BsdfModel::Ideal(k) => concatenated(&[k.base_color.as_ref(), &k.mix, &[k.ior]]),
        BsdfModel::Translucent(k) => concatenated(&[
            k.reflectance.as_ref(),
            k.transmittance.as_ref(),
            &[k.reflects],
        ]),
        BsdfModel::Disney(k) => disney_numbers(k),
        BsdfModel::Interface(InterfaceBsdf::Conductor(k)) => concatenated(&[
            &k.facets.alpha,
            k.tint.as_ref(),
            k.eta.as_ref(),
            k.k.as_ref(),
        ]),
        BsdfModel::Interface(InterfaceBsdf::Plastic(k)) => concatenated(&[
            &k.facets.alpha,
            k.specular.as_ref(),
            &[k.ior],
            k.diffuse.as_ref(),
            k.body.as_ref(),
        ]),
        BsdfModel::Interface(InterfaceBsdf::Glass(k)) => concatenated(&[
            &k.facets.alpha,
            k.specular.as_ref(),
            &[k.ior],
            k.base_color.as_ref(),
        ]),
    }
}

/// Returns a Disney BSDF as numbers.
fn disney_numbers(k: &Disney) -> [f32; NUMBERS] {
    let LobeEstimate {
        diffuse,
        reflection,
        rise,
    } = k.estimate;
    concatenated(&[
        k.base_color.as_ref(),
        &[k.opaque, k.metallic, k.refractive],
        &[k.ior, k.diffuse.roughness, k.diffuse.subsurface],
        k.diffuse.sheen.as_ref(),
        &k.ggx.alpha,
        k.tinted_f0.unwrap_or_default().as_ref(),
        &[k.coat.strength, k.coat.alpha, k.coat.ln_alpha2],
        &[diffuse, reflection, rise],
    ])
}

/// Builds the BSDFs of [`model_numbers`].
#[inline(always)]
fn load_model<R: Real>(class: &PackedClass, n: &[R; NUMBERS]) -> BsdfModel<R::Vec3> {
    let BsdfClass {
        model,
        distribution,
        thin,
        ..
    } = class.bsdf;
    let facets = Facets {
        distribution,
        alpha: [n[0], n[1]],
        smooth: R::Mask::splat(class.smooth),
    };
    match model {
        Model::Disney => BsdfModel::Disney(load_disney(class, n)),
        Model::Lambert => BsdfModel::Ideal(Ideal {
            base_color: vector(n, 0),
            mix: [n[3], n[4], n[5]],
            ior: n[6],
            one_sided: class.bsdf.one_sided,
        }),
        Model::Translucent => BsdfModel::Translucent(Translucent {
            reflectance: vector(n, 0),
            transmittance: vector(n, 3),
            reflects: n[6],
        }),
        Model::Conductor => BsdfModel::Interface(InterfaceBsdf::Conductor(Conductor {
            tint: vector(n, 2),
            eta: vector(n, 5),
            k: vector(n, 8),
            facets,
        })),
        Model::Plastic => BsdfModel::Interface(InterfaceBsdf::Plastic(Plastic {
            specular: vector(n, 2),
            ior: n[5],
            diffuse: vector(n, 6),
            body: vector(n, 9),
            facets,
        })),
        Model::Dielectric => BsdfModel::Interface(InterfaceBsdf::Glass(Glass {
            specular: vector(n, 2),
            ior: n[5],
            base_color: vector(n, 6),
            thin,
            facets,
        })),
    }
}

/// Builds the BSDFs of [`disney_numbers`].
#[inline(always)]
fn load_disney<R: Real>(class: &PackedClass, n: &[R; NUMBERS]) -> Disney<R::Vec3> {
    let base_color = vector(n, 0);
    let BsdfClass {
        anisotropic,
        tinted,
        one_sided,
        ..
    } = class.bsdf;
    Disney {
        base_color,
        opaque: n[3],
        metallic: n[4],
        refractive: n[5],
        ior: n[6],
        diffuse: Diffuse {
            base_color,
            roughness: n[7],
            subsurface: n[8],
            sheen: vector(n, 9),
        },
        ggx: Ggx {
            alpha: [n[12], if anisotropic { n[13] } else { n[12] }],
        },
        anisotropic,
        one_sided,
        smooth: R::Mask::splat(class.smooth),
        tinted_f0: tinted.then(|| vector(n, 14)),
        coat: Clearcoat {
            strength: n[17],
            alpha: n[18],
            ln_alpha2: n[19],
        },
        estimate: LobeEstimate {
            diffuse: n[20],
            reflection: n[21],
            rise: n[22],
        },
    }
}

/// Returns whether the microfacets of a BSDF are Dirac lobes, and its lobes: see
/// [`PackedClass`].
fn model_lobes(model: &BsdfModel<Vec3>) -> (bool, [bool; 7]) {
    match model {
        BsdfModel::Ideal(k) => {
            let [a, b, c] = k.mix.map(|weight| weight > 0.0);
            (false, [a, b, c, false, false, false, false])
        }
        BsdfModel::Translucent(_) => (false, [false; 7]),
        BsdfModel::Disney(k) => {
            let weights = [
                k.opaque,
                k.metallic,
                k.refractive,
                k.coat.strength,
                k.diffuse.subsurface,
            ];
            let [a, b, c, d, e] = weights.map(|weight| weight > 0.0);
            let sheen = k.diffuse.sheen != Vec3::ZERO;
            (k.smooth, [a, b, c, d, e, sheen, k.smooth_glass()])
        }
        BsdfModel::Interface(k) => (k.facets().smooth, [false; 7]),
    }
}

/// Returns whether the microfacets of a BSDF are anisotropic.
fn is_anisotropic(model: &BsdfModel<Vec3>) -> bool {
    let [x, y] = match model {
        BsdfModel::Ideal(_) | BsdfModel::Translucent(_) => return false,
        BsdfModel::Disney(k) => k.ggx.alpha,
        BsdfModel::Interface(k) => k.facets().alpha,
    };
    x != y
}
