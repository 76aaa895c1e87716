"""Bad inputs of a newcomer, from scene files to outputs, with what is said of each."""

from __future__ import annotations

import json
import struct
from typing import NamedTuple

import numpy as np

VIEW = '[camera]\nposition = [0, -5, 2]\n[[lights]]\nkind = "point"\nposition = [0, 0, 4]\n'
FLOOR = '[[objects]]\nshape = "plane"\nmaterial = "diffuse"\nposition = [0, 0, -1.5]\n'
BALL = '[[objects]]\nname = "ball"\nshape = "sphere"\n'
GLASS = '[[objects]]\nname = "ball"\nshape = "sphere"\nmaterial = {{ {} }}\n'
MESH = '[[objects]]\nmesh = "{}"\nposition = [0, 0, 1]\n'
PLAIN = VIEW + BALL + FLOOR

CORNERS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
FACES = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"


def glass(index: str) -> str:
    return VIEW + GLASS.format(index) + FLOOR


def light(keys: str) -> str:
    return VIEW + keys + "\n" + BALL + FLOOR


def ply(body: str = CORNERS + FACES, vertices: int = 4, faces: int = 4, normals: bool = False) -> bytes:
    columns = "x y z nx ny nz" if normals else "x y z"
    header = f"ply\nformat ascii 1.0\nelement vertex {vertices}\n"
    header += "".join(f"property float {column}\n" for column in columns.split())
    header += f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    return (header + body).encode()


def binary_ply(promised_faces: int, faces: int) -> bytes:
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 4\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += f"element face {promised_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [[int(number) for number in row.split()] for row in FACES.splitlines()]
    body = np.eye(4, 3, -1, dtype="<f4").tobytes()
    return header.encode() + body + b"".join(struct.pack("<B3i", *row) for row in rows[:faces])


def glb(claimed_bytes: int = 0, claimed_chunk: int = 0, cut: int = 0, index: int = 2, version: int = 2) -> bytes:
    """A GLB of one triangle whose headers may lie."""
    binary = np.eye(3, dtype="<f4").tobytes() + np.array([0, 1, index, 0], "<u2").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", claimed_chunk or len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    whole = struct.pack("<4sII", b"glTF", version, claimed_bytes or 12 + len(chunks)) + chunks
    return whole[: len(whole) - cut]


class Case(NamedTuple):
    """One bad input and what its sentence must name."""

    scene: str | bytes | None
    told: tuple[str, ...]
    options: tuple[str, ...] = ()
    files: dict[str, bytes] = {}
    name: str = "scene.toml"
    output: str = "out.png"


def said(*told: str) -> tuple[str, ...]:
    return told


def mesh_case(data: bytes | None, *told: str, name: str = "m.ply") -> Case:
    return Case(VIEW + MESH.format(name) + FLOOR, told, files={} if data is None else {name: data})


def option_case(options: str, *told: str) -> Case:
    return Case(PLAIN, told, tuple(options.split(" ")))


def file_case(name: str, data: str | bytes | None, *told: str) -> Case:
    return Case(data, (name, *told), name=name)


SCENE_FILES = {
    "missing file": file_case("scene.toml", None, "does not exist", "check the path"),
    "folder": file_case(".", None, "is a folder", "give a scene file"),
    "unknown kind": file_case("scene.blend", b"BLENDER", ".toml"),
    "not UTF-8": file_case("scene.toml", b'name = "\xff"\n', "byte 8", "save it as UTF-8"),
    "UTF-16": file_case("scene.toml", PLAIN.encode("utf-16"), "save it as UTF-8"),
    "TOML syntax": file_case("scene.toml", "name = 'x'\nunits = = 1\n", "is not valid TOML", "line 2"),
    "nested too deeply": file_case("scene.toml", "a = " + "[" * 5000, "nested too deeply"),
    "empty": file_case("scene.toml", "", "objects is missing", "add at least one [[objects]]"),
    "no object": file_case("scene.toml", VIEW, "objects is missing", "add at least one [[objects]]"),
    "no light": file_case("scene.toml", "lights = []\n" + BALL + FLOOR, "no light", "[[lights]]"),
    "no receiver": file_case("scene.toml", VIEW + BALL, "nothing receives the light", "diffuse"),
    "wrong table": file_case("scene.toml", 'objects = { shape = "box" }', "[[objects]]"),
}
KEYS = {
    "unknown key": Case(VIEW + BALL + "raduis = 1\n" + FLOOR, said("scene.toml", "objects[0].raduis", "'radius'")),
    "unknown key far from all": Case(
        VIEW + BALL + "qqq = 1\n" + FLOOR, said("objects[0].qqq", "knows", "rotation_deg")
    ),
    "unknown choice": Case(PLAIN.replace('"point"', '"pont"'), said("lights[0].kind", "'point'")),
    "wrong type": Case(VIEW + BALL + 'radius = "1"\n' + FLOOR, said("objects[0].radius", "must be a number")),
    "NaN": Case(VIEW + BALL + "radius = nan\n" + FLOOR, said("objects[0].radius", "finite")),
    "NaN in a vector": Case(PLAIN.replace("[0, -5, 2]", "[0, nan, 2]"), said("camera.position[1]", "finite")),
    "infinite": Case(VIEW + BALL + "scale = inf\n" + FLOOR, said("objects[0].scale", "finite")),
    "negative size": Case(VIEW + BALL + "radius = -1\n" + FLOOR, said("objects[0]", "radius", "greater than 0")),
    "no size": Case(VIEW + BALL + "scale = [1, 0, 1]\n" + FLOOR, said("objects[0].scale", "flatten")),
    "too large for float32": Case(
        VIEW + BALL + "radius = 1e200\n" + FLOOR, said("objects[0].radius", "1e+30", "units")
    ),
    "too different": Case(VIEW + BALL + "radius = 1e-30\n" + FLOOR, said("'ball'", "'plane'", "check the units")),
    "camera looks nowhere": Case(
        PLAIN.replace("2]", "2]\ntarget = [0, -5, 2]", 1), said("camera.target", "no direction")
    ),
    "field of view": Case(
        PLAIN.replace("2]", "2]\nvertical_fov_deg = 180", 1), said("camera.vertical_fov_deg", "below 180")
    ),
    "negative background": Case("background = [-1, 0, 0]\n" + PLAIN, said("background", "0 or more")),
    "bright colour": Case(
        VIEW + BALL + FLOOR.replace('"diffuse"', '{kind = "diffuse", colour = 2}'), said("objects[1].material.colour")
    ),
    "zero-size picture": Case("render = {size = [0, 9]}\n" + PLAIN, said("render.size", "1 to 16384")),
    "too many photons": Case("render = {photons = 1e30}\n" + PLAIN, said("render.photons", "1e+12")),
}
GLASSES = {
    "unknown glass": Case(
        VIEW + BALL + 'glass = "N-BK8"\n' + FLOOR, said("scene.toml", "objects[0].glass", "'Schott N-BK7'")
    ),
    "unknown glass far from all": Case(
        VIEW + BALL + 'glass = "qqqqqq"\n' + FLOOR, said("objects[0].glass", "spectrasplat glass")
    ),
    "n = 0": Case(glass("n_d = 0"), said("objects[0].material.n_d", "positive")),
    "n < 0": Case(glass("n_d = -1.5, V_d = 50"), said("objects[0].material.n_d", "positive")),
    "n NaN": Case(glass("n_d = nan"), said("objects[0].material.n_d", "finite")),
    "Sellmeier NaN": Case(glass("sellmeier = {B = [1, nan], C = [0.1, 0.1]}"), said("sellmeier.B[1]", "finite")),
    "Sellmeier pole": Case(glass("sellmeier = {B = [1], C = [0.3]}"), said("sellmeier", "547.7 nm", "check B and C")),
    "Sellmeier lengths": Case(glass("sellmeier = {B = [1, 1], C = [0.1]}"), said("sellmeier", "2 B and 1 C")),
    "Cauchy below 0": Case(glass("cauchy = [-1.5]"), said("objects[0].material.cauchy", "positive")),
    "Cauchy NaN": Case(glass("cauchy = [1.5, nan]"), said("objects[0].material.cauchy[1]", "finite")),
    "table of n out of order": Case(glass("table = [[500, 1.5], [400, 1.6]]"), said("table", "sort the rows")),
    "table of n below 0": Case(glass("table = [[400, 1.5], [500, -1.6]]"), said("table", "-1.6 at 500 nm")),
    "csv missing": Case(glass('csv = "n.csv"'), said("objects[0].material.csv", "n.csv", "not a file")),
    "csv with words": Case(
        glass('csv = "n.csv"'), said("n.csv", "two or more rows"), files={"n.csv": b"nm,n\nfive,1\n"}
    ),
    "line outside the glass": Case(
        VIEW + "spectrum = {laser = 700}\n" + GLASS.format("table = [[500, 1.5], [600, 1.4]]") + FLOOR,
        said("700 nm", "'ball'", "500 to 600 nm", "choose another"),
    ),
    "amplifying glass": Case(
        glass("n_d = 1.5, absorption = {nm = [400, 700], coefficient = [-1, 0]}"), said("absorption", "negative")
    ),
    "opaque glass": Case(
        glass("n_d = 1.5, absorption = {colour = 0.5, distance = 1e-300}"), said("absorption.distance", "black")
    ),
}
LIGHTS = {
    "inside glass": Case(
        PLAIN.replace("[0, 0, 4]", "[0, 0, 0.1]"), said("'point 1'", "inside the glass of 'ball'", "move")
    ),
    "infrared": Case(light("spectrum = {laser = 1064}"), said("lights[0].spectrum.laser", "380 to 780 nm")),
    "unknown illuminant": Case(light('spectrum = "D66"'), said("lights[0].spectrum", "'D65'")),
    "NaN power": Case(light("intensity_cd = nan"), said("lights[0].intensity_cd", "finite")),
    "negative power": Case(light("flux_w = -1"), said("lights[0].flux_w", "at least 0")),
    "power of another kind": Case(light("illuminance_lx = 3"), said("lights[0].illuminance_lx", "intensity_cd")),
    "zero spectrum": Case(
        light('spectrum = {csv = "s.csv"}\nflux_lm = 1'),
        said("s.csv", "zero from 380 to 780 nm"),
        files={"s.csv": b"400,0\n700,0\n"},
    ),
}
MESHES = {
    "missing": mesh_case(None, "scene.toml", "objects[0].mesh", "m.ply", "not a file"),
    "no bytes": mesh_case(b"", "m.ply", "the file is empty", "export"),
    "no triangles": mesh_case(ply(CORNERS, faces=0), "m.ply", "no faces"),
    "nothing at all": mesh_case(ply("", 0, 0), "m.ply", "no faces"),
    "only degenerate": mesh_case(ply(CORNERS + "3 0 0 1\n", faces=1), "m.ply", "every triangle is degenerate"),
    "ply not one": mesh_case(b"hello", "m.ply", "not a PLY file", "suffix"),
    "ply header cut": mesh_case(ply()[:40], "m.ply", "end_header"),
    "ply text cut": mesh_case(ply()[:-8], "m.ply", "promises 4 of 'face'", "ends after 3"),
    "ply binary cut": mesh_case(binary_ply(4, 2), "m.ply", "promises 4 of 'face'", "ends after 2"),
    "ply promises too much": mesh_case(ply(vertices=10**9), "m.ply", "promises 1000000000 of 'vertex'"),
    "ply promises petabytes": mesh_case(binary_ply(10**15, 4), "m.ply", "promises 1000000000000000 of 'face'"),
    "ply promises too little": mesh_case(ply(faces=2), "m.ply", "follow what the PLY header promises"),
    "ply negative": mesh_case(ply(vertices=-4), "m.ply", "line 3"),
    "ply index": mesh_case(ply(CORNERS + "3 0 1 9\n", faces=1), "m.ply", "face 0 names vertex 9", "4 vertices"),
    "ply NaN": mesh_case(ply((CORNERS + FACES).replace("1 0 0", "nan 0 0", 1)), "m.ply", "vertex 1 is not finite"),
    "ply huge": mesh_case(ply((CORNERS + FACES).replace("1 0 0", "1e200 0 0", 1)), "m.ply", "vertex 1"),
    "obj": mesh_case(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "m.obj", "line 4", "vertex 0", name="m.obj"),
    "stl": mesh_case(bytes(80) + struct.pack("<I", 10**9) + bytes(50), "m.stl", "1000000000 triangles", name="m.stl"),
    "glb as a mesh": mesh_case(glb(), "objects[0].mesh", "open a .glb", name="m.glb"),
    "bare ply cut": file_case("m.ply", ply()[:-8], "promises 4 of 'face'"),
    "glb empty": file_case("m.glb", b"", "not a GLB file"),
    "glb not one": file_case("m.glb", b"XXXX" + glb()[4:], "not a GLB file"),
    "glb cut": file_case("m.glb", glb(cut=20), "truncated"),
    "glb header only": file_case("m.glb", glb()[:10], "10 bytes"),
    "glb lies about its size": file_case("m.glb", glb(claimed_bytes=2**31), "promises 2147483648 bytes"),
    "glb lies about a chunk": file_case("m.glb", glb(claimed_chunk=2**31), "promises 2147483648 bytes"),
    "glb of another version": file_case("m.glb", glb(version=7), "version 7", "glTF 2.0"),
    "glb index": file_case("m.glb", glb(index=9), "vertex 9", "3 vertices"),
    "gltf JSON": file_case("m.gltf", '{"asset":', "JSON"),
    "gltf without triangles": file_case("m.gltf", '{"asset": {"version": "2.0"}}', "no triangles"),
}
OPTIONS = {
    "no width": option_case("--size 0x5", "--size 0x5", "at least 1"),
    "negative height": option_case("--size 5x-5", "--size 5x-5", "at least 1"),
    "no size": option_case("--size 960", "--size '960'", "960x540"),
    "too wide": option_case("--size 99999x9", "--size 99999x9", "16384"),
    "picture beyond memory": option_case("--size 16384x16384 --bins 32", "--size", "GiB", "smaller"),
    "no photons": option_case("--photons 0", "--photons 0", "at least 1"),
    "photons NaN": option_case("--photons nan", "--photons 'nan'", "whole number"),
    "photons beyond memory": option_case("--photons 1e30", "--photons 1e30", "at most"),
    "batch beyond memory": option_case("--batch 1e12", "--batch 1e12", "memory", "at most"),
    "no time": option_case("--seconds 0", "--seconds 0", "more than 0"),
    "photons and time": option_case("--seconds 3 --photons 3", "--photons", "--seconds", "not both"),
    "seed": option_case("--seed -1", "--seed -1", "4294967295"),
    "exposure": option_case("--exposure nan", "--exposure 'nan'", "-1.5"),
    "few bins": option_case("--bins 3", "--bins 3", "4 and 32"),
    "no depth": option_case("--max-depth 0", "--max-depth 0", "1 and 4096"),
    "method": option_case("--method srx", "--method 'srx'", "'srd'", "regular-16"),
    "layer": option_case("--layer caustics", "--layer 'caustics'", "'caustic'"),
    "receiver": option_case("--layer map:flor", "'map:flor'", "'scene'", "'map:plane'"),
    "unknown option": option_case("--sead 3", "--sead", "--seed", "--help"),
}
OUTPUTS = {
    "suffix": Case(PLAIN, said("x.gif", "'.gif'", ".png, .jpg, .jpeg, .webp, .exr, .npy"), output="x.gif"),
    "no suffix": Case(PLAIN, said("write x:", "no suffix", ".png, .jpg, .jpeg, .webp, .exr, .npy"), output="x"),
    "no folder": Case(PLAIN, said("gone/x.png", "does not exist", "create it"), output="gone/x.png"),
    "file as folder": Case(PLAIN, said("out.png/x.png", "not a folder"), output="out.png/x.png"),
    "folder": Case(PLAIN, said("made.png", "is a folder"), output="made.png"),
    "read-only place": Case(PLAIN, said("/proc/x.png", "no permission"), output="/proc/x.png"),
    "long name": Case(PLAIN, said("too long", "shorter"), output="x" * 300 + ".png"),
    "pipe": Case(PLAIN, said("pipe.png", "ordinary file"), output="pipe.png"),
    "scene itself": Case(ply(), said("bare.ply", ".png"), name="bare.ply", output="bare.ply"),
}
CASES = {
    f"{group}: {name}": case
    for group, cases in {
        "scene file": SCENE_FILES,
        "key": KEYS,
        "glass": GLASSES,
        "light": LIGHTS,
        "mesh": MESHES,
        "option": OPTIONS,
        "output": OUTPUTS,
    }.items()
    for name, case in cases.items()
}
