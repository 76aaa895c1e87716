"""TOML as text, new or over a file that a person wrote: comments, order and unchanged words stay."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import tomlkit
from tomlkit.items import AoT, InlineTable, Item, Table


def toml_text(values: Mapping[str, Any], before: str = "") -> str:
    """`values`, plain dictionaries, lists, texts and numbers, as TOML; `before`: what stood in the file.

    Dictionaries and lists of them at the top are tables with a header, and so are those of `materials`.
    """
    if before:
        # A form too odd to be edited in place is written anew.
        with suppress(Exception):
            document = tomlkit.parse(before)
            _update(document, values)
            text = tomlkit.dumps(document)
            if tomllib.loads(text) == values:
                return text
    document = tomlkit.document()
    for key, value in values.items():
        document.add(key, _item(value, depth=0))
    return tomlkit.dumps(document)


def _update(table: Any, values: Mapping[str, Any], depth: int = 0) -> None:
    """Bring `table` in line with `values`, touching only what differs."""
    for key in [key for key in table if key not in values]:
        table.remove(key)
    for key, value in values.items():
        old = table.get(key)
        if old is not None and _plain(old) == value:
            continue
        if isinstance(value, Mapping) and isinstance(old, InlineTable) and old.keys() != value.keys():
            table[key] = _braces(old, value, depth + 1)
            continue
        # In place in braces too: written anew they would lose the blanks that somebody put in them.
        if isinstance(value, Mapping) and isinstance(old, Table | InlineTable):
            _update(old, value, depth + 1)
        elif isinstance(old, AoT) and len(old) == len(value):
            for entry, wanted in zip(old, value, strict=True):
                _update(entry, wanted, depth + 1)
        elif isinstance(old, AoT) and value:
            table[key] = _entries(value, list(old))
        elif key in table:
            table[key] = _item(value, depth)
        else:
            table.add(key, _item(value, depth))


def _plain(known: Any) -> Any:
    """The plain value of an item of a document; tomlkit gives truth values as they are."""
    return known.unwrap() if isinstance(known, Item) else known


def _braces(old: InlineTable, values: Mapping[str, Any], depth: int) -> Item:
    """An inline table with other keys than `old`, with its blanks, and its words for what did not change."""
    entries = []
    for key in [*(key for key in old if key in values), *(key for key in values if key not in old)]:
        known = old.get(key)
        item = known if isinstance(known, Item) and _plain(known) == values[key] else _item(values[key], depth)
        entries.append(f"{tomlkit.key(key).as_string()} = {item.as_string().strip()}")
    blank = " " if old.as_string().startswith("{ ") else ""
    item = tomlkit.parse(f"x = {{{blank}{', '.join(entries)}{blank}}}")["x"]
    assert isinstance(item, InlineTable)
    return item


def _entries(values: list[Mapping[str, Any]], known: list[Any]) -> AoT:
    """[[…]] tables, those of `known` that say the same used again."""
    entries = tomlkit.aot()
    for value in values:
        same = next((entry for entry in known if _plain(entry) == value), None)
        if same is not None:
            known.remove(same)
        entries.append(_item(value, 0) if same is None else same)
    return entries


def _item(value: Any, depth: int) -> Item:
    """The item of a value, `depth` tables below the top."""
    if isinstance(value, Mapping):
        # [materials] is no table of its own, only what holds [materials.NAME].
        holds_tables = depth == 0 and bool(value) and all(isinstance(v, Mapping) for v in value.values())
        inner = tomlkit.table(is_super_table=holds_tables) if depth == 0 or holds_tables else tomlkit.inline_table()
        for key, entry in value.items():
            inner.add(key, _item(entry, 0 if holds_tables else depth + 1))
        return inner
    if isinstance(value, list) and depth == 0 and value and all(isinstance(entry, Mapping) for entry in value):
        return _entries(value, [])
    if isinstance(value, list):
        listed = tomlkit.array()
        listed.extend([_item(entry, depth + 1) for entry in value])
        return listed
    return tomlkit.item(value)
