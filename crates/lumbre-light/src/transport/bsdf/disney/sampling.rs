//! Sampling of the Disney BSDF: the choice of a lobe, a direction in it, and the weight and density
//! of the whole mixture.

use super::super::facets::mirrored;
use super::super::glass::refracted;
use super::super::outgoing::DisneyOutgoing;
use super::super::{LobeSample, MixtureSample, TransportMode, dielectric, flipped, fresnel};
use super::{DirectionPair, Disney};
use crate::math::real::{Mask, Real, Vector};
use crate::math::warp;

/// The lobe that each lane samples; every valid lane is in exactly one of the other masks.
struct LobeChoice<M> {
    /// Lanes in which any lobe reflects.
    valid: M,
    diffuse: M,
    reflection: M,
    glass: M,
    coat: M,
}

/// A sampled direction before the weight and density of the mixture are known.
struct Candidate<R: Real> {
    /// Lanes that still have a sample.
    valid: R::Mask,
    /// Lanes that sampled a Dirac lobe.
    delta: R::Mask,
    /// The sample of those lanes.
    dirac: MixtureSample<R::Vec3>,
    /// The direction of the other lanes.
    wi: R::Vec3,
    /// Lanes whose direction may lie on the lower side.
    below: R::Mask,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Disney<V> {
    /// Samples a direction: `u` selects a lobe, `v` a direction in it; the weight is that of the
    /// whole mixture. The mask is set where there is a sample. With `REVERSE` also returns the
    /// density of `wo` given the direction, else zero; for Dirac lobes it is zero.
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(
        &self,
        out: &DisneyOutgoing<V>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, R) {
        let zero = R::splat(0.0);
        let lobe = out.choose_lobe(u);
        let mut s = Candidate {
            valid: lobe.valid,
            delta: R::Mask::splat(false),
            dirac: MixtureSample::black(),
            wi: out.o,
            below: R::Mask::splat(false),
        };
        if lobe.diffuse.any() {
            s.wi = V::select(lobe.diffuse, warp::cosine_hemisphere(v), s.wi);
        }
        if lobe.reflection.any() {
            self.sample_reflection(out, v, lobe.reflection, &mut s);
        }
        if lobe.glass.any() {
            self.sample_glass(out, u, v, mode, lobe.glass, &mut s);
        }
        if lobe.coat.any() {
            let h = self.coat.sample(v);
            s.valid = s.valid & (out.o.dot(h).gt(zero) | !lobe.coat);
            s.wi = V::select(lobe.coat, mirrored(out.o, h), s.wi);
        }
        s.valid = s.valid & (s.delta | s.below | s.wi.z().gt(zero));
        let rough = s.valid & !s.delta;
        let (mut local, mut reverse) = (s.dirac, zero);
        if rough.any() {
            let (usable, finished, back) = self.finish::<REVERSE>(out, s.wi, mode);
            s.valid = s.valid & (usable | !rough);
            (local, reverse) = (
                MixtureSample::select(rough, finished, s.dirac),
                R::select(rough, back, zero),
            );
        }
        (s.valid, out.onto_side_of_wo(local), reverse)
    }

    /// Samples the specular reflection in the given lanes.
    #[inline(always)]
    fn sample_reflection(
        &self,
        out: &DisneyOutgoing<V>,
        v: [R; 2],
        lanes: R::Mask,
        s: &mut Candidate<R>,
    ) {
        let (o, probability) = (out.o, out.choice.reflection);
        let rough = lanes & !self.smooth;
        if rough.any() {
            s.wi = V::select(rough, mirrored(o, self.ggx.sample(o, v)), s.wi);
        }
        let smooth = lanes & self.smooth;
        if !smooth.any() {
            return;
        }
        let weight =
            self.opaque_reflectance(o.z()) / probability * self.coat.transmittance(o.z(), o.z());
        let wi = V::new(-o.x(), -o.y(), o.z());
        s.dirac = MixtureSample::new(
            LobeSample {
                wi,
                weight,
                eta: R::splat(1.0),
            },
            probability,
            R::Mask::splat(true),
        );
        s.delta = smooth;
    }

    /// Samples the refractive dielectric in the given lanes.
    #[inline(always)]
    fn sample_glass(
        &self,
        out: &DisneyOutgoing<V>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
        lanes: R::Mask,
        s: &mut Candidate<R>,
    ) {
        let zero = R::splat(0.0);
        let (o, eta, c) = (out.o, out.eta, &out.choice);
        let rest = ((u - c.diffuse - c.reflection) / c.glass).clamp(0.0, 1.0);
        let smooth = lanes & self.smooth_glass();
        if smooth.any() {
            let (passes, sample) = self.smooth_refraction(out, rest, mode);
            s.valid = s.valid & (passes | !smooth);
            s.dirac = MixtureSample::select(smooth, sample, s.dirac);
            s.delta = s.delta | smooth;
        }
        let lanes = lanes & !smooth;
        if !lanes.any() {
            return;
        }
        let h = self.ggx.sample(o, v);
        let reflects = rest.lt(fresnel::dielectric(o.dot(h).max(zero), eta).reflectance);
        let (bends, through) = refracted(o, h, eta);
        let sampled = V::select(reflects, mirrored(o, h), through);
        let up = sampled.z().gt(zero);
        let usable = reflects & up | !reflects & bends & !up;
        s.valid = s.valid & (usable | !lanes);
        s.wi = V::select(lanes, sampled, s.wi);
        s.below = lanes & !reflects;
    }

    /// Computes weight and density of the whole mixture for a sampled direction and, with
    /// `REVERSE`, the density of `wo` given it. The mask is set where the sample is usable.
    #[inline(always)]
    fn finish<const REVERSE: bool>(
        &self,
        out: &DisneyOutgoing<V>,
        i: V,
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, R) {
        let zero = R::splat(0.0);
        let up = i.z().gt(zero);
        let (mut f, mut pdf_w, mut reverse) = (V::splat(zero), zero, zero);
        if up.any() {
            let pair = DirectionPair::new(&self.ggx, out.o, i);
            let (value, pdf) = self.reflected::<REVERSE>(out, &pair);
            (f, pdf_w, reverse) = (value, pdf[0], pdf[1]);
        }
        let down = !up;
        if down.any() {
            let (value, density) = self.transmitted(out, i, mode);
            (f, pdf_w) = (V::select(up, f, value), R::select(up, pdf_w, density));
            if REVERSE {
                let wi = V::select(out.below, flipped(i), i);
                reverse = R::select(
                    up,
                    reverse,
                    R::select(i.z().lt(zero), self.pdf_w(wi, out.wo()), zero),
                );
            }
        }
        let weight = f * (i.z().abs() / pdf_w);
        let eta = R::select(i.z().lt(zero), out.eta, R::splat(1.0));
        let usable = pdf_w.gt(zero) & weight.is_finite();
        (
            usable,
            MixtureSample::new(
                LobeSample { wi: i, weight, eta },
                pdf_w,
                R::Mask::splat(false),
            ),
            reverse,
        )
    }

    /// Samples reflection or refraction at the smooth dielectric with the weight of the mixture.
    #[inline(always)]
    fn smooth_refraction(
        &self,
        out: &DisneyOutgoing<V>,
        u: R,
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>) {
        let (o, glass) = (out.o, out.choice.glass);
        let (some, mut s, probability) = dielectric::sample(self.base_color, out.eta, o, u, mode);
        let mut coat = self.coat.transmittance(o.z(), s.wi.z());
        if self.one_sided {
            // Light that is reflected at the back does not pass the coat.
            let inside = out.below & s.wi.z().gt(R::splat(0.0));
            coat = R::select(inside, R::splat(1.0), coat);
        }
        s.weight = s.weight * (self.refractive / glass * coat);
        (
            some,
            MixtureSample::new(s, glass * probability, R::Mask::splat(true)),
        )
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> DisneyOutgoing<V> {
    /// Selects a lobe in each lane by `u`.
    #[inline(always)]
    fn choose_lobe(&self, u: R) -> LobeChoice<R::Mask> {
        let zero = R::splat(0.0);
        let (o, c) = (self.o, &self.choice);
        let (to_reflection, to_glass) =
            (c.diffuse + c.reflection, c.diffuse + c.reflection + c.glass);
        let valid = o.z().gt(zero) & to_glass.gt(zero) | o.z().gt(zero) & c.coat.gt(zero);
        let rest = valid & !u.lt(c.diffuse) & !u.lt(to_reflection);
        let glass = rest & (u.lt(to_glass) | c.coat.le(zero));
        LobeChoice {
            valid,
            diffuse: valid & u.lt(c.diffuse),
            reflection: valid & !u.lt(c.diffuse) & u.lt(to_reflection),
            glass,
            coat: rest & !glass,
        }
    }
}
