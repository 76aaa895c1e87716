"""What an option of the command line is: its help, how its text becomes a value, and what that value sets.

The commands' options are the fields of the classes in `table`. Texts are read by the functions below, not by click,
whose own conversions say less and differ between versions: every mistake is one sentence with a way out.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from dataclasses import fields as dataclass_fields
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import click
from click.shell_completion import CompletionItem

from ..base.errors import UserError, suggestion
from ..base.memory import MAX_SIDE_PX, memory_bytes
from ..model.fields import Number

Parse = Callable[[str, str], Any]
"""Reads a text: its arguments are the option's flag, for the sentence of a mistake, and the text."""
Complete = Iterable[str] | Callable[[click.Context, str], Iterable[str]]
"""What a shell offers: words, or what finds them from the line so far and the word that is being typed."""
Values = TypeVar("Values")

MAX_PHOTONS = 10**12
MAX_SEED = 2**32 - 1
MAX_SECONDS = 7 * 24 * 3600.0
MIN_BINS, MAX_BINS = 4, 32
MAX_DEPTH = 4096
MAX_SPP = 4096
MAX_PARTS = 100_000
MAX_FRAMES = 1_000_000
_MULTIPLES = {"k": 10**3, "m": 10**6, "g": 10**9}
_BYTES_PER_PHOTON = 256
"""A photon record with several spectral columns, rounded up."""


@dataclass(frozen=True)
class Option:
    """How a field of a command's class is given on the command line: a `bool` by its flag alone, all else by a text."""

    metavar: str | None
    help: str
    parse: Parse | None = None
    """None: the text itself."""
    flags: tuple[str, ...] = ()
    """Default: the field's name after two hyphens."""
    sets: str = ""
    """Whose fields it sets: "settings" (how a picture is rendered or measured), "render" (the scene's own defaults) or
    "camera" (the scene's); "" where the command uses the value itself."""
    fields: tuple[str, ...] = ()
    """What those fields are called, where not as the option; a value for several is a tuple."""
    complete: Complete | None = None
    """None: names of files."""
    repeated: bool = False
    """Whether it may be given several times: its value is then the tuple of what is read from each text."""
    is_argument: bool = False
    """Whether it is given by its place instead of a flag."""


@dataclass(frozen=True)
class Row:
    """An option of one command."""

    name: str
    option: Option
    type: Any
    default: Any
    """`MISSING` where it is required."""

    @property
    def flag(self) -> str:
        """What it is called in sentences."""
        return next((flag for flag in self.option.flags if flag.startswith("--")), f"--{self.name.replace('_', '-')}")

    def parameter(self) -> click.Parameter:
        """The same in click's terms: every value is a text, and None or nothing where none was given."""
        option, is_required = self.option, self.default is MISSING
        more: dict[str, Any] = {"metavar": option.metavar, "help": option.help, "shell_complete": self._offered}
        if option.is_argument:
            return click.Argument([self.name], required=is_required, nargs=-1 if option.repeated else 1, **more)
        if self.is_switch:
            return click.Option([self.name, *(option.flags or (self.flag,))], is_flag=True, default=None, **more)
        flags = option.flags or (self.flag,)
        return click.Option([self.name, *flags], required=is_required, multiple=option.repeated, **more)

    def _offered(self, context: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
        words = self.option.complete or ()
        words = words(context, incomplete) if callable(words) else words
        found = [CompletionItem(word) for word in words if word.startswith(incomplete)]
        return found or [CompletionItem(incomplete, type="file")]

    @property
    def is_switch(self) -> bool:
        """Whether it takes no text."""
        return self.type in (bool, bool | None)

    def value(self, given: Any) -> Any:
        """What is meant by what click gives. Raises `UserError`."""
        if self.is_switch:
            return given
        parse = self.option.parse or (_path if Path in (self.type, *get_args(self.type)) else _text)
        return tuple(parse(self.flag, text) for text in given) if self.option.repeated else parse(self.flag, given)


def shared(one: Option, default: Any = None) -> Any:
    """A field of a command's class; `default` `MISSING` for what must be given."""
    return field(default=default, metadata={Option: one})


def option(
    metavar: str | None,
    help: str,
    parse: Parse | None = None,
    *,
    flags: tuple[str, ...] = (),
    sets: str = "",
    fields: tuple[str, ...] = (),
    complete: Complete | None = None,
    repeated: bool = False,
    default: Any = None,
) -> Any:
    """A field of a command's class: see `Option`; `default` `MISSING` for what must be given."""
    return shared(Option(metavar, help, parse, flags, sets, fields, complete, repeated), default)


def setting(metavar: str, help: str, parse: Parse | None = None, **more: Any) -> Any:
    """An option that sets a field of `RenderSettings`, or of a bench's settings."""
    return option(metavar, help, parse, sets="settings", **more)


def switch(help: str, *, flags: tuple[str, ...] = (), sets: str = "", default: bool | None = False) -> Any:
    """An option without a text; `default` None: with a flag for each of yes and no."""
    return option(None, help, flags=flags, sets=sets, default=default)


def target(metavar: str, help: str, default: Any = MISSING) -> Any:
    """Where the command writes."""
    return option(metavar, help, flags=("-o", "--output"), default=default)


def argument(
    metavar: str,
    help: str,
    *,
    complete: Complete | None = None,
    repeated: bool = False,
    default: Any = MISSING,
) -> Any:
    """A value that is given by its place."""
    return shared(Option(metavar, help, complete=complete, repeated=repeated, is_argument=True), default)


def rows(command: type) -> tuple[Row, ...]:
    """The arguments and options of a command's class, without those in its `without`; of the options its own come
    first, then those of the classes it extends."""
    hints, known = get_type_hints(command), {each.name: each for each in dataclass_fields(command)}
    names = dict.fromkeys(name for each in command.__mro__ for name in inspect.get_annotations(each) if name in known)
    found = [Row(name, known[name].metadata[Option], hints[name], known[name].default) for name in names]
    arguments = [row for row in found if row.option.is_argument]
    arguments.sort(key=lambda row: [*known].index(row.name))
    left = [row for row in found if not row.option.is_argument]
    return tuple(row for row in arguments + left if row.name not in getattr(command, "without", ()))


def read(command: type[Values], given: Mapping[str, Any]) -> Values:
    """A command's values, from what was given by the names of its options. Raises `UserError`."""
    texts = {name: value for name, value in given.items() if value not in (None, ())}
    return command(**{row.name: row.value(texts[row.name]) for row in rows(command) if row.name in texts})


def given_for(place: str, values: Any) -> dict[str, Any]:
    """What the values of a command set in `place` (`Option.sets`), by the names of the fields there; without what was
    not given."""
    found: dict[str, Any] = {}
    for row in rows(type(values)):
        value = getattr(values, row.name)
        if row.option.sets == place and value is not None:
            names = row.option.fields or (row.name,)
            found |= zip(names, value if len(names) > 1 else (value,), strict=True)
    return found


def words(values: Any, leave_out: Sequence[str]) -> list[str]:
    """Options as they could be typed, without those left at their defaults and those named in `leave_out`."""
    found: list[str] = []
    for row in rows(type(values)):
        value = getattr(values, row.name)
        if row.name not in leave_out and value != row.default:
            found += [row.flag] if value is True else [row.flag, _text_of(value)]
    return found


def _text_of(value: Any) -> str:
    if isinstance(value, tuple):
        return ("," if isinstance(value[0], str) else "x").join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


# ---- how texts are read: each function raises `UserError` -------------------------------------


def _text(_: str, text: str) -> str:
    return text


def _path(_: str, text: str) -> Path:
    return Path(text)


def size(flag: str, text: str) -> tuple[int, int]:
    """ "960x540" (or with ×, X) as (width, height) in pixels."""
    parts = text.strip().lower().replace("×", "x").split("x")
    if len(parts) != 2 or not all(_is_integer(part) for part in parts):
        raise UserError(f"{flag} '{text}' is not WIDTHxHEIGHT, for example {flag} 960x540")
    width, height = int(parts[0]), int(parts[1])
    if width < 1 or height < 1:
        raise UserError(f"{flag} {text} holds no pixel: both sides must be at least 1")
    if width > MAX_SIDE_PX or height > MAX_SIDE_PX:
        raise UserError(f"{flag} {text} is too large: no side may exceed {MAX_SIDE_PX} pixels")
    return width, height


def photons(flag: str, text: str) -> int:
    """A count of photons; "2M", "500k" and "1e6" are understood."""
    count = _count(flag, text)
    if count > MAX_PHOTONS:
        raise UserError(f"{flag} {text} is beyond what can be counted: give at most {MAX_PHOTONS:.0e}")
    return count


def batch(flag: str, text: str) -> int:
    """Photons in flight at once; their records must fit into memory."""
    count = _count(flag, text)
    limit = memory_bytes() // _BYTES_PER_PHOTON
    if count > limit:
        raise UserError(f"{flag} {text} is beyond this machine's memory: give at most {limit}")
    return count


def _count(flag: str, text: str) -> int:
    stripped = text.strip().lower().replace("_", "").replace(",", "")
    multiple = _MULTIPLES.get(stripped[-1:], 1)
    try:
        value = float(stripped[:-1] if multiple != 1 else stripped) * multiple
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isfinite(value) and not value.is_integer()):
        raise UserError(f"{flag} '{text}' is not a whole number: give for example 1000000, 1e6 or 1M")
    if value < 1:
        raise UserError(f"{flag} {text} is too few: give at least 1")
    if value > 10**18:
        raise UserError(f"{flag} {text} is beyond what memory can hold: give at most {MAX_PHOTONS:.0e}")
    return int(value)


def integer(low: int, high: int) -> Parse:
    """A whole number in [low, high]."""

    def parse(flag: str, text: str) -> int:
        if not _is_integer(text.strip()):
            raise UserError(f"{flag} '{text}' is not a whole number, give between {low} and {high}")
        value = int(text)
        if not low <= value <= high:
            raise UserError(f"{flag} {text} is out of range: give between {low} and {high}")
        return value

    return parse


def number(limits: Number, example: str) -> Parse:
    """A number within `limits`."""

    def parse(flag: str, text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if math.isnan(value):
            raise UserError(f"{flag} '{text}' is not a number, give one{example}")
        if not limits.holds(value):
            raise UserError(f"{flag} {text} is out of range: give {limits.range_words}")
        return value

    return parse


def seconds(longest: float = MAX_SECONDS) -> Parse:
    """A time in seconds."""
    return number(Number("seconds", above=0.0, at_most=longest), ", for example 3")


def one_of(*known: str) -> Parse:
    """One of these words."""

    def parse(flag: str, text: str) -> str:
        if text not in known:
            raise UserError(f"{flag} '{text}' is unknown{suggestion(text, known) or ','} known are {', '.join(known)}")
        return text

    return parse


def names(flag: str, text: str) -> tuple[str, ...]:
    """Words with commas between."""
    return tuple(dict.fromkeys(part.strip() for part in text.split(",")))


def wavelengths(flag: str, text: str) -> tuple[float, ...]:
    """ "486.13,587.56" in nm."""
    try:
        nm = tuple(float(part) for part in text.split(","))
    except ValueError:
        nm = ()
    if not nm or not all(100.0 <= each <= 100_000.0 for each in nm):
        raise UserError(
            f"{flag} '{text}' is no list of wavelengths in nm: give for example {flag} 486.13,587.56,656.27"
        )
    return nm


def place(flag: str, text: str) -> tuple[float, float, float]:
    """ "1,2,3" as a place."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"{flag} '{text}' is no place: give three numbers, for example {flag} 0,-2,5") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise UserError(f"{flag} '{text}' is no place: its numbers must be finite")
    return x, y, z


def frames(flag: str, text: str) -> tuple[int | None, range | None]:
    """How many frames in all, and which of them: "240", "101-200" or "101-200/240"."""
    which, slash, total = text.partition("/")
    first, dash, last = which.partition("-")
    if not dash and not slash:
        return integer(1, MAX_FRAMES)(flag, text), None
    if not (dash and first.strip() and last.strip()):
        raise UserError(f"{flag} '{text}' is no range: give for example 0-119, or 101-200/240 of 240 in all")
    begin, end = (integer(0, MAX_FRAMES - 1)(flag, each) for each in (first, last))
    if end < begin:
        raise UserError(f"{flag} {text} runs backwards: give the lower number first")
    return integer(1, MAX_FRAMES)(flag, total) if slash else None, range(begin, end + 1)


def share(flag: str, text: str) -> tuple[int, int]:
    """ "1/8" as the index and the number of parts."""
    parts = text.split("/")
    if len(parts) != 2 or not all(part.isascii() and part.isdigit() and len(part) < 8 for part in parts):
        raise UserError(f"{flag} '{text}' is no part: give which of how many, for example 1/8")
    index, count = map(int, parts)
    if not 1 <= index <= count <= MAX_PARTS:
        raise UserError(f"{flag} {text} is out of range: give 1/N to N/N, N at most {MAX_PARTS}")
    return index, count


def _is_integer(text: str) -> bool:
    """ASCII digits with an optional sign, of a length that int() takes gladly."""
    digits = text.removeprefix("-").removeprefix("+")
    return digits.isascii() and digits.isdigit() and len(digits) <= 4000
