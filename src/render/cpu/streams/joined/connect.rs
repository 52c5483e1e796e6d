//! What joins the subpaths of a tile: listed in the order of each sample's sum, made by the classes of surfaces, eight in the
//! lanes of one vector.

use glam::Vec3;

use super::{Node, Subpaths, Work};
use crate::math::lanes::{Doubles, LANES, Reals, Row, Vectors, Words, Yes, transposed};
use crate::math::real::{Double, Mask, Real, Vector, Word};
use crate::render::cpu::streams::shade::{Vertices, shadow_ray, shadow_rays};
use crate::render::cpu::streams::{each, filled, set, stored};
use crate::transport::bsdf::{BsdfValue, Mode};
use crate::transport::camera::FilterSpec;
use crate::transport::camera::lens::Projection;
use crate::transport::integrator::bdpt::weights::{Chain, Side, others_of_ends, others_of_lens, others_of_next_event};
use crate::transport::ray::Ray;
use crate::transport::sampler::Independent;
use crate::transport::surface::Point;
use crate::transport::vertex::area_factor;

/// Who is told of light for another pixel: the path that brings it, the pixel, and the light.
pub(super) type Splat<'a> = dyn FnMut(u32, [u32; 2], Vec3) + 'a;

/// So many connections wait for their shadow rays until those are traced.
const WAITING: usize = 64;

/// Connections are made when so many are listed, or a tile is through.
const LISTED: usize = 1 << 13;

/// Where light goes that is found.
#[derive(Clone, Copy)]
pub(super) enum To {
    /// A slot of [`Lists`].
    Slot(u32),
    /// A pixel, from a path.
    Pixel(u32, [u32; 2]),
}

/// Light that waits for its shadow rays.
#[derive(Default)]
pub(super) struct Waiting {
    rays: Vec<(Ray, f32)>,
    lights: Vec<(Vec3, To)>,
    hidden: Vec<bool>,
}

impl Waiting {
    /// Takes the light of a row of values for whose ray a row of [`shadow_rays`] stands.
    #[inline]
    pub fn push(&mut self, ray: &Row, value: &Row, to: To) {
        self.rays.push(shadow_ray(ray));
        let [r, g, b, ..] = value.0;
        self.lights.push((Vec3::new(r, g, b), to));
    }
}

/// A camera vertex that is to be joined to a sampled point of a light.
#[derive(Clone, Copy)]
struct Event {
    slot: u32,
    path: u32,
    z: u32,
    taken: u32,
}

/// A light vertex and a camera vertex that are to be joined.
#[derive(Clone, Copy)]
struct Pair {
    slot: u32,
    y: u32,
    z: u32,
}

/// The same when it is known what the camera vertex makes of it: value and both densities.
#[derive(Clone, Copy)]
struct Half {
    pair: Pair,
    at_z: [f32; 5],
}

/// A light vertex that is to be joined to the lens.
#[derive(Clone, Copy)]
struct Shot {
    path: u32,
    y: u32,
    taken: u32,
}

/// All connections of a tile.
#[derive(Default)]
pub(super) struct Lists {
    /// What is added to each sample, in this order: its path, and the light.
    slots: Vec<(u32, Vec3)>,
    /// By the class of the camera vertex.
    events: Vec<Vec<Event>>,
    pairs: Vec<Vec<Pair>>,
    /// By the class of the light vertex.
    halves: Vec<Vec<Half>>,
    shots: Vec<Vec<Shot>>,
    pub(super) waiting: Waiting,
}

impl Lists {
    pub fn reset(&mut self, classes: usize) {
        self.events.resize_with(classes, Vec::new);
        self.pairs.resize_with(classes, Vec::new);
        self.halves.resize_with(classes, Vec::new);
        self.shots.resize_with(classes, Vec::new);
    }

    fn slot(&mut self, path: usize, value: Vec3) -> u32 {
        self.slots.push((path as u32, value));
        self.slots.len() as u32 - 1
    }

    /// Lists everything that a sample brings to its own pixel, and returns how many of its numbers are then taken.
    pub fn own(&mut self, work: &Work, path: usize, [light, camera]: [&Subpaths; 2], escaped: Vec3) -> u32 {
        let Work { table, context, .. } = *work;
        let (settings, max) = (context.settings, context.max_depth);
        let mut taken = light.walkers[path].taken();
        if escaped != Vec3::ZERO {
            self.slot(path, escaped);
        }
        for (z, t) in camera.path(path).zip(2..) {
            let node = &camera.nodes[z as usize];
            if node.found != Vec3::ZERO {
                self.slot(path, node.found);
            }
            let Some(class) = node.class.map(usize::from).filter(|class| table.common(*class).joined) else { continue };
            if settings.wants(1, t) {
                let slot = self.slot(path, Vec3::ZERO);
                self.events[class].push(Event { slot, path: path as u32, z, taken });
                taken += 3;
            }
            for (y, s) in light.path(path).zip(2..).take_while(|(_, s)| s + t - 1 <= max) {
                if settings.wants(s, t) && work.joins(&light.nodes[y as usize]).is_some() {
                    let slot = self.slot(path, Vec3::ZERO);
                    self.pairs[class].push(Pair { slot, y, z });
                }
            }
        }
        taken
    }

    /// Lists what the light subpath of a sample brings to whatever pixel, when so many of its numbers are taken.
    pub fn lens(&mut self, work: &Work, path: usize, light: &Subpaths, mut taken: u32) {
        for (y, s) in light.path(path).zip(2..) {
            if work.context.settings.wants(s, 1)
                && let Some(class) = work.joins(&light.nodes[y as usize])
            {
                self.shots[class].push(Shot { path: path as u32, y, taken });
                taken += 4;
            }
        }
    }

    /// Whether it is time to make what is listed: deep paths have many connections.
    pub fn are_full(&self) -> bool {
        self.slots.len() >= LISTED
    }

    /// Makes all connections that are listed, and adds what each brings to its own pixel to the value of its sample.
    pub fn make(&mut self, work: &Work, light: &Subpaths, camera: &Subpaths, values: &mut [Vec3], splat: &mut Splat) {
        #[expect(unsafe_code, reason = "functions that are compiled for AVX2")]
        // SAFETY: streams are made only where the processor has AVX2.
        unsafe {
            self.make_avx2(work, light, camera, splat);
        }
        for (path, value) in self.slots.drain(..) {
            values[path as usize] += value;
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn make_avx2(&mut self, work: &Work, light: &Subpaths, camera: &Subpaths, splat: &mut Splat) {
        let Lists { slots, events, pairs, halves, shots, waiting } = self;
        for class in 0..events.len() {
            for group in events[class].chunks(LANES) {
                next_events(work, class, group, camera, waiting);
                if waiting.lights.len() >= WAITING {
                    work.resolve(waiting, slots, splat);
                }
            }
            events[class].clear();
            for group in pairs[class].chunks(LANES) {
                halfway(work, class, group, [light, camera], halves);
            }
            pairs[class].clear();
            for group in shots[class].chunks(LANES) {
                lens_shots(work, class, group, light, waiting);
                if waiting.lights.len() >= WAITING {
                    work.resolve(waiting, slots, splat);
                }
            }
            shots[class].clear();
        }
        for (class, list) in halves.iter_mut().enumerate() {
            for group in list.chunks(LANES) {
                ends(work, class, group, [light, camera], waiting);
                if waiting.lights.len() >= WAITING {
                    work.resolve(waiting, slots, splat);
                }
            }
            list.clear();
        }
        work.resolve(waiting, slots, splat);
    }
}

impl Work<'_> {
    /// The class of a vertex, if anything can be joined to it.
    fn joins(&self, node: &Node) -> Option<usize> {
        node.class.map(usize::from).filter(|class| self.table.common(*class).joined)
    }

    /// Traces the rays that wait, and hands on what is not hidden.
    pub(super) fn resolve(&self, waiting: &mut Waiting, slots: &mut [(u32, Vec3)], splat: &mut Splat) {
        let Waiting { rays, lights, hidden } = waiting;
        hidden.clear();
        // Points that coincide are not hidden from each other.
        if rays.iter().any(|(_, distance)| *distance <= 0.0) {
            hidden.extend(rays.iter().map(|(ray, d)| (*d > 0.0 || d.is_nan()) && self.context.trace.occluded(ray, *d)));
        } else {
            self.context.trace.occluded_each(rays, hidden);
        }
        rays.clear();
        for ((value, to), _) in lights.drain(..).zip(&*hidden).filter(|(_, hidden)| !**hidden) {
            match to {
                To::Slot(slot) => slots[slot as usize].1 = value,
                To::Pixel(path, pixel) => splat(path, pixel, value),
            }
        }
    }

    /// What is left of light when all strategies that find it have their share, in the lanes where it is of any use.
    #[inline(always)]
    pub(super) fn shared(&self, unweighted: Vectors, others: Doubles, usable: Yes) -> [Row; LANES] {
        let zero = Reals::of(0.0);
        let one = Doubles::of(1.0);
        let weight = if self.context.settings.raw() { Reals::of(1.0) } else { (one / (one + others)).single() };
        let value = Vectors::select(usable, unweighted * weight, Vectors::of(Vec3::ZERO));
        stored([value.x(), value.y(), value.z(), zero, zero, zero, zero, zero])
    }
}

/// Points joined to the lens.
pub(super) struct OnFilm {
    pub at: Projection<Vectors>,
    /// The pixels for which they count.
    pub pixels: [[u32; 2]; LANES],
    /// Whether there is one.
    pub inside: Yes,
    /// As `CameraConnection::importance`.
    pub importance: Reals,
}

impl Work<'_> {
    /// The numbers with which these paths choose points of the lens and pixels, when so many are taken; zeros where neither
    /// has a use for them.
    #[inline(always)]
    pub(super) fn lens_numbers(&self, paths: &Subpaths, of: [u32; LANES], taken: [u32; LANES]) -> [Reals; 4] {
        let camera = self.context.camera;
        if !camera.has_lens() && camera.filter() == FilterSpec::PIXEL {
            return [Reals::of(0.0); 4];
        }
        let (key, taken) = (keys(paths, of), words(taken));
        let [a, b, c] = Independent::next_three(key, taken);
        let [d, ..] = Independent::next_three(key, taken.add(Words::of(3)));
        [a, b, c, d]
    }

    /// Joins points to the lens, in the lanes that want it.
    #[inline(always)]
    pub(super) fn onto_film(&self, position: Vectors, [a, b, c, d]: [Reals; 4], wanted: Yes) -> OnFilm {
        let zero = Reals::of(0.0);
        let at = self.context.camera.project(position, [a, b]);
        let ahead = wanted & at.ahead;
        let camera = self.context.camera;
        let (mut pixels, mut weights) = ([[0; 2]; LANES], Row::default());
        if camera.filter() == FilterSpec::PIXEL {
            // As `FilterSpec::choose`: the pixel in which the place lies.
            let [width, height] = camera.resolution();
            let (width, height) = (Reals::of(width as f32), Reals::of(height as f32));
            let [x, y] = at.place;
            let inside = ahead & x.ge(zero) & x.lt(width) & y.ge(zero) & y.lt(height);
            let [x, y] = [x.truncated().as_bits().store(), y.truncated().as_bits().store()];
            for i in set(inside.bits()) {
                (pixels[i], weights.0[i]) = ([x.0[i].to_bits(), y.0[i].to_bits()], 1.0);
            }
        } else {
            let places = stored([at.place[0], at.place[1], c, d, zero, zero, zero, zero]);
            for i in set(ahead.bits()) {
                let [x, y, u, v, ..] = places[i].0;
                if let Some((pixel, weight)) = camera.choose([x, y], [u, v]) {
                    (pixels[i], weights.0[i]) = (pixel, weight);
                }
            }
        }
        let weight = Reals::load(&weights);
        let importance = weight * at.pdf_w / (at.distance * at.distance);
        OnFilm { at, pixels, inside: ahead & weight.gt(zero), importance }
    }
}

/// Vertices in lanes, with what their paths carry and what weights need of them.
struct Loaded {
    vertices: Vertices,
    throughput: Vectors,
    side: Side<Reals>,
}

/// Points, directions to the vertices before, what paths carry, and what weights need.
#[inline(always)]
fn places(nodes: [&Node; LANES]) -> (Point<Vectors>, Vectors, Vectors, Side<Reals>) {
    let a = transposed(nodes.map(|node| &node.rows[0]));
    let b = transposed(nodes.map(|node| &node.rows[1]));
    let last = Reals::load(&Row(nodes.map(|node| node.rows[2].0[0])));
    let [joint, tail] = [0, 1].map(|k| nodes.map(|node| node.chain[k]));
    let point = Point {
        position: Vectors::new(a[0], a[1], a[2]),
        n_geometric: Vectors::new(a[3], a[4], a[5]),
        n_shading: Vectors::new(b[0], b[1], b[2]),
    };
    let chain = Chain { joint: Doubles::load(&joint), tail: Doubles::load(&tail) };
    (point, Vectors::new(b[3], b[4], b[5]), Vectors::new(b[6], b[7], last), Side { chain, back: a[6] })
}

#[inline(always)]
fn loaded(work: &Work, class: usize, nodes: [&Node; LANES], active: Yes) -> Loaded {
    let (point, wo, throughput, side) = places(nodes);
    let rows = nodes.map(|node| &work.table.rows[node.rows[0].0[7].to_bits() as usize]);
    Loaded { vertices: Vertices::new(point, wo, rows, &work.table.common(class), active), throughput, side }
}

/// The keys of the numbers of paths.
#[inline(always)]
pub(super) fn keys(paths: &Subpaths, of: [u32; LANES]) -> [Words; 4] {
    let [.., a, b, c, d] = transposed(each(of, |path| &paths.walkers[path as usize].rows[2]));
    [a.bits(), b.bits(), c.bits(), d.bits()]
}

#[inline(always)]
pub(super) fn words(of: [u32; LANES]) -> Words {
    Reals::load(&Row(of.map(f32::from_bits))).bits()
}

/// `s = 1`, `t >= 2`.
#[inline(always)]
fn next_events(work: &Work, class: usize, group: &[Event], camera: &Subpaths, waiting: &mut Waiting) {
    let events = filled(group);
    let active = Yes::first(group.len());
    let zero = Reals::of(0.0);
    let numbers = Independent::next_three(keys(camera, events.map(|e| e.path)), words(events.map(|e| e.taken)));
    let z = loaded(work, class, events.map(|e| &camera.nodes[e.z as usize]), active);
    let Point { position, n_geometric, n_shading } = z.vertices.point;
    let d = work.table.lamps.direct(work.context, position, numbers, z.vertices.seen);
    let arrives = z.vertices.seen & d.density.gt(zero);
    if !arrives.any() {
        return;
    }
    let at_z = z.vertices.evaluate::<true>(d.wi, Mode::Radiance, arrives);
    let unweighted = z.throughput * at_z.f * d.wi.dot(n_shading).abs() * d.radiance / d.density;
    let lit = arrives & !unweighted.same(Vectors::of(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let from = [position, n_geometric];
    let end = d.ends(work.context, from);
    let others = others_of_next_event(work.h, &z.side, &end, &at_z);
    // At the rim of a sphere rounding may put the point on the side that is hidden, where no strategy has a density.
    let usable = end.direct.gt(Doubles::of(0.0));
    let values = work.shared(unweighted, others, usable);
    let rays = shadow_rays(from, [d.at, d.normal], d.wi, d.endless);
    for i in set(lit.bits()) {
        waiting.push(&rays[i], &values[i], To::Slot(events[i].slot));
    }
}

/// What camera vertices make of the directions to light vertices; pairs without any are dropped.
#[inline(always)]
fn halfway(work: &Work, class: usize, group: &[Pair], [light, camera]: [&Subpaths; 2], halves: &mut [Vec<Half>]) {
    let pairs = filled(group);
    let z = loaded(work, class, pairs.map(|p| &camera.nodes[p.z as usize]), Yes::first(group.len()));
    let [x, y, c, ..] = transposed(pairs.map(|p| &light.nodes[p.y as usize].rows[0]));
    let edge = Vectors::new(x, y, c) - z.vertices.point.position;
    let wi = edge / edge.length_squared().sqrt();
    let BsdfValue { f, pdf_w, reverse_pdf_w } = z.vertices.evaluate::<true>(wi, Mode::Radiance, wi.is_finite());
    let some = !f.same(Vectors::of(Vec3::ZERO)) & wi.is_finite();
    let zero = Reals::of(0.0);
    let found = stored([f.x(), f.y(), f.z(), pdf_w, reverse_pdf_w, zero, zero, zero]);
    for i in set(some.bits()) {
        let [r, g, b, w, back, ..] = found[i].0;
        if let Some(class) = light.nodes[pairs[i].y as usize].class {
            halves[usize::from(class)].push(Half { pair: pairs[i], at_z: [r, g, b, w, back] });
        }
    }
}

/// `s >= 2`, `t >= 2`.
#[inline(always)]
fn ends(work: &Work, class: usize, group: &[Half], [light, camera]: [&Subpaths; 2], waiting: &mut Waiting) {
    let halves = filled(group);
    let active = Yes::first(group.len());
    let y = loaded(work, class, halves.map(|h| &light.nodes[h.pair.y as usize]), active);
    let (z, _, z_throughput, z_side) = places(halves.map(|h| &camera.nodes[h.pair.z as usize]));
    let known = halves.map(|h| {
        let [r, g, b, w, back] = h.at_z;
        Row([r, g, b, w, back, 0.0, 0.0, 0.0])
    });
    let [r, g, b, pdf_w, reverse_pdf_w, ..] = transposed(known.each_ref());
    let at_z = BsdfValue { f: Vectors::new(r, g, b), pdf_w, reverse_pdf_w };
    let at = y.vertices.point;
    let edge = at.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    let at_y = y.vertices.evaluate::<true>(-wi, Mode::Importance, active);
    let [cos_y, cos_z] = [wi.dot(at.n_shading).abs(), wi.dot(z.n_shading).abs()];
    let unweighted = y.throughput * at_y.f * cos_y * at_z.f * cos_z * z_throughput / distance2;
    let lit = active & !unweighted.same(Vectors::of(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let to = [wi.dot(at.n_geometric).abs() / distance2, wi.dot(z.n_geometric).abs() / distance2];
    let others = others_of_ends(work.h, [&y.side, &z_side], [&at_y, &at_z], to);
    let values = work.shared(unweighted, others, lit);
    let rays = shadow_rays([z.position, z.n_geometric], [at.position, at.n_geometric], wi, Yes::of(false));
    for i in set(lit.bits()) {
        waiting.push(&rays[i], &values[i], To::Slot(halves[i].pair.slot));
    }
}

/// `s >= 2`, `t = 1`.
#[inline(always)]
fn lens_shots(work: &Work, class: usize, group: &[Shot], light: &Subpaths, waiting: &mut Waiting) {
    let shots = filled(group);
    let active = Yes::first(group.len());
    let y = loaded(work, class, shots.map(|s| &light.nodes[s.y as usize]), active);
    let Point { position, n_geometric, n_shading } = y.vertices.point;
    let numbers = work.lens_numbers(light, shots.map(|s| s.path), shots.map(|s| s.taken));
    let OnFilm { at, pixels, inside, importance } = work.onto_film(position, numbers, y.vertices.seen);
    if !inside.any() {
        return;
    }
    let at_y = y.vertices.evaluate::<true>(-at.dir, Mode::Importance, inside);
    let unweighted = y.throughput * at_y.f * at.dir.dot(n_shading).abs() * importance;
    let lit = inside & !unweighted.same(Vectors::of(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let spread = area_factor(at.lens, position, n_geometric);
    let others = others_of_lens(work.h, &y.side, &at_y, [at.pdf_w, spread]);
    let values = work.shared(unweighted, others, lit);
    let nowhere = Vectors::of(Vec3::ZERO);
    let rays = shadow_rays([position, n_geometric], [at.lens, nowhere], at.dir, Yes::of(false));
    for i in set(lit.bits()) {
        waiting.push(&rays[i], &values[i], To::Pixel(shots[i].path, pixels[i]));
    }
}
