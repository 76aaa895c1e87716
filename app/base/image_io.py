"""Pictures to and from files; the suffix chooses the format, a row of `FORMATS`.

| suffix | content |
|---|---|
| .png | 8-bit sRGB through `tone_map`: for looking at |
| .webp | the same, without loss, smaller |
| .jpg, .jpeg | the same, smaller still, by a little that is lost |
| .exr | float32 scene-referred linear Rec.709, negatives kept, and spectral channels where given: for working on |
| .npy | float32 (H, W, 3) scene-referred linear Rec.709: for comparing |

Files appear whole or not at all (`atomic`).
"""

from __future__ import annotations

import errno
import io
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import files
from .atomic import atomic_output
from .errors import BrokenPictureError, UserError, own_fault
from .exr_layers import read_exr_layer
from .glare import with_glare
from .primaries import REC709
from .tone_map import auto_exposure, srgb_eotf, tone_map_8bit

MAX_PIXELS = 1 << 26
"""Largest picture that is read; 805 MB as float32: a mistake rather than a wish."""
_HUGE = 1e30
"""Radiance beyond which sums may be more than float32 holds."""


@dataclass(frozen=True)
class Picture:
    """What a file held."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709 (of a PNG: display-referred, 0 to 1)."""
    spectral: np.ndarray | None
    """float32 (H, W, B), radiance per bin, or None."""
    wavelengths_nm: np.ndarray | None
    """float64 (B,), centres of the bins, rising, or None."""
    notes: tuple[str, ...] = ()
    """Sentences on what was assumed."""
    is_converted: bool = False
    """From other primaries, so that colours may lie outside of Rec.709."""


@dataclass(frozen=True)
class Extras:
    """What a file may hold besides its pixels; a format that has no place for it leaves it out."""

    texts: Mapping[str, str] = field(default_factory=dict)
    channels: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Spectral ones, each float32 (H, W)."""
    bin_edges_nm: np.ndarray | None = None


@dataclass(frozen=True)
class PictureFormat:
    """A kind of picture file."""

    suffixes: tuple[str, ...]
    """Suffixes of its files; the first is offered."""
    write: Callable[[Path | io.BytesIO, np.ndarray, Extras], None]
    """Gets sRGB codes, uint8 (H, W, 3), of a picture to look at, and float32 linear Rec.709 otherwise."""
    read: Callable[[Path, str], Picture] | None = None
    """Gets the name of a layer as well; None: such files are not read."""
    is_shown: bool = True
    """Whether its pictures are for looking at: tone mapped, 8 bits."""
    holds_spectrum: bool = False
    largest_side: int | None = None
    """Pixels that it can say."""


def format_of(path: Path | str) -> PictureFormat:
    """The format that a file's suffix names; raises `UserError` where it is none."""
    return _BY_SUFFIX[check_suffix(path)]


def check_suffix(path: Path | str) -> str:
    """The suffix of `path` in lower case; raises `UserError` when no writer knows it."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        what = f"the suffix '{suffix}' is not a picture format" if suffix else "its name has no suffix"
        raise UserError(f"cannot write {path}: {what}; use one of {', '.join(SUFFIXES)}")
    return suffix


def write_image(
    path: Path | str,
    rgb: np.ndarray,
    *,
    exposure_ev: float | None = None,
    spectral: np.ndarray | None = None,
    bin_edges_nm: np.ndarray | None = None,
    glare: float = 0.0,
    antialias: bool = True,
    into: Path | None = None,
) -> None:
    """Write a picture; row 0 of the arrays is its top.

    rgb: (H, W, 3) linear Rec.709 radiance. exposure_ev: stops added to the automatic exposure
    (of pictures for looking at only). glare: share that the lens scatters, of those too; antialias:
    whether edges of what is overexposed have no steps (`highlights`), of those too. spectral: (H, W, B) radiance
    per bin in W/(m² sr), written as the channels
    `S0.<centre>nm` of an .exr; bin_edges_nm: (B + 1,) rising. into: the file that the caller got from
    `atomic_outputs` and that becomes `path`. Raises `UserError` for an unknown suffix or a place that cannot be
    written, `BrokenPictureError` for numbers that are not finite.
    """
    kind = format_of(path)
    with atomic_output(path) if into is None else nullcontext(into) as part:
        rgb = np.ascontiguousarray(rgb, np.float32)
        if rgb.ndim != 3 or rgb.shape[2] != 3 or 0 in rgb.shape:
            raise ValueError(f"a picture is (H, W, 3) and not empty, got {rgb.shape}")
        check_finite(str(path), rgb, spectral)
        check_side(path, (rgb.shape[1], rgb.shape[0]), kind.largest_side)
        if kind.is_shown:
            kind.write(part, *_developed(rgb, exposure_ev or 0.0, glare, antialias))
        else:
            kind.write(part, rgb, Extras({}, _spectral_channels(rgb, spectral, bin_edges_nm), bin_edges_nm))


def check_finite(name: str, *pictures: np.ndarray | None) -> None:
    """Raise `BrokenPictureError` where a picture that is to be written as `name` holds NaN or infinity."""
    broken = [picture for picture in pictures if picture is not None and not np.isfinite(picture).all()]
    if not broken:
        return
    what = f"{name} is not written: the picture holds numbers that are not finite"
    if any(np.abs(picture).max(where=np.isfinite(picture), initial=0.0) > _HUGE for picture in broken):
        raise BrokenPictureError(f"{what}, and others above {_HUGE:g}: light of the scene is too strong, choose less")
    raise BrokenPictureError(own_fault(what))


def shown_bytes(
    rgb: np.ndarray, exposure_ev: float = 0.0, glare: float = 0.0, antialias: bool = True, suffix: str = ".png"
) -> bytes:
    """The file, .png or .jpg, that `write_image` would write of `rgb`, float32 (H, W, 3)."""
    check_finite("the picture", rgb)
    buffer = io.BytesIO()
    _BY_SUFFIX[suffix].write(buffer, *_developed(rgb, exposure_ev, glare, antialias))
    return buffer.getvalue()


def png_bytes(codes: np.ndarray) -> bytes:
    """A PNG file of sRGB codes, uint8 (H, W, 3)."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(codes).save(buffer, "PNG")
    return buffer.getvalue()


def _developed(rgb: np.ndarray, exposure_ev: float, glare: float, antialias: bool) -> tuple[np.ndarray, Extras]:
    """sRGB codes of a picture to look at, and how it was exposed."""
    ev = auto_exposure(rgb) + exposure_ev
    return tone_map_8bit(with_glare(rgb, glare), ev, antialias), Extras({"Exposure": f"{ev:+.3f} EV"})


def read_image(path: Path | str, layer: str = "") -> Picture:
    """Read a picture, of an .exr a layer; raises `UserError` when it is missing or is not one."""
    path = Path(path)
    suffix = path.suffix.lower()
    kind = _BY_SUFFIX.get(suffix)
    if kind is None or kind.read is None:
        raise UserError(f"cannot read {path}: '{suffix}' cannot be read; use one of {', '.join(READ_SUFFIXES)}")
    with files.reading(path, "check the name and the file's permissions"):
        files.check_regular(path, files.DATA_BYTES)
    try:
        return kind.read(path, layer)
    except (OSError, EOFError, ValueError, RuntimeError, KeyError, TypeError, SyntaxError, MemoryError) as error:
        raise UserError(
            f"cannot read {path}: it is not a whole {suffix[1:].upper()} picture ({files.reason_of(error)}); write it "
            "again"
        ) from error


def channel_name(wavelength_nm: float) -> str:
    """Name of a spectral EXR channel: Stokes component 0, wavelength with a decimal comma.

    Fichet, Pacanowski, Wilkie: An OpenEXR Layout for Spectral Images, JCGT 10(3), 2021.
    """
    return f"S0.{wavelength_nm:.6f}nm".replace(".", ",").replace(",", ".", 1)


def save_codes(path: Path, codes: np.ndarray) -> None:
    """Save sRGB codes uint8 (H, W, 3) in the format of the suffix, one of `SHOWN_SUFFIXES`."""
    kind = format_of(path)
    check_side(path, (codes.shape[1], codes.shape[0]), kind.largest_side)
    kind.write(path, codes, Extras())


def check_side(path: Path | str, size: tuple[int, int], largest: int | None) -> None:
    """Raise `UserError` where a picture or film of `size` has more pixels a side than its format can say."""
    if largest is not None and max(size) > largest:
        raise UserError(
            f"cannot write {path}: a {Path(path).suffix[1:].upper()} file has at most {largest} pixels a side, not "
            f"{size[0]}×{size[1]}; choose a smaller size or another format"
        )


def _write_png(file: Path | io.BytesIO, codes: np.ndarray, extras: Extras) -> None:
    from PIL import Image, PngImagePlugin

    texts = PngImagePlugin.PngInfo()
    for key, value in extras.texts.items():
        texts.add_itxt(key, str(value))
    texts.add(b"sRGB", b"\x00")  # rendering intent: perceptual
    # Level 6 is three times smaller than 1 on caustics and still takes less than a tone map.
    Image.fromarray(codes).save(file, format="PNG", pnginfo=texts, compress_level=6)


def _write_jpeg(file: Path | io.BytesIO, codes: np.ndarray, extras: Extras) -> None:
    from PIL import Image

    # Colours at full resolution: those of a caustic change from pixel to pixel.
    Image.fromarray(codes).save(file, format="JPEG", quality=95, subsampling=0)


def _write_webp(file: Path | io.BytesIO, codes: np.ndarray, extras: Extras) -> None:
    from PIL import Image

    # Without loss: its other way halves the resolution of colours, and those of a caustic change from pixel to pixel.
    # `quality` is how hard it tries.
    Image.fromarray(codes).save(file, format="WEBP", lossless=True, quality=50, method=3)


def _write_npy(path: Path | io.BytesIO, rgb: np.ndarray, extras: Extras) -> None:
    assert isinstance(path, Path)
    with path.open("wb") as file:
        # Not np.save: the error of its tofile does not say that the disk is full.
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(rgb))
        file.write(rgb.data)


def _read_png(path: Path, layer: str) -> Picture:
    from PIL import Image

    with Image.open(path, formats=("PNG",)) as image:
        _check_pixels(image.width, image.height)
        encoded = np.asarray(image.convert("RGB"), np.float32) / np.float32(255)
    return Picture(srgb_eotf(encoded).astype(np.float32), None, None)


def _spectral_channels(
    rgb: np.ndarray, spectral: np.ndarray | None, bin_edges_nm: np.ndarray | None
) -> dict[str, np.ndarray]:
    if spectral is None:
        return {}
    edges = np.asarray(bin_edges_nm, np.float64)
    if spectral.shape[:2] != rgb.shape[:2] or edges.shape != (spectral.shape[2] + 1,) or np.any(np.diff(edges) <= 0):
        raise ValueError(f"spectral {spectral.shape} does not belong to rgb {rgb.shape} and {edges.shape} rising edges")
    centres = 0.5 * (edges[:-1] + edges[1:])
    return {
        channel_name(centre): np.ascontiguousarray(spectral[:, :, i], np.float32) for i, centre in enumerate(centres)
    }


def _write_exr(path: Path | io.BytesIO, rgb: np.ndarray, extras: Extras) -> None:
    import OpenEXR

    header: dict[str, object] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header["chromaticities"] = REC709
    channels = {name: np.ascontiguousarray(rgb[:, :, i]) for i, name in enumerate("RGB")}
    if extras.channels:
        header |= {"spectralLayoutVersion": "1.0", "emissiveUnits": "W.m^-2.sr^-1"}
        # A channel's name only tells the bin's centre; the values are integrals over the bin.
        header["spectralBinEdgesNm"] = " ".join(f"{edge:.9g}" for edge in np.asarray(extras.bin_edges_nm))
        channels |= extras.channels
    try:
        with OpenEXR.File(header, channels) as file:
            file.write(str(path))
    except RuntimeError as error:  # OpenEXR turns every failure to write into this
        raise OSError(errno.EIO, "its pixels cannot be stored (is the disk full?)", str(path)) from error


def _read_exr(path: Path, layer: str) -> Picture:
    held = read_exr_layer(path, layer, MAX_PIXELS)
    waves = {
        float(name[3:-2].replace(",", ".")): pixels
        for name, pixels in held.others.items()
        if name.startswith("S0.") and name.endswith("nm")
    }
    wavelengths = np.array(sorted(waves), np.float64)
    spectral = np.stack([waves[w] for w in wavelengths], axis=-1) if waves else None
    return Picture(held.rgb, spectral, wavelengths if waves else None, held.notes, held.is_converted)


def _read_npy(path: Path, layer: str) -> Picture:
    rgb = files.read_npy(path)
    if rgb.dtype.kind != "f":
        raise ValueError(f"it holds whole numbers ({rgb.dtype}): codes of a picture are a .png, light is float32")
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise ValueError(f"its shape is {rgb.shape}, not (H, W, 3)")
    _check_pixels(rgb.shape[1], rgb.shape[0])
    with np.errstate(over="ignore", invalid="ignore"):  # what float32 does not hold becomes infinite
        return Picture(rgb.astype(np.float32), None, None)


def _check_pixels(width: int, height: int) -> None:
    """Before memory is taken for them."""
    if width * height > MAX_PIXELS:
        raise ValueError(f"{width} × {height} pixels are more than {MAX_PIXELS >> 20} million")


FORMATS = (
    PictureFormat((".png",), _write_png, _read_png),
    PictureFormat((".jpg", ".jpeg"), _write_jpeg),
    PictureFormat((".webp",), _write_webp, largest_side=16383),
    PictureFormat((".exr",), _write_exr, _read_exr, is_shown=False, holds_spectrum=True),
    PictureFormat((".npy",), _write_npy, _read_npy, is_shown=False),
)
"""What pictures are written as; every list of formats that a user meets follows from it."""
_BY_SUFFIX = {suffix: each for each in FORMATS for suffix in each.suffixes}
SUFFIXES = tuple(_BY_SUFFIX)
SHOWN_SUFFIXES = tuple(suffix for suffix, each in _BY_SUFFIX.items() if each.is_shown)
"""Suffixes of pictures for looking at: tone mapped, 8 bits."""
SPECTRAL_SUFFIXES = tuple(suffix for suffix, each in _BY_SUFFIX.items() if each.holds_spectrum)
READ_SUFFIXES = tuple(suffix for suffix, each in _BY_SUFFIX.items() if each.read is not None)
OFFERED_SHOWN = tuple(each.suffixes[0] for each in FORMATS if each.is_shown)
OFFERED_LINEAR = tuple(each.suffixes[0] for each in FORMATS if not each.is_shown)
