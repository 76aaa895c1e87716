"""The base class of materials: all that the renderer, scene files and panels need to know of one.

Each kind of material (glass, mirror, diffuse, …) is a subclass that overrides what differs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from ..fields import Number, Part, read_fields, write_fields
from ..io.scene_table import SceneTable
from ..optics.colorimetry import rgb_basis
from ..texture import TextureReader
from ..vectors import Vec3, unit

if TYPE_CHECKING:
    from ..geometry.mesh import Mesh
    from ..optics.glass import Dispersion


@dataclass(frozen=True)
class Material:
    """How a surface, and the inside of a solid, affects light."""

    kind: ClassVar[str]
    """Its name in a scene file, under the key `kind`."""
    title: ClassVar[str]
    gpu_code: ClassVar[int]
    """Identifies the kind on the GPU (KIND_… of shaders/lib/scene.glsl)."""
    parts: ClassVar[tuple[Part, ...]] = ()
    """Its keys in a scene file, besides `kind`."""
    is_specular: ClassVar[bool] = False
    """Light paths continue from it as rays (glass, mirrors, gratings); they end on any other material."""
    transmits: ClassVar[bool] = False
    """Light is refracted into it: a dielectric."""
    is_mirror: ClassVar[bool] = False
    is_grating: ClassVar[bool] = False
    is_polariser: ClassVar[bool] = False
    receives: ClassVar[bool] = False
    """It is diffuse, so caustics are visible on it."""
    why_no_beams: ClassVar[str | None] = None
    """Why its light cannot go as polygons of flat facets; None: it can."""
    # Defaults of what some kinds have as fields. Unannotated: annotated, they would be fields of every kind.
    reflectance_rgb = (0.0, 0.0, 0.0)
    """Linear Rec.709."""
    reflectance = cast(Any, None)
    """Spectral reflectance, (401,) on the visible grid (380 to 780 nm), which replaces `reflectance_rgb`; or None."""
    film = cast(Any, None)
    """The thin film on it, `optics.thin_films.Film`."""
    coating = cast(Any, None)
    film_nm = 0.0
    film_along = cast(Any, None)
    """Direction that a film's thickness varies in; None: it is even."""
    metal = ""
    texture = cast(Any, None)
    absorption = cast(Any, None)
    roughness = cast(Any, None)
    """Roughness of the coat of a diffuse surface (None: no coat) or of glass or a mirror (0: polished)."""
    coat_index = 1.0
    diffuse_roughness = 0.0
    dispersion = cast(Any, None)
    """The function of wavelength that it deflects light by: a glass's index, for a grating the wavelength itself."""
    extraordinary = cast(Any, None)
    """A crystal's second dispersion."""
    axis = (0.0, 0.0, 1.0)
    """A crystal's optic axis or a polariser's, a unit vector in the object's own coordinates."""
    priority = 0
    thin = False
    retardance_nm = 0.0
    transmittance_rgb = (1.0, 1.0, 1.0)
    """Linear Rec.709 transmittance of coloured glass, for light that enters and leaves it."""

    @property
    def met_as(self) -> int:
        """KIND_… of shaders/lib/scene.glsl that its surface is treated as: `gpu_code`, but a thin sheet has its own."""
        return self.gpu_code

    @property
    def profile_code(self) -> int:
        """How a grating's grooves share light out (PROFILE_… of shaders/lib/grating.glsl); 0: its shares are given."""
        return 0

    @property
    def spread_per_um(self) -> float:
        """One over the width of the opening that its light is diffracted by, 1/µm; 0: it is not."""
        return 0.0

    @property
    def is_solid(self) -> bool:
        """It is transparent with an inside, unlike a thin sheet."""
        return self.transmits and not self.thin

    @property
    def disperses(self) -> bool:
        """It deflects different wavelengths into different directions."""
        return not self.thin and any(dispersion.is_dispersive for dispersion in self.dispersions)

    @property
    def dispersions(self) -> tuple[Dispersion, ...]:
        """None, its one, or both of a crystal."""
        other = (self.extraordinary,) if self.is_crystal else ()
        return () if self.dispersion is None else (self.dispersion, *other)

    @property
    def is_crystal(self) -> bool:
        """It is birefringent: it parts light into an ordinary and an extraordinary ray."""
        return False

    @property
    def polarises(self) -> bool:
        """What it does is polarised in the first place, so that a scene with it keeps light's polarisation."""
        return self.is_crystal or self.is_polariser

    @property
    def has_coat(self) -> bool:
        """It is diffuse with a glossy coat."""
        return False

    @property
    def is_black(self) -> bool:
        """It absorbs all light: paths end on it, and it shows no caustics."""
        return not (self.is_specular or self.receives)

    @property
    def is_rough(self) -> bool:
        """It is a solid or a mirror with a rough surface, which scatters paths at random."""
        return (self.is_solid or self.is_mirror) and self.roughness > 0.0

    @property
    def microfacet_width(self) -> float:
        """GGX's α, the square of the roughness as in glTF; 0: polished. Half of the microfacets are steeper than the
        slope α."""
        return self.roughness**2 if self.is_rough else 0.0

    @property
    def is_coloured(self) -> bool:
        """Its RGB reflectance or its RGB transmittance is not grey."""
        return len(set(self.reflectance_rgb)) > 1 or len(set(self.transmittance_rgb)) > 1

    @property
    def filters(self) -> bool:
        """It is coloured or grey glass: each surface absorbs part of the light that enters or leaves."""
        return self.transmittance_rgb != (1.0, 1.0, 1.0)

    @property
    def surface_filter(self) -> np.ndarray:
        """Spectral transmittance of one surface, float64 (401,) on the visible grid, such that white light has the
        colour `transmittance_rgb` behind a sheet (one surface) or a solid (two surfaces)."""
        passed: np.ndarray = rgb_basis() @ np.asarray(self.transmittance_rgb, float)
        return passed if self.thin else np.sqrt(passed)

    @classmethod
    def usual(cls) -> Self:
        """The default of this kind, for a user who sets nothing else."""
        return cls()

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """A material of this kind from its table in a scene file; `textures` reads its pictures."""
        return cls(**read_fields(cls.parts, table))

    def values(self, path: Path | None = None) -> dict[str, Any]:
        """Its table, key by key, for the scene file `path`.

        Without a path, files are named absolutely, and a picture that has no file by its content.
        """
        return {"kind": self.kind} | write_fields(self.parts, self, path)

    def changed(self, **values: Any) -> Self:
        """A copy in which these fields have other values."""
        return replace(self, **values)

    def axis_in_world(self, object_to_world: np.ndarray) -> np.ndarray:
        """Unit vector (3,) along the axis, of an object placed so."""
        return unit(np.asarray(object_to_world)[:3, :3] @ np.asarray(self.axis, float))

    def check_on(self, mesh: Mesh, name: str, file_name: str) -> None:
        """Raise UserError if object `name` of this file cannot have this material on its mesh."""

    def shown_numbers(self) -> tuple[Number, ...]:
        """Its numeric keys that the panel shows, each in a row."""
        return tuple(part for part in self.parts if isinstance(part, Number) and part.row is not None)

    def is_like(self, other: Material) -> bool:
        """Whether `other` differs in values only, so that the same GPU programs and buffers serve both."""
        return False

    def words(self) -> str:
        """A short description for reports."""
        return self.kind

    def content(self) -> tuple[object, ...]:
        """All values and arrays that light depends on: equal for two materials that act alike (`scene_key`)."""
        return (*(float(v) for v in self.reflectance_rgb), self.reflectance)


def colour_words(rgb: Vec3) -> str:
    """A colour as text: one number if it is grey, else three."""
    return f"{rgb[0]:.3g}" if len(set(rgb)) == 1 else "(" + ", ".join(f"{c:.3g}" for c in rgb) + ")"
