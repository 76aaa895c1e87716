// Random numbers as a function of counters: the same (seed, pass, photon, branch, dimension) gives
// the same number in any batch, on any machine. PCG output permutation as a hash
// [Jarzynski and Olano 2020].

uint hash_pcg(uint value) {
    uint state = value * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash_combine(uint a, uint b) { return hash_pcg(a ^ (hash_pcg(b) + 0x9e3779b9u)); }

// Uniform in [0, 1) with 24 bits.
float unit_float(uint bits) { return float(bits >> 8) * (1.0 / 16777216.0); }

// Fraction of i * alpha + shift, alpha = generator / 2^32: a Kronecker sequence, exact in integers.
float kronecker(uint i, uint generator, uint shift) { return unit_float(i * generator + shift); }

// The digits of i behind the point, and others in place of some (van der Corput's sequence with a digital shift):
// together with a (0, m, 2)-net's coordinates, whose first is i itself, a (0, m, 3)-net.
float radical_inverse(uint i, uint shift) { return unit_float(bitfieldReverse(i) ^ shift); }

// Generator of a path's draws at this depth, one irrational a depth: the square roots of primes, as far from rational
// as from the light's golden-ratio lattice. Deeper ones are hashed: with one that comes again a path's later draws
// would follow from its earlier ones.
uint depth_generator(uint depth) {
    const uint generators[8] =
        uint[](1779033703u, 3144134277u, 2773480763u, 1359893119u, 2600822925u, 528734635u, 1541459225u, 3418070365u);
    return depth < 8u ? generators[depth] : hash_pcg(depth) | 1u;
}
