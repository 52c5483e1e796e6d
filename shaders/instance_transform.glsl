// Instances of meshes: the world-space geometry of a primitive and its instance, as in
// crates/lumbre-light/src/scene/compile/instance.rs. Without INSTANCES a scene has none, and every instance is
// NONE. Transforms need double precision.
#ifndef INSTANCE_TRANSFORM_GLSL
#define INSTANCE_TRANSFORM_GLSL

#include "scene.glsl"
#include "math/trig.glsl"

// A normal that points behind its triangle is tilted until its cosine with the front has this
// value.
const float FRONT_COSINE = 1e-3;

#ifdef EXTENDED
double place_entry(uvec2 words) {
    return packDouble2x32(words);
}

// Transforms a vector of the mesh to world space.
dvec3 place_vector(Placement place, vec3 v) {
    dvec3 x = dvec3(place_entry(place.xx), place_entry(place.xy), place_entry(place.xz));
    dvec3 y = dvec3(place_entry(place.yx), place_entry(place.yy), place_entry(place.yz));
    dvec3 z = dvec3(place_entry(place.zx), place_entry(place.zy), place_entry(place.zz));
    return x * double(v.x) + y * double(v.y) + z * double(v.z);
}

// Transforms a point of the mesh to world space, rounded once.
vec3 place_point(Placement place, vec3 p) {
    return vec3(
        place_vector(place, p)
            + dvec3(place_entry(place.tx), place_entry(place.ty), place_entry(place.tz))
    );
}

vec3 on_front_side(vec3 n, bool behind, vec3 front) {
    n = behind ? -n : n;
    float cosine = dot(n, front);
    return cosine >= 0.0 ? n : normalize_or(n - (cosine - FRONT_COSINE) * front, front);
}
#endif

// Returns the world-space corners of a triangle.
Triangle triangle_corners(uint primitive, uint instance) {
    Triangle corners = triangles[primitive];
#ifdef EXTENDED
    if (INSTANCES && instance != NONE) {
        Placement place = places[instance];
        corners = Triangle(
            place_point(place, corners.a), place_point(place, corners.b),
            place_point(place, corners.c)
        );
    }
#endif
    return corners;
}

// Returns the greatest absolute coordinate of a vector.
float greatest_coordinate(vec3 v) {
    v = abs(v);
    return max(v.x, max(v.y, v.z));
}

// Returns the greatest absolute coordinate of a triangle with these world-space corners, and of how
// far its instance was moved: a measure of the rounding errors of its points.
float triangle_extent(Triangle corners, uint instance) {
    float extent = max(
        greatest_coordinate(corners.a),
        max(greatest_coordinate(corners.b), greatest_coordinate(corners.c))
    );
#ifdef EXTENDED
    if (INSTANCES && instance != NONE) {
        extent = max(extent, greatest_coordinate(place_point(places[instance], vec3(0.0))));
    }
#endif
    return max(extent, job.least_extent);
}

// Returns the same of a sphere.
float sphere_extent(Sphere ball) {
    return max(greatest_coordinate(ball.center) + ball.radius, job.least_extent);
}

// Returns the shading data of a triangle with these world-space corners: normals in world space.
TriangleAttributes triangle_attributes(uint primitive, uint instance, Triangle corners) {
    TriangleAttributes a = attributes[primitive];
#ifdef EXTENDED
    if (INSTANCES && instance != NONE) {
        Placement place = places[instance];
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

// Returns the world-space tangents at the corners of a triangle; zero if there are none.
Tangents triangle_tangents(uint primitive, uint instance) {
    Tangents t = Tangents(vec4(0.0), vec4(0.0), vec4(0.0));
    if (job.has_tangents != 0u) {
        t = tangents[primitive];
    }
#ifdef EXTENDED
    if (INSTANCES && instance != NONE) {
        Placement place = places[instance];
        t.a.xyz = normalize_or(vec3(place_vector(place, t.a.xyz)), vec3(0.0));
        t.b.xyz = normalize_or(vec3(place_vector(place, t.b.xyz)), vec3(0.0));
        t.c.xyz = normalize_or(vec3(place_vector(place, t.c.xyz)), vec3(0.0));
    }
#endif
    return t;
}

// Returns the material row of a primitive.
uint material_of(uint primitive, uint instance) {
    uint own = primitive < job.triangle_count
        ? attributes[primitive].material
        : spheres[primitive - job.triangle_count].material;
    if (INSTANCES && instance != NONE) {
        own = place_materials[places[instance].materials + own];
    }
    return own;
}

// Returns the emitter row of a primitive, or NONE.
uint emitter_of(uint primitive, uint instance) {
    uint own = primitive < job.triangle_count
        ? attributes[primitive].emitter
        : spheres[primitive - job.triangle_count].emitter;
    if (INSTANCES && instance != NONE && own != NONE) {
        own += places[instance].emitters;
    }
    return own;
}

// Returns a number that is unique to every primitive of every instance.
uint number_of(uint primitive, uint instance) {
    if (INSTANCES && instance != NONE) {
        return places[instance].first + (primitive - places[instance].start);
    }
    return primitive;
}

// Returns the distance at which a ray hits the plane of an instance's triangle in world space, in
// double precision; not positive if the plane is behind the ray: `distance` of
// crates/lumbre-render/src/cpu/bvh/instances.rs.
float instance_distance(vec3 origin, vec3 dir, uint primitive, uint instance) {
#ifdef EXTENDED
    Triangle t = triangle_corners(primitive, instance);
    dvec3 a = dvec3(t.a), b = dvec3(t.b), c = dvec3(t.c), o = dvec3(origin), d = dvec3(dir);
    dvec3 normal = cross(b - a, c - a);
    return float(dot(normal, a - o) / dot(normal, d));
#else
    return 0.0;
#endif
}

#endif
