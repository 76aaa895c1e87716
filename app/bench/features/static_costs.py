"""What each feature of a scene adds to what is stored and moved, in bytes: facts that need no measuring.

`inspect` shows them; what a feature costs in time is measured by `bench --features`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...features.features import Features, beam_objects, half_spaces
from ...gpu.mip_chain import level_count
from ...gpu.records import photon_record, ray_record_of
from ...gpu.scene_records import PIECE, TRIANGLE
from ...gpu.spectral_groups import SAMPLES
from ...model.contacts import contacts, overlapping_solids
from ...model.curved_solids import curved_solids
from ...model.scene import Scene
from ...model.texture import Environment, Texture
from ...passes.footprint import SPLAT
from ...passes.variants import MOST_IMAGES

_TEXEL = 16
"""Bytes of an RGBA32F or RGBA32UI texel."""
_NODE = 4 * _TEXEL


@dataclass(frozen=True)
class RecordSizes:
    """Bytes per record, and derivative columns a ray carries."""

    ray: int
    photon: int
    splats_per_photon: int
    texel: int
    columns: int

    @staticmethod
    def of(features: Features) -> RecordSizes:
        """The sizes under `features`."""
        columns = features.defines()["COLUMNS"]
        slots = (2 if features.nested_windows else 1) * SPLAT.stride
        return RecordSizes(
            ray_record_of(features).stride,
            photon_record(features.spectral_groups, features.hero).stride,
            slots,
            features.targets * _TEXEL,
            columns,
        )

    def words(self) -> str:
        """One line for people."""
        return (
            f"A ray is {self.ray} bytes with {self.columns} derivative column(s), a photon record {self.photon}, "
            f"its splats {self.splats_per_photon}, a map's texel {self.texel}."
        )


def static_costs(scene: Scene, features: Features) -> dict[str, str]:
    """By `explain`'s names: what the features that are in add. Those that are out, or add nothing, are not listed."""
    sizes = RecordSizes.of(features)
    unspectral = RecordSizes.of(replace(features, spectral_groups=0))
    unspatial = RecordSizes.of(replace(features, footprints=False, lamp_columns=False))
    polished = RecordSizes.of(replace(features, rough=False))
    from_points = RecordSizes.of(replace(features, lamp_columns=False))
    unpolarised = RecordSizes.of(replace(features, polarised=False))
    untinted = RecordSizes.of(replace(features, tint_levels=0))
    convex = half_spaces(scene)
    round_ones = curved_solids(scene)
    pieces = sum(len(faces) for faces in round_ones.values())
    loose = [o for i, o in enumerate(scene.objects) if i not in convex and i not in round_ones]
    triangles = sum(len(o.mesh.triangles) for o in loose)
    smooth = sum(len(o.mesh.triangles) for o in loose if o.material.is_specular and o.mesh.corner_normals is not None)
    planes = sum(len(own) for own in convex.values())
    row = SAMPLES * 8
    glasses = {o.material.dispersion for o in scene.objects if o.material.transmits}
    absorbing = sum(o.material.absorption is not None for o in scene.objects)
    mirrors = sum(o.material.is_mirror for o in scene.objects)
    curved = [o for o in scene.objects if o.material.receives]
    worn = {id(o.material.texture.rgb): o.material.texture for o in scene.objects if o.material.texture is not None}
    beyond = scene.environment
    costs = {
        "spectral columns": (
            features.spectral_groups > 0,
            f"{sizes.ray - unspectral.ray} B a ray, {sizes.photon - unspectral.photon} B a photon",
        ),
        "shared spectral variable": (
            features.merged_groups,
            f"one lookup of the slope a refraction, {size_words(row * len(glasses))}",
        ),
        "weights over the band": (features.spectral_weights, "Fresnel and indices at 3 wavelengths instead of 1"),
        "band cuts": (features.band_cuts, "one program more; a cut ray becomes two"),
        "landing cuts": (features.landing_cuts, "two rays more a landing; a cut ray becomes two"),
        "spatial columns": (features.footprints, f"{sizes.ray - unspatial.ray} B a ray"),
        "refraction": (features.dielectrics, f"{size_words(row * len(glasses))} of indices; two children a surface"),
        "polarisation": (features.polarised, f"{sizes.ray - unpolarised.ray} B a ray"),
        "coats": (
            features.coats,
            f"a path goes on from every coat that is seen; {size_words(2 * row)} a coat",
        ),
        "rough diffuse": (features.rough_diffuse, "one more function a light and surface"),
        "rough surfaces": (features.rough, f"{sizes.ray - polished.ray} B a ray"),
        "lamp columns": (features.lamp_columns, f"{sizes.ray - from_points.ray} B a ray"),
        "light edges": (features.light_edges, "splats beside an edge have another program; one more number a fragment"),
        "mirrors": (features.mirrors, f"{size_words(row * mirrors)} of reflectances"),
        "thin sheets": (features.sheets, "one more kind of surface; indices of both sides are looked up"),
        "surface colours": (features.filters, f"3 lookups a surface, {size_words(row)} a colour"),
        "gratings": (features.gratings, f"{_TEXEL} B an order; a step of the queue for each"),
        "interpolated normals": (features.smooth_normals, f"{3 * _TEXEL} B a facet, {size_words(3 * _TEXEL * smooth)}"),
        "normal derivatives": (features.normal_derivatives, "one more vector a column and surface"),
        "absorption": (features.absorption, f"3 lookups a flight, {size_words(row * absorbing)}"),
        "tint levels": (
            features.tint_levels > 0,
            f"{sizes.ray - untinted.ray} B a ray; {features.tint_levels} tables a light and band instead of one",
        ),
        "contacts": (features.contacts, f"{len(contacts(scene))} pair(s) that may touch"),
        "medium stack": (features.medium_stack, f"{len(overlapping_solids(scene))} bit(s) of a ray's mask"),
        "triangle tree": (features.tree, f"about {size_words(triangles * (TRIANGLE.stride + _NODE // 2))}"),
        "half-space solids": (
            features.convex_solids,
            f"{planes} planes, {size_words(planes * _TEXEL)}: each ray walks through all",
        ),
        "curved solids": (
            features.curved_solids,
            f"{pieces} faces, {size_words(pieces * PIECE.stride)}: each ray walks through all",
        ),
        "charts": (features.charts, f"{len(curved)} receiver(s) with a placement a facet"),
        "local gain": (features.local_gain, "eight voxels a photon"),
        "photons by index": (features.reindexed, "32 B a band"),
        "contact lines": (features.contact_lines, "4 B a texel; splats beside them have a program each"),
        "border images": (
            features.border_images,
            f"room for {MOST_IMAGES} more splats a photon and window, {SPLAT.stride} B each",
        ),
        "nested windows": (features.nested_windows, f"{SPLAT.stride} B a photon: a splat for each window"),
        "camera refraction": (features.camera_specular, "a second program; 4 B a pixel list what it has to do"),
        "camera spectral taps": (
            features.camera_disperses,
            f"{features.spectral_groups} column(s) a camera ray; looks along each sweep",
        ),
        "spectral maps": (features.map_tents > 0, f"{features.map_tents * _TEXEL // 4} B a texel"),
        "textures": (bool(worn), f"about {size_words(sum(map(picture_bytes, worn.values())))}"),
        "environment map": (
            beyond is not None,
            f"about {size_words(picture_bytes(beyond))}" if beyond is not None else "",
        ),
        "environment light": (
            features.environment_lights,
            "up to six lookups a diffuse surface; a texture of some thousand texels a receiver",
        ),
        "bounces": (
            features.bounces > 0,
            "up to six lookups a diffuse surface; a texture of some thousand texels a receiver, and one a bounce",
        ),
        "beams": (features.beams, f"{len(beam_objects(scene))} object(s) searched on the processor; one bit an object"),
        "spectral bins": (features.targets > 1, f"{sizes.texel} B a texel instead of {_TEXEL}"),
    }
    return {name: words for name, (included, words) in costs.items() if included}


def picture_bytes(picture: Texture | Environment) -> int:
    """What a picture takes on the device, its smaller copies in a column beside it (`TextureStore`); packing several
    adds a little."""
    height, width = picture.rgb.shape[:2]
    return _TEXEL * height * (width + (max(width // 2, 1) if level_count(width, height) > 1 else 0))


def size_words(count: int) -> str:
    """Bytes for people."""
    return (
        f"{count} B"
        if count < 2048
        else f"{count / 1024:.0f} KiB"
        if count < 1 << 21
        else f"{count / (1 << 20):.1f} MiB"
    )
