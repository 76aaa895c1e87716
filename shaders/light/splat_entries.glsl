// Where in the list of pieces those of a kind are, told by the counts of all kinds (`kind_words`). There is room for
// more entries than splats.

// Pieces of a splat that an entry stands for: one, unless the list would be too long.
uint pieces_an_entry() {
    uint splats_in_all = 0u, pieces_in_all = 0u;
    for (uint k = 0u; k < KINDS; ++k) {
        splats_in_all += kind_words[KIND_WORDS * k + SPLATS_AT];
        pieces_in_all += kind_words[KIND_WORDS * k + PIECES_AT];
    }
    return pieces_in_all <= entries_room
        ? 1u
        : (pieces_in_all - 1u) / (entries_room - min(splats_in_all, entries_room - 1u)) + 1u;
}

uint entries_of(uint pieces, uint at_once) { return (pieces + at_once - 1u) / at_once; }

// All of a kind, or more.
uint most_entries(uint kind, uint at_once) {
    uint pieces = kind_words[KIND_WORDS * kind + PIECES_AT];
    return at_once == 1u ? pieces : kind_words[KIND_WORDS * kind + SPLATS_AT] + pieces / at_once;
}

uint first_entry(uint kind, uint at_once) {
    uint first = 0u;
    for (uint k = 0u; k < kind; ++k) first += most_entries(k, at_once);
    return first;
}
