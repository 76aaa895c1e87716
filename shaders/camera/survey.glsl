// Which pixels are even: in these and all round them one surface is seen directly, lit by the same lights, or only
// glass that is followed on its own. A few looks that share a pixel out tell; a still's samples then add what these
// saw, and have their own looks at outlines, shadows' edges and whatever else is seen in parts. Lookups of maps and
// textures are averaged over what a look stands for, so that few looks hold all of a pixel's detail of these.

// Cosine between normals that two looks of an even pixel may have at the least.
const float EVEN_NORMALS = 0.99;

struct Survey {
    uint key;
    vec3 normal;  // of the first look
};

// One look: what it met, and which lights it saw there.
void survey_look(inout Survey survey, uint look, uint sees, bool met, Hit hit, uint lights_met) {
    uint key = (hash_combine(met ? hit.object : NONE, lights_met) & ~KEY_FLAGS) | sees;
    if (look == 0u) survey = Survey(key, hit.normal_g);
    bool even = key == survey.key && !saw_light && !skipped_texels
        && (sees != SEES_DIRECTLY || !met || dot(hit.normal_g, survey.normal) >= EVEN_NORMALS);
    even = even && (!COATS || sees != SEES_COATED || dot(hit.normal_g, survey.normal) >= EVEN_NORMALS);
    if (!even) survey.key = 0u;
}

// A survey's sample: `mean` is what its looks saw.
void keep_survey(uint number, uint key, vec3 mean) {
    uint at = survey_place(number);
    if (p.sample_index > 0u) {
        key = listed[at] == key ? key : 0u;
        mean += surveyed_mean(number);
    }
    listed[at] = key;
    for (uint c = 0u; c < 3u; ++c) listed[at + 1u + c] = floatBitsToUint(mean[c]);
}
