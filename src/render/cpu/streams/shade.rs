//! A step of as many paths as there are lanes.

use glam::Vec3;

use super::clock;
use super::lamps::{Direct, Lamps};
use super::table::{Common, Table};
use super::{SPECULAR, Tile, Waiting};
use crate::math::Frame;
use crate::math::lanes::{AnyWidth, Lanes, Row, each, filled, set};
use crate::math::real::{Double, Mask, Real, Vector, Word};
use crate::scene::CompiledScene;
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::clearcoat::Clearcoat;
use crate::transport::bsdf::diffuse::Diffuse;
use crate::transport::bsdf::disney::{Disney, Estimate, View};
use crate::transport::bsdf::ggx::Ggx;
use crate::transport::bsdf::{BsdfValue, Local, Mode, adjoint, index_ratio, lambert};
use crate::transport::flight::Stamp;
use crate::transport::integrator::Context;
use crate::transport::ray::{Ray, offset_by_axis};
use crate::transport::sampler::Independent;
use crate::transport::surface::Point;
use crate::transport::vertex::towards;

/// A Lambert surface in rows.
pub(super) fn rows_of_lambert(albedo: Vec3) -> [Row; 3] {
    [Row([albedo.x, albedo.y, albedo.z, 0.0, 0.0, 0.0, 0.0, 0.0]), Row::default(), Row::default()]
}

/// Where the index of the inside stands in the first row of [`rows_of`].
pub(super) const INSIDE: usize = 6;

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

/// The BSDFs of materials.
#[inline(always)]
fn bsdfs<R: Lanes<N>, const N: usize>(rows: [&[Row; 3]; N], common: &Common) -> Disney<R::Vec3> {
    let a = R::transposed(each(rows, |r| &r[0]));
    let b = R::transposed(each(rows, |r| &r[1]));
    let c = R::transposed(each(rows, |r| &r[2]));
    let base_color = R::Vec3::new(a[0], a[1], a[2]);
    Disney {
        base_color,
        opaque: a[3],
        metallic: a[4],
        refractive: a[5],
        ior: a[INSIDE],
        tinted_f0: common.tinted.then(|| R::Vec3::new(b[5], b[6], b[7])),
        diffuse: Diffuse { base_color, roughness: a[7], subsurface: b[1], sheen: R::Vec3::new(b[2], b[3], b[4]) },
        ggx: Ggx { alpha: [b[0]; 2] },
        smooth: common.smooth,
        coat: Clearcoat { strength: c[0], alpha: c[1] },
        estimate: Estimate { diffuse: c[2], reflection: c[3], rise: c[4] },
    }
}

/// Three vectors of each lane.
#[inline(always)]
fn three_vectors<R: Lanes<N>, const N: usize>(of: [&[Vec3; 3]; N]) -> [R::Vec3; 3] {
    let rows = each(of, |[a, b, c]| Row([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y]));
    let last = R::load(&each(of, |[_, _, c]| c.z));
    let [ax, ay, az, bx, by, bz, cx, cy] = R::transposed(rows.each_ref());
    [R::Vec3::new(ax, ay, az), R::Vec3::new(bx, by, bz), R::Vec3::new(cx, cy, last)]
}

/// Where rays, given by origin and direction, have met primitives.
#[inline(always)]
pub(super) fn points<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    sphere: bool,
    primitives: [u32; N],
    [origin, dir]: [R::Vec3; 2],
    [t, v, w]: [R; 3],
) -> Point<R::Vec3> {
    if sphere {
        let rows = each(primitives, |p| {
            let s = &scene.spheres[p as usize - scene.triangles.len()];
            Row([s.center.x, s.center.y, s.center.z, s.radius, 0.0, 0.0, 0.0, 0.0])
        });
        let [x, y, z, radius, ..] = R::transposed(rows.each_ref());
        return Point::on_sphere(R::Vec3::new(x, y, z), radius, origin + dir * t, dir);
    }
    let corners = three_vectors::<R, N>(each(primitives, |p| &scene.triangles[p as usize]));
    let normals = three_vectors::<R, N>(each(primitives, |p| &scene.attributes[p as usize].normals));
    Point::on_triangle(corners, normals, [v, w], dir)
}

/// Points of surfaces to which paths have come, with what their BSDFs know of the directions from there.
pub(super) struct Vertices<R: Real> {
    pub point: Point<R::Vec3>,
    pub frame: Frame<R::Vec3>,
    /// Whether the shading normal is that of the real surface.
    flat: R::Mask,
    /// Of Lambert surfaces only the base colour says anything.
    bsdf: Disney<R::Vec3>,
    view: View<R::Vec3>,
    /// Whether they are Lambert surfaces; else they are of the model `disney`.
    lambert: bool,
    /// Unit direction to where the path came from.
    pub wo: R::Vec3,
    /// Its cosine with the shading normal.
    pub cos_o: R,
    /// Whether the surface shows anything towards it.
    pub seen: R::Mask,
}

impl<R: Real> Vertices<R> {
    /// On surfaces of one class whose materials have these rows; where `active` is not set nothing is seen.
    #[inline(always)]
    pub fn new<const N: usize>(
        point: Point<R::Vec3>,
        wo: R::Vec3,
        rows: [&[Row; 3]; N],
        common: &Common,
        active: R::Mask,
    ) -> Vertices<R>
    where
        R: Lanes<N>,
    {
        let bsdf = bsdfs::<R, N>(rows, common);
        let frame = Frame::from_normal(point.n_shading);
        let local = frame.to_local(wo);
        let lambert = common.lambert;
        let view = if lambert { View::none() } else { bsdf.view(local) };
        let flat = point.n_shading.same(point.n_geometric);
        let vertices = Vertices { point, frame, flat, bsdf, view, lambert, wo, cos_o: local.z(), seen: active };
        Vertices { seen: active & vertices.agree(wo, local.z()), ..vertices }
    }

    /// As `Bsdf::agrees`, in each lane.
    #[inline(always)]
    pub fn agree(&self, w: R::Vec3, cos: R) -> R::Mask {
        let zero = R::of(0.0);
        self.flat & !cos.eq(zero) | !self.flat & (w.dot(self.point.n_geometric) * cos).gt(zero)
    }

    /// The correction of shading normals for light that comes from `wo` and leaves into `wi`.
    #[inline(always)]
    pub fn adjoint(&self, wi: R::Vec3, cos_i: R) -> R {
        let factor = adjoint(self.point.n_geometric, [self.wo, wi], [self.cos_o, cos_i]);
        R::select(self.flat, R::of(1.0), factor)
    }

    /// As `Bsdf::evaluate_from` in the lanes that want it, and as `Bsdf::evaluate_forward` without `REVERSE`.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(&self, wi: R::Vec3, mode: Mode, wanted: R::Mask) -> BsdfValue<R::Vec3> {
        let zero = R::of(0.0);
        let black = R::Vec3::of(Vec3::ZERO);
        let n = self.point.n_shading;
        let cos_i = wi.dot(n);
        let same = (self.cos_o * cos_i).gt(zero);
        let (mut f, [mut pdf_w, mut reverse]) = if self.lambert {
            let (o, i) = (self.frame.to_local(self.wo), self.frame.to_local(wi));
            let back = if REVERSE { lambert::pdf_w(i, o) } else { zero };
            (lambert::eval(self.bsdf.base_color, o, i), [lambert::pdf_w(o, i), back])
        } else {
            self.bsdf.evaluate_round::<REVERSE>(&self.view, self.wo, wi, n, cos_i)
        };
        let through = wanted & !same;
        if through.any() && self.bsdf.refractive.gt(zero).any() {
            let (other, [other_w, back]) = self.bsdf.evaluate::<REVERSE>(&self.view, self.frame.to_local(wi), mode);
            (f, pdf_w) = (R::Vec3::select(same, f, other), R::select(same, pdf_w, other_w));
            reverse = R::select(same, reverse, back);
        } else {
            (f, pdf_w) = (R::Vec3::select(same, f, black), R::select(same, pdf_w, zero));
            reverse = R::select(same, reverse, zero);
        }
        if mode == Mode::Importance {
            f = f * self.adjoint(wi, cos_i);
        }
        let lets = wanted & self.seen & self.agree(wi, cos_i);
        BsdfValue {
            f: R::Vec3::select(lets, f, black),
            pdf_w: R::select(lets, pdf_w, zero),
            reverse_pdf_w: R::select(lets, reverse, zero),
        }
    }
}

impl<R: Real> Vertices<R> {
    /// As `Disney::sample` and `Ideal::sample`; what is sampled may still be refused.
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(&self, choice: R, v: [R; 2], mode: Mode) -> (R::Mask, Local<R::Vec3>, R) {
        if !self.lambert {
            return self.bsdf.sample::<REVERSE>(&self.view, choice, v, mode);
        }
        let o = self.frame.to_local(self.wo);
        let (some, sample) = lambert::sample(self.bsdf.base_color, o, v);
        let reverse = if REVERSE { lambert::pdf_w(sample.wi, o) } else { R::of(0.0) };
        (some, Local { sample, pdf_w: lambert::pdf_w(o, sample.wi), delta: R::Mask::of(false) }, reverse)
    }

    /// As `Bsdf::index_ratio`, in the lanes where light can pass between `wo` and `wi`.
    #[inline(always)]
    pub fn index_ratio(&self, wi: R::Vec3) -> R {
        if !self.bsdf.refractive.gt(R::of(0.0)).any() {
            return R::of(1.0);
        }
        index_ratio([self.cos_o, wi.dot(self.point.n_shading)], self.bsdf.ior)
    }

    /// As [`of_direct`](crate::transport::flight::of_direct).
    #[inline(always)]
    pub fn of_direct<const N: usize>(&self, context: &Context, stamp: &Stamp<R>, direct: &Direct<R, N>) -> R::Double
    where
        R: Lanes<N>,
    {
        let mut distance = direct.distance;
        if direct.endless.any() {
            let lead = context.lights.lead(self.point.position, direct.wi);
            distance = R::select(direct.endless, lead, distance);
        }
        stamp.onward(self.index_ratio(direct.wi), distance)
    }
}

/// Rays between points of surfaces, given by position and normal; or from them into the directions `wi` where the other end
/// has no place. In rows: origin, direction, distance.
#[inline(always)]
pub(super) fn shadow_rays<R: Lanes<N>, const N: usize>(
    [from, n]: [R::Vec3; 2],
    [at, n_at]: [R::Vec3; 2],
    wi: R::Vec3,
    endless: R::Mask,
) -> [Row; N] {
    let edge = at - from;
    let origin = offset_by_axis(from, towards(n, R::Vec3::select(endless, wi, edge)));
    let target = offset_by_axis(at, towards(n_at, -edge));
    let edge = target - origin;
    let distance = edge.length();
    let dir = R::Vec3::select(endless, wi, edge / distance);
    let distance = R::select(endless, R::of(f32::INFINITY), distance);
    R::stored([origin.x(), origin.y(), origin.z(), dir.x(), dir.y(), dir.z(), distance, R::of(0.0)])
}

/// The ray of a row of [`shadow_rays`], and how far it goes.
#[inline]
pub(super) fn shadow_ray(row: &Row) -> (Ray, f32) {
    let [x, y, z, dx, dy, dz, distance, _] = row.0;
    (Ray { origin: Vec3::new(x, y, z), dir: Vec3::new(dx, dy, dz) }, distance)
}

/// The step of paths that have met surfaces of one class; those that go on are named in `tile.next`.
pub(super) fn step<const TIMED: bool>(
    table: &Table,
    common: Common,
    context: &Context,
    depth: u32,
    paths: &[u32],
    tile: &mut Tile,
) {
    table.width.run(Step::<TIMED> { table, common, context, depth, paths, tile });
}

struct Step<'a, const TIMED: bool> {
    table: &'a Table,
    common: Common,
    context: &'a Context<'a>,
    depth: u32,
    paths: &'a [u32],
    tile: &'a mut Tile,
}

impl<const TIMED: bool> AnyWidth for Step<'_, TIMED> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.paths.chunks(N) {
            step_of_lanes::<R, N, TIMED>(self.table, self.common, self.context, self.depth, group, self.tile);
        }
    }
}

#[inline(always)]
fn step_of_lanes<R: Lanes<N>, const N: usize, const TIMED: bool>(
    table: &Table,
    common: Common,
    context: &Context,
    depth: u32,
    group: &[u32],
    tile: &mut Tile,
) {
    let lanes = each(filled(group), |path| path as usize);
    let zero = R::of(0.0);
    let records = each(lanes, |i| &tile.records[i]);
    let way = R::transposed(each(records, |r| &r.rows[0]));
    let state = R::transposed(each(records, |r| &r.rows[1]));
    let met = R::transposed(each(records, |r| &r.rows[2]));
    let (origin, dir) = (R::Vec3::new(way[0], way[1], way[2]), R::Vec3::new(way[3], way[4], way[5]));
    let throughput = R::Vec3::new(way[6], way[7], state[0]);
    let key = [met[4].bits(), met[5].bits(), met[6].bits(), met[7].bits()];
    let mut taken = state[6].bits();
    let primitives = each(records, |r| r.rows[2].0[3].to_bits());
    let active = R::Mask::first(group.len());

    let point = points::<R, N>(context.scene, common.sphere, primitives, [origin, dir], [met[0], met[1], met[2]]);
    let mut stamp = Stamp { path: state[7], late: zero, delay: zero, index: zero };
    if TIMED {
        stamp.late = tile.emitted.of_lanes(lanes);
        stamp.index = R::load(&each(lanes, |i| tile.index[i]));
        if clock::counts(context, depth) {
            let from = if depth == 1 { origin } else { R::Vec3::new(state[1], state[2], state[3]) };
            stamp.travel(from, point.position);
        }
    }
    let rows = each(primitives, |p| &table.rows[table.row_of[p as usize] as usize]);
    let vertices = Vertices::<R>::new(point, -dir, rows, &common, active);

    if common.joined {
        let numbers = Independent::next_three(key, taken);
        taken = taken.add(R::Word::of(3));
        connect::<R, N, TIMED>(context, &table.lamps, &vertices, (throughput, &stamp), numbers, lanes, tile);
    }

    let [choice, u, v] = Independent::next_three(key, taken);
    taken = taken.add(R::Word::of(3));
    let (some, s, _) = vertices.sample::<false>(choice, [u, v], Mode::Radiance);
    let wi = vertices.frame.to_world(s.sample.wi);
    let mut on = vertices.seen & some & s.pdf_w.gt(zero) & vertices.agree(wi, s.sample.wi.z());
    let mut throughput = throughput * s.sample.weight;
    let eta_scale = state[5] * (s.sample.eta * s.sample.eta);
    if context.rr_start.is_some_and(|start| depth >= start) {
        let most = throughput.x().max(throughput.y()).max(throughput.z());
        let survival = (most * eta_scale).min(R::of(MAX_SURVIVAL));
        let [u, ..] = Independent::next_three(key, taken);
        taken = taken.add(R::Word::of(1));
        on = on & u.lt(survival);
        throughput = throughput / survival;
    }
    on = on & !throughput.same(R::Vec3::of(Vec3::ZERO));
    let last = R::select(s.delta, R::of(SPECULAR), s.pdf_w);
    let from = vertices.point.position;
    let start = offset_by_axis(from, towards(vertices.point.n_geometric, wi));
    let way = [start.x(), start.y(), start.z(), wi.x(), wi.y(), wi.z(), throughput.x(), throughput.y()];
    let state = [throughput.z(), from.x(), from.y(), from.z(), last, eta_scale, taken.as_bits(), stamp.path];
    let (way, state) = (R::stored(way), R::stored(state));
    if TIMED {
        stamp.leave(s.sample.eta);
        let index = stamp.index.store();
        set(on.bits()).for_each(|i| tile.index[lanes[i]] = index[i]);
    }
    for i in set(on.bits()) {
        tile.records[lanes[i]].rows[0] = way[i];
        tile.records[lanes[i]].rows[1] = state[i];
        tile.next.push(lanes[i] as u32);
    }
}

/// Joins each vertex to a sampled point of a light: as `nee` does, but that the shadow ray waits.
#[inline(always)]
fn connect<R: Lanes<N>, const N: usize, const TIMED: bool>(
    context: &Context,
    lamps: &Lamps,
    vertices: &Vertices<R>,
    (throughput, stamp): (R::Vec3, &Stamp<R>),
    numbers: [R; 3],
    lanes: [usize; N],
    tile: &mut Tile,
) {
    let zero = R::of(0.0);
    let Point { position: from, n_geometric, n_shading } = vertices.point;
    let direct = lamps.direct(context, from, numbers, vertices.seen);
    let Direct { wi, radiance, density, .. } = direct;
    let arrives = vertices.seen & density.gt(zero);
    if !arrives.any() {
        return;
    }
    let BsdfValue { f, pdf_w, .. } = vertices.evaluate::<false>(wi, Mode::Radiance, arrives);
    let radiance = f * wi.dot(n_shading).abs() * radiance / density;
    let lit = arrives & !radiance.same(R::Vec3::of(Vec3::ZERO));
    let weight = match context.settings.mis {
        Some(h) => R::select(direct.delta, R::of(1.0), h.weight(density, pdf_w)),
        None => R::of(1.0),
    };
    let value = throughput * radiance * weight;
    let rays = shadow_rays::<R, N>([from, n_geometric], [direct.at, direct.normal], wi, direct.endless);
    let values = R::stored([value.x(), value.y(), value.z(), zero, zero, zero, zero, zero]);
    if TIMED && let Some(timing) = context.timing {
        let places = R::store_doubles(timing.axis.places(vertices.of_direct(context, stamp, &direct), R::Double::of));
        tile.places.extend(set(lit.bits()).map(|i| places[i]));
    }
    for i in set(lit.bits()) {
        let (ray, distance) = shadow_ray(&rays[i]);
        let [r, g, b, ..] = values[i].0;
        tile.waiting.push(Waiting { ray, distance, value: Vec3::new(r, g, b), path: lanes[i] as u32 });
    }
}
