//! Glass: a dielectric that is smooth, rough with either distribution of microfacets [Walter et al.
//! 2007], or a thin pane.

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::{LobeSample, MixtureSample, TransportMode, fresnel};
use crate::math::real::{Real, Vector};

/// Glass at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Square of the factor on light that passes once, as in [`super::dielectric`].
    pub base_color: Vec3,
    /// Factor on reflected light.
    pub specular: Vec3,
    /// Index of the inside relative to the outside.
    pub ior: f32,
    /// Whether this is a pane without an inside: light passes without being bent, and reflections
    /// between its faces are summed.
    pub thin: bool,
    /// Its microfacets; `None` if the surface is smooth. A thin pane is always smooth.
    pub facets: Option<Facets>,
}

impl Glass {
    #[inline]
    fn tint(&self) -> Vec3 {
        self.base_color.map(f32::sqrt)
    }

    /// Returns whether sampled directions have a density.
    #[inline]
    pub fn has_density(&self) -> bool {
        self.facets.is_some() && !self.thin
    }

    /// Returns value and density of `i` given `o`, for `o` on the upper side; `eta` is the index of
    /// the lower side relative to the upper one.
    #[inline]
    pub fn density(&self, o: Vec3, i: Vec3, eta: f32, mode: TransportMode) -> (Vec3, f32) {
        let Some(facets) = self
            .facets
            .as_ref()
            .filter(|_| !self.thin && o.z > 0.0 && i.z != 0.0)
        else {
            return (Vec3::ZERO, 0.0);
        };
        if i.z > 0.0 {
            let h = (o + i).normalize_or(Vec3::Z);
            let r = fresnel::dielectric(o.dot(h).max(0.0), eta).reflectance;
            let common = 0.25 * r * facets.pdf_over_dot(o, h);
            return (
                self.specular * (common * facets.masking_over_cos(i)),
                common,
            );
        }
        let (bent, refraction) = Refraction::between(o, i, eta);
        if !bent {
            return (Vec3::ZERO, 0.0);
        }
        let common = refraction
            .direction_density(refraction.transmittance * facets.pdf_over_dot(o, refraction.h));
        let masking = facets.masking_over_cos(Vec3::new(i.x, i.y, -i.z));
        (
            self.tint() * (common * masking * refraction.scale(mode)),
            common * eta * eta,
        )
    }

    /// Samples a direction for `o` on the upper side.
    #[inline]
    pub fn sample(
        &self,
        o: Vec3,
        eta: f32,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<MixtureSample> {
        if self.thin {
            return Some(self.through_pane(o, u));
        }
        let Some(facets) = &self.facets else {
            let (mut s, probability) = super::dielectric::sample(self.base_color, eta, o, u, mode)?;
            if s.eta == 1.0 {
                s.weight *= self.specular;
            }
            return Some(MixtureSample::new(s, probability, true));
        };
        let h = facets.sample(o, v);
        let r = fresnel::dielectric(o.dot(h).max(0.0), eta).reflectance;
        let reflects = u < r;
        let (bends, through) = refracted(o, h, eta);
        let wi = if reflects { mirrored(o, h) } else { through };
        if !(reflects || bends) || (wi.z > 0.0) != reflects {
            return None;
        }
        let (f, pdf_w) = self.density(o, wi, eta, mode);
        let weight = f * (wi.z.abs() / pdf_w);
        let eta = if reflects { 1.0 } else { eta };
        (pdf_w > 0.0 && weight.is_finite())
            .then(|| MixtureSample::new(LobeSample { wi, weight, eta }, pdf_w, false))
    }

    /// Samples a thin pane. The sum over reflections between its faces is `R + T^2 R + T^2 R^3 +
    /// ... = 2 R / (1 + R)`.
    #[inline]
    fn through_pane(&self, o: Vec3, u: f32) -> MixtureSample {
        let once = fresnel::dielectric(o.z, self.ior.max(1.0 / self.ior)).reflectance;
        let r = 2.0 * once / (1.0 + once);
        if u < r {
            let wi = Vec3::new(-o.x, -o.y, o.z);
            return MixtureSample::new(
                LobeSample {
                    wi,
                    weight: self.specular,
                    eta: 1.0,
                },
                r,
                true,
            );
        }
        MixtureSample::new(
            LobeSample {
                wi: -o,
                weight: self.tint(),
                eta: 1.0,
            },
            1.0 - r,
            true,
        )
    }
}

/// Refraction at a microfacet from `o` on the upper side to `i` on the lower one [Walter et al.
/// 2007, equations 17 and 21], the basis of every rough refractive lobe.
#[derive(Clone, Copy, Debug)]
pub struct Refraction<V: Vector = Vec3> {
    /// Normal of the microfacet, on the upper side.
    pub h: V,
    /// Fresnel transmittance of the microfacet.
    pub transmittance: V::Scalar,
    /// Cosines of `o` and `i` with `h`.
    dot: [V::Scalar; 2],
    /// Index of the lower side relative to the upper one.
    eta: V::Scalar,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Refraction<V> {
    /// Finds the microfacet that refracts `o` into `i`; the mask is set where there is one. `eta`
    /// is the index of the lower side relative to the upper one.
    #[inline(always)]
    pub fn between(o: V, i: V, eta: R) -> (R::Mask, Refraction<V>) {
        let zero = R::splat(0.0);
        let h = (o + i * eta).normalize_or(V::broadcast(Vec3::Z));
        let h = V::select(h.z().lt(zero), -h, h);
        let dot = [o.dot(h), i.dot(h)];
        let transmittance = R::splat(1.0) - fresnel::dielectric(dot[0], eta).reflectance;
        (
            !(dot[0].le(zero) | dot[1].ge(zero)),
            Refraction {
                h,
                transmittance,
                dot,
                eta,
            },
        )
    }

    /// Converts a density of facets over the cosine of `o` to a density of directions `i` per solid
    /// angle, without the factor `eta^2`.
    #[inline(always)]
    pub fn direction_density(&self, density: R) -> R {
        let [dot_o, dot_i] = self.dot;
        let bend = dot_o + self.eta * dot_i;
        density * dot_o * -dot_i / (bend * bend)
    }

    /// Returns the factor of the transport mode: radiance is compressed into `1 / eta^2` of the
    /// solid angle of importance.
    #[inline(always)]
    pub fn scale(&self, mode: TransportMode) -> R {
        match mode {
            TransportMode::Radiance => R::splat(1.0),
            TransportMode::Importance => self.eta * self.eta,
        }
    }
}

/// Returns the direction refracted at `h`; the mask is set where there is one. The tangential part
/// is computed from the vectors rather than from their cosine, which has no digits of it near the
/// normal, so the result is a unit vector even under strong refraction.
#[inline(always)]
pub fn refracted<R: Real, V: Vector<Scalar = R>>(o: V, h: V, eta: R) -> (R::Mask, V) {
    let along = (h * o.dot(h) - o) / eta;
    let cos2_t = R::splat(1.0) - along.length_squared();
    (cos2_t.gt(R::splat(0.0)), along - h * cos2_t.sqrt())
}
