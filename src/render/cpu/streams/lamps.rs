//! Light from sampled points, for the surface points in all lanes.

use glam::Vec3;

use crate::math::lanes::{Lanes, Row, each, set};
use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::warp;
use crate::scene::CompiledScene;
use crate::scene::compile::Uv;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::weights::LightEnd;
use crate::transport::light::{LightPoint, area};

/// The lights that lanes know: triangles that shine alike everywhere. All others are sampled one by one.
#[derive(Default)]
pub(super) struct Lamps {
    /// Of every emitter its corners, area, radiance and a one; zeros where lanes do not know it. The indices of lights
    /// begin with those of emitters.
    rows: Vec<[Row; 2]>,
}

/// In the place of a light that lanes do not know.
const NOTHING: [Row; 2] = [Row([0.0; 8]); 2];

/// A light in each lane.
pub(super) struct Chosen<R, const N: usize> {
    /// The rows of [`Lamps`], zeros for other lights.
    pub rows: [[R; 8]; 2],
    /// The indices of the lights.
    pub light: [u32; N],
    /// The probability of the choice.
    pub chance: R,
    /// A bit for each lane with a light that lanes do not know.
    pub alone: u32,
}

/// Light that arrives, in each lane, not yet tested for shadow.
pub(super) struct Direct<R: Real, const N: usize> {
    /// Unit direction to the light.
    pub wi: R::Vec3,
    /// Radiance, or irradiance of a Dirac light.
    pub radiance: R::Vec3,
    /// Density per solid angle, the choice of the light included; zero where nothing arrives, and else nothing counts.
    pub density: R,
    /// Whether no other technique can find this light.
    pub delta: R::Mask,
    /// Distance to it; says nothing where the light has no place.
    pub distance: R,
    /// Position on the light.
    pub at: R::Vec3,
    /// Unit normal there.
    pub normal: R::Vec3,
    /// Whether the light has no place.
    pub endless: R::Mask,
    /// The index of the light, and the probability of its choice.
    light: [u32; N],
    chance: R,
    /// The area of lights that lanes know; a bit for each lane with another one.
    area: R,
    alone: u32,
}

impl Lamps {
    /// The lights of a scene.
    pub fn of(scene: &CompiledScene) -> Lamps {
        let row = |i: u32| {
            let Some(([a, b, c], radiance)) = area::plain_triangle(scene, i) else { return NOTHING };
            let area = scene.emitters[i as usize].area;
            [
                Row([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y]),
                Row([c.z, area, radiance.x, radiance.y, radiance.z, 1.0, 0.0, 0.0]),
            ]
        };
        Lamps { rows: (0..scene.emitters.len() as u32).map(row).collect() }
    }

    /// The lights that these numbers choose, in the lanes that want any.
    #[inline(always)]
    pub fn choose<R: Lanes<N>, const N: usize>(&self, context: &Context, choice: R, wanted: R::Mask) -> Chosen<R, N> {
        let choices = choice.store();
        let (mut rows, mut chances) = ([&NOTHING; N], [0.0; N]);
        let (mut light, mut alone) = ([0; N], 0);
        for i in set(wanted.bits()) {
            if let Some((index, chance)) = context.lights.choose(choices[i]) {
                chances[i] = chance;
                light[i] = index;
                match self.rows.get(index as usize).filter(|row| row[1].0[5] > 0.0) {
                    Some(row) => rows[i] = row,
                    None => alone |= 1 << i,
                }
            }
        }
        let rows = [R::transposed(each(rows, |r| &r[0])), R::transposed(each(rows, |r| &r[1]))];
        Chosen { rows, light, chance: R::load(&chances), alone }
    }

    /// Light that arrives at points from a light that these numbers choose, and from a point on it, in the lanes that want
    /// any: as `Lights::sample_direct` finds it.
    #[inline(always)]
    pub fn direct<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        from: R::Vec3,
        [choice, u, v]: [R; 3],
        wanted: R::Mask,
    ) -> Direct<R, N> {
        let Chosen { rows: [a, b], light, chance, alone } = self.choose(context, choice, wanted);
        let corners = [R::Vec3::new(a[0], a[1], a[2]), R::Vec3::new(a[3], a[4], a[5]), R::Vec3::new(a[6], a[7], b[0])];
        let (at, normal) = area::on_triangle(corners, warp::uniform_triangle([u, v]));
        let (wi, distance, density) = area::seen(from, at, normal, b[1]);
        let radiance = R::Vec3::new(b[2], b[3], b[4]);
        let (delta, endless) = (R::Mask::of(false), R::Mask::of(false));
        let area = b[1];
        let mut direct =
            Direct { wi, radiance, density, delta, distance, at, normal, endless, light, chance, area, alone };
        if alone != 0 {
            let from = [from.x().store(), from.y().store(), from.z().store()];
            let [found, end] = singles(context, alone, light, from, [u.store(), v.store()]);
            direct = direct.or(b[5].gt(R::of(0.0)), R::transposed(found.each_ref()), R::transposed(end.each_ref()));
        }
        Direct { density: direct.density * chance, ..direct }
    }
}

impl<R: Lanes<N>, const N: usize> Direct<R, N> {
    /// This where the mask is set, else what [`singles`] found.
    #[inline(always)]
    fn or(self, known: R::Mask, light: [R; 8], end: [R; 8]) -> Direct<R, N> {
        let zero = R::of(0.0);
        let [x, y, z, r, g, b, density, delta] = light;
        let [px, py, pz, nx, ny, nz, endless, distance] = end;
        Direct {
            wi: R::Vec3::select(known, self.wi, R::Vec3::new(x, y, z)),
            radiance: R::Vec3::select(known, self.radiance, R::Vec3::new(r, g, b)),
            density: R::select(known, self.density, density),
            delta: !known & delta.gt(zero),
            distance: R::select(known, self.distance, distance),
            at: R::Vec3::select(known, self.at, R::Vec3::new(px, py, pz)),
            normal: R::Vec3::select(known, self.normal, R::Vec3::new(nx, ny, nz)),
            endless: !known & endless.gt(zero),
            ..self
        }
    }

    /// What weights of bidirectional paths need of the light, where it is sampled from points with these normals.
    #[inline(always)]
    pub fn ends(&self, context: &Context, from: [R::Vec3; 2]) -> LightEnd<R> {
        let (light, dir) = ([self.at, self.normal], -self.wi);
        let plain = plain_ends(light, from, dir, [self.chance, self.area]);
        if self.alone == 0 {
            return plain;
        }
        let zero = R::of(0.0);
        let mut points = [None; N];
        let places =
            R::stored([light[0].x(), light[0].y(), light[0].z(), light[1].x(), light[1].y(), light[1].z(), zero, zero]);
        for i in set(self.alone) {
            let [x, y, z, a, b, c, ..] = places[i].0;
            let (position, normal) = (Vec3::new(x, y, z), Vec3::new(a, b, c));
            points[i] =
                Some(LightPoint { light: context.lights.id(self.light[i]), position, normal, uv: Uv::default() });
        }
        with_singles(context, plain, self.area.gt(zero), &points, from, dir)
    }
}

/// What weights of bidirectional paths need of points of plain triangles, given by position and normal, and so the next
/// vertices; of the directions to those, and of the probability and the area of each light.
#[inline(always)]
pub(super) fn plain_ends<R: Real>(
    light: [R::Vec3; 2],
    next: [R::Vec3; 2],
    dir: R::Vec3,
    [chance, area]: [R; 2],
) -> LightEnd<R> {
    let start_a = chance * (R::of(1.0) / area);
    let dir_w = warp::cosine_hemisphere_pdf_w(light[1].dot(dir));
    let direct_w = chance * area::direct_w(next[0], light[0], light[1], area);
    LightEnd::on_surface(light, next, [start_a, dir_w, direct_w])
}

/// The same where a light is known, and elsewhere what its point, if there is one, says by itself.
#[inline(always)]
pub(super) fn with_singles<R: Lanes<N>, const N: usize>(
    context: &Context,
    plain: LightEnd<R>,
    known: R::Mask,
    points: &[Option<LightPoint>; N],
    [next, n]: [R::Vec3; 2],
    dir: R::Vec3,
) -> LightEnd<R> {
    let zero = R::of(0.0);
    let nexts = R::stored([next.x(), next.y(), next.z(), n.x(), n.y(), n.z(), zero, zero]);
    let dirs = R::stored([dir.x(), dir.y(), dir.z(), zero, zero, zero, zero, zero]);
    let [start, direct, next, back] = single_ends(context, points, &nexts, &dirs);
    LightEnd {
        start: R::Double::select(known, plain.start, R::load_doubles(&start)),
        direct: R::Double::select(known, plain.direct, R::load_doubles(&direct)),
        next: R::Double::select(known, plain.next, R::load_doubles(&next)),
        back: R::select(known, plain.back, R::load_doubles(&back).single()),
    }
}

/// [`LightEnd::new`] of each point, its four numbers in rows.
fn single_ends<const N: usize>(
    context: &Context,
    points: &[Option<LightPoint>; N],
    nexts: &[Row; N],
    dirs: &[Row; N],
) -> [[f64; N]; 4] {
    let mut found = [[0.0; N]; 4];
    for (i, point) in points.iter().enumerate().filter_map(|(i, p)| Some((i, p.as_ref()?))) {
        let [x, y, z, a, b, c, ..] = nexts[i].0;
        let [u, v, w, ..] = dirs[i].0;
        let end = LightEnd::new(context, point, Vec3::new(u, v, w), Vec3::new(x, y, z), Vec3::new(a, b, c));
        let LightEnd { start, direct, next, back } = end;
        for (row, number) in found.iter_mut().zip([start, direct, next, f64::from(back)]) {
            row[i] = number;
        }
    }
    found
}

/// Light from sampled points in the lanes whose bits are set, one by one: rows of direction, radiance, density without the
/// choice, and whether it is a Dirac light; and rows of the light's point, its normal, whether it has no place, and
/// the distance.
fn singles<const N: usize>(
    context: &Context,
    lanes: u32,
    lights: [u32; N],
    from: [[f32; N]; 3],
    u: [[f32; N]; 2],
) -> [[Row; N]; 2] {
    let mut found = [[Row::default(); N]; 2];
    for i in set(lanes) {
        let from = Vec3::new(from[0][i], from[1][i], from[2][i]);
        if let Some(s) = context.lights.sample_direct_from(context.scene, lights[i], from, [u[0][i], u[1][i]]) {
            let (w, c, p, n) = (s.wi, s.radiance, s.point.position, s.point.normal);
            let [delta, endless] = [s.delta, !s.distance.is_finite()].map(|yes| f32::from(u8::from(yes)));
            found[0][i] = Row([w.x, w.y, w.z, c.x, c.y, c.z, s.pdf_w, delta]);
            found[1][i] = Row([p.x, p.y, p.z, n.x, n.y, n.z, endless, s.distance]);
        }
    }
    found
}
