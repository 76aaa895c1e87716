"""Rows of the table: where light lands, and what a picture shows besides caustics."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.contacts import standing
from ..model.scene import Camera, SceneObject
from ..model.texture import Environment, Texture
from . import facts as of_scenes
from .facts import Facts, names
from .row import Sizes, feature, size_words

MOST_IMAGES = 4
"""Images of a footprint that its receiver's borders may reflect: at the two nearest ones, and at both."""


@dataclass(frozen=True, kw_only=True)
class ReceiverFeatures:
    """Features of caustic maps."""

    charts: bool = feature(
        "charts",
        lambda facts: len(facts.flat_receivers) < len(facts.receivers),
        symbol="CHARTS",
        why=lambda facts: f"{len(facts.receivers) - len(facts.flat_receivers)} curved receiver(s)",
        why_not="all receivers are flat",
        names=("RECEIVER_CHARTS", "PLACED_CHART"),
        cost=lambda facts, sizes: (
            f"{len(facts.receivers) - len(facts.flat_receivers)} receiver(s) with a placement a facet"
        ),
    )
    """A receiver is curved and carries charts."""
    nested_windows: int = feature(
        "nested windows",
        lambda facts: 2 if facts.flat_receivers else 0,
        why="flat receivers may get a fine window inside coarse ones",
        why_not="no receiver has two windows",
        names=("is_only_fine", "outer"),
        cost=lambda facts, sizes: f"{sizes.splat} B a photon: a splat for each window",
        off=0,
    )
    """Windows that flat receivers carry round their finest one, at most."""
    contact_lines: bool = feature(
        "contact lines",
        lambda facts: bool(standing(facts.scene)),
        why=lambda facts: (
            f"on a receiver: {names({j: facts.scene.objects[j] for _, j in standing(facts.scene)}.values())}"
        ),
        why_not="nothing stands on a receiver",
        names=("contact_words", "takes_side", "side_of_contact"),
        cost="4 B a texel; splats next to them have a program each",
    )
    """An object touches a flat receiver: in a still, light beneath it does not spread to the places around."""
    border_images: bool = feature(
        "border images",
        lambda facts: facts.has_columns and bool(_bordered(facts)),
        symbol="BORDER_IMAGES",
        why=lambda facts: f"footprints near a border of {names(_bordered(facts))} come back from it",
        why_not="no flat receiver is convex, or no light lands near a border",
        names=("put_images", "border_distance", "mirrored_step"),
        cost=lambda facts, sizes: f"room for {MOST_IMAGES} more splats a photon and window, {sizes.splat} B each",
    )
    """A flat receiver is convex: what footprints would spread beyond its borders comes back as their mirror image."""
    local_gain: bool = feature(
        "local gain",
        lambda facts: facts.groups > 0 and facts.is_painted,
        symbol="LOCAL_GAIN",
        why="the dispersion brush was used on a receiver",
        why_not="no receiver was painted on",
        names=("gain_boxes", "local_gain"),
        cost="eight voxels a photon",
        requires=("spectral_groups",),
    )
    """The dispersion brush scales spectral displacements on some receiver."""
    bins: int = feature(
        "spectral bins",
        lambda facts: facts.settings.bins or 0,
        why=lambda facts: f"{facts.settings.bins} of equal width, instead of XYZ",
        why_not="the picture is in colours",
        cost=lambda facts, sizes: f"{4 * (facts.settings.bins or 0)} B a texel instead of {sizes.texel}",
        off=0,
    )
    """Spectral bins of the picture; 0: it is in colours."""
    map_tents: int = feature(
        "spectral maps",
        lambda facts: facts.tents,
        why=lambda facts: f"{facts.tents} channels beside XYZ: light and camera disperse",
        why_not="no caustic is seen through dispersive glass",
        names=("BIN_ROW", "BIN_SPECTRUM_ROW", "BIN_TARGET"),
        cost=lambda facts, sizes: f"{4 * facts.tents} B a texel",
        requires=("camera_disperses",),
        off=0,
    )
    """Spectral channels of the caustic maps beside XYZ, for light whose dispersion the camera's adds to."""
    flights: bool = feature("", lambda facts: False, symbol="FLIGHTS", requires=("haze",))
    """Where rays fly outside glass is recorded: of photons that are traced for haze alone (`passes.flights`)."""


@dataclass(frozen=True, kw_only=True)
class PictureFeatures:
    """Features of what the camera sees: no caustic map depends on them."""

    camera_specular: bool = feature(
        "camera refraction",
        lambda facts: facts.camera_needs[0],
        why="the camera may see glass, mirrors or coats",
        why_not="no glass and no mirror is in view",
        names=("meet_surface", "path_stack", "stack_size", "listed_entry"),
        cost="a second program; 4 B a pixel list what it has to do",
    )
    """The camera may see glass or a mirror: its rays go on behind them."""
    camera_disperses: bool = feature(
        "camera spectral taps",
        lambda facts: facts.camera_needs[1],
        why="the camera may see through dispersive glass",
        why_not=lambda facts: "no dispersive glass is in view" if facts.dispersive else "nothing disperses",
        names=(r"restrict_to_band\(path, pixel_key\)", "taps_of"),
        cost=lambda facts, sizes: f"{facts.groups} column(s) a camera ray; lookups along each sweep",
        requires=("camera_specular",),
    )
    """The camera may see through glass that disperses: its rays carry a band of the spectrum, and look up along their
    sweep."""
    camera_colours: bool = feature(
        "",
        lambda facts: bool(
            facts.having(lambda m: m.filters or m.absorption is not None or (m.is_mirror and m.is_coloured))
        ),
    )
    """What camera rays pass or meet may have a colour: they carry it along the spectrum."""
    has_receivers: bool = feature(
        "", lambda facts: bool(facts.having(lambda material: not material.is_specular)), symbol="HAS_RECEIVERS"
    )
    """Some surface ends camera rays."""
    lens: bool = feature(
        "lens",
        lambda facts: facts.scene.camera.lens_radius > 0.0,
        why=lambda facts: _lens_words(facts.scene.camera),
        why_not=lambda facts: (
            "the camera is a pinhole" if facts.scene.camera.kind == "pinhole" else "the camera has no lens"
        ),
        names=("lens_place", "by_lens", "begin_on_lens"),
        cost="two columns a camera ray",
    )
    """The camera has a lens: its rays begin all over it, and carry columns of the place there."""
    coats: bool = feature(
        "coats",
        lambda facts: facts.is_picture and bool(facts.having(lambda material: material.has_coat)),
        symbol="COATS",
        why=lambda facts: f"glossy: {names(facts.having(lambda material: material.has_coat))}",
        why_not="no receiver is glossy",
        names=("coat_pdf", "coat_weight", "coat_response"),
        cost=lambda facts, sizes: (
            f"a path goes on from every coat that is seen; {size_words(2 * sizes.spectrum)} a coat"
        ),
    )
    """Some receiver has a glossy coat: camera rays go on from it."""
    rough_diffuse: bool = feature(
        "rough diffuse",
        lambda facts: facts.is_picture and bool(facts.having(lambda material: material.diffuse_roughness)),
        symbol="ROUGH_DIFFUSE",
        why=lambda facts: f"rough: {names(facts.having(lambda material: material.diffuse_roughness))}",
        why_not="what is diffuse is Lambertian",
        names=("rough_response", "rough_albedo"),
        cost="one more function a light and surface",
    )
    """Some receiver is rougher than Lambert's law has it."""
    textures: bool = feature(
        "textures",
        lambda facts: bool(facts.having(lambda material: material.texture is not None)),
        why=lambda facts: f"on {names(facts.having(lambda m: m.receives and m.texture is not None))}",
        why_not="no surface has a picture",
        cost=lambda facts, sizes: f"about {size_words(_texture_bytes(facts, sizes))}",
    )
    environment_map: bool = feature(
        "environment map",
        lambda facts: facts.scene.environment is not None,
        why=lambda facts: f"a {_environment(facts).kind} lies beyond",
        why_not="one colour lies beyond",
        cost=lambda facts, sizes: f"about {size_words(picture_bytes(_environment(facts), sizes.texel))}",
    )
    environment_lights: bool = feature(
        "environment light",
        lambda facts: facts.no_environment_light is None,
        why=lambda _: "every diffuse surface is lit by it, with visibility, also through glass and over mirrors",
        why_not=lambda facts: facts.no_environment_light or "",
        names=("add_environment",),
        cost="up to six lookups a diffuse surface; a texture of some thousand texels a receiver",
    )
    """What lies beyond everything lights receivers: camera rays look up how much."""
    environment_spectrum: bool = feature(
        "environment spectrum",
        lambda facts: facts.no_environment_light is None and bool(facts.dispersive or facts.films),
        why=lambda facts: (
            f"{names(facts.dispersive)} disperses what passes through it"
            if facts.dispersive
            else f"films part its colours on {names(facts.films)}"
        ),
        why_not=lambda facts: facts.no_environment_light or "nothing disperses",
        names=("environment_by", "reflect_spectrum", "keep_anchor"),
        cost="a dozen lookups of the environment a path through glass",
        requires=("environment_lights",),
    )
    """Its light arrives on receivers with the colours of dispersion."""
    bounces: int = feature(
        "bounces",
        lambda facts: facts.scene.render.bounces if facts.no_bounces is None else 0,
        why=lambda facts: f"diffuse surfaces light each other, {facts.scene.render.bounces} time(s) over",
        why_not=lambda facts: facts.no_bounces or "",
        names=("gathered", "cosine_direction"),
        cost="up to six lookups a diffuse surface; a texture of some thousand texels a receiver, and one a bounce",
        off=0,
    )
    """How often light goes on from one diffuse surface to another: camera rays look up what arrived."""
    haze: bool = feature(
        "haze",
        lambda facts: facts.no_haze is None,
        why=lambda facts: f"light is seen on its way: {facts.scene.render.haze:.4g} of it is scattered per scene unit",
        why_not=lambda facts: facts.no_haze or "",
        names=("henyey_greenstein", "blur_1d", "store_flight", "flown"),
        cost="photons of its own, whose every flight is drawn",
    )
    """The air scatters: the camera sees light on its way (`passes.haze`)."""


def _bordered(facts: Facts) -> list[SceneObject]:
    return [item for item in facts.scene.objects if of_scenes.has_borders(item)]


def _environment(facts: Facts) -> Environment:
    assert facts.scene.environment is not None
    return facts.scene.environment


def _lens_words(camera: Camera) -> str:
    return f"radius {camera.lens_radius:.4g}, focused at {camera.plane_of_focus:.4g}"


def _texture_bytes(facts: Facts, sizes: Sizes) -> int:
    worn = [item.material.texture for item in facts.scene.objects if item.material.texture is not None]
    return sum(picture_bytes(texture, sizes.texel) for texture in {id(each.rgb): each for each in worn}.values())


def picture_bytes(picture: Texture | Environment, texel: int = 16) -> int:
    """What a picture takes on the device, its smaller copies in a column beside it (`TextureStore`); packing several
    adds a little."""
    height, width = picture.rgb.shape[:2]
    return texel * height * (width + (max(width // 2, 1) if max(width, height) > 1 else 0))
