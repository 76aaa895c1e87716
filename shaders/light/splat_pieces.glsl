// Splats are added in pieces of some texels, each by a team of invocations, so that small ones leave none idle and
// large ones are shared out. How many pieces a splat has is counted where it is made (footprint.comp), so that the list
// of all pieces (splat_list_any.comp) knows where those of a kind begin. Where it has no room for all, an entry stands
// for several. Of a record's `kind`: whether its lines of texels are columns, pieces.
const uint COLUMNS_BIT = 3u;
const uint PIECES_BIT = 4u;
// Words of each kind: work groups that add it (x, y, z), splats, pieces, entries of the list.
const uint KIND_WORDS = 8u;
const uint SPLATS_AT = 3u;
const uint PIECES_AT = 4u;
const uint ENTRIES_AT = 5u;
// Lines of texels that a piece has at most, and room for some more: another program's rounding may find a line more.
const int MOST_LINES = 28;
const int LINES_ROOM = 32;
