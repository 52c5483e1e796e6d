void twin() { out_vec3(texel_at(in_word())); }
