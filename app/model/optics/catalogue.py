"""The glass catalogue: 1,700 optical glasses and common transparent materials by name.

Baked by assets/glass/bake.py from the CC0 refractiveindex.info database, and gems.toml. A name is looked
up without regard to case, blanks and punctuation: "N-BK7", "nbk7" and "Schott N-BK7" are the
same. Where several makers use a name, the first in `MAKER_ORDER` wins; write the maker before
it, as in "hikari:F2", to choose. Nothing is read before the first lookup.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache, cached_property
from typing import cast

import msgspec

from ...base.errors import UserError, nearest_names
from ...base.paths import assets_dir
from .dispersion_formulas import Kind
from .glass import Dispersion

MAKER_ORDER = ("Materials", "Schott", "Ohara", "Hoya", "CDGM", "Hikari", "Sumita", "LZOS", "Cargille")
"""Materials (water, diamond, …) first: they are what a plain word means."""


@dataclass(frozen=True)
class Entry:
    """One material of the catalogue."""

    name: str
    maker: str
    kind: int | str
    coefficients: tuple[float, ...]
    range_nm: tuple[float, float]
    source: str
    aliases: tuple[str, ...] = ()
    status: str = ""
    """The maker's own word (standard, preferred, special), where known."""
    note: str = ""
    licence: str = "CC0 1.0 (refractiveindex.info database)"

    @property
    def qualified_name(self) -> str:
        """The name that finds this entry and no other: "Schott N-BK7", or "water"."""
        return self.name if self.maker == "Materials" else f"{self.maker} {self.name}"

    @cached_property
    def dispersion(self) -> Dispersion:
        """n(λ) of this entry; its `name` is the qualified name."""
        kind = f"formula {self.kind}" if isinstance(self.kind, int) else self.kind
        return Dispersion(self.qualified_name, cast(Kind, kind), self.coefficients, self.range_nm)


_NO_KEY = re.compile(r"[^\w+*]|_")


def search_key(text: str) -> str:
    """`text` without case, blanks and punctuation; "+" and "*" are part of some names."""
    return _NO_KEY.sub("", text.casefold())


@cache
def entries() -> tuple[Entry, ...]:
    """The whole catalogue, by maker in `MAKER_ORDER`, then by name."""
    raw = msgspec.json.decode((assets_dir() / "glass" / "catalogue.json").read_bytes())
    sources = raw["sources"]
    return tuple(
        Entry(
            name,
            maker,
            fields["f"],
            tuple(fields["c"]),
            tuple(fields["r"]),
            sources[fields["s"]],
            tuple(fields.get("a", ())),
            fields.get("t", ""),
            fields.get("n", ""),
            fields.get("l", Entry.licence),
        )
        for maker in MAKER_ORDER
        for name, fields in raw["makers"][maker].items()
    )


@cache
def _by_key() -> dict[str, Entry]:
    """Search key -> entry; earlier makers keep a contested short name, own names beat aliases."""
    table: dict[str, Entry] = {}
    for entry in entries():
        table.setdefault(search_key(entry.name), entry)
        table[search_key(entry.maker + entry.name)] = entry
    for entry in entries():
        for alias in entry.aliases:
            table.setdefault(search_key(alias), entry)
    return table


def find_entry(name: str, where: str = "") -> Entry:
    """The entry called `name`. Raises `UserError`, opened by `where`, with the nearest names."""
    entry = _by_key().get(search_key(name))
    if entry is not None:
        return entry
    near = [f"'{_label(entry, key)}'" for key, entry in _resembling(name, 3)]
    hint = f", did you mean {' or '.join(near)}?" if near else "; 'spectrasplat glass' lists all"
    raise UserError(f"{where + ': ' if where else ''}unknown glass '{name}'{hint}")


def find(name: str, where: str = "") -> Dispersion:
    """n(λ) of the glass called `name`; see `find_entry`."""
    return find_entry(name, where).dispersion


def search(query: str = "") -> list[Entry]:
    """Entries whose maker, name or other name contains every word of `query`, best first.

    An exact name comes first, then names that begin with the query, then the rest in catalogue
    order. Where nothing contains the words, entries with similar names. "" gives all.
    """
    found = _matching(query)
    if not found and query.strip():
        return list(dict.fromkeys(entry for _, entry in _resembling(query, 8)))
    return found


def is_guess(query: str) -> bool:
    """Whether `search` has nothing that is called so, and gives what resembles it."""
    return bool(query.strip()) and not _matching(query)


def _matching(query: str) -> list[Entry]:
    """Entries that contain every word of `query`, best first; all of them for none."""
    if not query.strip():
        return list(entries())
    words = [key for key in (search_key(w) for w in query.replace(":", " ").split()) if key]
    if not words:
        return []
    whole = search_key(query)
    exact = _by_key().get(whole)
    ranked: list[tuple[int, int, Entry]] = []
    for order, entry in enumerate(entries()):
        keys = [search_key(text) for text in (entry.name, entry.maker, *entry.aliases)]
        keys.append(keys[1] + keys[0])
        if entry is exact:
            ranked.append((0, order, entry))
        elif all(any(word in key for key in keys) for word in words):
            begins = keys[0].startswith(whole) or any(key.startswith(whole) for key in keys[2:])
            ranked.append((1 if begins else 2, order, entry))
    return [entry for _, _, entry in sorted(ranked, key=lambda item: item[:2])]


def _resembling(name: str, count: int) -> list[tuple[str, Entry]]:
    """(search key, entry) of names like `name`, most alike first."""
    table = _by_key()
    return [(key, table[key]) for key in nearest_names(search_key(name), table, count)]


def _label(entry: Entry, key: str) -> str:
    """The name of `entry` that has this search key."""
    return next((alias for alias in entry.aliases if search_key(alias) == key), entry.qualified_name)
