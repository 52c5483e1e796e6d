// Inputs: the number of a texture, the environment map's behind the others, COLORS or SECOND_COORDINATES, and the
// number of a texel.
const uint COLORS = 0xfffffffeu, SECOND_COORDINATES = 0xffffffffu;

void twin() {
    uint texture = in_word(), i = in_word();
    if (texture == COLORS) {
        out_vec3(float_texel(job.first_color, i));
    } else if (texture == SECOND_COORDINATES) {
        out_vec3(float_texel(job.first_second_uv, i));
    } else {
        out_vec3(texture_texel(textures[texture], i));
    }
}
