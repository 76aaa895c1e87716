"""Every reader of files, with sound files to damage: small ones, for most damage is where a file says what it holds."""

from __future__ import annotations

import base64
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

from tests.unit.picture_bytes import hdr_file, new_rows, old_rows, random_rgbe

TETRAHEDRON = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], "<f4")
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], "<u2")


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


def _gltf() -> tuple[dict[str, object], bytes]:
    uv = np.array([(0, 0), (1, 0), (0, 1), (1, 1)], "<f4")
    parts = [TETRAHEDRON.tobytes(), FACES.tobytes(), uv.tobytes(), _png()]
    starts = [sum(len(p) + -len(p) % 4 for p in parts[:i]) for i in range(len(parts))]
    data = b"".join(p + b"\0" * (-len(p) % 4) for p in parts)
    views = [{"buffer": 0, "byteOffset": s, "byteLength": len(p)} for s, p in zip(starts, parts, strict=True)]
    volume = {"attenuationColor": [0.9, 0.5, 0.5], "attenuationDistance": 0.5, "thicknessFactor": 1}
    glass = {
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": volume,
            "KHR_materials_ior": {"ior": 1.6},
            "KHR_materials_dispersion": {"dispersion": 0.3},
        }
    }
    worn = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}, "name": "worn"}
    touches = [{"position": [0, 0, 0], "radius": 0.5, "log2_gain": 1.0}]
    dabs = [{"primitive": 0, "dabs": touches}]
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
        ],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33071}],
        "textures": [{"source": 0, "sampler": 0}],
        "materials": [glass, worn],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": m}]}
            for m in range(2)
        ],
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}},
        ],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_transmission"],
        "extensions": {
            "KHR_lights_punctual": {
                "lights": [
                    {"type": "spot", "intensity": 9, "color": [1, 0.9, 0.8], "spot": {"outerConeAngle": 0.5}},
                    {
                        "type": "point",
                        "extras": {"spectrasplat": {"light": {"kind": "area", "size": [0.2, 0.1], "spectrum": "D65"}}},
                    },
                ]
            }
        },
        "extras": {"spectrasplat": {"scene": {"background": [0, 0, 1], "render": {"size": [64, 36]}}}},
        "nodes": [
            {"mesh": 0, "name": "glass", "translation": [0, 1, 0], "children": [1], "extras": {}},
            {
                "mesh": 1,
                "extras": {"spectrasplat": {"local_dispersion": dabs}},
                "name": "worn",
                "scale": [2, 2, 2],
                "rotation": [0, 0, 0, 1],
            },
            {"camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}, "camera": 1},
        ],
        "scenes": [{"nodes": [0, 2, 3, 4]}],
        "scene": 0,
    }, data


def _gltf_texts() -> tuple[bytes, ...]:
    document, data = _gltf()
    document["buffers"] = [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}]
    return (json.dumps(document).encode(),)


def _glbs() -> tuple[bytes, ...]:
    document, data = _gltf()
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)

    def number(value: int) -> bytes:
        return value.to_bytes(4, "little")

    chunks = number(len(text)) + b"JSON" + text + number(len(data)) + b"BIN\0" + data
    return (b"glTF" + number(2) + number(12 + len(chunks)) + chunks,)


def _mesh(path: Path) -> object:
    from spectrasplat.model.scene_objects import load_checked_mesh

    return load_checked_mesh(path, None, [])


def _objs() -> tuple[bytes, ...]:
    corners = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in TETRAHEDRON)
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
    body = "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in TETRAHEDRON)
    body += "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    binary = [TETRAHEDRON.tobytes() + b"".join(b"\3" + face.astype("<i4").tobytes() for face in FACES)]
    binary += [TETRAHEDRON.astype(">f4").tobytes() + b"".join(b"\3" + face.astype(">i4").tobytes() for face in FACES)]
    more = head.replace(names, names + "property uchar red\nproperty float s\nproperty float t\n")
    mixed = body.replace("3 0 3 2\n", "4 0 3 2 1\n")
    rows = [(*p, i, i / 4, 0.5) for i, p in enumerate(TETRAHEDRON.tolist())]
    coloured = "".join(" ".join(f"{v:g}" for v in row) + "\n" for row in rows) + body[body.index("3 0") :]
    return (
        f"ply\nformat ascii 1.0\ncomment a\n{head}{body}".encode(),
        f"ply\nformat ascii 1.0\n{head}{mixed}".encode(),
        f"ply\nformat ascii 1.0\n{more}{coloured}".encode(),
        f"ply\nformat binary_little_endian 1.0\n{head}".encode() + binary[0],
        f"ply\nformat binary_big_endian 1.0\n{head}".encode() + binary[1],
    )


def _stls() -> tuple[bytes, ...]:
    corners = TETRAHEDRON[FACES]
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
    header = b"#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\nPRIMARIES=0.64 0.33 0.3 0.6\n"
    return (flat, hdr_file(new_rows(rgbe), 16, 4), hdr_file(old_rows(rgbe), 16, 4, header))


@cache
def _exrs() -> tuple[bytes, ...]:
    import tempfile

    from spectrasplat.base.image_io import write_image

    rgb = _levels().astype(np.float32) / 255
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        write_image(path, rgb)
        plain = path.read_bytes()
        write_image(path, rgb, spectral=rgb, bin_edges_nm=np.array([400.0, 500, 600, 700]), metadata={"a": "b"})
        return plain, path.read_bytes()


def _npys() -> tuple[bytes, ...]:
    return tuple(_stored(_levels().astype(kind)) for kind in (np.float32, np.float64, np.uint8))


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
    from spectrasplat.model.optics.spectrum import from_csv

    return from_csv(path)


def _spectra() -> tuple[bytes, ...]:
    rows = [(380 + 20 * i, 0.1 * i) for i in range(20)]
    return (
        ("wavelength_nm, power\n" + "".join(f"{w}, {p:g}\n" for w, p in rows)).encode(),
        "".join(f"{w};{p:g} # a\n" for w, p in rows).encode(),
    )


def _ies(path: Path) -> object:
    from spectrasplat.model.lights.ies_file import read_ies

    return read_ies(path)


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
    from spectrasplat.reference.kept import load_kept

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
    "gltf": Reader("scene.gltf", _scene, _gltf_texts),
    "glb": Reader("scene.glb", _scene, _glbs),
    "obj": Reader("mesh.obj", _mesh, _objs),
    "obj-parts": Reader("mesh.obj", _scene, _objs),
    "mtl": Reader("own.mtl", _materials, _material_texts),
    "ply": Reader("mesh.ply", _mesh, _plys),
    "stl": Reader("mesh.stl", _mesh, _stls),
    "png": Reader("picture.png", _picture, _pngs),
    "jpeg": Reader("picture.jpg", _picture, _jpegs),
    "hdr": Reader("picture.hdr", _picture, _hdrs),
    "exr": Reader("picture.exr", _picture, _exrs),
    "npy": Reader("picture.npy", _picture, _npys),
    "own-png": Reader("picture.png", _own_picture, _pngs),
    "heights-npy": Reader("heights.npy", _heights, _height_arrays),
    "heights-csv": Reader("heights.csv", _heights, _height_tables),
    "spectrum": Reader("spectrum.csv", _spectrum, _spectra),
    "ies": Reader("lamp.ies", _ies, _lamps),
    "keys": Reader("keys.toml", _keys, _key_texts),
    "settings": Reader("settings.json", _in_config(_settings), _settings_texts, ()),
    "autosave": Reader("autosave/12_a.json", _in_config(_recoveries), _notes, ()),
    "frames": Reader("animation.json", _frames, _manifests),
    "cache": Reader("cache.npz", _kept, _caches, ()),
}
"""By name."""
