// What softening makes of a picture of halos (glare.comp), which whoever shows it looks up between its texels.
// One lookup between texels that were softened first (SOFTEN) is the same as one for every part of the tent.
vec3 between_softened(sampler2D of, vec2 at) {
    vec2 within = vec2(textureSize(of, 0) - 2);
    return textureLod(of, (at * within + 1.0) / (within + 2.0), 0.0).rgb;
}
