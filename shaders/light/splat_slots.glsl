// Which slots of a photon hold splats: SLOTS of its own, and behind them its images beyond borders.
const uint PHOTON_SLOTS = uint(SLOTS + IMAGE_SLOTS);

// What its record begins with.
uint kind_at(uint slot) { return splat_texels[slot * uint(SplatRecord_TEXELS)].x; }

// Behind the last slot of a photon that holds anything.
uint end_of(uint photon) {
    uint slot = photon * PHOTON_SLOTS;
    return BORDER_IMAGES ? slot + uint(SLOTS) + splat_texels[slot * uint(SplatRecord_TEXELS)].y : slot + uint(SLOTS);
}
