// Twin of crates/lumbre-light/src/transport/surface.rs.
#ifndef TRANSPORT_SURFACE_GLSL
#define TRANSPORT_SURFACE_GLSL

#include "scene.glsl"
#include "instance_transform.glsl"
#include "math/trig.glsl"
#include "math/rng.glsl"
#include "transport/light/types.glsl"
#include "transport/ray.glsl"
#include "transport/vertex.glsl"

// A mapped normal that points behind the geometric surface is tilted until its cosine with the
// geometric normal has this value.
const float GRAZING_COSINE = 1e-3;

// An offset against the shadow terminator; fields as in Rust, and whether there is one.
struct TerminatorOffset {
    bool present;
    vec3 base;
    vec3 lifted_point;
    vec3 up;
    bool lifted;
};

const TerminatorOffset NO_TERMINATOR_OFFSET = TerminatorOffset(
    false, vec3(0.0), vec3(0.0), vec3(0.0), false
);

// A point of a surface with everything that shading needs; fields as in Rust.
struct Surface {
    vec3 position;
    vec3 n_geometric;
    float extent;
    vec3 n_shading;
    vec3 tangent;
    Uv uv;
    vec3 tint;
    uint material;
    uint emitter;
    TerminatorOffset terminator;
};

// Returns whether an edge in this direction leaves from the lifted point, provided that its far end
// is below the plane.
bool terminator_offset_applies_to(TerminatorOffset o, vec3 dir) {
    return o.present && dot(dir, o.up) <= 0.0;
}

// Returns whether a point lies below the triangle's plane.
bool terminator_offset_has_below(TerminatorOffset o, vec3 point) {
    return dot(point - o.base, o.up) <= 0.0;
}

// Returns whether a light sample belongs to the other one of base and lifted point.
bool terminator_offset_excludes(TerminatorOffset o, DirectSample direct) {
    bool below = is_finite(direct.distance)
        ? terminator_offset_has_below(o, direct.point.position)
        : terminator_offset_applies_to(o, direct.wi);
    return o.present && below != o.lifted;
}

// Returns the two texels around a coordinate in units of the picture's size, and the weight of the
// second.
uvec2 neighbours(float coordinate, uint size, uint wrap, out float weight) {
    float wrapped = coordinate - floor(coordinate);
    if (wrap == WRAP_MIRROR) {
        // Mirrored wrapping has period 2.
        wrapped = coordinate - 2.0 * floor(coordinate * 0.5);
    } else if (wrap == WRAP_CLAMP) {
        wrapped = is_finite(coordinate) ? clamp(coordinate, 0.0, 1.0) : 0.0;
    }
    float x = (is_finite(wrapped) ? wrapped : 0.0) * float(size) - 0.5;
    float low = floor(x);
    weight = x - low;
    if (wrap == WRAP_REPEAT) {
        // -1 is the last texel; 1 - epsilon may be rounded to the size.
        uint first = low < 0.0 ? size - 1u : uint(low) % size;
        return uvec2(first, (first + 1u) % size);
    }
    int last = int(size) - 1;
    ivec2 texel = ivec2(int(low), int(low) + 1);
    if (wrap == WRAP_MIRROR) {
        texel.x = texel.x > last ? 2 * last + 1 - texel.x : texel.x;
        texel.y = texel.y > last ? 2 * last + 1 - texel.y : texel.y;
    }
    return uvec2(clamp(texel, 0, last));
}

// Returns the texture's image coordinates for texture coordinates on a surface with this tiling.
vec2 texture_place(uint index, Uv uv, float scale, vec2 offset) {
    vec2 set = uv.xy;
    if (SECOND_UVS && textures[index].second != 0u) {
        set = uv.zw;
    }
    vec2 own = set * scale + offset;
    if (textures[index].moved == 0u) {
        return own;
    }
    return textures[index].map_u * own.x + textures[index].map_v * own.y
        + textures[index].map_origin;
}

// Returns the texel of an axis that contains a coordinate, twice, from the two around it.
uvec2 containing(uvec2 around, inout float weight) {
    uint one = weight < 0.5 ? around.x : around.y;
    weight = 0.0;
    return uvec2(one);
}

// Returns the colour at image coordinates: see `Texture::filtered`.
vec3 texture_filtered(uint index, vec2 place) {
    Texture t = textures[index];
    vec2 f;
    uvec2 x = neighbours(place.x, t.width, t.wrap.x, f.x);
    // Row 0 is the top of the picture and v = 0 its bottom; with repetition these coincide.
    float top = t.wrap.y == WRAP_REPEAT ? 0.0 : 1.0;
    uvec2 y = neighbours(top - place.y, t.height, t.wrap.y, f.y);
    if (t.nearest != 0u) {
        x = containing(x, f.x);
        y = containing(y, f.y);
    }
    uvec2 rows = y * t.width;
    vec3 upper = mix(texture_texel(t, rows.x + x.x), texture_texel(t, rows.x + x.y), f.x);
    vec3 lower = mix(texture_texel(t, rows.y + x.x), texture_texel(t, rows.y + x.y), f.x);
    return mix(upper, lower, f.y);
}

// Returns a texture's colour at texture coordinates of a material's surface.
vec3 texture_color(uint index, Uv uv, uint material) {
    vec2 place = texture_place(
        index, uv, materials[material].tiling_scale, materials[material].tiling_offset
    );
    return texture_filtered(index, place);
}

// Returns the colour of a texture of a parameter, or white without a texture.
vec3 lookup(uint index, Uv uv, uint material) {
    return !TEXTURES || index == NONE ? vec3(1.0) : texture_color(index, uv, material);
}

// Returns a texture's red channel, or `scalar` without a texture.
float lookup_scalar(uint index, Uv uv, uint material, float scalar) {
    return !TEXTURES || index == NONE ? scalar : lookup(index, uv, material).x;
}

// Returns texture coordinates on a sphere: longitude about y in u, from the south pole to the north
// pole in v.
vec2 sphere_uv(vec3 n) {
    return vec2(atan2(n.x, n.z) / TAU + 0.5, 1.0 - arc_cos(clamp(n.y, -1.0, 1.0)) / PI);
}

// Returns the texture coordinates at barycentric coordinates of a triangle.
Uv triangle_uv(uint primitive, vec2 at) {
    TriangleAttributes a = attributes[primitive];
    vec2 own = a.ta * (1.0 - at.x - at.y) + a.tb * at.x + a.tc * at.y;
    if (!SECOND_UVS) {
        return uv_of(own);
    }
    uint first = job.first_second_uv, a_corner = 3u * primitive;
    vec3 second = float_texel(first, a_corner) * (1.0 - at.x - at.y)
        + float_texel(first, a_corner + 1u) * at.x + float_texel(first, a_corner + 2u) * at.y;
    return Uv(own, second.xy);
}

// Returns the texture coordinates at a hit of `ray`.
Uv uv_at(Ray ray, Hit hit) {
    if (hit.primitive < job.triangle_count) {
        return triangle_uv(hit.primitive, hit.uv);
    }
    vec3 center = spheres[hit.primitive - job.triangle_count].center;
    return uv_of(sphere_uv(normalize_or(ray.origin + ray.dir * hit.t - center, -ray.dir)));
}

// Returns the coverage of a material's mask at texture coordinates: see Rust.
float coverage(uint material, Uv uv) {
    uint index = materials[material].mask_texture;
    if (!MASKS || index == NONE) {
        return 1.0;
    }
    float mask = texture_color(index, uv, material).x;
    if (materials[material].mask_mode == MASK_BLEND) {
        return clamp(mask, 0.0, 1.0);
    }
    return mask >= materials[material].mask_threshold ? 1.0 : 0.0;
}

// Returns whether a hit is the one at which the ray leaves a sphere.
bool leaves_sphere(Ray ray, Hit hit) {
    if (hit.primitive < job.triangle_count) {
        return false;
    }
    vec3 center = spheres[hit.primitive - job.triangle_count].center;
    return dot(ray.origin + ray.dir * hit.t - center, ray.dir) > 0.0;
}

// Returns whether the mask of the hit material leaves a hole at the hit; in blend mode a hash of
// ray and primitive decides, for each crossing of a sphere.
bool is_masked_out(Ray ray, Hit hit) {
    uint material = material_of(hit.primitive, hit.instance);
    if (!MASKS || materials[material].mask_texture == NONE) {
        return false;
    }
    float covered = coverage(material, uv_at(ray, hit));
    if (materials[material].mask_mode == MASK_THRESHOLD) {
        return covered == 0.0;
    }
    uint number = number_of(hit.primitive, hit.instance) ^ (leaves_sphere(ray, hit) ? 0x80000000u : 0u);
    uvec4 directed = pcg4d(uvec4(floatBitsToUint(ray.dir), number));
    uvec4 placed = uvec4(floatBitsToUint(ray.origin) ^ directed.xyz, directed.w);
    return unit(pcg4d(placed).x) >= covered;
}

// The hit triangle in world space; meaningless for a sphere.
struct Face {
    Triangle corners;
    TriangleAttributes attributes;
};

// Computes the terminator offset at this point of a triangle, if there is one: see Rust.
TerminatorOffset find_terminator_offset(Surface s, Face face, Ray ray, Hit hit) {
    bool opaque = materials[s.material].opacity >= 1.0
        && materials[s.material].opacity_texture == NONE;
    bool metal = !(materials[s.material].metallic < 1.0)
        && materials[s.material].metallic_texture == NONE;
    if (!opaque && !metal) {
        return NO_TERMINATOR_OFFSET;
    }
    Triangle corners = face.corners;
    TriangleAttributes a = face.attributes;
    vec3 lift = a.na * (dot(s.position - corners.a, a.na) * -(1.0 - hit.uv.x - hit.uv.y))
        - a.nb * (dot(s.position - corners.b, a.nb) * hit.uv.x)
        - a.nc * (dot(s.position - corners.c, a.nc) * hit.uv.y);
    vec3 up = dot(ray.dir, s.n_geometric) < 0.0 ? s.n_geometric : -s.n_geometric;
    if (!(dot(lift, up) > 0.0)) {
        return NO_TERMINATOR_OFFSET;
    }
    vec3 lifted_point = offset_origin(s.position + lift, up, s.extent);
    return TerminatorOffset(true, s.position, lifted_point, up, false);
}

// Returns a unit normal tilted to the front of the triangle.
vec3 surface_in_front(Surface s, vec3 n) {
    float behind = dot(n, s.n_geometric) - GRAZING_COSINE;
    return behind < 0.0 ? normalize_or(n - s.n_geometric * behind, s.n_geometric) : n;
}

// Tilts the normal by the slopes of the bump map: see Rust.
void surface_emboss(inout Surface s, Face face, Hit hit, vec3 smooth_normal) {
    uint bump_map = materials[s.material].bump_texture;
    vec2 place =
        texture_place(
            bump_map, s.uv, materials[s.material].tiling_scale, materials[s.material].tiling_offset
        );
    vec2 texel = 1.0 / vec2(textures[bump_map].width, textures[bump_map].height);
    vec2 between = materials[s.material].formulas == FORMULAS_MITSUBA
        ? (floor(place / texel - 0.5) + 1.0) * texel
        : place;
    vec2 slopes = vec2(0.0);
    // A loop with one lookup, since compilers inline every call.
    for (int i = 0; i < 4; ++i) {
        float side = (i & 1) == 0 ? 1.0 : -1.0;
        vec2 along = i < 2 ? vec2(1.0, 0.0) : vec2(0.0, 1.0);
        vec2 at = mix(place, between, along) + along * texel * (0.5 * side);
        slopes += along * (side * texture_filtered(bump_map, at).x);
    }
    slopes /= texel;
    // Slopes along the map's own coordinates, then along those of the surface.
    if (textures[bump_map].moved != 0u) {
        slopes = vec2(dot(textures[bump_map].map_u, slopes), dot(textures[bump_map].map_v, slopes));
    }
    slopes *= materials[s.material].tiling_scale * materials[s.material].bump_height;
    vec3 first, second;
    vec2 rises = slopes;
    if (hit.primitive < job.triangle_count) {
        Triangle corners = face.corners;
        TriangleAttributes a = face.attributes;
        first = corners.b - corners.a;
        second = corners.c - corners.a;
        rises = vec2(dot(slopes, a.tb - a.ta), dot(slopes, a.tc - a.ta));
        if (SECOND_UVS && textures[bump_map].second != 0u) {
            uint first = job.first_second_uv, a_corner = 3u * hit.primitive;
            vec2 uv = float_texel(first, a_corner).xy;
            rises = vec2(
                dot(slopes, float_texel(first, a_corner + 1u).xy - uv),
                dot(slopes, float_texel(first, a_corner + 2u).xy - uv)
            );
        }
    } else {
        float along = spheres[hit.primitive - job.triangle_count].radius * PI;
        vec3 east = vec3(smooth_normal.z, 0.0, -smooth_normal.x);
        first = east * (2.0 * along);
        second = cross(smooth_normal, normalize_or(east, vec3(0.0))) * along;
    }
    vec3 gradient = cross(second * rises.x - first * rises.y, smooth_normal)
        / dot(smooth_normal, cross(first, second));
    vec3 n = s.n_shading - gradient * max(dot(s.n_shading, smooth_normal), 0.0);
    s.n_shading = surface_in_front(s, normalize_or(n, s.n_shading));
}

// Applies the normal map and determines the direction of anisotropy.
void surface_orient(inout Surface s, Face face, Hit hit) {
    // MikkTSpace decodes with interpolated vectors that are not normalised.
    vec3 n_axis = s.n_shading, u_axis, v_axis;
    if (hit.primitive < job.triangle_count) {
        vec3 weights = vec3(1.0 - hit.uv.x - hit.uv.y, hit.uv);
        TriangleAttributes a = face.attributes;
        Tangents t = triangle_tangents(hit.primitive, hit.instance);
        n_axis = a.na * weights.x + a.nb * weights.y + a.nc * weights.z;
        u_axis = (t.a * weights.x + t.b * weights.y + t.c * weights.z).xyz;
        v_axis = cross(a.na, t.a.xyz) * t.a.w * weights.x + cross(a.nb, t.b.xyz) * t.b.w * weights.y
            + cross(a.nc, t.c.xyz) * t.c.w * weights.z;
    } else {
        u_axis = normalize_or(vec3(n_axis.z, 0.0, -n_axis.x), vec3(0.0));
        v_axis = cross(n_axis, u_axis);
    }
    uint normal_map = materials[s.material].normal_texture;
    if (normal_map != NONE && u_axis != vec3(0.0)) {
        vec3 texel = texture_color(normal_map, s.uv, s.material) * 2.0 - 1.0;
        texel.xy *= materials[s.material].normal_strength;
        vec3 n = normalize_or(u_axis * texel.x + v_axis * texel.y + n_axis * texel.z, s.n_shading);
        s.n_shading = surface_in_front(s, n);
    }
    uint directions = materials[s.material].anisotropic_texture;
    if (directions != NONE) {
        vec3 texel = texture_color(directions, s.uv, s.material) * 2.0 - 1.0;
        s.tangent = u_axis * texel.x + v_axis * texel.y;
    } else {
        vec3 along = materials[s.material].anisotropic_direction;
        s.tangent = along != vec3(0.0) ? along : u_axis;
    }
}

// Returns whether shading a material needs tangents.
bool uses_tangents(uint material) {
    bool stretched = materials[material].model != MODEL_LAMBERT
        && materials[material].model != MODEL_TRANSLUCENT
        && materials[material].model != MODEL_OREN_NAYAR && materials[material].anisotropic > 0.0;
    return TANGENTS && (stretched || materials[material].normal_texture != NONE);
}

// Returns the factor on the base colour at barycentric coordinates of a triangle.
vec3 tint_at(uint primitive, vec2 uv) {
    if (job.first_color == NONE) {
        return vec3(1.0);
    }
    uint first = job.first_color, a_corner = 3u * primitive;
    return float_texel(first, a_corner) * (1.0 - uv.x - uv.y)
        + float_texel(first, a_corner + 1u) * uv.x + float_texel(first, a_corner + 2u) * uv.y;
}

// Builds the surface at a hit of `ray` with the given material row.
Surface surface_with_material(Ray ray, Hit hit, uint material) {
    Surface s;
    s.material = material;
    s.tangent = vec3(0.0);
    s.terminator = NO_TERMINATOR_OFFSET;
    Face face;
    if (hit.primitive < job.triangle_count) {
        face.corners = triangle_corners(hit.primitive, hit.instance);
        face.attributes = triangle_attributes(hit.primitive, hit.instance, face.corners);
        Triangle corners = face.corners;
        TriangleAttributes a = face.attributes;
        vec3 weights = vec3(1.0 - hit.uv.x - hit.uv.y, hit.uv);
        s.position = corners.a * weights.x + corners.b * weights.y + corners.c * weights.z;
        s.n_geometric = normalize_or(cross(corners.b - corners.a, corners.c - corners.a), -ray.dir);
        s.extent = triangle_extent(corners, hit.instance);
        s.n_shading = normalize_or(
            a.na * weights.x + a.nb * weights.y + a.nc * weights.z, s.n_geometric
        );
        s.uv = triangle_uv(hit.primitive, hit.uv);
        s.tint = tint_at(hit.primitive, hit.uv);
        s.emitter = emitter_of(hit.primitive, hit.instance);
        if (TERMINATORS && materials[s.material].shadow_terminator != 0u) {
            s.terminator = find_terminator_offset(s, face, ray, hit);
        }
    } else {
        Sphere ball = spheres[hit.primitive - job.triangle_count];
        vec3 n = normalize_or(ray.origin + ray.dir * hit.t - ball.center, -ray.dir);
        s.position = ball.center + n * ball.radius;
        s.n_geometric = n;
        s.extent = sphere_extent(ball);
        s.n_shading = n;
        s.uv = uv_of(sphere_uv(n));
        s.tint = vec3(1.0);
        s.emitter = ball.emitter;
    }
    vec3 smooth_normal = s.n_shading;
    if (uses_tangents(s.material)) {
        surface_orient(s, face, hit);
    }
    if (BUMPS && materials[s.material].bump_texture != NONE) {
        surface_emboss(s, face, hit, smooth_normal);
    }
    return s;
}

// Builds the surface at a hit of `ray`; a composed material is used as a whole.
Surface surface_at(Ray ray, Hit hit) {
    return surface_with_material(ray, hit, material_of(hit.primitive, hit.instance));
}

// Computes this surface as the start of edges from the lifted point; false if it has none.
bool surface_lifted(Surface s, out Surface lifted) {
    lifted = s;
    lifted.position = s.terminator.lifted_point;
    lifted.n_geometric = vec3(0.0);
    lifted.terminator.lifted = true;
    return s.terminator.present;
}

// Returns the terminator offset if an edge in direction `dir` leaves from the lifted point.
TerminatorOffset terminator_into(Surface s, vec3 dir) {
    TerminatorOffset o = s.terminator;
    o.present = terminator_offset_applies_to(o, dir);
    return o;
}

// Returns the radiance emitted towards `wo`: the material's emission on the front side, black
// behind.
vec3 surface_emitted(Surface s, vec3 wo) {
    if (s.emitter == NONE || dot(s.n_geometric, wo) <= 0.0) {
        return vec3(0.0);
    }
    return materials[s.material].emission
        * lookup(materials[s.material].emission_texture, s.uv, s.material);
}

// Returns the base colour.
vec3 surface_base_color(Surface s) {
    return materials[s.material].base_color * s.tint
        * lookup(materials[s.material].base_color_texture, s.uv, s.material);
}

// Returns whether a path that hits this surface ends there: a light that does not reflect.
bool surface_ends_paths(Surface s) {
    return s.emitter != NONE && materials[s.material].emitter_reflects == 0u;
}

// Returns a surface as an end of edges.
EdgeEnd surface_end(Surface s) {
    return EdgeEnd(s.position, s.n_geometric, s.extent);
}

// Returns a ray in direction `dir`, started off the surface on the side of `dir`.
Ray surface_spawn(Surface s, vec3 dir) {
    if (terminator_offset_applies_to(s.terminator, dir)) {
        return Ray(s.terminator.lifted_point, dir);
    }
    return spawn_ray(surface_end(s), dir);
}

#endif
