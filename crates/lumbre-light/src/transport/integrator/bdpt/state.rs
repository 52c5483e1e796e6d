//! State of subpaths between two steps and of their vertices, in lanes and as records in memory.

use glam::Vec3;

use super::weights::{EdgePartials, MisEdge, MisEndpoint, MisPartials};
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, map_array};
use crate::record;
use crate::scene::compile::Uv;
use crate::transport::bsdf::{Bsdf, Orientation, Outgoing};
use crate::transport::integrator::Context;
use crate::transport::integrator::camera_path::Path;
use crate::transport::light::{EmissionSample, LightPoint, SelectedLights};
use crate::transport::path_time::OpticalLength;
use crate::transport::surface::{ShadingParameters, TerminatorOffset};
use crate::transport::vertex::EdgeEnd;

record! {
    /// State of a subpath on an edge, beside that of its [`Path`] and the partial sums of MIS terms.
    pub struct MisState => MisRecord {
        /// Unit normal of the vertex that the edge leaves; zero for a lens point or a lifted point.
        n_last: Vec3,
        /// Product of the BSDF weights, by which Russian roulette chooses the survival probability.
        rr_throughput: Vec3,
        /// Index of the light at which a light subpath starts.
        light: Word,
    }
}

record! {
    /// A vertex of a subpath on a surface, beside its partial sums of MIS terms.
    pub struct VertexState => VertexRecord {
        /// Position in world space.
        position: Vec3,
        /// Unit normal on the front side; zero for a lifted point.
        n_geometric: Vec3,
        /// Greatest absolute coordinate of the primitive: see [`EdgeEnd::extent`].
        extent: Real,
        /// Unit shading normal on the same side.
        n_shading: Vec3,
        /// Unit direction to the previous vertex.
        wo: Vec3,
        /// Throughput of the subpath up to this vertex, over the density of its generation.
        throughput: Vec3,
        /// Density of the way back: see [`MisEndpoint::back`].
        back: Real,
        /// Index of the material.
        material: Word,
        /// Length of all segments: see [`OpticalLength::path`].
        path: Real,
        /// Delays of previous vertices: see [`OpticalLength::delays`].
        delays: Real,
        /// Delay of this vertex: see [`OpticalLength::delay`].
        delay: Real,
        /// Index of the last medium: see [`OpticalLength::index`].
        index: Real,
        /// Index of the region of space that guides camera subpaths there, or
        /// [`NONE`](crate::scene::compile::NONE).
        region: Word,
        /// At guided vertices of light subpaths, density per solid angle with which the region
        /// samples `wo`; elsewhere 0.
        guided_back_w: Real,
    }
}

record! {
    /// Properties of a vertex that only some surfaces have; zero elsewhere.
    pub struct ShadingState => ShadingRecord {
        /// Base colour, with texture and tint: see [`ShadingParameters::base_color`].
        base_color: Vec3,
        /// Roughness, from 0 to 1: see [`ShadingParameters::roughness`].
        roughness: Real,
        /// Weight of the metallic lobes: see [`ShadingParameters::metallic`].
        metallic: Real,
        /// Weight of the opaque lobes: see [`ShadingParameters::opacity`].
        opacity: Real,
        /// Direction of anisotropy: see [`Orientation::tangent`].
        tangent: Vec3,
        /// Start of lifted edges: see [`TerminatorOffset::lifted_point`].
        lifted_point: Vec3,
        /// Unit normal of the triangle: see [`TerminatorOffset::up`].
        up: Vec3,
        /// 1 if there is a terminator offset, else 0.
        lifts: Real,
    }
}

record! {
    /// Start of a light subpath.
    pub struct LightStart => LightStartRecord {
        /// Position in world space: see [`LightPoint::position`].
        position: Vec3,
        /// Unit normal or direction: see [`LightPoint::normal`].
        normal: Vec3,
        /// Unit direction of the first edge.
        dir: Vec3,
        /// First texture coordinate of the first set.
        u: Real,
        /// Second texture coordinate of the first set.
        v: Real,
        /// First texture coordinate of the second set.
        second_u: Real,
        /// Second texture coordinate of the second set.
        second_v: Real,
        /// Index of the light, or [`NONE`](crate::scene::compile::NONE) if no
        /// subpath starts.
        light: Word,
        /// Time of emission of the sample's light, as an optical length.
        emitted: Real,
    }
}

record! {
    /// BSDF of a camera vertex towards a light vertex.
    pub struct CameraEnd => CameraEndRecord {
        /// Value without cosine: see [`BsdfValue::f`](crate::transport::bsdf::BsdfValue::f).
        f: Vec3,
        /// Density of the connecting edge per solid angle.
        pdf_w: Real,
        /// Density of the way back per solid angle.
        reverse_pdf_w: Real,
        /// Index of the connecting edge's medium over that of the last edge.
        ratio: Real,
    }
}

/// Two partial sums of MIS terms in memory, in the order `d_vcm`, `d_vc`.
pub type PartialsRecord = [f64; 2];

/// Loads partial sums in each lane.
#[inline(always)]
pub(super) fn load_partials<R: Lanes<N>, const N: usize>(
    records: [&PartialsRecord; N],
) -> [R::Double; 2] {
    let d_vcm = map_array(records, |record| record[0]);
    let d_vc = map_array(records, |record| record[1]);
    [R::load_doubles(&d_vcm), R::load_doubles(&d_vc)]
}

/// Stores the partial sums of each lane.
#[inline(always)]
fn store_partials<R: Lanes<N>, const N: usize>(
    [d_vcm, d_vc]: [R::Double; 2],
) -> [PartialsRecord; N] {
    let (d_vcm, d_vc) = (R::store_doubles(d_vcm), R::store_doubles(d_vc));
    let mut records = [[0.0; 2]; N];
    for (i, record) in records.iter_mut().enumerate() {
        *record = [d_vcm[i], d_vc[i]];
    }
    records
}

/// A subpath in each lane, on an edge.
#[derive(Clone, Copy)]
pub struct Subpath<R: Real> {
    /// Ray, throughput, random numbers and optical length.
    pub path: Path<R>,
    /// The rest of the state.
    pub mis: MisState<R>,
    /// Partial sums of MIS terms.
    pub partials: EdgePartials<R::Double>,
}

impl<R: Real> Subpath<R> {
    /// Returns the edge; `parallel` is whether it is a parallel ray of the camera.
    #[inline(always)]
    pub fn edge(&self, parallel: bool) -> MisEdge<R> {
        MisEdge {
            from: [self.path.state.last, self.mis.n_last],
            pdf_w: self.path.state.last_pdf_w,
            partials: self.partials,
            parallel,
        }
    }

    /// Returns the subpaths whose state beside that of the path was stored.
    #[inline(always)]
    pub fn load<const N: usize>(
        path: Path<R>,
        records: [&MisRecord; N],
        partials: [&PartialsRecord; N],
    ) -> Subpath<R>
    where
        R: Lanes<N>,
    {
        let [d_vcm, d_vc] = load_partials::<R, N>(partials);
        Subpath {
            path,
            mis: MisRecord::load(records),
            partials: EdgePartials { d_vcm, d_vc },
        }
    }

    /// Stores the state beside that of the path.
    #[inline(always)]
    pub fn store<const N: usize>(&self) -> ([MisRecord; N], [PartialsRecord; N])
    where
        R: Lanes<N>,
    {
        let EdgePartials { d_vcm, d_vc } = self.partials;
        let partials = store_partials::<R, N>([d_vcm, d_vc]);
        (MisRecord::store(self.mis), partials)
    }
}

/// A vertex of a subpath on a surface in each lane, with its BSDF.
#[derive(Clone, Copy)]
pub struct Vertex<R: Real = f32> {
    /// Position, normals, and the subpath up to here.
    pub state: VertexState<R>,
    /// Partial sums of MIS terms.
    pub partials: MisPartials<R::Double>,
    /// Offset against the shadow terminator for edges towards light; `None` if no lane has one.
    pub terminator: Option<TerminatorOffset<R>>,
    /// The BSDF at these points.
    pub bsdf: Bsdf<R>,
    /// Direction to the previous vertex, with everything that the BSDF derives from it.
    pub out: Outgoing<R>,
}

impl<R: Real> VertexState<R> {
    /// Loads camera vertices with their partial sums, as [starts](Self::towards_light) of edges
    /// towards light at `point`. `shading` exists in scenes with terminator offsets.
    #[inline(always)]
    pub fn load_towards<const N: usize>(
        records: [&VertexRecord; N],
        partials: [&PartialsRecord; N],
        shading: Option<[&ShadingRecord; N]>,
        point: R::Vec3,
    ) -> (VertexState<R>, MisPartials<R::Double>)
    where
        R: Lanes<N>,
    {
        let state: VertexState<R> = VertexRecord::load(records);
        let [d_vcm, d_vc] = load_partials::<R, N>(partials);
        let shading: Option<ShadingState<R>> = shading.map(ShadingRecord::load);
        let terminator = shading.and_then(|shading| shading.terminator(state.position));
        let state = state.towards_light(&terminator, point);
        (state, MisPartials { d_vcm, d_vc })
    }

    /// Returns position and unit normal.
    #[inline(always)]
    pub fn point(&self) -> [R::Vec3; 2] {
        [self.position, self.n_geometric]
    }

    /// Returns the vertex as an end of edges.
    #[inline(always)]
    pub fn end(&self) -> EdgeEnd<R> {
        EdgeEnd {
            position: self.position,
            normal: self.n_geometric,
            extent: self.extent,
        }
    }

    /// Returns the cosine by which a BSDF value towards `wi` is multiplied.
    #[inline(always)]
    pub fn cos(&self, wi: R::Vec3) -> R {
        wi.dot(self.n_shading).abs()
    }

    /// Returns the optical length of the subpath up to this vertex.
    #[inline(always)]
    pub fn optical(&self) -> OpticalLength<R> {
        OpticalLength {
            path: self.path,
            delays: self.delays,
            delay: self.delay,
            index: self.index,
        }
    }

    /// Returns this vertex with the partial sums of its subpath, as weights need it.
    #[inline(always)]
    pub fn endpoint(&self, partials: MisPartials<R::Double>) -> MisEndpoint<R> {
        let back = self.back;
        MisEndpoint { partials, back }
    }

    /// Returns the vertices as starts of edges towards light at `point`: lifted where the offset
    /// against the shadow terminator applies.
    #[inline(always)]
    pub fn towards_light(
        &self,
        terminator: &Option<TerminatorOffset<R>>,
        point: R::Vec3,
    ) -> VertexState<R> {
        match terminator {
            Some(offset) => self.lifted(offset, offset.has_below(point)),
            None => *self,
        }
    }

    /// Returns the vertices as starts of edges from their lifted points in the lanes of `lifted`:
    /// see [`Surface::lifted`](crate::transport::surface::Surface::lifted).
    #[inline(always)]
    fn lifted(&self, offset: &TerminatorOffset<R>, lifted: R::Mask) -> VertexState<R> {
        let none = R::Vec3::broadcast(Vec3::ZERO);
        VertexState {
            position: R::Vec3::select(lifted, offset.lifted_point, self.position),
            n_geometric: R::Vec3::select(lifted, none, self.n_geometric),
            ..*self
        }
    }
}

impl<R: Real> ShadingState<R> {
    /// Returns the properties of vertices that the surfaces have.
    #[inline(always)]
    pub fn new(
        parameters: Option<&ShadingParameters<R>>,
        tangent: R::Vec3,
        terminator: Option<&TerminatorOffset<R>>,
    ) -> ShadingState<R> {
        let (zero, black) = (R::splat(0.0), R::Vec3::broadcast(Vec3::ZERO));
        let parameters = parameters.copied().unwrap_or(ShadingParameters {
            base_color: black,
            roughness: zero,
            metallic: zero,
            opacity: zero,
        });
        let exists = terminator.map_or(R::Mask::default(), |offset| offset.exists);
        ShadingState {
            base_color: parameters.base_color,
            roughness: parameters.roughness,
            metallic: parameters.metallic,
            opacity: parameters.opacity,
            tangent,
            lifted_point: terminator.map_or(black, |offset| offset.lifted_point),
            up: terminator.map_or(black, |offset| offset.up),
            lifts: R::select(exists, R::splat(1.0), zero),
        }
    }

    /// Returns the offsets against the shadow terminator of vertices at `base`; `None` if no lane
    /// has one.
    #[inline(always)]
    pub fn terminator(&self, base: R::Vec3) -> Option<TerminatorOffset<R>> {
        let exists = self.lifts.gt(R::splat(0.0));
        exists.any().then_some(TerminatorOffset {
            exists,
            base,
            lifted_point: self.lifted_point,
            up: self.up,
            lifted: false,
        })
    }

    /// Returns the parameters of the materials.
    #[inline(always)]
    fn parameters(&self) -> ShadingParameters<R> {
        ShadingParameters {
            base_color: self.base_color,
            roughness: self.roughness,
            metallic: self.metallic,
            opacity: self.opacity,
        }
    }
}

impl<R: Real> Vertex<R> {
    /// Loads vertices on surfaces of the class with an index. `shading` exists in scenes where
    /// surfaces have such properties.
    #[inline(always)]
    pub fn load<const N: usize>(
        context: &Context,
        class: usize,
        records: [&VertexRecord; N],
        partials: [&PartialsRecord; N],
        shading: Option<[&ShadingRecord; N]>,
    ) -> Vertex<R>
    where
        R: Lanes<N>,
    {
        let state: VertexState<R> = VertexRecord::load(records);
        let [d_vcm, d_vc] = load_partials::<R, N>(partials);
        let class = &context.classes[class];
        let shading: Option<ShadingState<R>> = shading
            .filter(|_| class.has_shading())
            .map(ShadingRecord::load);
        let terminator = shading.and_then(|shading| shading.terminator(state.position));
        let at = Orientation {
            n_geometric: state.n_geometric,
            n_shading: state.n_shading,
            tangent: shading
                .filter(|_| class.surface.tangents)
                .map(|shading| shading.tangent),
            terminator: terminator.map_or(R::Mask::default(), |offset| offset.exists),
        };
        let parameters = shading
            .filter(|_| class.bsdf.varies)
            .map(|shading| shading.parameters());
        let materials = R::store_words(state.material);
        let bsdf = context
            .classes
            .bsdf(class, materials, &at, parameters.as_ref());
        Vertex {
            out: bsdf.outgoing(state.wo),
            state,
            partials: MisPartials { d_vcm, d_vc },
            terminator,
            bsdf,
        }
    }

    /// Stores state and partial sums.
    #[inline(always)]
    pub fn store<const N: usize>(&self) -> ([VertexRecord; N], [PartialsRecord; N])
    where
        R: Lanes<N>,
    {
        let MisPartials { d_vcm, d_vc } = self.partials;
        let partials = store_partials::<R, N>([d_vcm, d_vc]);
        (VertexRecord::store(self.state), partials)
    }

    /// Returns the quantities of the vertices that weights depend on.
    #[inline(always)]
    pub fn endpoint(&self) -> MisEndpoint<R> {
        self.state.endpoint(self.partials)
    }

    /// Makes the vertices starts of edges from their lifted points. Returns the lanes that have one.
    #[inline(always)]
    pub fn lift(&mut self) -> R::Mask {
        let Some(offset) = &mut self.terminator else {
            return R::Mask::default();
        };
        self.state = self.state.lifted(offset, offset.exists);
        offset.lifted = true;
        offset.exists
    }
}

impl<R: Real> LightStart<R> {
    /// Returns the start that was sampled, on the lights with these indices.
    #[inline(always)]
    pub fn new<const N: usize>(
        sample: &EmissionSample<R, N>,
        light: R::Word,
        emitted: R,
    ) -> LightStart<R> {
        let [u, v, second_u, second_v] = sample.point.uv.to_array();
        LightStart {
            position: sample.point.position,
            normal: sample.point.normal,
            dir: sample.dir,
            u,
            v,
            second_u,
            second_v,
            light,
            emitted,
        }
    }

    /// Returns the points of the lights, which are selected.
    #[inline(always)]
    pub fn point<const N: usize>(&self, lights: &SelectedLights<R, N>) -> LightPoint<R, N>
    where
        R: Lanes<N>,
    {
        LightPoint {
            lights: lights.ids(),
            position: self.position,
            normal: self.normal,
            extent: lights.extent(),
            uv: Uv::from_array([self.u, self.v, self.second_u, self.second_v]),
        }
    }
}

/// A vertex of a subpath, with the event that led to the next one.
#[derive(Clone, Copy)]
pub struct SubpathVertex {
    /// The vertex itself, with its BSDF.
    pub vertex: Vertex,
    /// Whether the event was a Dirac event.
    pub delta: bool,
    /// Index ratio crossed by that event.
    pub eta: f32,
}
