//! BSDFs in the lanes of every width have the same bits as scalar ones: for materials without and
//! with textures, for every model, both transport modes and both normals.

use glam::Vec3;
use lumbre_light::math::real::{Mask, Vector};
use lumbre_light::math::simd::{Lanes, SimdKernel, Width, dispatch, map_array, padded};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::compile::{Interface, Material, Model};
use lumbre_light::transport::bsdf::{Bsdf, Orientation, PackedBsdf, TransportMode};
use lumbre_light::transport::surface::{ShadingParameters, Surface, TerminatorOffset};

use crate::common::WHITE;
use crate::render::bsdf_grid::{
    DISNEY, NORMAL, grids, interfaces, one_sided, sheets, surface, uniform,
};

/// Numbers that a case yields: for each mode 5 of the value, 4 without the reverse density, 2 x 11
/// of samples; index ratio, and whether there is a density.
const RESULTS: usize = 2 * (5 + 4 + 22) + 2;

/// Number of cases per material: no multiple of a width.
const CASES: usize = 85;

/// A point of a surface with two directions and random numbers.
#[derive(Clone, Copy)]
struct Case {
    material: Material,
    wo: Vec3,
    wi: Vec3,
    u: [f32; 3],
    n_shading: Vec3,
    tangent: Vec3,
    terminator: bool,
}

/// Returns cases with each of the materials in turn, half of the directions sampled from the other.
fn cases(materials: &[Material]) -> Vec<Case> {
    let case = |i: usize| {
        let [a, b, c, d] = uniform(i as u32, 61);
        let [u, v, w, bend] = uniform(i as u32, 62);
        let bent = if bend < 0.5 {
            NORMAL
        } else {
            (NORMAL + uniform_sphere([bend, u]) * 0.8).normalize_or(NORMAL)
        };
        let mut case = Case {
            material: materials[i % materials.len()],
            wo: uniform_sphere([a, b]),
            wi: uniform_sphere([c, d]),
            u: [u, v, w],
            n_shading: bent,
            tangent: surface(&WHITE).tangent,
            terminator: i.is_multiple_of(5),
        };
        if i.is_multiple_of(7) {
            case.tangent = Vec3::ZERO;
        }
        let sampled = case
            .bsdf()
            .sample(case.wo, v, [w, u], TransportMode::Radiance);
        if let Some(s) = sampled.filter(|_| i.is_multiple_of(2)) {
            case.wi = s.wi;
        }
        case
    };
    (0..CASES).map(case).collect()
}

impl Case {
    fn bsdf(&self) -> Bsdf {
        let offset = TerminatorOffset {
            exists: true,
            base: Vec3::ZERO,
            lifted_point: NORMAL,
            up: NORMAL,
            lifted: false,
        };
        let point = Surface {
            n_shading: self.n_shading,
            tangent: self.tangent,
            terminator: self.terminator.then_some(offset),
            ..surface(&self.material)
        };
        Bsdf::new(&point, &[])
    }

    /// Returns the results of the scalar functions.
    fn results(&self) -> Vec<f32> {
        let b = self.bsdf();
        let out = b.outgoing(self.wo);
        let [u, v, w] = self.u;
        let mut all = Vec::new();
        for mode in [TransportMode::Radiance, TransportMode::Importance] {
            let value = b.values::<true>(&out, self.wi, mode, true);
            all.extend(value.f.to_array());
            all.extend([value.pdf_w, value.reverse_pdf_w]);
            let forward = b.values::<false>(&out, self.wi, mode, true);
            all.extend(forward.f.to_array());
            all.push(forward.pdf_w);
            let forward = b.sample_from(&out, u, [v, w], mode).map(|s| (s, 0.0));
            let (some, s, reverse) = b.samples::<true>(&out, u, [v, w], mode);
            let both = (out.same_side && some).then_some((s, reverse));
            for sampled in [both, forward] {
                let Some((s, reverse)) = sampled else {
                    all.extend([0.0; 11]);
                    continue;
                };
                all.extend(s.wi.to_array());
                all.extend(s.weight.to_array());
                all.extend([s.pdf_w, s.eta, reverse]);
                all.extend([f32::from(u8::from(s.delta)), 1.0]);
            }
        }
        all.push(b.index_ratio(self.wo, self.wi));
        all.push(f32::from(u8::from(b.has_density())));
        all
    }
}

/// Evaluates and samples the BSDFs of cases whose materials share a class; `varies` if their
/// parameters are those of textures.
struct Evaluate<'a> {
    cases: &'a [Case],
    varies: bool,
}

impl SimdKernel for Evaluate<'_> {
    type Output = Vec<Vec<f32>>;

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) -> Vec<Vec<f32>> {
        let mut all = Vec::new();
        for group in self.cases.chunks(N) {
            let columns = map_array(lanes_of::<R, N>(padded(group), self.varies), R::store);
            all.extend((0..group.len()).map(|i| columns.iter().map(|c| c[i]).collect()));
        }
        all
    }
}

/// Loads one vector per lane.
#[inline(always)]
fn load<R: Lanes<N>, const N: usize>(v: [Vec3; N]) -> R::Vec3 {
    R::Vec3::new(
        R::load(&v.map(|v| v.x)),
        R::load(&v.map(|v| v.y)),
        R::load(&v.map(|v| v.z)),
    )
}

/// Returns the results of one case per lane.
#[inline(always)]
fn lanes_of<R: Lanes<N>, const N: usize>(cases: [Case; N], varies: bool) -> [R; RESULTS] {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let packed = cases.map(|c| PackedBsdf::new(&c.material, varies));
    let at = Orientation {
        n_geometric: R::Vec3::broadcast(NORMAL),
        n_shading: load::<R, N>(cases.map(|c| c.n_shading)),
        tangent: Some(load::<R, N>(cases.map(|c| c.tangent))),
        terminator: R::load(&cases.map(|c| f32::from(u8::from(c.terminator)))).gt(zero),
    };
    let values = cases.map(|c| ShadingParameters::of(&c.material));
    let parameters = ShadingParameters {
        base_color: load::<R, N>(values.map(|p| p.base_color)),
        roughness: R::load(&values.map(|p| p.roughness)),
        metallic: R::load(&values.map(|p| p.metallic)),
        opacity: R::load(&values.map(|p| p.opacity)),
    };
    let parameters = varies.then_some(&parameters);
    let b = Bsdf::<R>::unpack(&at, &packed[0].class, packed.each_ref(), parameters);
    let (wo, wi) = (
        load::<R, N>(cases.map(|c| c.wo)),
        load::<R, N>(cases.map(|c| c.wi)),
    );
    let [u, v, w] = [0, 1, 2].map(|k| R::load(&cases.map(|c| c.u[k])));
    let (out, every) = (b.outgoing(wo), R::Mask::splat(true));
    let mut all = [zero; RESULTS];
    let mut at = 0;
    let mut put = |values: &[R]| {
        all[at..at + values.len()].copy_from_slice(values);
        at += values.len();
    };
    for mode in [TransportMode::Radiance, TransportMode::Importance] {
        let value = b.values::<true>(&out, wi, mode, every);
        put(&[value.f.x(), value.f.y(), value.f.z()]);
        put(&[value.pdf_w, value.reverse_pdf_w]);
        let value = b.values::<false>(&out, wi, mode, every);
        put(&[value.f.x(), value.f.y(), value.f.z(), value.pdf_w]);
        let both = [
            b.samples::<true>(&out, u, [v, w], mode),
            b.samples::<false>(&out, u, [v, w], mode),
        ];
        for (some, s, reverse) in both {
            let found = R::select(some, one, zero);
            let delta = R::select(s.delta, one, zero);
            let numbers = [
                s.wi.x(),
                s.wi.y(),
                s.wi.z(),
                s.weight.x(),
                s.weight.y(),
                s.weight.z(),
                s.pdf_w,
                s.eta,
                reverse,
                delta,
                found,
            ];
            put(&map_array(numbers, |x| R::select(some, x, zero)));
        }
    }
    put(&[b.index_ratio(wo, wi), R::select(b.has_density(), one, zero)]);
    all
}

/// Panics unless the cases have the same bits in lanes of every width as in scalar form.
fn assert_same_bits(cases: &[Case], varies: bool) {
    let expected: Vec<Vec<f32>> = cases.iter().map(Case::results).collect();
    for width in Width::all() {
        let found = dispatch(width, Evaluate { cases, varies });
        for ((case, expected), found) in cases.iter().zip(&expected).zip(found) {
            let differing = expected
                .iter()
                .zip(&found)
                .position(|(a, b)| a.to_bits() != b.to_bits());
            assert_eq!(
                differing, None,
                "{width:?}, varies {varies}: {expected:?} instead of {found:?} for {:?}",
                case.material
            );
        }
    }
}

/// Returns smooth and ideal materials, which the grids lack, thin panes, and one-sided materials.
fn more() -> Vec<Material> {
    let mut all = Vec::new();
    for (metallic, opacity) in [(0.0, 1.0), (1.0, 1.0), (0.0, 0.0), (0.3, 0.4)] {
        for model in [Model::Lambert, Model::Disney] {
            all.push(Material {
                model,
                metallic,
                opacity,
                roughness: 0.0,
                ..DISNEY
            });
        }
    }
    for m in interfaces() {
        all.push(Material {
            roughness: 0.0,
            ..m
        });
        let interface = Interface {
            thin: true,
            nonlinear: false,
            ..m.interface
        };
        all.push(Material { interface, ..m });
    }
    all.extend(one_sided());
    all.extend(sheets());
    all
}

#[test]
fn every_material_has_the_same_bits_in_lanes_of_every_width() {
    let mut all = grids();
    all.extend(interfaces());
    all.extend(more());
    for m in all {
        let other = Material {
            base_color: Vec3::new(0.1, 0.9, 0.6),
            ior: m.ior * 1.1,
            ..m
        };
        let shared = PackedBsdf::new(&m, false).class == PackedBsdf::new(&other, false).class;
        assert_same_bits(
            &cases(&if shared { vec![m, other] } else { vec![m] }),
            false,
        );
    }
}

/// Lanes differ in roughness, so that some are smooth, and in the weights of their lobes.
#[test]
fn every_texture_of_a_material_has_the_same_bits_in_lanes_of_every_width() {
    let mut all = grids();
    all.extend(interfaces());
    all.extend(more());
    for (k, m) in all.into_iter().enumerate() {
        let texel = |i: u32| {
            let [r, g, b, t] = uniform(i, 63 + k as u32);
            let step = |x: f32| (x * 1.5 - 0.25).clamp(0.0, 1.0);
            Material {
                base_color: Vec3::new(r, g, b),
                roughness: step(t) * 0.6,
                metallic: step(r),
                opacity: step(g),
                transmittance: Vec3::new(step(b), step(r), step(t)),
                ..m
            }
        };
        let materials: Vec<Material> = (0..CASES as u32).map(texel).collect();
        assert_same_bits(&cases(&materials), true);
    }
}
