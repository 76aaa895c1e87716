// Which pixels are even: in these and all round them one surface is seen directly, lit by the same lights, or only
// glass that is followed on its own. A few looks that share a pixel out tell; a still's samples then add what these
// saw, and have their own looks at outlines, shadows' edges and whatever else is seen in parts. Lookups of maps and
// textures are averaged over what a look stands for, so that few looks hold all of a pixel's detail of these.

const uint SURVEY_TAKES = 1u, SURVEY_KEPT = 2u;
// What a pixel's looks have in common, in a key's lowest bits. A key of 0: nothing.
const uint SEES_DIRECTLY = 1u, SEES_SPECULAR = 2u, SEES_COATED = 3u, KIND_BITS = 3u;
// Cosine between normals that two looks of an even pixel may have at the least.
const float EVEN_NORMALS = 0.99;

uint survey_place(uvec2 pixel) { return p.survey_at + 4u * (pixel.y * p.size.x + pixel.x); }

struct Survey {
    uint key;
    vec3 normal;  // of the first look
};

// One look: what it met, and which lights it saw there.
void survey_look(inout Survey survey, uint look, uint sees, bool met, Hit hit, uint lights_met) {
    uint key = (hash_combine(met ? hit.object : NONE, lights_met) & ~KIND_BITS) | sees;
    if (look == 0u) survey = Survey(key, hit.normal_g);
    bool even = key == survey.key && !saw_light && !skipped_texels
        && (sees != SEES_DIRECTLY || !met || dot(hit.normal_g, survey.normal) >= EVEN_NORMALS);
#if COATS
    even = even && (sees != SEES_COATED || dot(hit.normal_g, survey.normal) >= EVEN_NORMALS);
#endif
    if (!even) survey.key = 0u;
}

// A survey's sample: `mean` is what its looks saw.
void keep_survey(uvec2 pixel, uint key, vec3 mean) {
    uint at = survey_place(pixel);
    if (p.sample_index > 0u) {
        key = listed[at] == key ? key : 0u;
        mean += uintBitsToFloat(uvec3(listed[at + 1u], listed[at + 2u], listed[at + 3u]));
    }
    listed[at] = key;
    for (uint c = 0u; c < 3u; ++c) listed[at + 1u + c] = floatBitsToUint(mean[c]);
}

// The key that a pixel shares with all its neighbours, or 0.
uint even_key(uvec2 pixel) {
    uint key = listed[survey_place(pixel)];
    for (uint i = 0u; i < 9u && key != 0u; ++i) {
        ivec2 at = clamp(ivec2(pixel) + ivec2(int(i % 3u) - 1, int(i / 3u) - 1), ivec2(0), ivec2(p.size) - 1);
        if (listed[survey_place(uvec2(at))] != key) key = 0u;
    }
    return key;
}

vec3 surveyed_mean(uvec2 pixel) {
    uint at = survey_place(pixel);
    return uintBitsToFloat(uvec3(listed[at + 1u], listed[at + 2u], listed[at + 3u]));
}
