//! What shaders read of a scene.

super::gpu_structs! {
    /// Corners of a triangle in world space, counter-clockwise seen from its front.
    pub struct Triangle {
        /// First corner.
        a: [f32; 3],
        /// Second corner, weight `hit.uv.x`.
        b: [f32; 3],
        /// Third corner, weight `hit.uv.y`.
        c: [f32; 3],
    }

    /// What shading needs of a triangle.
    pub struct TriangleAttributes {
        /// Unit shading normal at the first corner.
        na: [f32; 3],
        /// Unit shading normal at the second corner.
        nb: [f32; 3],
        /// Unit shading normal at the third corner.
        nc: [f32; 3],
        /// Texture coordinates at the first corner.
        ta: [f32; 2],
        /// Texture coordinates at the second corner.
        tb: [f32; 2],
        /// Texture coordinates at the third corner.
        tc: [f32; 2],
        /// Index into `materials`.
        material: u32,
        /// Index into `emitters`, or NONE.
        emitter: u32,
    }

    /// MikkTSpace tangents of a triangle: a unit vector and in `w` the sign of the bitangent.
    pub struct Tangents {
        /// At the first corner.
        a: [f32; 4],
        /// At the second corner.
        b: [f32; 4],
        /// At the third corner.
        c: [f32; 4],
    }

    /// An analytic sphere; its front is the outside.
    pub struct Sphere {
        /// Centre in world space.
        center: [f32; 3],
        /// Radius, positive.
        radius: f32,
        /// Index into `materials`.
        material: u32,
        /// Index into `emitters`, or NONE.
        emitter: u32,
    }

    /// A material, as `scene::compile::Material`.
    pub struct Material {
        /// Base colour, linear.
        base_color: [f32; 3],
        /// Emitted radiance of the front side.
        emission: [f32; 3],
        /// MODEL_DISNEY and so on.
        model: u32,
        /// Perceptual roughness.
        roughness: f32,
        /// 0 dielectric to 1 metal.
        metallic: f32,
        /// 1 opaque to 0 refractive.
        opacity: f32,
        /// Index of refraction relative to the outside.
        ior: f32,
        /// Part of the flatter diffuse lobe.
        subsurface: f32,
        /// Hue in the dielectric's reflectance at normal incidence.
        specular_tint: f32,
        /// Stretch of highlights.
        anisotropic: f32,
        /// World-space direction of the stretch; zero is the direction of growing u.
        anisotropic_direction: [f32; 3],
        /// Sheen.
        sheen: f32,
        /// Hue of the sheen.
        sheen_tint: f32,
        /// Clear coat.
        clearcoat: f32,
        /// Gloss of the clear coat.
        clearcoat_gloss: f32,
        /// Roughness below which specular lobes are Dirac lobes.
        smooth_below: f32,
        /// Factor on the slope of the normal map.
        normal_strength: f32,
        /// How far 1 in the bump map stands out, in scene units.
        bump_height: f32,
        /// Mask values below this are holes.
        mask_threshold: f32,
        /// MASK_THRESHOLD or MASK_BLEND.
        mask_mode: u32,
        /// 1 where paths leave opaque triangles from the surface that their normals suggest, else 0.
        shadow_terminator: u32,
        /// Texture that multiplies `base_color`, or NONE.
        base_color_texture: u32,
        /// Texture that multiplies `emission`, or NONE.
        emission_texture: u32,
        /// Texture whose red channel is the mask, or NONE.
        mask_texture: u32,
        /// Texture whose red channel replaces `roughness`, or NONE.
        roughness_texture: u32,
        /// Texture whose red channel replaces `metallic`, or NONE.
        metallic_texture: u32,
        /// Texture whose red channel replaces `opacity`, or NONE.
        opacity_texture: u32,
        /// Texture of directions in the tangent frame, or NONE.
        anisotropic_texture: u32,
        /// Normal map, or NONE.
        normal_texture: u32,
        /// Texture whose red channel is a height, or NONE.
        bump_texture: u32,
        /// Factor from texture coordinates to places in the textures.
        tiling_scale: f32,
        /// Offset of the same, in repeats.
        tiling_offset: [f32; 2],
        /// 1 where the surface of a light also reflects, else 0.
        emitter_reflects: u32,
        /// Factor on what an interface reflects.
        specular: [f32; 3],
        /// Real part of a metal's index by channel.
        eta: [f32; 3],
        /// Imaginary part of a metal's index by channel.
        k: [f32; 3],
        /// DISTRIBUTION_GGX or DISTRIBUTION_BECKMANN.
        distribution: u32,
        /// 1 where a dielectric is a thin pane, else 0.
        thin: u32,
        /// 1 where light that plastic reflects back inside takes on its colour each time, else 0.
        nonlinear: u32,
        /// Part of diffuse light that is reflected back at the inside of plastic.
        internal_reflectance: f32,
        /// First row in `material_parts` of a composed or delayed material, and how many; none for a plain one.
        parts: [u32; 2],
    }

    /// A part of a composed or delayed material.
    pub struct MaterialPart {
        /// The sum of the weights up to this part; exactly 1 for the last one.
        upto: f32,
        /// Index into `materials`.
        material: u32,
        /// First row in `delay_profiles`, and how many: their delays add up.
        profiles: [u32; 2],
    }

    /// A profile in time: each of its one or two parameters is `offset + value * texture`.
    pub struct DelayProfile {
        /// DELAY_NONE and so on.
        kind: u32,
        /// What textures multiply.
        value: [f32; 2],
        /// What is added.
        offset: [f32; 2],
        /// Textures whose red channel counts, or NONE.
        textures: [u32; 2],
        /// Factor from texture coordinates to places in the textures.
        tiling_scale: f32,
        /// Offset of the same, in repeats.
        tiling_offset: [f32; 2],
        /// First row in `knots` of a table, and how many.
        knots: [u32; 2],
    }

    /// A point of the density of a table, as words of double precision, low word first.
    pub struct Knot {
        /// Delay in scene units.
        x: [u32; 2],
        /// Density in 1 / scene unit.
        density: [u32; 2],
        /// Probability of everything below.
        below: [u32; 2],
    }

    /// A texture: texels `[y][x]` from `texel_at(first)`, linear, origin top-left.
    pub struct Texture {
        /// Index of the first texel.
        first: u32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// What is beyond the edges along u and v: WRAP_REPEAT and so on.
        wrap: [u32; 2],
        /// 1 where the second set of texture coordinates is meant, else 0.
        second: u32,
        /// 1 where coordinates are moved by the three below, else 0.
        moved: u32,
        /// Where the map takes growing u.
        map_u: [f32; 2],
        /// Where the map takes growing v.
        map_v: [f32; 2],
        /// Where the map takes (0, 0).
        map_origin: [f32; 2],
    }

    /// One emissive primitive.
    pub struct Emitter {
        /// Primitive id: triangles first, spheres after them.
        primitive: u32,
        /// The copy of a mesh that it belongs to, or NONE.
        instance: u32,
        /// Area in square scene units.
        area: f32,
    }

    /// Where a copy of a mesh stands: `scene::compile::Instance`. Words of doubles, low one first.
    pub struct Place {
        /// What the mesh's x axis is in the world, its x.
        xx: [u32; 2],
        /// Its y.
        xy: [u32; 2],
        /// Its z.
        xz: [u32; 2],
        /// What the mesh's y axis is in the world, its x.
        yx: [u32; 2],
        /// Its y.
        yy: [u32; 2],
        /// Its z.
        yz: [u32; 2],
        /// What the mesh's z axis is in the world, its x.
        zx: [u32; 2],
        /// Its y.
        zy: [u32; 2],
        /// Its z.
        zz: [u32; 2],
        /// Where the mesh's origin is in the world, its x.
        tx: [u32; 2],
        /// Its y.
        ty: [u32; 2],
        /// Its z.
        tz: [u32; 2],
        /// From the mesh's normals to the world's, first column.
        normal_x: [f32; 3],
        /// Second column.
        normal_y: [f32; 3],
        /// Third column.
        normal_z: [f32; 3],
        /// Row in `triangles` of the mesh's first triangle.
        start: u32,
        /// First row in `place_materials`.
        materials: u32,
        /// Row in `emitters` of the first of its triangles that shine.
        emitters: u32,
        /// The number of its first triangle where nothing is shared.
        first: u32,
    }

    /// How rays enter the space of a copy's mesh: `render::entrance::Entrance`.
    pub struct Entrance {
        /// From directions of the world to those of the mesh, first column.
        inverse_x: [f32; 3],
        /// Second column.
        inverse_y: [f32; 3],
        /// Third column.
        inverse_z: [f32; 3],
        /// The middle of the mesh's box in the world.
        pivot_world: [f32; 3],
        /// The same in the mesh's space.
        pivot_own: [f32; 3],
        /// The first node of the mesh's tree.
        root: u32,
    }

    /// A point that shines in all directions or into a cone.
    pub struct PointLight {
        /// Position in world space.
        position: [f32; 3],
        /// Radiant intensity along the axis.
        intensity: [f32; 3],
        /// Axis of the cone, a unit vector.
        axis: [f32; 3],
        /// Angle in radians up to which the intensity is whole.
        beam: f32,
        /// Angle in radians from which on there is none.
        cutoff: f32,
        /// One minus the cosine of `beam`.
        beam_height: f32,
        /// One minus the cosine of `cutoff`; 2 is all directions.
        cutoff_height: f32,
        /// 1 where it falls off with the square of what is linear in the cosine, 0 where linearly with the angle.
        is_smooth: u32,
    }

    /// Parallel light.
    pub struct DirectionalLight {
        /// Unit direction in which the light travels.
        direction: [f32; 3],
        /// Irradiance on a surface that faces the light.
        irradiance: [f32; 3],
    }
}
