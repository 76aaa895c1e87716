// Roulette on weak parts of rays: what lives carries the power, and stands in the place, of those that died.

// On the emission lattice every `every`-th point in both directions lives: a lattice of the same shape, whose
// footprints make a plane as even as those of the whole. What lives already is one that many steps coarser. Chance
// chooses which, once for a branch and sub-lattice.
bool is_of_coarser_lattice(Path path, uint key, uint every) {
    uint sub = path.walk.photon_id % p.lattices;
    uvec2 place = lattice_place(path.walk.photon_id / p.lattices, p.lattice_bits >> LATTICE_BIT,
        p.lattice_shift + sub / p.lattices_together * PLASTIC_2);
    place /= uint(path.walk.footprint_scale);
    uint along = hash_pcg(key), across = hash_pcg(along);
    return place.x % every == along % every && place.y % every == across % every;
}

// Share of a ray's power that must remain for a child to be followed for certain; weaker ones play roulette.
bool survives(inout Path path, inout float roulette_w, float share, uint branch, bool keeps_lattice) {
    path.walk.survival *= share;
    path.walk.branch_key = hash_combine(path.walk.branch_key, branch);
    // What carries nothing, or less than a float can say, has no chance, whatever the threshold.
    if (path.walk.survival <= 0.0) {
        roulette_w += carried_w(path);
        return false;
    }
    float chance = path.walk.survival / p.split_threshold;
    if (chance >= 1.0 || keeps_lattice) return true;
    uint key = path.walk.branch_key + (path.walk.photon_id % p.lattices) * 2654435769u;
    float boost = 1.0 / max(chance, 1e-30);
    bool lives;
    if (p.lattice_bits != 0u) {
        float every = clamp(round(sqrt(boost)), 1.0, 4096.0);
        boost = every * every;
        lives = is_of_coarser_lattice(path, key, uint(every));
    } else {
        // Rays that beams handed on: a Kronecker sequence in their numbers, so that survivors are again close to a
        // lattice. The count is that of the sub-lattice's own points: a multiple of an irrational may be a poor one.
        lives = kronecker(path.walk.photon_id / p.lattices, depth_generator(path.depth), key) < chance;
    }
    if (!lives) {
        roulette_w += carried_w(path);
        return false;
    }
    roulette_w -= carried_w(path) * (boost - 1.0);
    path.walk.flux_w *= boost;
    path.throughput *= boost;
    if (HERO) path.walk.companion_throughput *= boost;
    path.walk.footprint_scale *= sqrt(boost);
    path.walk.survival *= boost;
    return true;
}

// What a first surface throws back is seen all round the glass: it keeps its whole lattice.
bool survives(inout Path path, inout float roulette_w, float share, uint branch) {
    return survives(path, roulette_w, share, branch, path.depth == 1u);
}
