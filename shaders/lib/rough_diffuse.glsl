// A rough diffuse surface that loses no energy: EON [Portsmouth, Kutz and Hill 2025]. Pure functions;
// app/model/optics/rough_surfaces.py tells more.
const float MEAN_LOSS = 0.28779340921;  // 1/2 - 2 / (3 pi)
const float HEMISPHERE_LOSS = 0.07248821244;  // 2/3 - 28 / (15 pi)

// Directional albedo of single scattering by white facets.
float rough_single_albedo(float cosine, float roughness) {
    float sine = sqrt(max((1.0 - cosine) * (1.0 + cosine), 0.0));
    float steep = sine * (atan(sine, cosine) - sine * cosine);
    float grazing = sine * cosine * (1.0 + sine + sine * sine) / (1.0 + sine);
    return (1.0 + roughness * (steep + (2.0 / 3.0) * (grazing - sine)) * 0.31830988618) / (1.0 + MEAN_LOSS * roughness);
}

// Colour of what is scattered more than once.
vec3 rough_multiple_colour(vec3 reflectance, float roughness) {
    float mean = (1.0 + HEMISPHERE_LOSS * roughness) / (1.0 + MEAN_LOSS * roughness);
    return reflectance * reflectance * mean / (1.0 - reflectance * (1.0 - mean));
}

// Reflectance for light from all sides, seen at this cosine.
vec3 rough_albedo(vec3 reflectance, float roughness, float cosine) {
    float single = rough_single_albedo(cosine, roughness);
    return reflectance * single + rough_multiple_colour(reflectance, roughness) * (1.0 - single);
}

// Reflectance for light of one direction: pi times what is sent from `from` to `toward` (unit, away from the surface),
// whose heights over it are the two cosines.
vec3 rough_response(vec3 reflectance, float roughness, vec3 toward, vec3 from, float toward_cosine, float from_cosine) {
    float turned = dot(toward, from) - toward_cosine * from_cosine;
    turned = turned > 0.0 ? turned / max(max(toward_cosine, from_cosine), 1e-6) : turned;
    float single = (1.0 + roughness * turned) / (1.0 + MEAN_LOSS * roughness);
    float mean = (1.0 + HEMISPHERE_LOSS * roughness) / (1.0 + MEAN_LOSS * roughness);
    float twice = (1.0 - rough_single_albedo(toward_cosine, roughness))
        * (1.0 - rough_single_albedo(from_cosine, roughness)) / max(1.0 - mean, 1e-7);
    return reflectance * single + rough_multiple_colour(reflectance, roughness) * twice;
}
