"""Every command of the program with its options: help, default, how a text is read, what it sets.

A command is a frozen class: its docstring is the command's help, its fields are the options, and a value of it is what
the command's function gets (`program` says which function). A new option is a field here and the code that honours it;
with `sets` it reaches `RenderSettings` or the scene without further code.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..base import files
from ..base.errors import UserError
from ..base.image_io import OFFERED_LINEAR, OFFERED_SHOWN, SPECTRAL_SUFFIXES
from ..base.movie import FILMS
from ..model.fields import Number
from ..model.geometry.mesh_normals import ROUND_DEG
from ..model.scene_camera import FOCUS_DISTANCE, LENS_RADIUS
from ..model.scene_render import EXPOSURE_EV, GLARE, HAZE, HAZE_ANISOTROPY, MAX_BOUNCES
from ..model.settings import CAMERA_METHODS, METHODS
from . import completion, options
from .options import MISSING, Option, argument, option, setting, shared, switch, target

if TYPE_CHECKING:
    from ..edit.opening import Opening

MAX_WORKERS = 1024

# ---- how some options are read ----------------------------------------------------------------

_exposure = options.number(EXPOSURE_EV, " in stops, for example -1.5")
_seed, _spp = options.integer(0, options.MAX_SEED), options.integer(1, options.MAX_SPP)
_bins = options.integer(options.MIN_BINS, options.MAX_BINS)


def _either(*words: str) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"


SHOWN, LINEAR = ", ".join(OFFERED_SHOWN), _either(*OFFERED_LINEAR)
_NOT_LINEAR = f"not of {' and '.join(OFFERED_LINEAR)}"
_SPECTRAL = ", ".join(SPECTRAL_SUFFIXES)
_FORMATS = tuple(suffix[1:] for suffix in (*OFFERED_SHOWN, *OFFERED_LINEAR))
A_LENGTH = " a length in the scene's unit, for example 0.05"
POSITIVE = Number("", above=0.0, below=1e9)


def _up(flag: str, text: str) -> str:
    if text not in ("y", "z"):
        raise UserError(f"{flag} '{text}' is no axis that can be up: give y or z")
    return text


def _glass(flag: str, text: str) -> tuple[str | None, str]:
    """ "GLASS" or "OBJECT=GLASS"; an object's name may hold "=": the last one counts."""
    name, equals, kind = text.rpartition("=")
    if not kind or (equals and not name):
        raise UserError(f"{flag} '{text}' names no glass: give {flag} diamond, or {flag} OBJECT=N-SF11")
    return (name if equals else None), kind


def _environment(flag: str, text: str) -> str:
    if text not in ("studio", "sky") and not files.is_file(Path(text).expanduser()):
        raise UserError(f"{flag} '{text}' is neither studio nor sky nor a file; check the path")
    return text


# ---- options of several commands --------------------------------------------------------------

_SCENE = Option(
    "SCENE",
    "A scene file (.toml, .glb, .gltf, a bare mesh), or a shipped scene's name.",
    complete=completion.scenes,
    is_argument=True,
)
_SIZE = Option("WxH", "Pixels; default: the scene's.", options.size, sets="settings", fields=("width", "height"))
PHOTONS = Option("N", "Photons to emit; default: the scene's.", options.photons, sets="settings")
SPP = Option("N", "Camera samples a pixel.", _spp, sets="settings")
BINS = Option(
    "N",
    f"Keep {options.MIN_BINS} to {options.MAX_BINS} spectral bins (written to {_SPECTRAL}).",
    _bins,
    sets="settings",
)
SEED = Option("K", "Seed of the random numbers; default: 1.", _seed, sets="settings")
_METHOD = Option(
    "NAME",
    f"How wavelengths are sampled: {', '.join(METHODS)}; default: srd.",
    options.one_of(*METHODS),
    sets="settings",
    complete=METHODS,
)
_CAMERA_METHOD = Option(
    "NAME",
    f"The same for the camera's rays: {', '.join(CAMERA_METHODS)}; default: as --method.",
    options.one_of(*CAMERA_METHODS),
    ("--camera-method", "--eye-method"),
    sets="settings",
    complete=CAMERA_METHODS,
)
_STATS = "Print the energy balance and the times of all stages."


@dataclass(frozen=True, kw_only=True)
class ReadsScenes:
    """Options of every command that reads scenes."""

    allow_outside: bool = switch(
        "Let the scene read files outside its own folder, anywhere this user can; only for scenes you trust."
    )


@dataclass(frozen=True, kw_only=True)
class OpensFile(ReadsScenes):
    """Options that say how a file is opened."""

    up: str | None = option("AXIS", "Which axis of a mesh or glTF file is up: y or z; default: guessed.", _up)
    glass: tuple[tuple[str | None, str], ...] = option(
        "GLASS",
        "Make all solids of a glass (diamond, 'cobalt blue'), or some: OBJECT=N-SF11, MATERIAL=N-SF11, "
        "'Gem*=diamond', 'Window*=thin N-BK7' (a sheet); may be repeated.",
        _glass,
        complete=completion.glasses,
        repeated=True,
        default=(),
    )
    smooth: bool | None = switch(
        f"Round meshes where edges bend by less than {ROUND_DEG:g} degrees, or keep facets flat; default: as the "
        "file's normals say, unless they cannot be meant.",
        flags=("--smooth/--flat",),
        default=None,
    )
    environment: str | None = option(
        "FILE", "What lies behind everything: studio, sky, or a panorama's file.", _environment
    )

    @property
    def opening(self) -> Opening | None:
        """How the file is opened; None: as it is."""
        if (self.up, self.glass, self.smooth, self.environment) == (None, (), None, None):
            return None
        from ..edit.opening import Opening
        from ..model.staging import Staging

        return Opening(Staging(self.up, self.glass, self.smooth), self.environment)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class OpensScene(OpensFile):
    """A scene that must be named, and how it is opened."""

    scene: str = shared(_SCENE, default=MISSING)


@dataclass(frozen=True, kw_only=True)
class ByWorkers:
    """Options of every command whose work can be spread."""

    workers: int | None = option(
        "N",
        "Workers on this machine, each with its share of the cores, or a GPU of its own where there are several.",
        options.integer(1, MAX_WORKERS),
    )
    scheduler: str | None = option("ADDRESS", "A Dask scheduler that runs already, for example tcp://10.0.0.1:8786.")


# ---- commands that make pictures --------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Render(OpensScene):
    """Render a scene to a picture file."""

    output: Path = target("OUT", f"The picture: {SHOWN} (to look at), {LINEAR} (linear, to work on).")
    size: tuple[int, int] | None = setting(
        "WxH", "Pixels, for example 1920x1080; default: the scene's.", options.size, fields=("width", "height")
    )
    photons: int | None = setting("N", "Photons to emit, for example 4M; default: the scene's.", options.photons)
    seconds: float | None = setting("S", "Seconds that the picture may take in all, instead.", options.seconds())
    seed: int | None = shared(SEED)
    method: str | None = shared(_METHOD)
    camera_method: str | None = shared(_CAMERA_METHOD)
    layer: str | None = setting("LAYER", "beauty (default), caustic, or map:RECEIVER.", complete=completion.layers)
    bins: int | None = shared(BINS)
    exposure: float | None = setting(
        "EV", f"Stops brighter (or darker) than automatic; {_NOT_LINEAR}.", _exposure, fields=("exposure_ev",)
    )
    glare: float | None = setting(
        "SHARE",
        f"Share of the light that the lens scatters, 0 to 0.5; {_NOT_LINEAR}.",
        options.number(GLARE, ", for example 0.03"),
    )
    lens_radius: float | None = option(
        "R",
        "Half the aperture of the camera's lens, scene units: what is out of focus is blurred.",
        options.number(LENS_RADIUS, A_LENGTH),
        sets="camera",
    )
    focus_distance: float | None = option(
        "D",
        "From the lens to what is in focus; default: the camera's target.",
        options.number(FOCUS_DISTANCE, A_LENGTH),
        sets="camera",
    )
    max_depth: int | None = setting(
        "N", "Specular events on a light path, at most; default: 64.", options.integer(1, options.MAX_DEPTH)
    )
    spp: int | None = shared(SPP)
    batch: int | None = setting("N", "Photons in flight at once (never changes the picture).", options.batch)
    polarisation: bool | None = switch(
        "Light keeps its polarisation from surface to surface (default: as the scene has it).",
        flags=("--polarisation/--no-polarisation",),
        sets="render",
        default=None,
    )
    antialias_highlights: bool | None = switch(
        f"Edges of what is overexposed without steps (default: as the scene has it; {_NOT_LINEAR}).",
        flags=("--antialias-highlights/--no-antialias-highlights",),
        sets="render",
        default=None,
    )
    bounces: int | None = option(
        "N",
        f"How often light goes on from one diffuse surface to another, 0 to {MAX_BOUNCES} (default: as the scene "
        "has it).",
        options.integer(0, MAX_BOUNCES),
        sets="render",
    )
    haze: float | None = option(
        "K",
        "Haze in which light is seen on its way: what is scattered per scene unit, for example 0.03 (default: as "
        "the scene has it).",
        options.number(HAZE, " per scene unit, for example 0.03"),
        sets="render",
    )
    haze_anisotropy: float | None = option(
        "G",
        "Mean cosine of the angle by which haze scatters, -0.99 to 0.99 (default: as the scene has it).",
        options.number(HAZE_ANISOTROPY, ", for example 0.3"),
        sets="render",
    )
    stats: bool = switch(_STATS)
    passes: tuple[int, int] | None = option(
        "I/N", "Trace only part I of N, to a file OUT.ssp: 'merge' makes the picture of all parts.", options.share
    )


@dataclass(frozen=True, kw_only=True)
class Merge(ReadsScenes):
    """Make a picture of its parts, traced one by one or on many machines."""

    parts: tuple[Path, ...] = argument(
        "PART.ssp...", "Parts that 'render --passes' wrote, or folders of them.", repeated=True
    )
    output: Path = target("OUT", f"The picture: {SHOWN}, {LINEAR}; or .ssp, a part that holds them all.")
    scene: str | None = option("SCENE", "The scene; default: the file that the parts were traced from.")
    exposure: float | None = option("EV", f"Stops brighter (or darker) than automatic; {_NOT_LINEAR}.", _exposure)
    partial: bool = switch("Make a noisier picture of the parts there are, where some are missing.")
    stats: bool = switch(_STATS)


@dataclass(frozen=True, kw_only=True)
class Animate(OpensScene):
    """Render an animation: a turntable, or any parameters over time."""

    output: Path = target("OUT", f"A movie ({_either(*FILMS)}), or a folder for numbered PNGs, which can be resumed.")
    turntable: bool = switch("Turn the camera once about its target; the default when no parameter moves.")
    keys: Path | None = option(
        "FILE.toml", "Keys of any parameter: tables named keys with time_s, parameter, value, interpolation."
    )
    ranges: tuple[str, ...] = option(
        "P=A:B",
        "Let a parameter go from A to B, for example objects.prism.dispersion_gain=0:3; may be repeated.",
        flags=("--set",),
        repeated=True,
        default=(),
    )
    frames: tuple[int | None, range | None] = option(
        "N",
        "Pictures in all; default: 120, or as many as the keys last. Or some of them by the numbers of their "
        "files: 101-200, or 101-200/240 of 240 in all.",
        options.frames,
        default=(None, None),
    )
    fps: float = option(
        "F",
        "Pictures a second; default: 24.",
        options.number(Number("fps", at_least=0.1, at_most=240.0), ", for example 24"),
        default=24.0,
    )
    size: tuple[int, int] | None = shared(_SIZE)
    photons: int | None = setting("N", "Photons of each traced frame; default: the scene's.", options.photons)
    spp: int | None = setting("N", "Camera samples a pixel; default: 16, with --layer caustic 64.", _spp)
    exposure: float | None = option("EV", "Stops brighter (or darker) than is automatic in the first frame.", _exposure)
    seed: int | None = setting("K", "Seed of the random numbers, the same for all frames; default: 1.", _seed)
    method: str | None = shared(_METHOD)
    camera_method: str | None = shared(_CAMERA_METHOD)
    overwrite: bool = switch("Replace the frames of another animation in the folder.")


@dataclass(frozen=True, kw_only=True)
class Sweep(ByWorkers, OpensScene):
    """Render a picture for every combination of parameters' values."""

    output: Path = target("DIR", "A folder for pictures and sweep.json, their values.")
    ranges: tuple[str, ...] = option(
        "P=A:B:N",
        "A parameter's values: N from A to B, or a list A,B,C; may be repeated for all combinations.",
        flags=("--set",),
        repeated=True,
        default=MISSING,
    )
    format: str = option(
        "NAME",
        f"{_either(*_FORMATS)}; default: png.",
        options.one_of(*_FORMATS),
        default="png",
    )
    size: tuple[int, int] | None = shared(_SIZE)
    photons: int | None = setting("N", "Photons of each tracing; default: the scene's.", options.photons)
    spp: int | None = setting("N", "Camera samples a pixel; default: 32.", _spp)
    bins: int | None = setting("N", f"Keep spectral bins (written to {_SPECTRAL}); every point is then traced.", _bins)
    exposure: float | None = option(
        "EV", "Stops brighter (or darker) than is automatic in the first picture.", _exposure
    )
    seed: int | None = shared(SEED)
    method: str | None = shared(_METHOD)
    exact: bool = switch("Trace every point, also where kept photons follow to first order.")
    overwrite: bool = switch("Replace another sweep in the folder.")


# ---- commands about one scene, its caustics and glasses ---------------------------------------


@dataclass(frozen=True, kw_only=True)
class View(OpensFile):
    """Open the viewer: edit dispersion and caustics on the screen."""

    scene: str | None = argument(
        "[SCENE]",
        "A scene file, a bare mesh, or a shipped scene's name; default: the default scene.",
        complete=completion.scenes,
        default=None,
    )
    size: tuple[int, int] | None = option("WxH", "Of the window; default: as it was last.", options.size)
    theme: Literal["dark", "light"] | None = option(
        "NAME", "dark or light; default: as it was last.", options.one_of("dark", "light")
    )
    screenshot: Path | None = option("FILE.png", "Write a picture of the window and close.")
    after: float | None = option(
        "S", "Seconds from the first picture until --screenshot; default: 10.", options.seconds()
    )


@dataclass(frozen=True, kw_only=True)
class Lesson:
    """Open a lesson in the viewer: a scene, a few sentences, what to try; or list them."""

    name: str | None = argument(
        "[NAME]", "Which to open; nothing lists all.", complete=completion.lessons, default=None
    )


@dataclass(frozen=True, kw_only=True)
class BakesCaustic(OpensScene):
    """Options of the commands that bake a caustic map."""

    size: tuple[int, int] | None = setting(
        "WxH",
        "Texels, of a page pixels; default: 1024x1024, of a page as the scene.",
        options.size,
        fields=("width", "height"),
    )
    photons: int | None = shared(PHOTONS)
    seed: int | None = shared(SEED)


@dataclass(frozen=True, kw_only=True)
class Bake(BakesCaustic):
    """Bake the caustic on an object to a texture, with its placement."""

    receiver: str = argument("RECEIVER", "The diffuse object whose caustic is baked.", complete=completion.receivers)
    output: Path = target(
        "OUT",
        f"The texture: {LINEAR} (linear irradiance), {SHOWN} (to look at); where it is placed is written to a .json "
        "next to it.",
    )


@dataclass(frozen=True, kw_only=True)
class Export(BakesCaustic):
    """Export the caustic on an object to glTF or USD, as a cookie for game engines, or as a page for browsers; or a
    stone's faceting design."""

    receiver: str = argument(
        "RECEIVER", "The diffuse object whose caustic is exported, or a stone.", complete=completion.receivers
    )
    output: Path = target(
        "OUT",
        "The receiver with its caustic as emission: .glb, .gltf, .usda, .usdc, .usd; or a spot light's cookie: "
        ".png, .exr. Numbers are written to a .json next to it. Or a page whose dispersion can be dragged: .html. "
        "Of a stone, its facets as GemCad reads them: .asc.",
    )
    plane: bool = switch("Only the rectangle that is lit, as bright as on a white receiver.")
    source: tuple[float, float, float] | None = option(
        "X,Y,Z", "Where the cookie's spot is; default: at the scene's only lamp, or straight above.", options.place
    )


@dataclass(frozen=True, kw_only=True)
class Gallery:
    """Make a static site of shipped scenes and lessons, each a page whose dispersion can be dragged."""

    scenes: tuple[str, ...] = argument(
        "[NAME]...",
        "Scenes and lessons; default: all.",
        complete=completion.scenes,
        repeated=True,
        default=(),
    )
    output: Path = target("DIR", "Folder of the site; pages that are there already are kept.")
    photons: int = option("N", "Of each page; default: 100k.", options.photons, default=100_000)


@dataclass(frozen=True, kw_only=True)
class Inspect(ReadsScenes):
    """Show what a scene holds, its glasses and mesh health, and which features its programs need."""

    scene: str = shared(_SCENE, default=MISSING)
    programs: bool = switch(
        "List instead what each of its programs needs of the driver and holds code of; compiles them."
    )


@dataclass(frozen=True, kw_only=True)
class Glass:
    """Search the glass catalogue; show one glass in full."""

    query: str = argument(
        "[QUERY]", "Part of a name or maker; nothing lists all.", complete=completion.glasses, default=""
    )
    plot: Path | None = option("FILE.png", "Plot n over the wavelength and the place in the Abbe diagram.")


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """Check OpenGL, its limits and the packages, with a remedy for what is missing."""


# ---- the same by many workers -----------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class FarmRender(ByWorkers, Render):
    """Render a scene to a picture file, on a farm."""

    without = ("passes", "seconds")

    parts: int | None = option(
        "N", "Into how many parts light is divided; default: four a worker.", options.integer(1, options.MAX_PARTS)
    )
    keep_parts: bool = switch("Leave the parts next to the picture, in OUT.parts.")


@dataclass(frozen=True, kw_only=True)
class FarmAnimate(ByWorkers, Animate):
    """Render an animation: a turntable, or any parameters over time, on a farm."""
