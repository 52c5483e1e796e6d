void twin() {
    in_word();
    out_vec3(triangles[2].a);
    out_vec3(triangles[2].b);
    out_vec3(triangles[2].c);
    out_vec3(attributes[1].nc);
    out_vec2(attributes[1].tc);
    out_word(attributes[1].material);
    out_word(attributes[1].emitter);
    out_vec3(spheres[0].center);
    out_float(spheres[0].radius);
    out_word(spheres[0].emitter);
    Material last = materials[spheres[0].material];
    out_vec3(last.base_color);
    out_float(last.ior);
    out_float(last.tiling_scale);
    out_word(last.normal_texture);
    out_word(last.emitter_reflects);
    out_vec3(texture_texel(textures[0], 1u));
    out_vec3(float_texel(textures[job.environment_texture].first, 2u));
    out_float(emitters[1].area);
    out_vec3(points[0].position);
    out_vec3(directionals[0].direction);
    out_word(job.triangle_count);
    out_word(job.sphere_count);
    out_word(job.light_count);
    out_word(job.resolution.x);
    out_words(job.seed);
}
