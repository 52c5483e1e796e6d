//! Glass: a dielectric that is smooth, rough with either distribution of microfacets [Walter et al.
//! 2007], or a thin pane.

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::interface::{self, Interface};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::Numbers;
use super::outgoing::InterfaceOutgoing;
use super::{LobeSample, MixtureSample, TransportMode, dielectric, fresnel};
use crate::math::real::{Mask, Real, Vector};

/// Glass at a point of a surface, scalar or vectorised; all lanes are panes or none is.
#[derive(Clone, Copy, Debug)]
pub struct Glass<V: Vector = Vec3> {
    /// Square of the factor on light that passes once, as in [`super::dielectric`].
    pub base_color: V,
    /// Factor on reflected light.
    pub specular: V,
    /// Index of the inside relative to the outside.
    pub ior: V::Scalar,
    /// Whether this is a pane without an inside: light passes without being bent, and reflections
    /// between its faces are summed.
    pub thin: bool,
    /// Its microfacets. A thin pane is always smooth.
    pub facets: Facets<V::Scalar>,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Glass<V> {
    #[inline(always)]
    fn tint(&self) -> V {
        self.base_color.sqrt()
    }

    /// Returns value and density of `i` given `out.o`, for `out.o` on the upper side.
    #[inline(always)]
    fn density(&self, out: &InterfaceOutgoing<V>, i: V, mode: TransportMode) -> (V, R) {
        let (o, eta, zero) = (out.o, out.eta, R::splat(0.0));
        let some = o.z().gt(zero) & !self.facets.smooth;
        let (up, down) = (some & i.z().gt(zero), some & i.z().lt(zero));
        let (mut f, mut pdf_w) = (V::splat(zero), zero);
        if up.any() {
            let h = (o + i).normalize_or(V::broadcast(Vec3::Z));
            let r = fresnel::dielectric(o.dot(h).max(zero), eta).reflectance;
            let common = R::splat(0.25) * r * (out.masking * self.facets.d(h));
            let value = self.specular * (common * self.facets.masking_over_cos(i));
            f = V::select(up, value, f);
            pdf_w = R::select(up, common, pdf_w);
        }
        if down.any() {
            let (bent, refraction) = Refraction::between(o, i, eta);
            let facing = out.masking * self.facets.d(refraction.h);
            let common = refraction.direction_density(refraction.transmittance * facing);
            let masking = self.facets.masking_over_cos(V::new(i.x(), i.y(), -i.z()));
            let value = self.tint() * (common * masking * refraction.scale(mode));
            f = V::select(down & bent, value, f);
            pdf_w = R::select(down & bent, common * eta * eta, pdf_w);
        }
        (f, pdf_w)
    }

    /// Samples a direction for `out.o` on the upper side; the mask is set where there is one.
    #[inline(always)]
    fn sample(
        &self,
        out: &InterfaceOutgoing<V>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>) {
        if self.thin {
            return (R::Mask::splat(true), self.through_pane(out.o, u));
        }
        let smooth = self.facets.smooth;
        let (mut valid, mut sample) = (R::Mask::splat(false), MixtureSample::black());
        if smooth.any() {
            let (some, mut s, probability) =
                dielectric::sample(self.base_color, out.eta, out.o, u, mode);
            let reflects = s.eta.eq(R::splat(1.0));
            s.weight = V::select(reflects, s.weight * self.specular, s.weight);
            valid = smooth & some;
            sample = MixtureSample::new(s, probability, R::Mask::splat(true));
        }
        let rough = !smooth;
        if rough.any() {
            let (some, s) = self.sample_facets(out, u, v, mode);
            valid = valid | rough & some;
            sample = MixtureSample::select(rough, s, sample);
        }
        (valid, sample)
    }

    /// Samples reflection or refraction at a microfacet; the mask is set where there is one.
    #[inline(always)]
    fn sample_facets(
        &self,
        out: &InterfaceOutgoing<V>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>) {
        let (o, eta, zero) = (out.o, out.eta, R::splat(0.0));
        let h = self.facets.sample(o, v);
        let reflects = u.lt(fresnel::dielectric(o.dot(h).max(zero), eta).reflectance);
        let (bends, through) = refracted(o, h, eta);
        let wi = V::select(reflects, mirrored(o, h), through);
        let up = wi.z().gt(zero);
        let passes = reflects & up | !reflects & bends & !up;
        let (f, pdf_w) = self.density(out, wi, mode);
        let weight = f * (wi.z().abs() / pdf_w);
        let eta = R::select(reflects, R::splat(1.0), eta);
        (
            passes & pdf_w.gt(zero) & weight.is_finite(),
            MixtureSample::new(LobeSample { wi, weight, eta }, pdf_w, R::Mask::splat(false)),
        )
    }

    /// Samples a thin pane. The sum over reflections between its faces is `R + T^2 R + T^2 R^3 +
    /// ... = 2 R / (1 + R)`.
    #[inline(always)]
    fn through_pane(&self, o: V, u: R) -> MixtureSample<V> {
        let one = R::splat(1.0);
        let denser = self.ior.max(one / self.ior);
        let once = fresnel::dielectric(o.z(), denser).reflectance;
        let r = R::splat(2.0) * once / (one + once);
        let reflects = u.lt(r);
        MixtureSample::new(
            LobeSample {
                wi: V::new(-o.x(), -o.y(), R::select(reflects, o.z(), -o.z())),
                weight: V::select(reflects, self.specular, self.tint()),
                eta: one,
            },
            R::select(reflects, r, one - r),
            R::Mask::splat(true),
        )
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Interface<R> for Glass<V> {
    const OPAQUE: bool = false;

    #[inline(always)]
    fn with_facets(
        class: &BsdfClass,
        m: &MaterialConstants<V>,
        base_color: V,
        facets: Facets<R>,
    ) -> Glass<V> {
        let equal = m.ior.eq(R::splat(1.0)) | R::Mask::splat(class.thin);
        let smooth = facets.smooth | equal;
        Glass {
            base_color,
            specular: m.specular,
            ior: m.ior,
            thin: class.thin,
            facets: Facets { smooth, ..facets },
        }
    }

    #[inline(always)]
    fn body_numbers(&self) -> Vec<R> {
        let [specular, base_color] = [self.specular, self.base_color].map(Numbers::<R>::of_vector);
        [&specular[..], &[self.ior], &base_color].concat()
    }

    #[inline(always)]
    fn load_body(class: &BsdfClass, n: &Numbers<R>, facets: Facets<R>) -> Glass<V> {
        Glass {
            specular: n.vector(2),
            ior: n.get(5),
            base_color: n.vector(6),
            thin: class.thin,
            facets,
        }
    }

    #[inline(always)]
    fn facets(&self) -> &Facets<R> {
        &self.facets
    }

    #[inline(always)]
    fn eta(&self, below: R::Mask) -> R {
        R::select(below, R::splat(1.0) / self.ior, self.ior)
    }

    #[inline(always)]
    fn evaluate<const REVERSE: bool>(
        &self,
        out: &InterfaceOutgoing<V>,
        wi: V,
        i: V,
        mode: TransportMode,
    ) -> (V, [R; 2]) {
        let (f, pdf_w) = self.density(out, i, mode);
        let reverse = if REVERSE {
            interface::pdf_w(self, wi, out.wo())
        } else {
            R::splat(0.0)
        };
        (f, [pdf_w, reverse])
    }

    #[inline(always)]
    fn sample(
        &self,
        out: &InterfaceOutgoing<V>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (some, s) = Glass::sample(self, out, u, v, mode);
        (some, s, None)
    }

    #[inline(always)]
    fn index_inside(&self) -> R {
        if self.thin { R::splat(1.0) } else { self.ior }
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
