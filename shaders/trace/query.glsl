// The traversal of `vulkan-query`: ray queries against acceleration structures.
#ifndef TRACE_QUERY_GLSL
#define TRACE_QUERY_GLSL

#extension GL_EXT_ray_query : require

#include "trace/instances.glsl"
#include "trace/intersect.glsl"
#include "trace/valid.glsl"
#include "transport/surface.glsl"

layout(set = 0, binding = 34) uniform accelerationStructureEXT structure;

bool traversal_query(Ray ray, float t_max, uint flags, out Hit hit) {
    hit = Hit(t_max, NONE, NONE, vec2(0.0));
    if (!is_traceable(ray, t_max)) {
        return false;
    }
    rayQueryEXT query;
    rayQueryInitializeEXT(query, structure, flags, 0xffu, ray.origin, 0.0, ray.dir, t_max);
    while (rayQueryProceedEXT(query)) {
        uint i = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        if (rayQueryGetIntersectionTypeEXT(query, false)
            == gl_RayQueryCandidateIntersectionTriangleEXT) {
            vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
            Hit candidate = hit_of_instance(
                ray.origin, ray.dir, rayQueryGetIntersectionTEXT(query, false),
                uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false)),
                uint(rayQueryGetIntersectionGeometryIndexEXT(query, false)), i, uv
            );
            if (candidate.t > 0.0 && !is_masked_out(ray, candidate)) {
                rayQueryConfirmIntersectionEXT(query);
            }
        } else {
            bool nearer =
                rayQueryGetIntersectionTypeEXT(query, true)
                != gl_RayQueryCommittedIntersectionNoneEXT;
            float before = nearer ? rayQueryGetIntersectionTEXT(query, true) : t_max;
            Hit candidate = Hit(0.0, job.triangle_count + i, NONE, vec2(0.0));
            bool found = intersect_sphere(spheres[i], ray, before, candidate.t);
            if (found && is_masked_out(ray, candidate)) {
                found = intersect_sphere_exit(spheres[i], ray, before, candidate.t)
                    && !is_masked_out(ray, candidate);
            }
            if (found) {
                rayQueryGenerateIntersectionEXT(query, candidate.t);
            }
        }
    }
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT) {
        return false;
    }
    float t = rayQueryGetIntersectionTEXT(query, true);
    uint custom = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
    uint i = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
    if (custom == INSTANCE_SPHERES) {
        hit = Hit(t, job.triangle_count + i, NONE, vec2(0.0));
    } else {
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
        uint geometry = uint(rayQueryGetIntersectionGeometryIndexEXT(query, true));
        hit = hit_of_instance(ray.origin, ray.dir, t, custom, geometry, i, uv);
    }
    return true;
}

bool traversal_closest(Ray ray, float t_max, out Hit hit) {
    return traversal_query(ray, t_max, gl_RayFlagsNoneEXT, hit);
}

bool traversal_occluded(Ray ray, float t_max) {
    Hit hit;
    return traversal_query(ray, t_max, gl_RayFlagsTerminateOnFirstHitEXT, hit);
}

#endif
