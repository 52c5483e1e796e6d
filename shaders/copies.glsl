// Copies of meshes: what src/scene/compile/instance.rs says of a primitive and its copy. Without COPIES a scene has none, every
// instance is NONE, and nothing of it is left in a shader.
#ifndef COPIES_GLSL
#define COPIES_GLSL

#include "scene.glsl"
#include "math/elementary.glsl"

// A normal that points behind its triangle is tilted until its cosine with the front is this.
const float FRONT_COSINE = 1e-3;

#ifdef COPIES
double place_entry(uvec2 words) {
    return packDouble2x32(words);
}

// A vector of the mesh in the world.
dvec3 place_vector(Place place, vec3 v) {
    dvec3 x = dvec3(place_entry(place.xx), place_entry(place.xy), place_entry(place.xz));
    dvec3 y = dvec3(place_entry(place.yx), place_entry(place.yy), place_entry(place.yz));
    dvec3 z = dvec3(place_entry(place.zx), place_entry(place.zy), place_entry(place.zz));
    return x * double(v.x) + y * double(v.y) + z * double(v.z);
}

// A point of the mesh in the world, rounded once.
vec3 place_point(Place place, vec3 p) {
    return vec3(place_vector(place, p) + dvec3(place_entry(place.tx), place_entry(place.ty), place_entry(place.tz)));
}

vec3 on_front_side(vec3 n, bool behind, vec3 front) {
    n = behind ? -n : n;
    float cosine = dot(n, front);
    return cosine >= 0.0 ? n : normalize_or(n - (cosine - FRONT_COSINE) * front, front);
}
#endif

// The corners in world space of a triangle.
Triangle triangle_corners(uint primitive, uint instance) {
    Triangle corners = triangles[primitive];
#ifdef COPIES
    if (instance != NONE) {
        Place place = places[instance];
        corners = Triangle(
            place_point(place, corners.a), place_point(place, corners.b), place_point(place, corners.c)
        );
    }
#endif
    return corners;
}

// What shading needs of a triangle whose corners in world space are these: normals in the world.
TriangleAttributes triangle_attributes(uint primitive, uint instance, Triangle corners) {
    TriangleAttributes a = attributes[primitive];
#ifdef COPIES
    if (instance != NONE) {
        Place place = places[instance];
        vec3 front = normalize_or(cross(corners.b - corners.a, corners.c - corners.a), vec3(0.0));
        mat3 m = mat3(place.normal_x, place.normal_y, place.normal_z);
        a.na = normalize_or(m * a.na, front);
        a.nb = normalize_or(m * a.nb, front);
        a.nc = normalize_or(m * a.nc, front);
        bool behind = dot(a.na + a.nb + a.nc, front) < 0.0;
        a.na = on_front_side(a.na, behind, front);
        a.nb = on_front_side(a.nb, behind, front);
        a.nc = on_front_side(a.nc, behind, front);
    }
#endif
    return a;
}

// The tangents at the corners of a triangle in world space; zero where there are none.
Tangents triangle_tangents(uint primitive, uint instance) {
    Tangents t = Tangents(vec4(0.0), vec4(0.0), vec4(0.0));
    if (job.has_tangents != 0u) {
        t = tangents[primitive];
    }
#ifdef COPIES
    if (instance != NONE) {
        Place place = places[instance];
        t.a.xyz = normalize_or(vec3(place_vector(place, t.a.xyz)), vec3(0.0));
        t.b.xyz = normalize_or(vec3(place_vector(place, t.b.xyz)), vec3(0.0));
        t.c.xyz = normalize_or(vec3(place_vector(place, t.c.xyz)), vec3(0.0));
    }
#endif
    return t;
}

// The material row of a primitive.
uint material_of(uint primitive, uint instance) {
    uint own = primitive < job.triangle_count
        ? attributes[primitive].material
        : spheres[primitive - job.triangle_count].material;
#ifdef COPIES
    if (instance != NONE) {
        own = place_materials[places[instance].materials + own];
    }
#endif
    return own;
}

// The emitter row of a primitive, or NONE.
uint emitter_of(uint primitive, uint instance) {
    uint own = primitive < job.triangle_count
        ? attributes[primitive].emitter
        : spheres[primitive - job.triangle_count].emitter;
#ifdef COPIES
    if (instance != NONE && own != NONE) {
        own += places[instance].emitters;
    }
#endif
    return own;
}

// A number that every primitive of every copy has for itself.
uint number_of(uint primitive, uint instance) {
#ifdef COPIES
    if (instance != NONE) {
        return places[instance].first + (primitive - places[instance].start);
    }
#endif
    return primitive;
}

#ifdef COPIES
// The distance at which a ray meets the plane of a copy's triangle as it lies in the world, in double precision; not above
// zero where it starts behind: `distance` of src/render/cpu/copies.rs.
float copy_distance(vec3 origin, vec3 dir, uint primitive, uint instance) {
    Triangle t = triangle_corners(primitive, instance);
    dvec3 a = dvec3(t.a), b = dvec3(t.b), c = dvec3(t.c), o = dvec3(origin), d = dvec3(dir);
    dvec3 normal = cross(b - a, c - a);
    return float(dot(normal, a - o) / dot(normal, d));
}
#endif

#endif
