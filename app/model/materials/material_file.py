"""Materials of a scene file: [materials.NAME] tables and those written inline on an object."""

from __future__ import annotations

from ...base.errors import suggestion
from ..io.scene_table import SceneTable
from ..texture import TextureReader
from . import MATERIAL_KINDS
from .dielectric import DEFAULT_GLASS, PRIORITY, ROUGHNESS, THIN, Dielectric
from .dispersion_file import GAIN, named_glass
from .material import Material

_OF_GLASS = {
    PRIORITY: "decides between overlapping solids of glass",
    ROUGHNESS: "is for the surface of glass or of a mirror",
    THIN: "is for a sheet of glass",
}
"""Keys that an object may give its glass or its mirror, and what they are for."""


def read_materials(table: SceneTable, textures: TextureReader | None = None) -> dict[str, Material]:
    """All of [materials.NAME] by name; `textures` reads their pictures, each once."""
    textures = textures or TextureReader()
    return {name: read_material(entry, textures) for name, entry in table.named_tables("materials").items()}


def read_object_material(
    table: SceneTable, named: dict[str, Material], textures: TextureReader | None = None
) -> Material:
    """The material of one object: `glass = "…"`, `material = "NAME"`, `material = {…}` or the default glass.

    "mirror", "diffuse" and "black" are known without being defined. The object's `priority`,
    `roughness`, `thin` and `dispersion_gain` go above the material's own.
    """
    key = table.one_of(("glass", "material"), "the material")
    if key == "material" and isinstance(table.raw(key), str):
        name = table.string(key)
        plain = {kind: cls() for kind, cls in MATERIAL_KINDS.items() if not cls.transmits}
        known = plain | named
        if name not in known:
            table.fail(key, f"names '{name}', which is not defined under [materials]" + suggestion(name, known))
        material = known[name]
    elif key == "material" and isinstance(table.raw(key), Material):
        material = table.raw(key)  # from Python: one that was read before
    elif key == "material":
        material = read_material(table.given_table(key, '{ kind = "diffuse", colour = [0.8, 0.8, 0.8] }'), textures)
    else:
        material = Dielectric(named_glass(table, key or "", table.string("glass", DEFAULT_GLASS)))
    if table.has(GAIN):
        if not material.transmits:
            table.fail(GAIN, "is for glass; this object has none")
        assert isinstance(material, Dielectric)
        material = material.with_gain(table.number(GAIN, at_least=0.0), table.where(GAIN))
    for field, what in _OF_GLASS.items():
        if table.has(field.attribute):
            if field not in material.parts:
                table.fail(field.attribute, f"{what}; this object has none")
            material = material.changed(**field.read(table))
    return material


def read_material(table: SceneTable, textures: TextureReader | None = None) -> Material:
    """One material table of any kind ('glass' unless it says otherwise)."""
    kind = table.choice("kind", tuple(MATERIAL_KINDS), Dielectric.kind)
    material = MATERIAL_KINDS[kind].read(table, textures or TextureReader())
    table.finish(f"a material of kind '{kind}'")
    return material
