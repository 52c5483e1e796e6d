//! A step of up to eight paths in the lanes of one vector.

use glam::Vec3;

use super::lamps::{Direct, Lamps};
use super::table::{Common, Table};
use super::{SPECULAR, Tile, Waiting, each, filled, set, stored};
use crate::math::Frame;
use crate::math::lanes::{LANES, Reals, Row, Vectors, Words, Yes, transposed};
use crate::math::real::{Mask, Real, Vector, Word};
use crate::scene::CompiledScene;
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::clearcoat::Clearcoat;
use crate::transport::bsdf::diffuse::Diffuse;
use crate::transport::bsdf::disney::{Disney, Estimate, View};
use crate::transport::bsdf::ggx::Ggx;
use crate::transport::bsdf::{BsdfValue, Mode, adjoint};
use crate::transport::integrator::Context;
use crate::transport::ray::{Ray, offset_by_axis};
use crate::transport::sampler::Independent;
use crate::transport::surface::Point;
use crate::transport::vertex::towards;

/// A BSDF in rows, for [`bsdfs`].
pub(super) fn rows_of(d: &Disney) -> [Row; 3] {
    let (c, sheen, tinted) = (d.base_color, d.diffuse.sheen, d.tinted_f0.unwrap_or_default());
    let Estimate { diffuse, reflection, rise } = d.estimate;
    [
        Row([c.x, c.y, c.z, d.opaque, d.metallic, d.refractive, d.ior, d.diffuse.roughness]),
        Row([d.ggx.alpha[0], d.diffuse.subsurface, sheen.x, sheen.y, sheen.z, tinted.x, tinted.y, tinted.z]),
        Row([d.coat.strength, d.coat.alpha, diffuse, reflection, rise, 0.0, 0.0, 0.0]),
    ]
}

/// The BSDFs that eight materials have.
#[inline(always)]
fn bsdfs(rows: [&[Row; 3]; LANES], common: &Common) -> Disney<Vectors> {
    let a = transposed(rows.map(|r| &r[0]));
    let b = transposed(rows.map(|r| &r[1]));
    let c = transposed(rows.map(|r| &r[2]));
    let base_color = Vectors::new(a[0], a[1], a[2]);
    Disney {
        base_color,
        opaque: a[3],
        metallic: a[4],
        refractive: a[5],
        ior: a[6],
        tinted_f0: common.tinted.then(|| Vectors::new(b[5], b[6], b[7])),
        diffuse: Diffuse { base_color, roughness: a[7], subsurface: b[1], sheen: Vectors::new(b[2], b[3], b[4]) },
        ggx: Ggx { alpha: [b[0]; 2] },
        smooth: common.smooth,
        coat: Clearcoat { strength: c[0], alpha: c[1] },
        estimate: Estimate { diffuse: c[2], reflection: c[3], rise: c[4] },
    }
}

/// Three vectors of each lane.
#[inline(always)]
fn three_vectors(of: [&[Vec3; 3]; LANES]) -> [Vectors; 3] {
    let rows: [Row; LANES] = std::array::from_fn(|lane| {
        let [a, b, c] = *of[lane];
        Row([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y])
    });
    let last = Reals::load(&Row(std::array::from_fn(|lane| of[lane][2].z)));
    let [ax, ay, az, bx, by, bz, cx, cy] = transposed(rows.each_ref());
    [Vectors::new(ax, ay, az), Vectors::new(bx, by, bz), Vectors::new(cx, cy, last)]
}

/// Where rays, given by origin and direction, have met primitives.
#[inline(always)]
pub(super) fn points(
    scene: &CompiledScene,
    sphere: bool,
    primitives: [u32; LANES],
    [origin, dir]: [Vectors; 2],
    [t, v, w]: [Reals; 3],
) -> Point<Vectors> {
    if sphere {
        let rows: [Row; LANES] = std::array::from_fn(|lane| {
            let s = &scene.spheres[primitives[lane] as usize - scene.triangles.len()];
            Row([s.center.x, s.center.y, s.center.z, s.radius, 0.0, 0.0, 0.0, 0.0])
        });
        let [x, y, z, radius, ..] = transposed(rows.each_ref());
        return Point::on_sphere(Vectors::new(x, y, z), radius, origin + dir * t, dir);
    }
    let corners = three_vectors(each(primitives, |p| &scene.triangles[p as usize]));
    let normals = three_vectors(each(primitives, |p| &scene.attributes[p as usize].normals));
    Point::on_triangle(corners, normals, [v, w], dir)
}

/// Points of surfaces to which paths have come, with what their BSDFs know of the directions from there.
pub(super) struct Vertices {
    pub point: Point<Vectors>,
    pub frame: Frame<Vectors>,
    /// Whether the shading normal is that of the real surface.
    flat: Yes,
    pub bsdf: Disney<Vectors>,
    pub view: View<Vectors>,
    /// Unit direction to where the path came from.
    pub wo: Vectors,
    /// Its cosine with the shading normal.
    pub cos_o: Reals,
    /// Whether the surface shows anything towards it.
    pub seen: Yes,
}

impl Vertices {
    /// On surfaces of one class whose materials have these rows; where `active` is not set nothing is seen.
    #[inline(always)]
    pub fn new(point: Point<Vectors>, wo: Vectors, rows: [&[Row; 3]; LANES], common: &Common, active: Yes) -> Vertices {
        let bsdf = bsdfs(rows, common);
        let frame = Frame::from_normal(point.n_shading);
        let local = frame.to_local(wo);
        let view = bsdf.view(local);
        let flat = point.n_shading.same(point.n_geometric);
        let vertices = Vertices { point, frame, flat, bsdf, view, wo, cos_o: local.z(), seen: active };
        Vertices { seen: active & vertices.agree(wo, local.z()), ..vertices }
    }

    /// As `Bsdf::agrees`, in each lane.
    #[inline(always)]
    pub fn agree(&self, w: Vectors, cos: Reals) -> Yes {
        let zero = Reals::of(0.0);
        self.flat & !cos.eq(zero) | !self.flat & (w.dot(self.point.n_geometric) * cos).gt(zero)
    }

    /// The correction of shading normals for light that comes from `wo` and leaves into `wi`.
    #[inline(always)]
    pub fn adjoint(&self, wi: Vectors, cos_i: Reals) -> Reals {
        let factor = adjoint(self.point.n_geometric, [self.wo, wi], [self.cos_o, cos_i]);
        Reals::select(self.flat, Reals::of(1.0), factor)
    }

    /// As `Bsdf::evaluate_from` in the lanes that want it, and as `Bsdf::evaluate_forward` without `REVERSE`.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(&self, wi: Vectors, mode: Mode, wanted: Yes) -> BsdfValue<Vectors> {
        let zero = Reals::of(0.0);
        let black = Vectors::of(Vec3::ZERO);
        let n = self.point.n_shading;
        let cos_i = wi.dot(n);
        let same = (self.cos_o * cos_i).gt(zero);
        let (mut f, [mut pdf_w, mut reverse]) = self.bsdf.evaluate_round::<REVERSE>(&self.view, self.wo, wi, n, cos_i);
        let through = wanted & !same;
        if through.any() && self.bsdf.refractive.gt(zero).any() {
            let (other, [other_w, back]) = self.bsdf.evaluate::<REVERSE>(&self.view, self.frame.to_local(wi), mode);
            (f, pdf_w) = (Vectors::select(same, f, other), Reals::select(same, pdf_w, other_w));
            reverse = Reals::select(same, reverse, back);
        } else {
            (f, pdf_w) = (Vectors::select(same, f, black), Reals::select(same, pdf_w, zero));
            reverse = Reals::select(same, reverse, zero);
        }
        if mode == Mode::Importance {
            f = f * self.adjoint(wi, cos_i);
        }
        let lets = wanted & self.seen & self.agree(wi, cos_i);
        BsdfValue {
            f: Vectors::select(lets, f, black),
            pdf_w: Reals::select(lets, pdf_w, zero),
            reverse_pdf_w: Reals::select(lets, reverse, zero),
        }
    }
}

/// Rays between points of surfaces, given by position and normal; or from them into the directions `wi` where the other end
/// has no place. In rows: origin, direction, distance.
#[inline(always)]
pub(super) fn shadow_rays(
    [from, n]: [Vectors; 2],
    [at, n_at]: [Vectors; 2],
    wi: Vectors,
    endless: Yes,
) -> [Row; LANES] {
    let edge = at - from;
    let origin = offset_by_axis(from, towards(n, Vectors::select(endless, wi, edge)));
    let target = offset_by_axis(at, towards(n_at, -edge));
    let edge = target - origin;
    let distance = edge.length();
    let dir = Vectors::select(endless, wi, edge / distance);
    let distance = Reals::select(endless, Reals::of(f32::INFINITY), distance);
    stored([origin.x(), origin.y(), origin.z(), dir.x(), dir.y(), dir.z(), distance, Reals::of(0.0)])
}

/// The ray of a row of [`shadow_rays`], and how far it goes.
#[inline]
pub(super) fn shadow_ray(row: &Row) -> (Ray, f32) {
    let [x, y, z, dx, dy, dz, distance, _] = row.0;
    (Ray { origin: Vec3::new(x, y, z), dir: Vec3::new(dx, dy, dz) }, distance)
}

/// The step of paths that have met surfaces of one class; those that go on are named in `tile.next`.
pub(super) fn step(table: &Table, common: Common, context: &Context, depth: u32, paths: &[u32], tile: &mut Tile) {
    #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
    // SAFETY: streams are made only where the processor has AVX2.
    unsafe {
        step_avx2(table, common, context, depth, paths, tile);
    }
}

#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn step_avx2(table: &Table, common: Common, context: &Context, depth: u32, paths: &[u32], tile: &mut Tile) {
    for group in paths.chunks(LANES) {
        // Lanes that have no path do again what the first has, for nothing.
        let lanes = each(filled(group), |path| path as usize);
        step_of_eight(table, common, context, depth, lanes, group.len(), tile);
    }
}

#[inline(always)]
fn step_of_eight(
    table: &Table,
    common: Common,
    context: &Context,
    depth: u32,
    lanes: [usize; LANES],
    count: usize,
    tile: &mut Tile,
) {
    let zero = Reals::of(0.0);
    let records = each(lanes, |i| &tile.records[i]);
    let way = transposed(each(records, |r| &r.rows[0]));
    let state = transposed(each(records, |r| &r.rows[1]));
    let met = transposed(each(records, |r| &r.rows[2]));
    let (origin, dir) = (Vectors::new(way[0], way[1], way[2]), Vectors::new(way[3], way[4], way[5]));
    let throughput = Vectors::new(way[6], way[7], state[0]);
    let key = [met[4].bits(), met[5].bits(), met[6].bits(), met[7].bits()];
    let mut taken = state[6].bits();
    let primitives = each(records, |r| r.rows[2].0[3].to_bits());
    let active = Yes::first(count);

    let point = points(context.scene, common.sphere, primitives, [origin, dir], [met[0], met[1], met[2]]);
    let rows = each(primitives, |p| &table.rows[table.row_of[p as usize] as usize]);
    let vertices = Vertices::new(point, -dir, rows, &common, active);

    if common.joined {
        let numbers = Independent::next_three(key, taken);
        taken = taken.add(Words::of(3));
        connect(context, &table.lamps, &vertices, throughput, numbers, lanes, &mut tile.waiting);
    }

    let [choice, u, v] = Independent::next_three(key, taken);
    taken = taken.add(Words::of(3));
    let (some, s, _) = vertices.bsdf.sample::<false>(&vertices.view, choice, [u, v], Mode::Radiance);
    let wi = vertices.frame.to_world(s.sample.wi);
    let mut on = vertices.seen & some & s.pdf_w.gt(zero) & vertices.agree(wi, s.sample.wi.z());
    let mut throughput = throughput * s.sample.weight;
    let eta_scale = state[5] * (s.sample.eta * s.sample.eta);
    if context.rr_start.is_some_and(|start| depth >= start) {
        let most = throughput.x().max(throughput.y()).max(throughput.z());
        let survival = (most * eta_scale).min(Reals::of(MAX_SURVIVAL));
        let [u, ..] = Independent::next_three(key, taken);
        taken = taken.add(Words::of(1));
        on = on & u.lt(survival);
        throughput = throughput / survival;
    }
    on = on & !throughput.same(Vectors::of(Vec3::ZERO));
    let last = Reals::select(s.delta, Reals::of(SPECULAR), s.pdf_w);
    let from = vertices.point.position;
    let start = offset_by_axis(from, towards(vertices.point.n_geometric, wi));
    let way = [start.x(), start.y(), start.z(), wi.x(), wi.y(), wi.z(), throughput.x(), throughput.y()];
    let state = [throughput.z(), from.x(), from.y(), from.z(), last, eta_scale, taken.as_bits(), zero];
    let (way, state) = (stored(way), stored(state));
    for i in set(on.bits()) {
        tile.records[lanes[i]].rows[0] = way[i];
        tile.records[lanes[i]].rows[1] = state[i];
        tile.next.push(lanes[i] as u32);
    }
}

/// Joins each vertex to a sampled point of a light: as `nee` does, but that the shadow ray waits.
#[inline(always)]
fn connect(
    context: &Context,
    lamps: &Lamps,
    vertices: &Vertices,
    throughput: Vectors,
    numbers: [Reals; 3],
    lanes: [usize; LANES],
    waiting: &mut Vec<Waiting>,
) {
    let zero = Reals::of(0.0);
    let Point { position: from, n_geometric, n_shading } = vertices.point;
    let direct = lamps.direct(context, from, numbers, vertices.seen);
    let Direct { wi, radiance, density, .. } = direct;
    let arrives = vertices.seen & density.gt(zero);
    if !arrives.any() {
        return;
    }
    let BsdfValue { f, pdf_w, .. } = vertices.evaluate::<false>(wi, Mode::Radiance, arrives);
    let radiance = f * wi.dot(n_shading).abs() * radiance / density;
    let lit = arrives & !radiance.same(Vectors::of(Vec3::ZERO));
    let weight = match context.settings.mis {
        Some(h) => Reals::select(direct.delta, Reals::of(1.0), h.weight(density, pdf_w)),
        None => Reals::of(1.0),
    };
    let value = throughput * radiance * weight;
    let rays = shadow_rays([from, n_geometric], [direct.at, direct.normal], wi, direct.endless);
    let values = stored([value.x(), value.y(), value.z(), zero, zero, zero, zero, zero]);
    for i in set(lit.bits()) {
        let (ray, distance) = shadow_ray(&rays[i]);
        let [r, g, b, ..] = values[i].0;
        waiting.push(Waiting { ray, distance, value: Vec3::new(r, g, b), path: lanes[i] as u32 });
    }
}
