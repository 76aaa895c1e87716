"""Every reader of files, with sound files to damage: small ones, for most damage is where a file says what it holds."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir

from tests.unit.gltf_builder import FACES, POSITIONS, Builder, glass_material
from tests.unit.picture_bytes import hdr_file, new_rows, old_rows, random_rgbe


@dataclass(frozen=True)
class Reader:
    """`read` takes a file named `name`; it may raise `refusals` and nothing else, and warn of nothing."""

    name: str
    read: Callable[[Path], object]
    seeds: Callable[[], tuple[bytes, ...]]
    refusals: tuple[type[Exception], ...] = (UserError,)


def _scene(path: Path) -> object:
    from spectrasplat.commands.inspect_report import camera_line
    from spectrasplat.model.io.scene_file import load_scene

    return camera_line(load_scene(path))


def _scene_texts() -> tuple[bytes, ...]:
    shipped = ("default", "prism", "wine_glass", "achromat", "spectrometer", "brilliant_studio", "lens_text", "tube")
    texts = [(assets_dir() / "scenes" / f"{name}.toml").read_bytes() for name in shipped]
    return tuple(t.replace(b'"../', f'"{assets_dir().as_posix()}/'.encode()) for t in texts)


@cache
def _gltf() -> Builder:
    """A file with something of everything that is read."""
    tint = {"attenuationColor": [0.9, 0.5, 0.5], "attenuationDistance": 0.5}
    made = Builder().tetrahedron(glass_material(**tint))
    worn = made.primitive(FACES) | {"material": 1}
    worn["attributes"]["TEXCOORD_0"] = made.accessor(np.array([(0, 0), (1, 0), (0, 1), (1, 1)], "<f4"), "VEC2", 5126)
    area = {"spectrasplat": {"light": {"kind": "area", "size": [0.2, 0.1], "spectrum": "D65"}}}
    lights = [
        {"type": "spot", "intensity": 9, "color": [1, 0.9, 0.8], "spot": {"outerConeAngle": 0.5}},
        {"type": "point", "extras": area},
    ]
    dabs = [{"primitive": 0, "dabs": [{"position": [0, 0, 0], "radius": 0.5, "log2_gain": 1.0}]}]
    made.json["meshes"].append({"primitives": [worn]})
    made.json["materials"].append(
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}, "name": "worn"}
    )
    made.json["accessors"][0] |= {"min": [0, 0, 0], "max": [1, 1, 1]}
    made.json |= {
        "images": [{"bufferView": made.view(_png()), "mimeType": "image/png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33071}],
        "textures": [{"source": 0, "sampler": 0}],
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}},
        ],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_transmission"],
        "extensions": {"KHR_lights_punctual": {"lights": lights}},
        "extras": {"spectrasplat": {"scene": {"background": [0, 0, 1], "render": {"size": [64, 36]}}}},
        "nodes": [
            {"mesh": 0, "name": "glass", "translation": [0, 1, 0], "children": [1], "extras": {}},
            {"mesh": 1, "extras": {"spectrasplat": {"local_dispersion": dabs}}, "name": "worn", "scale": [2, 2, 2]},
            {"camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": [0, 0, 0, 1]},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}, "camera": 1},
        ],
        "scenes": [{"nodes": [0, 2, 3, 4]}],
    }
    return made


def _lens(path: Path) -> object:
    from spectrasplat.model.io.prescription_file import read_prescription
    from spectrasplat.model.optics.lens_design import lens_table

    return lens_table(read_prescription(path))


def _lens_tables() -> tuple[bytes, ...]:
    shipped = (assets_dir() / "lenses" / "cooke_triplet.csv").read_bytes()
    return shipped, b"curvature;diameter;thickness;glass\n.1;1;1;1.5/60\n0;1;;\n"


def _designs() -> tuple[bytes, ...]:
    shipped = (assets_dir() / "gems" / "trillion.asc").read_bytes()
    from tests.unit.test_facet_designs import SQUARE

    return shipped, SQUARE.replace("24 n P1", "24 n P 1\n").replace("72 96\na 0", "72 96 G to\nmeet\na 0").encode(
        "utf-16"
    )


def _zemax() -> tuple[bytes, ...]:
    from tests.unit.test_lenses import ZEMAX

    return ZEMAX.encode(), ZEMAX.replace("ENPD 1.0E+1", "FNUM 5 0").encode("utf-16")


def _mesh(path: Path) -> object:
    from spectrasplat.model.scene_objects import load_checked_mesh

    return load_checked_mesh(path, None, [])


def _objs() -> tuple[bytes, ...]:
    corners = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in POSITIONS)
    extra = "vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nvn 1 0 0\n"
    plain = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)
    full = "".join(f"f {a + 1}/1/1 {b + 1}/2/2 {c + 1}/3/1\n" for a, b, c in FACES)
    mixed = "o a\ng b\ns 1\nf 1 3 2\nf -4 -3 -1\nf 2//1 3//1 4//2\nf 1 4 3 2\n"
    return tuple((corners + more).encode() for more in (plain, extra + full, extra + mixed))


def _materials(path: Path) -> object:
    from spectrasplat.model.io.obj_materials import read_materials

    return [told.material() for told in read_materials(path.with_suffix(".obj"), (path.name,), []).values()]


def _material_texts() -> tuple[bytes, ...]:
    glass = b"newmtl glass\nKd 1 1 1\nNi 1.78\nd -halo 0.1\nillum 7\n"
    return (glass + b"newmtl wood # oak\nKd 0.4 0.2 0.08\nTr 0.0\nKa 1 1 1\nmap_Kd oak.png\n",)


def _plys() -> tuple[bytes, ...]:
    names = "".join(f"property float {n}\n" for n in ("x", "y", "z"))
    head = "element vertex 4\n" + names + "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    body = "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in POSITIONS)
    body += "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    binary = [POSITIONS.tobytes() + b"".join(b"\3" + face.astype("<i4").tobytes() for face in FACES)]
    binary += [POSITIONS.astype(">f4").tobytes() + b"".join(b"\3" + face.astype(">i4").tobytes() for face in FACES)]
    more = head.replace(names, names + "property uchar red\nproperty float s\nproperty float t\n")
    mixed = body.replace("3 0 3 2\n", "4 0 3 2 1\n")
    rows = [(*p, i, i / 4, 0.5) for i, p in enumerate(POSITIONS.tolist())]
    coloured = "".join(" ".join(f"{v:g}" for v in row) + "\n" for row in rows) + body[body.index("3 0") :]
    return (
        f"ply\nformat ascii 1.0\ncomment a\n{head}{body}".encode(),
        f"ply\nformat ascii 1.0\n{head}{mixed}".encode(),
        f"ply\nformat ascii 1.0\n{more}{coloured}".encode(),
        f"ply\nformat binary_little_endian 1.0\n{head}".encode() + binary[0],
        f"ply\nformat binary_big_endian 1.0\n{head}".encode() + binary[1],
    )


def _stls() -> tuple[bytes, ...]:
    corners = POSITIONS[FACES]
    text = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {:g} {:g} {:g}\n".format(*p) for p in t) + "endloop\n"
        "endfacet\n"
        for t in corners
    )
    binary = b"".join(bytes(12) + t.tobytes() + b"\0\0" for t in corners)
    return (f"solid a\n{text}endsolid a\n".encode(), bytes(80) + len(corners).to_bytes(4, "little") + binary)


def _picture(path: Path) -> object:
    from spectrasplat.model.io.picture_files import read_picture

    return read_picture(path)


def _levels() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (6, 8, 3)).astype(np.uint8)


def _encoded(kind: str, **more: object) -> bytes:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(_levels()).save(stream, kind, **more)
    return stream.getvalue()


@cache
def _png() -> bytes:
    return _encoded("PNG")


def _pngs() -> tuple[bytes, ...]:
    from PIL import Image, PngImagePlugin

    texts = PngImagePlugin.PngInfo()
    texts.add_itxt("Exposure", "+1 EV")
    texts.add_text("Comment", "a" * 40, zip=True)
    transparent = io.BytesIO()
    Image.fromarray(_levels()).convert("RGBA").save(transparent, "PNG")
    grey = io.BytesIO()
    Image.fromarray(_levels()).convert("P").save(grey, "PNG", transparency=3)
    return (_png(), _encoded("PNG", pnginfo=texts), transparent.getvalue(), grey.getvalue())


def _jpegs() -> tuple[bytes, ...]:
    from PIL import Image

    turned = Image.Exif()
    turned[0x112] = 6
    return (_encoded("JPEG"), _encoded("JPEG", progressive=True), _encoded("JPEG", exif=turned))


def _hdrs() -> tuple[bytes, ...]:
    rgbe = random_rgbe(16, 4)
    flat = hdr_file(rgbe.tobytes(), 16, 4)
    header = b"#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\nCOLORCORR=1 2 1\n"
    wide = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nPRIMARIES=0.7 0.29 0.17 0.79 0.13 0.05 0.31 0.33\n"
    turned = hdr_file(new_rows(rgbe), 16, 4, wide, axes=("+X", "-Y"))
    return (flat, hdr_file(new_rows(rgbe), 16, 4), hdr_file(old_rows(rgbe), 16, 4, header), turned)


@cache
def _exrs() -> tuple[bytes, ...]:
    import tempfile

    from spectrasplat.base.image_io import write_image

    rgb = _levels().astype(np.float32) / 255
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        write_image(path, rgb)
        plain = path.read_bytes()
        write_image(path, rgb, spectral=rgb, bin_edges_nm=np.array([400.0, 500, 600, 700]))
        spectral = path.read_bytes()
        return plain, spectral, *(_exr(path, *each) for each in _EXR_KINDS)


_EXR_KINDS: tuple[tuple[tuple[str, ...], dict[str, object]], ...] = (
    (("R", "G", "B"), {"chromaticities": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)}),
    (("V.Combined.R", "V.Combined.G", "V.Combined.B", "V.Depth.Z"), {"whiteLuminance": 100.0}),
    (("Y",), {"displayWindow": (np.array([-1, -1], np.int32), np.array([8, 6], np.int32))}),
)


def _exr(path: Path, names: tuple[str, ...], header: dict[str, object]) -> bytes:
    import OpenEXR

    channels = {name: np.full((6, 8), 0.5, np.float16) for name in names}
    with OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header, channels
    ) as file:
        file.write(str(path))
    return path.read_bytes()


def _npys() -> tuple[bytes, ...]:
    return tuple(_stored(_levels().astype(kind)) for kind in (np.float16, np.float32, np.float64))


def _stored(values: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values)
    return stream.getvalue()


def _own_picture(path: Path) -> object:
    from spectrasplat.base.image_io import read_image

    return read_image(path)


def _heights(path: Path) -> object:
    from spectrasplat.model.scene_objects import make_shape

    return make_shape("height_field", heights=str(path), depth=5.0)


def _height_arrays() -> tuple[bytes, ...]:
    return tuple(_stored(0.01 * _levels()[:, :, 0].astype(kind)) for kind in (np.float32, np.float64))


def _height_tables() -> tuple[bytes, ...]:
    rows = 0.01 * _levels()[:, :, 0]
    return ("\n".join(",".join(f"{v:g}" for v in row) for row in rows).encode(),)


def _spectrum(path: Path) -> object:
    from spectrasplat.model.io.curve_file import read_curve, share
    from spectrasplat.model.optics.spectrum import from_csv

    share(path, read_curve(path, []), "transmittance", [])
    return from_csv(path)


def _spectra() -> tuple[bytes, ...]:
    rows = [(380 + 20 * i, round(0.05 * i, 2)) for i in range(20)]
    comma = "Wellenl\u00e4nge [nm];%T\n" + "".join(f"{w};{p:g}\n" for w, p in rows).replace(".", ",")
    across = "ID\t" + "\t".join(f"nm{w}" for w, _ in rows) + "\n1\t" + "\t".join(f"{p:g}" for _, p in rows)
    return (
        ("wavelength_nm, power\n" + "".join(f"{w}, {p:g}\n" for w, p in rows)).encode(),
        "".join(f"{w};{p:g} # a\n" for w, p in rows).encode(),
        comma.encode("utf-16"),
        ("Date: today\n>>>>>Begin<<<<<\n" + "".join(f"{w}\t{p:g}\n" for w, p in rows) + ">>>>>End<<<<<\n").encode(),
        ("Tcp,3262\n" + "".join(f"Spectral Data {w}[nm],{p:g}\n" for w, p in rows)).encode(),
        across.encode(),
    )


def _spdx() -> tuple[bytes, ...]:
    rows = "".join(f'<SpectralData wavelength="{380 + 20 * i}">{0.05 * i:g}</SpectralData>\n' for i in range(20))
    return (
        f'<?xml version="1.0"?>\n<IESTM2714><SpectralDistribution>{rows}</SpectralDistribution></IESTM2714>'.encode(),
    )


def _index(path: Path) -> object:
    from spectrasplat.model.optics.index_file import read_index

    return read_index(path, [])


def _index_tables() -> tuple[bytes, ...]:
    rows = [f"0.{35 + 5 * i}" for i in range(10)]
    n, k = "".join(f"{w},{1.55 - 0.005 * i:g}\n" for i, w in enumerate(rows)), "".join(f"{w},1e-7\n" for w in rows)
    return f"wl,n\n{n}\nwl,k\n{k}".encode(), f"wavelength (um)\tn\n{n.replace(',', chr(9))}".encode()


def _index_pages() -> tuple[bytes, ...]:
    rows = "".join(f"      0.{35 + 5 * i} {1.55 - 0.005 * i:g} 1e-8\n" for i in range(10))
    formula = (
        "  - type: formula 2\n    wavelength_range: 0.3 2.5\n    coefficients: 0 1.04 0.006 0.23 0.02 1.01 103.6\n"
    )
    others = "  - type: formula {}\n    wavelength_range: 0.3 2.5\n    coefficients: {}\n"
    return (
        f"DATA:\n{formula}  - type: tabulated k\n    data: |\n      0.3 1e-8\n      0.9 1e-8\n".encode(),
        f"DATA:\n  - type: tabulated nk\n    data: |\n{rows}".encode(),
        ("DATA:\n" + others.format(7, "1.5 0.01 0.0001 -0.003 1e-5 1e-6")).encode(),
        ("DATA:\n" + others.format(8, "0.27 0.02 0.01 -0.001")).encode(),
        ("DATA:\n" + others.format(9, "2.4 0.02 0.03 0.01 0.2 0.03")).encode(),
    )


def _agfs() -> tuple[bytes, ...]:
    head, c = "NM G {} 517642 1.5168 64.17 0 1\nED 7 8 2.5 0 0\n", "1.04 0.006 0.23 0.02 1.01 103.6 0 0 0 0"
    glass = f"CC own\n{head.format(2)}CD {c}\nTD 0 0 0\nLD 0.3 2.5\nIT 0.4 0.99 10\n"
    series = f"CC own\n{head.format(13)}CD 2.27 -0.01 1e-5 0.01 2e-4 0 0 0 0\nLD 0.3 2.5\n"
    return glass.encode(), series.encode("utf-16")


def _ies(path: Path) -> object:
    from spectrasplat.model.lights.ies_file import read_ies

    return read_ies(path)


def _ldts() -> tuple[bytes, ...]:
    from tests.reference.lamps import ldt_text

    up = [0.0, 30.0, 60.0, 90.0]
    return tuple(ldt_text(lambda v, h: 100.0 + v, up, 8, symmetry).encode() for symmetry in (0, 1, 2, 3, 4))


def _lamps() -> tuple[bytes, ...]:
    angles = "1 -1 1 5 3 1 1 0 0 0\n1 1 9\n0 22.5 45 67.5 90\n0 45 90\n"
    tilted = "IESNA:LM-63-2002\n[TEST] 1\nTILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.8\n" + angles
    table = "100 90 70 40 10\n" * 3
    return ((assets_dir() / "lights" / "downlight.ies").read_bytes(), (tilted + table).encode())


def _keys(path: Path) -> object:
    from spectrasplat.edit.animation import keyed, read_keys
    from spectrasplat.edit.parameters import Stage

    scene = _default_scene()
    return keyed(Stage(scene, scene.camera), read_keys(path, Stage(scene, scene.camera)), 3, 24.0)  # type: ignore[attr-defined]


@cache
def _default_scene() -> object:
    from spectrasplat.model.io.scene_file import load_scene

    return load_scene(assets_dir() / "scenes" / "prism.toml")


def _key_texts() -> tuple[bytes, ...]:
    key = '[[keys]]\ntime_s = {}\nparameter = "{}"\nvalue = {}\ninterpolation = "{}"\n'
    rows = [(0, "exposure_ev", 0, "smooth"), (1, "exposure_ev", 2, "hold"), (0.5, "camera.orbit_deg", 30, "linear")]
    return ("".join(key.format(*row) for row in rows).encode(),)


def _in_config(read: Callable[[], object]) -> Callable[[Path], object]:
    """`read` with the folder of the file as the config folder."""

    def run(path: Path) -> object:
        before = os.environ.get("SPECTRASPLAT_CONFIG")
        os.environ["SPECTRASPLAT_CONFIG"] = str(path.parent)
        try:
            return read()
        finally:
            if before is None:
                del os.environ["SPECTRASPLAT_CONFIG"]
            else:
                os.environ["SPECTRASPLAT_CONFIG"] = before

    return run


def _settings() -> object:
    from spectrasplat.edit.preferences import load_settings, save_settings

    settings, _ = load_settings()
    settings.existing_recent()
    save_settings(settings.opened(Path("/tmp/a.toml")))
    return settings


def _settings_texts() -> tuple[bytes, ...]:
    import msgspec
    from spectrasplat.edit.preferences import Settings

    settings = Settings().opened(Path("/tmp/a.toml")).opened(Path("/tmp/b.glb"))
    return (msgspec.json.encode(settings, enc_hook=os.fspath),)


def _recoveries() -> object:
    from spectrasplat.edit.autosave import recoveries
    from spectrasplat.edit.preferences import config_dir

    return recoveries(config_dir().parent)


def _notes() -> tuple[bytes, ...]:
    return (b'{"pid":12,"title":"a","original":"/tmp/a.toml","saved_at":1.5e9}',)


def _frames(path: Path) -> object:
    from spectrasplat.base.movie import Frames

    frames = Frames(path.parent, {"fps": 24.0, "frames": 3})
    return frames.base_ev, frames.has(0)


def _manifests() -> tuple[bytes, ...]:
    return (json.dumps({"fps": 24.0, "frames": 3, "base_ev": 0.5}, indent=1).encode(),)


SHAPES = {"sums": (3, 4), "noise": ()}


def _kept(path: Path) -> object:
    from spectrasplat.reference.rounds import load_kept

    return load_kept(path, SHAPES)


@cache
def _caches() -> tuple[bytes, ...]:
    values = {name: np.full(shape, 1.5) for name, shape in SHAPES.items()}
    plain, packed = io.BytesIO(), io.BytesIO()
    np.savez(plain, **values)  # type: ignore[arg-type]
    np.savez_compressed(packed, **values)  # type: ignore[arg-type]
    return plain.getvalue(), packed.getvalue()


READERS = {
    "scene": Reader("scene.toml", _scene, _scene_texts),
    "lens": Reader("lens.csv", _lens, _lens_tables),
    "zemax": Reader("lens.zmx", _lens, _zemax),
    "gltf": Reader("scene.gltf", _scene, lambda: (_gltf().content(".gltf"),)),
    "glb": Reader("scene.glb", _scene, lambda: (_gltf().content(".glb"),)),
    "obj": Reader("mesh.obj", _mesh, _objs),
    "obj-parts": Reader("mesh.obj", _scene, _objs),
    "mtl": Reader("own.mtl", _materials, _material_texts),
    "ply": Reader("mesh.ply", _mesh, _plys),
    "stl": Reader("mesh.stl", _mesh, _stls),
    "design": Reader("stone.asc", _scene, _designs),
    "png": Reader("picture.png", _picture, _pngs),
    "jpeg": Reader("picture.jpg", _picture, _jpegs),
    "hdr": Reader("picture.hdr", _picture, _hdrs),
    "exr": Reader("picture.exr", _picture, _exrs),
    "npy": Reader("picture.npy", _picture, _npys),
    "own-png": Reader("picture.png", _own_picture, _pngs),
    "heights-npy": Reader("heights.npy", _heights, _height_arrays),
    "heights-csv": Reader("heights.csv", _heights, _height_tables),
    "spectrum": Reader("spectrum.csv", _spectrum, _spectra),
    "spdx": Reader("spectrum.spdx", _spectrum, _spdx),
    "index-csv": Reader("index.csv", _index, _index_tables),
    "index-yml": Reader("index.yml", _index, _index_pages),
    "agf": Reader("glass.agf", _index, _agfs),
    "ldt": Reader("lamp.ldt", _ies, _ldts),
    "ies": Reader("lamp.ies", _ies, _lamps),
    "keys": Reader("keys.toml", _keys, _key_texts),
    "settings": Reader("settings.json", _in_config(_settings), _settings_texts, ()),
    "autosave": Reader("autosave/12_a.json", _in_config(_recoveries), _notes, ()),
    "frames": Reader("animation.json", _frames, _manifests),
    "cache": Reader("cache.npz", _kept, _caches, ()),
}
"""By name."""
