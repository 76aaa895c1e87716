// Which slots of a photon hold splats: SLOTS of its own, and behind them its images beyond borders.
const uint PHOTON_SLOTS = uint(SLOTS + IMAGE_SLOTS);

// Behind the last slot of a photon that holds anything.
uint end_of(uint photon) {
    uint slot = photon * PHOTON_SLOTS;
    return BORDER_IMAGES ? slot + uint(SLOTS) + splats[slot].images : slot + uint(SLOTS);
}
