// A ground surface of glass or metal: a path meets one of its microfacets, the same at all wavelengths of its band
// (which all meet it as probably as the anchor does), and goes on as from a polished surface that is turned as this one
// is.

// Which microfacet a path meets: number `number` of the sequence of this key, at this depth. Parts of a band that was
// cut here meet the surface again, and find the same one.
struct MicrofacetDraw {
    uint number;
    uint depth;
    uint key;
};

#include "lib/rough_surface.glsl"
#include "lib/rough_energy.glsl"

// Change of a share over half a band, of itself: where derivatives say more they are steep (deep paths, grazing exits),
// and know nothing of a band's ends.
#define MOST_CHANGE 0.3

// What is known of a ground surface besides its microfacet.
struct Ground {
    float width;  // GGX's; 0: it is polished
    float table;  // of what it sends on
    vec3 normal;  // the surface's own, against the path
    float thrown;  // of a mirror: share of what its microfacets reflect that they throw at each other
    vec3 regained;  // of glass: factor for what its microfacets send on after all, over the band
    vec3 end_normal[2];  // where the band's ends arrive
};
