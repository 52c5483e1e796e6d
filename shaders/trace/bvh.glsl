// The traversal of `vulkan-compute`: 8-wide nodes with compressed boxes [Ylitie et al. 2017], as
// built by crates/lumbre-vulkan/src/accel/bvh.rs. A node is five uvec4:
//   0: corner of its box (3 floats); exponents of the box's grid (3 bytes); which children are
//      nodes (1 byte)
//   1: first child node; first primitive; meta data of the eight children
//   2, 3, 4: lower and upper grid coordinates of the eight children in x, in y, in z
// Node 0 is the root of the scene's tree. With INSTANCES some of its primitives are instances of
// meshes: there the ray continues in the space of the mesh, through the mesh's own tree, on the
// same stack.
#ifndef TRACE_BVH_GLSL
#define TRACE_BVH_GLSL

#include "trace/intersect.glsl"
#include "transport/surface.glsl"

layout(set = 0, binding = 34, scalar) readonly buffer Nodes { uvec4 nodes[]; };
// Triangles, then spheres, then instances.
layout(set = 0, binding = 35, scalar) readonly buffer LeafPrimitives { uint leaf_primitives[]; };
layout(set = 0, binding = 36, scalar) readonly buffer Transforms {
    InstanceTransform transforms[];
};

// A ray prepared for box tests.
struct BoxRay {
    vec3 origin;
    vec3 inverse;
    // Which of the two planes of an axis the ray hits first: true for the upper one.
    bvec3 backward;
    // In every byte, the slot that the ray visits first.
    uint octant;
};

uint byte_of(uint word, uint i) {
    return bitfieldExtract(word, int(8u * i), 8);
}

// Returns the children of a node whose boxes the ray hits before t_max: in the upper byte the
// nodes, in visiting order; below, the primitives of leaves.
uint node_hits(uvec4 n0, uvec4 n1, uint node, BoxRay ray, float t_max) {
    vec3 grid = uintBitsToFloat(
        uvec3(byte_of(n0.w, 0u), byte_of(n0.w, 1u), byte_of(n0.w, 2u)) << 23
    );
    vec3 scale = grid * ray.inverse;
    vec3 start = (uintBitsToFloat(n0.xyz) - ray.origin) * ray.inverse;
    // A bound on rounding errors, so that no box is missed.
    vec3 slack = 4e-7 * (abs(start) + 255.0 * abs(scale));
    vec3 first = start - slack;
    vec3 last = start + slack;
    uvec4 x = nodes[node + 2u];
    uvec4 y = nodes[node + 3u];
    uvec4 z = nodes[node + 4u];
    x = ray.backward.x ? x.zwxy : x;
    y = ray.backward.y ? y.zwxy : y;
    z = ray.backward.z ? z.zwxy : z;
    uint hits = 0u;
    for (uint half_node = 0u; half_node < 2u; half_node++) {
        uint meta = half_node == 0u ? n1.z : n1.w;
        uvec3 near = half_node == 0u ? uvec3(x.x, y.x, z.x) : uvec3(x.y, y.y, z.y);
        uvec3 far = half_node == 0u ? uvec3(x.z, y.z, z.z) : uvec3(x.w, y.w, z.w);
        uint inner = ((meta & (meta << 1)) & 0x10101010u) >> 4;
        uint bits = (meta >> 5) & 0x07070707u;
        uint places = (meta ^ (ray.octant & (inner * 0xffu))) & 0x1f1f1f1fu;
        for (uint i = 0u; i < 4u; i++) {
            vec3 enter = vec3(byte_of(near.x, i), byte_of(near.y, i), byte_of(near.z, i)) * scale
                + first;
            vec3 leave = vec3(byte_of(far.x, i), byte_of(far.y, i), byte_of(far.z, i)) * scale
                + last;
            float from = max(max(enter.x, enter.y), max(enter.z, 0.0));
            float to = min(min(leave.x, leave.y), min(leave.z, t_max));
            if (from <= to) {
                hits |= byte_of(bits, i) << byte_of(places, i);
            }
        }
    }
    return hits;
}

BoxRay box_ray(Ray ray) {
    BoxRay boxed;
    boxed.origin = ray.origin;
    // A zero component would give 0 * inf = NaN on a box's plane; a tiny one is equivalent and
    // stays finite.
    vec3 dir = mix(ray.dir, mix(vec3(1e-20), vec3(-1e-20), lessThan(ray.dir, vec3(0.0))),
        lessThan(abs(ray.dir), vec3(1e-20)));
    boxed.inverse = 1.0 / dir;
    boxed.backward = lessThan(dir, vec3(0.0));
    boxed.octant = (boxed.backward.x ? 0u : 0x04040404u) | (boxed.backward.y ? 0u : 0x02020202u)
        | (boxed.backward.z ? 0u : 0x01010101u);
    return boxed;
}

// Widens the maximum distance in the space of an instance, since distances there are subject to
// rounding.
const float LIMIT_SLACK = 1.0 + 1.0 / 1048576.0;

// Transforms a ray to the space of an instance's mesh, as crates/lumbre-render/src/instance_transform.rs does.
Ray transform_ray(InstanceTransform e, Ray ray) {
    mat3 inverse = mat3(e.inverse_x, e.inverse_y, e.inverse_z);
    return Ray(inverse * (ray.origin - e.pivot_world) + e.pivot_own, inverse * ray.dir);
}

// Returns the maximum distance of hits in the space of an instance, or in world space for NONE.
float limit_in(uint instance, float t_max) {
    return INSTANCES && instance != NONE ? t_max * LIMIT_SLACK : t_max;
}

// The groups that wait. One stack for all traversals of an invocation, since compilers give every
// call of a function its own variables.
uvec2 stack[BVH_STACK];

// Finds the nearest hit with 0 < t < t_max, or with `any` some hit; masks applied.
bool traverse(Ray ray, float t_max, bool any, out Hit best) {
    best = Hit(t_max, NONE, NONE, vec2(0.0));
    ShearedRay shear = sheared_ray(ray);
    BoxRay boxed = box_ray(ray);
    uint depth = 0u;
    uint instance = NONE;
    // A group of nodes: the first child, and above bit 24 which of them are pending. A group of
    // primitives: likewise below bit 24. Neither: return from an instance to world space.
    uvec2 group = uvec2(0u, 0x80000000u);
    uint first_instance = job.triangle_count + job.sphere_count;
    if (!INSTANCES && first_instance == 0u) {
        group.y = 0u;
    }
    while (true) {
        uvec2 leaf = uvec2(0u);
        if ((group.y & 0xff000000u) != 0u) {
            uint place = uint(findMSB(group.y));
            group.y &= ~(1u << place);
            if ((group.y & 0xff000000u) != 0u) {
                stack[depth++] = group;
            }
            uint slot = (place - 24u) ^ (boxed.octant & 0xffu);
            uint node = 5u * (group.x + bitCount(group.y & ~(0xffffffffu << slot)));
            uvec4 n0 = nodes[node];
            uvec4 n1 = nodes[node + 1u];
            uint hits = node_hits(n0, n1, node, boxed, limit_in(instance, best.t));
            group = uvec2(n1.x, (hits & 0xff000000u) | (n0.w >> 24));
            leaf = uvec2(n1.y, hits & 0x00ffffffu);
        } else if (INSTANCES && group.y != 0u) {
            leaf = group;
            group.y = 0u;
        }
        while (leaf.y != 0u) {
            uint place = uint(findMSB(leaf.y));
            leaf.y &= ~(1u << place);
            Hit hit;
            hit.primitive = leaf_primitives[leaf.x + place];
            hit.instance = instance;
            hit.uv = vec2(0.0);
            if (INSTANCES && hit.primitive >= first_instance) {
                // Postpone everything else of this group until the ray is back in world space.
                if ((group.y & 0xff000000u) != 0u) {
                    stack[depth++] = group;
                }
                if (leaf.y != 0u) {
                    stack[depth++] = leaf;
                }
                stack[depth++] = uvec2(0u);
                instance = hit.primitive - first_instance;
                Ray own = transform_ray(transforms[instance], ray);
                shear = sheared_ray(own);
                boxed = box_ray(own);
                group = uvec2(transforms[instance].root, 0x80000000u);
                break;
            }
            bool found;
            if (hit.primitive < job.triangle_count) {
                float limit = limit_in(instance, best.t);
                found = intersect_triangle(shear, triangles[hit.primitive], limit, hit.t, hit.uv);
                if (INSTANCES && found && instance != NONE) {
                    hit.t = instance_distance(ray.origin, ray.dir, hit.primitive, instance);
                    found = hit.t > 0.0 && hit.t < best.t;
                }
            } else {
                Sphere sphere = spheres[hit.primitive - job.triangle_count];
                found = intersect_sphere(sphere, ray, best.t, hit.t);
                if (found && is_masked_out(ray, hit)) {
                    found = intersect_sphere_exit(sphere, ray, best.t, hit.t);
                }
            }
            if (found && !is_masked_out(ray, hit)) {
                best = hit;
                if (any) {
                    return true;
                }
            }
        }
        bool done = group.y <= 0x00ffffffu;
        while (done) {
            if (depth == 0u) {
                return best.primitive != NONE;
            }
            group = stack[--depth];
            // Without instances every group on the stack has nodes.
            done = INSTANCES && group.y == 0u;
            if (done) {
                instance = NONE;
                shear = sheared_ray(ray);
                boxed = box_ray(ray);
            }
        }
    }
    return false;
}

bool traversal_closest(Ray ray, float t_max, out Hit hit) {
    return traverse(ray, t_max, false, hit);
}

bool traversal_occluded(Ray ray, float t_max) {
    Hit hit;
    return traverse(ray, t_max, true, hit);
}

#endif
