//! Structs of the vertices of subpaths, and of the light subpaths that the samples of an iteration share.

super::gpu_structs! {
    /// A light subpath: its start, and its vertices.
    pub struct LightPath {
        /// Index of its light; NONE if there is no subpath.
        light: u32,
        /// Position of the start in world space.
        position: [f32; 3],
        /// Unit normal there, or direction of the light.
        normal: [f32; 3],
        /// Greatest absolute coordinate of the primitive.
        extent: f32,
        /// Texture coordinates of both sets.
        uv: [f32; 4],
        /// Unit direction of the first edge.
        dir: [f32; 3],
        /// Radiance that the light emits there.
        radiance: [f32; 3],
        /// Number of vertices on surfaces.
        vertices: u32,
        /// Number of those that can be connected.
        connectible: u32,
        /// Number of those of the earlier subpaths of its block.
        before: u32,
    }

    /// A vertex of a subpath: the ray that hit the surface, and the hit. Everything that depends only on
    /// the scene is derived again when the vertex is connected.
    pub struct SubpathVertex {
        /// Origin of the ray.
        origin: [f32; 3],
        /// Direction of the ray.
        dir: [f32; 3],
        /// Distance of the hit.
        t: f32,
        /// Primitive that was hit.
        primitive: u32,
        /// Instance of a mesh, or NONE.
        instance: u32,
        /// Barycentric weights of the hit.
        uv: [f32; 2],
        /// Row of the material, with NOT_CONNECTIBLE.
        material: u32,
        /// Factor from a density per solid angle to the other side's density of the previous vertex.
        back: f32,
        /// Root of the MIS terms of the other strategies if a camera vertex emits; else 0.
        hit_others: f32,
        /// Throughput of the subpath up to this vertex.
        throughput: [f32; 3],
        /// Root of the first partial sum of MIS terms.
        d_vcm: f32,
        /// Root of the second partial sum of MIS terms.
        d_vc: f32,
    }

    /// Optical length of a subpath up to a vertex.
    pub struct SubpathLength {
        /// Length of all segments.
        path: f32,
        /// Delays of previous vertices.
        delays: f32,
        /// Delay of this vertex.
        delay: f32,
        /// Index of the last medium.
        index: f32,
    }

    /// Start of the list of vertices that can be connected.
    pub struct LightListHead {
        /// Number of vertices in the list.
        count: u32,
        /// Expected number of connections with each vertex of a light subpath, for weights.
        connecting: f32,
    }
}
