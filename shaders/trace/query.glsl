// The traversal of `vulkan-query`: ray queries against acceleration structures. Instances say by their custom index what
// they hold: 0 triangles, 1 spheres.
#ifndef TRACE_QUERY_GLSL
#define TRACE_QUERY_GLSL

#extension GL_EXT_ray_query : require

#include "trace/intersect.glsl"
#include "transport/surface.glsl"

layout(set = 0, binding = 27) uniform accelerationStructureEXT structure;

bool seam_query(Ray ray, float t_max, uint flags, out Hit hit) {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, structure, flags, 0xffu, ray.origin, 0.0, ray.dir, t_max);
    while (rayQueryProceedEXT(query)) {
        uint i = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionTriangleEXT) {
            vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
            if (!is_masked_out(ray, Hit(rayQueryGetIntersectionTEXT(query, false), i, uv))) {
                rayQueryConfirmIntersectionEXT(query);
            }
        } else {
            bool nearer = rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
            float before = nearer ? rayQueryGetIntersectionTEXT(query, true) : t_max;
            Hit candidate = Hit(0.0, job.triangle_count + i, vec2(0.0));
            if (intersect_sphere(spheres[i], ray, before, candidate.t) && !is_masked_out(ray, candidate)) {
                rayQueryGenerateIntersectionEXT(query, candidate.t);
            }
        }
    }
    hit = Hit(t_max, NONE, vec2(0.0));
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT) {
        return false;
    }
    hit.t = rayQueryGetIntersectionTEXT(query, true);
    hit.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
    if (rayQueryGetIntersectionInstanceCustomIndexEXT(query, true) == 0) {
        hit.uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
    } else {
        hit.primitive += job.triangle_count;
    }
    return true;
}

bool seam_closest(Ray ray, float t_max, out Hit hit) {
    return seam_query(ray, t_max, gl_RayFlagsNoneEXT, hit);
}

bool seam_occluded(Ray ray, float t_max) {
    Hit hit;
    return seam_query(ray, t_max, gl_RayFlagsTerminateOnFirstHitEXT, hit);
}

#endif
