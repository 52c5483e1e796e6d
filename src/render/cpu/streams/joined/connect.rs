//! What joins the subpaths of a tile: listed in the order of each sample's sum, made by the classes of surfaces, as many at
//! once as there are lanes.

use glam::Vec3;

use super::{Node, Own, Subpaths, Work};
use crate::math::lanes::{AnyWidth, Lanes, Row, each, filled, set};
use crate::math::real::{Double, Mask, Real, Vector, Word};
use crate::render::cpu::streams::shade::{INSIDE, Vertices, shadow_ray, shadow_rays};
use crate::transport::bsdf::{BsdfValue, Mode, index_ratio};
use crate::transport::camera::FilterSpec;
use crate::transport::camera::lens::Projection;
use crate::transport::flight::Stamp;
use crate::transport::integrator::bdpt::weights::{Chain, Side, others_of_ends, others_of_lens, others_of_next_event};
use crate::transport::ray::Ray;
use crate::transport::sampler::Independent;
use crate::transport::surface::Point;
use crate::transport::vertex::area_factor;

/// Who is told of light for another pixel: the path that brings it, the pixel, the light, and when it arrives.
pub(super) type Splat<'a> = dyn FnMut(u32, [u32; 2], Vec3, f64) + 'a;

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
    /// When they arrive, where there is a time axis.
    pub lengths: Vec<f64>,
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

/// What is added to samples, in this order.
#[derive(Default)]
pub(super) struct Slots {
    /// The path, and the light.
    lights: Vec<(u32, Vec3)>,
    /// When it arrives, where there is a time axis.
    lengths: Vec<f64>,
}

/// All connections of a tile.
#[derive(Default)]
pub(super) struct Lists {
    slots: Slots,
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

    fn slot<const TIMED: bool>(&mut self, path: usize, value: Vec3, length: f64) -> u32 {
        self.slots.lights.push((path as u32, value));
        if TIMED {
            self.slots.lengths.push(length);
        }
        self.slots.lights.len() as u32 - 1
    }

    /// Lists everything that a sample brings to its own pixel, and returns how many of its numbers are then taken.
    pub fn own<const TIMED: bool>(
        &mut self,
        work: &Work<TIMED>,
        path: usize,
        [light, camera]: [&Subpaths; 2],
        (escaped, length): (Vec3, f64),
    ) -> u32 {
        let Work { table, context, .. } = *work;
        let (settings, max) = (context.settings, context.max_depth);
        let mut taken = light.walkers[path].taken();
        if escaped != Vec3::ZERO {
            self.slot::<TIMED>(path, escaped, length);
        }
        for (z, t) in camera.path(path).zip(2..) {
            let node = &camera.nodes[z as usize];
            if node.found != Vec3::ZERO {
                self.slot::<TIMED>(path, node.found, if TIMED { node.stamp().arrived() } else { 0.0 });
            }
            let Some(class) = node.class.map(usize::from).filter(|class| table.common(*class).joined) else { continue };
            if settings.wants(1, t) {
                let slot = self.slot::<TIMED>(path, Vec3::ZERO, 0.0);
                self.events[class].push(Event { slot, path: path as u32, z, taken });
                taken += 3;
            }
            for (y, s) in light.path(path).zip(2..).take_while(|(_, s)| s + t - 1 <= max) {
                if settings.wants(s, t) && work.joins(&light.nodes[y as usize]).is_some() {
                    let slot = self.slot::<TIMED>(path, Vec3::ZERO, 0.0);
                    self.pairs[class].push(Pair { slot, y, z });
                }
            }
        }
        taken
    }

    /// Lists what the light subpath of a sample brings to whatever pixel, when so many of its numbers are taken.
    pub fn lens<const TIMED: bool>(&mut self, work: &Work<TIMED>, path: usize, light: &Subpaths, mut taken: u32) {
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
        self.slots.lights.len() >= LISTED
    }

    /// Makes all connections that are listed, and adds what each brings to its own pixel to the value of its sample.
    pub fn make<const TIMED: bool>(
        &mut self,
        work: &Work<TIMED>,
        [light, camera]: [&Subpaths; 2],
        own: &mut Own,
        splat: &mut Splat,
    ) {
        work.table.width.run(Make { lists: self, work, light, camera, splat });
        for (i, (path, value)) in self.slots.lights.drain(..).enumerate() {
            own.values[path as usize] += value;
            if TIMED
                && value != Vec3::ZERO
                && let Some(timing) = work.context.timing
            {
                own.parts.push(timing, path, value, timing.axis.place(self.slots.lengths[i]));
            }
        }
        self.slots.lengths.clear();
    }
}

/// The work of [`Lists::make`].
struct Make<'a, 'b, const TIMED: bool> {
    lists: &'a mut Lists,
    work: &'a Work<'a, TIMED>,
    light: &'a Subpaths,
    camera: &'a Subpaths,
    splat: &'a mut Splat<'b>,
}

impl<const TIMED: bool> AnyWidth for Make<'_, '_, TIMED> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Make { lists, work, light, camera, splat } = self;
        let Lists { slots, events, pairs, halves, shots, waiting } = lists;
        for class in 0..events.len() {
            for group in events[class].chunks(N) {
                next_events::<R, N, TIMED>(work, class, group, camera, waiting);
                if waiting.lights.len() >= WAITING {
                    work.resolve(waiting, slots, splat);
                }
            }
            events[class].clear();
            for group in pairs[class].chunks(N) {
                halfway::<R, N, TIMED>(work, class, group, [light, camera], halves);
            }
            pairs[class].clear();
            for group in shots[class].chunks(N) {
                lens_shots::<R, N, TIMED>(work, class, group, light, waiting);
                if waiting.lights.len() >= WAITING {
                    work.resolve(waiting, slots, splat);
                }
            }
            shots[class].clear();
        }
        for (class, list) in halves.iter_mut().enumerate() {
            for group in list.chunks(N) {
                ends::<R, N, TIMED>(work, class, group, [light, camera], waiting);
                if waiting.lights.len() >= WAITING {
                    work.resolve(waiting, slots, splat);
                }
            }
            list.clear();
        }
        work.resolve(waiting, slots, splat);
    }
}

impl<const TIMED: bool> Work<'_, TIMED> {
    /// The class of a vertex, if anything can be joined to it.
    fn joins(&self, node: &Node) -> Option<usize> {
        node.class.map(usize::from).filter(|class| self.table.common(*class).joined)
    }

    /// Traces the rays that wait, and hands on what is not hidden.
    pub(super) fn resolve(&self, waiting: &mut Waiting, slots: &mut Slots, splat: &mut Splat) {
        let Waiting { rays, lights, lengths, hidden } = waiting;
        hidden.clear();
        // Points that coincide are not hidden from each other.
        if rays.iter().any(|(_, distance)| *distance <= 0.0) {
            hidden.extend(rays.iter().map(|(ray, d)| (*d > 0.0 || d.is_nan()) && self.context.trace.occluded(ray, *d)));
        } else {
            self.context.trace.occluded_each(rays, hidden);
        }
        rays.clear();
        for (i, ((value, to), _)) in lights.drain(..).zip(&*hidden).enumerate().filter(|(_, (_, hidden))| !**hidden) {
            let length = if TIMED { lengths[i] } else { 0.0 };
            match to {
                To::Slot(slot) => {
                    slots.lights[slot as usize].1 = value;
                    if TIMED {
                        slots.lengths[slot as usize] = length;
                    }
                }
                To::Pixel(path, pixel) => splat(path, pixel, value, length),
            }
        }
        lengths.clear();
    }

    /// What is left of light when all strategies that find it have their share, in the lanes where it is of any use.
    #[inline(always)]
    pub(super) fn shared<R: Lanes<N>, const N: usize>(
        &self,
        unweighted: R::Vec3,
        others: R::Double,
        usable: R::Mask,
    ) -> [Row; N] {
        let zero = R::of(0.0);
        let one = R::Double::of(1.0);
        let weight = if self.context.settings.raw() { R::of(1.0) } else { (one / (one + others)).single() };
        let value = R::Vec3::select(usable, unweighted * weight, R::Vec3::of(Vec3::ZERO));
        R::stored([value.x(), value.y(), value.z(), zero, zero, zero, zero, zero])
    }
}

/// Points joined to the lens.
pub(super) struct OnFilm<R: Real, const N: usize> {
    pub at: Projection<R::Vec3>,
    /// The pixels for which they count.
    pub pixels: [[u32; 2]; N],
    /// Whether there is one.
    pub inside: R::Mask,
    /// As `CameraConnection::importance`.
    pub importance: R,
}

impl<const TIMED: bool> Work<'_, TIMED> {
    /// When light of these paths arrives that only has to go so far to the lens.
    #[inline(always)]
    pub(super) fn lens_lengths<R: Lanes<N>, const N: usize>(&self, of: [u32; N], distance: R) -> R::Double {
        let emitted: R = self.emitted.of_lanes(each(of, |path| path as usize));
        let timing = self.context.timing.filter(|timing| timing.camera);
        let last = timing.map_or(R::of(0.0), |timing| R::of(timing.medium) * distance);
        emitted.double() + last.double()
    }

    /// The numbers with which these paths choose points of the lens and pixels, when so many are taken; zeros where neither
    /// has a use for them.
    #[inline(always)]
    pub(super) fn lens_numbers<R: Lanes<N>, const N: usize>(
        &self,
        paths: &Subpaths,
        of: [u32; N],
        taken: [u32; N],
    ) -> [R; 4] {
        let camera = self.context.camera;
        if !camera.has_lens() && camera.filter() == FilterSpec::PIXEL {
            return [R::of(0.0); 4];
        }
        let (key, taken) = (keys::<R, N>(paths, of), words::<R, N>(taken));
        let [a, b, c] = Independent::next_three(key, taken);
        let [d, ..] = Independent::next_three(key, taken.add(R::Word::of(3)));
        [a, b, c, d]
    }

    /// Joins points to the lens, in the lanes that want it.
    #[inline(always)]
    pub(super) fn onto_film<R: Lanes<N>, const N: usize>(
        &self,
        position: R::Vec3,
        [a, b, c, d]: [R; 4],
        wanted: R::Mask,
    ) -> OnFilm<R, N> {
        let zero = R::of(0.0);
        let at = self.context.camera.project(position, [a, b]);
        let ahead = wanted & at.ahead;
        let camera = self.context.camera;
        let (mut pixels, mut weights) = ([[0; 2]; N], [0.0; N]);
        if camera.filter() == FilterSpec::PIXEL {
            // As `FilterSpec::choose`: the pixel in which the place lies.
            let [width, height] = camera.resolution();
            let (width, height) = (R::of(width as f32), R::of(height as f32));
            let [x, y] = at.place;
            let inside = ahead & x.ge(zero) & x.lt(width) & y.ge(zero) & y.lt(height);
            let [x, y] = [x.truncated().as_bits().store(), y.truncated().as_bits().store()];
            for i in set(inside.bits()) {
                (pixels[i], weights[i]) = ([x[i].to_bits(), y[i].to_bits()], 1.0);
            }
        } else {
            let places = R::stored([at.place[0], at.place[1], c, d, zero, zero, zero, zero]);
            for i in set(ahead.bits()) {
                let [x, y, u, v, ..] = places[i].0;
                if let Some((pixel, weight)) = camera.choose([x, y], [u, v]) {
                    (pixels[i], weights[i]) = (pixel, weight);
                }
            }
        }
        let weight = R::load(&weights);
        let importance = weight * at.pdf_w / (at.distance * at.distance);
        OnFilm { at, pixels, inside: ahead & weight.gt(zero), importance }
    }
}

/// Vertices in lanes, with what their paths carry and what weights need of them.
struct Loaded<R: Real> {
    vertices: Vertices<R>,
    throughput: R::Vec3,
    side: Side<R>,
}

/// Points, directions to the vertices before, what paths carry, and what weights need.
#[inline(always)]
fn places<R: Lanes<N>, const N: usize>(nodes: [&Node; N]) -> (Point<R::Vec3>, R::Vec3, R::Vec3, Side<R>) {
    let a = R::transposed(each(nodes, |node| &node.rows[0]));
    let b = R::transposed(each(nodes, |node| &node.rows[1]));
    let last = R::load(&each(nodes, |node| node.rows[2].0[0]));
    let (joint, tail) = (each(nodes, |node| node.chain[0]), each(nodes, |node| node.chain[1]));
    let point = Point {
        position: R::Vec3::new(a[0], a[1], a[2]),
        n_geometric: R::Vec3::new(a[3], a[4], a[5]),
        n_shading: R::Vec3::new(b[0], b[1], b[2]),
    };
    let chain = Chain { joint: R::load_doubles(&joint), tail: R::load_doubles(&tail) };
    (point, R::Vec3::new(b[3], b[4], b[5]), R::Vec3::new(b[6], b[7], last), Side { chain, back: a[6] })
}

/// When paths are at these vertices.
#[inline(always)]
fn stamps<R: Lanes<N>, const N: usize>(nodes: [&Node; N]) -> Stamp<R> {
    let [_, path, late, index, ..] = R::transposed(each(nodes, |node| &node.rows[2]));
    Stamp { path, late, delay: R::of(0.0), index }
}

#[inline(always)]
fn loaded<R: Lanes<N>, const N: usize, const TIMED: bool>(
    work: &Work<TIMED>,
    class: usize,
    nodes: [&Node; N],
    active: R::Mask,
) -> Loaded<R> {
    let (point, wo, throughput, side) = places::<R, N>(nodes);
    let rows = each(nodes, |node| &work.table.rows[node.material()]);
    Loaded { vertices: Vertices::<R>::new(point, wo, rows, &work.table.common(class), active), throughput, side }
}

/// The keys of the numbers of paths.
#[inline(always)]
pub(super) fn keys<R: Lanes<N>, const N: usize>(paths: &Subpaths, of: [u32; N]) -> [R::Word; 4] {
    let [.., a, b, c, d] = R::transposed(each(of, |path| &paths.walkers[path as usize].rows[2]));
    [a.bits(), b.bits(), c.bits(), d.bits()]
}

#[inline(always)]
pub(super) fn words<R: Lanes<N>, const N: usize>(of: [u32; N]) -> R::Word {
    R::load(&each(of, f32::from_bits)).bits()
}

/// `s = 1`, `t >= 2`.
#[inline(always)]
fn next_events<R: Lanes<N>, const N: usize, const TIMED: bool>(
    work: &Work<TIMED>,
    class: usize,
    group: &[Event],
    camera: &Subpaths,
    waiting: &mut Waiting,
) {
    let events: [Event; N] = filled(group);
    let active = R::Mask::first(group.len());
    let zero = R::of(0.0);
    let numbers = Independent::next_three(
        keys::<R, N>(camera, each(events, |e| e.path)),
        words::<R, N>(each(events, |e| e.taken)),
    );
    let nodes = each(events, |e| &camera.nodes[e.z as usize]);
    let z = loaded::<R, N, TIMED>(work, class, nodes, active);
    let Point { position, n_geometric, n_shading } = z.vertices.point;
    let d = work.table.lamps.direct::<R, N>(work.context, position, numbers, z.vertices.seen);
    let arrives = z.vertices.seen & d.density.gt(zero);
    if !arrives.any() {
        return;
    }
    let at_z = z.vertices.evaluate::<true>(d.wi, Mode::Radiance, arrives);
    let unweighted = z.throughput * at_z.f * d.wi.dot(n_shading).abs() * d.radiance / d.density;
    let lit = arrives & !unweighted.same(R::Vec3::of(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let from = [position, n_geometric];
    let end = d.ends(work.context, from);
    let others = others_of_next_event(work.h, &z.side, &end, &at_z);
    // At the rim of a sphere rounding may put the point on the side that is hidden, where no strategy has a density.
    let usable = end.direct.gt(R::Double::of(0.0));
    let values = work.shared::<R, N>(unweighted, others, usable);
    let rays = shadow_rays::<R, N>(from, [d.at, d.normal], d.wi, d.endless);
    if TIMED {
        let lengths = R::store_doubles(z.vertices.of_direct(work.context, &stamps::<R, N>(nodes), &d));
        waiting.lengths.extend(set(lit.bits()).map(|i| lengths[i]));
    }
    for i in set(lit.bits()) {
        waiting.push(&rays[i], &values[i], To::Slot(events[i].slot));
    }
}

/// What camera vertices make of the directions to light vertices; pairs without any are dropped.
#[inline(always)]
fn halfway<R: Lanes<N>, const N: usize, const TIMED: bool>(
    work: &Work<TIMED>,
    class: usize,
    group: &[Pair],
    [light, camera]: [&Subpaths; 2],
    halves: &mut [Vec<Half>],
) {
    let pairs: [Pair; N] = filled(group);
    let z =
        loaded::<R, N, TIMED>(work, class, each(pairs, |p| &camera.nodes[p.z as usize]), R::Mask::first(group.len()));
    let [x, y, c, ..] = R::transposed(each(pairs, |p| &light.nodes[p.y as usize].rows[0]));
    let edge = R::Vec3::new(x, y, c) - z.vertices.point.position;
    let wi = edge / edge.length_squared().sqrt();
    let BsdfValue { f, pdf_w, reverse_pdf_w } = z.vertices.evaluate::<true>(wi, Mode::Radiance, wi.is_finite());
    let some = !f.same(R::Vec3::of(Vec3::ZERO)) & wi.is_finite();
    let zero = R::of(0.0);
    let found = R::stored([f.x(), f.y(), f.z(), pdf_w, reverse_pdf_w, zero, zero, zero]);
    for i in set(some.bits()) {
        let [r, g, b, w, back, ..] = found[i].0;
        if let Some(class) = light.nodes[pairs[i].y as usize].class {
            halves[usize::from(class)].push(Half { pair: pairs[i], at_z: [r, g, b, w, back] });
        }
    }
}

/// `s >= 2`, `t >= 2`.
#[inline(always)]
fn ends<R: Lanes<N>, const N: usize, const TIMED: bool>(
    work: &Work<TIMED>,
    class: usize,
    group: &[Half],
    [light, camera]: [&Subpaths; 2],
    waiting: &mut Waiting,
) {
    let halves: [Half; N] = filled(group);
    let active = R::Mask::first(group.len());
    let (y_nodes, z_nodes) =
        (each(halves, |h| &light.nodes[h.pair.y as usize]), each(halves, |h| &camera.nodes[h.pair.z as usize]));
    let y = loaded::<R, N, TIMED>(work, class, y_nodes, active);
    let (z, z_wo, z_throughput, z_side) = places::<R, N>(z_nodes);
    let known = each(halves, |h| {
        let [r, g, b, w, back] = h.at_z;
        Row([r, g, b, w, back, 0.0, 0.0, 0.0])
    });
    let [r, g, b, pdf_w, reverse_pdf_w, ..] = R::transposed(known.each_ref());
    let at_z = BsdfValue { f: R::Vec3::new(r, g, b), pdf_w, reverse_pdf_w };
    let at = y.vertices.point;
    let edge = at.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    let at_y = y.vertices.evaluate::<true>(-wi, Mode::Importance, active);
    let [cos_y, cos_z] = [wi.dot(at.n_shading).abs(), wi.dot(z.n_shading).abs()];
    let unweighted = y.throughput * at_y.f * cos_y * at_z.f * cos_z * z_throughput / distance2;
    let lit = active & !unweighted.same(R::Vec3::of(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let to = [wi.dot(at.n_geometric).abs() / distance2, wi.dot(z.n_geometric).abs() / distance2];
    let others = others_of_ends(work.h, [&y.side, &z_side], [&at_y, &at_z], to);
    let values = work.shared::<R, N>(unweighted, others, lit);
    let rays = shadow_rays::<R, N>([z.position, z.n_geometric], [at.position, at.n_geometric], wi, R::Mask::of(false));
    if TIMED {
        let inside = each(z_nodes, |node| work.table.rows[node.material()][0].0[INSIDE]);
        let ratio = index_ratio([z_wo.dot(z.n_shading), wi.dot(z.n_shading)], R::load(&inside));
        let z = stamps::<R, N>(z_nodes);
        let near = z.onward(ratio, distance2.sqrt());
        let far = stamps::<R, N>(y_nodes).of_light(y.vertices.index_ratio(-wi), z.index * ratio);
        let lengths = R::store_doubles(near + far);
        waiting.lengths.extend(set(lit.bits()).map(|i| lengths[i]));
    }
    for i in set(lit.bits()) {
        waiting.push(&rays[i], &values[i], To::Slot(halves[i].pair.slot));
    }
}

/// `s >= 2`, `t = 1`.
#[inline(always)]
fn lens_shots<R: Lanes<N>, const N: usize, const TIMED: bool>(
    work: &Work<TIMED>,
    class: usize,
    group: &[Shot],
    light: &Subpaths,
    waiting: &mut Waiting,
) {
    let shots: [Shot; N] = filled(group);
    let active = R::Mask::first(group.len());
    let nodes = each(shots, |s| &light.nodes[s.y as usize]);
    let y = loaded::<R, N, TIMED>(work, class, nodes, active);
    let Point { position, n_geometric, n_shading } = y.vertices.point;
    let numbers = work.lens_numbers::<R, N>(light, each(shots, |s| s.path), each(shots, |s| s.taken));
    let OnFilm { at, pixels, inside, importance } = work.onto_film::<R, N>(position, numbers, y.vertices.seen);
    if !inside.any() {
        return;
    }
    let at_y = y.vertices.evaluate::<true>(-at.dir, Mode::Importance, inside);
    let unweighted = y.throughput * at_y.f * at.dir.dot(n_shading).abs() * importance;
    let lit = inside & !unweighted.same(R::Vec3::of(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let spread = area_factor(at.lens, position, n_geometric);
    let others = others_of_lens(work.h, &y.side, &at_y, [at.pdf_w, spread]);
    let values = work.shared::<R, N>(unweighted, others, lit);
    let nowhere = R::Vec3::of(Vec3::ZERO);
    let rays = shadow_rays::<R, N>([position, n_geometric], [at.lens, nowhere], at.dir, R::Mask::of(false));
    if TIMED {
        let medium = R::of(work.context.medium());
        let before = stamps::<R, N>(nodes).of_light(y.vertices.index_ratio(-at.dir), medium);
        let lengths = R::store_doubles(work.lens_lengths::<R, N>(each(shots, |s| s.path), at.distance) + before);
        waiting.lengths.extend(set(lit.bits()).map(|i| lengths[i]));
    }
    for i in set(lit.bits()) {
        waiting.push(&rays[i], &values[i], To::Pixel(shots[i].path, pixels[i]));
    }
}
