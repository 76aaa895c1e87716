"""Bad inputs of a newcomer, from scene files to outputs, with what is said of each.

Every reader has its own table of refusals; here is one of each kind, all the way through the program."""

from __future__ import annotations

import io
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


def npy(values: np.ndarray) -> bytes:
    np.save(stream := io.BytesIO(), values)
    return stream.getvalue()


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
    "NaN in a vector": Case(PLAIN.replace("[0, -5, 2]", "[0, nan, 2]"), said("camera.position[1]", "finite")),
    "infinite": Case(VIEW + BALL + "scale = inf\n" + FLOOR, said("objects[0].scale", "finite")),
    "too large for float32": Case(
        VIEW + BALL + "radius = 1e200\n" + FLOOR, said("objects[0].radius", "1e+30", "units")
    ),
    "too different": Case(VIEW + BALL + "radius = 1e-30\n" + FLOOR, said("'ball'", "'plane'", "check the units")),
    "negative background": Case("background = [-1, 0, 0]\n" + PLAIN, said("background", "0 or more")),
    "bright colour": Case(
        VIEW + BALL + FLOOR.replace('"diffuse"', '{kind = "diffuse", colour = 2}'), said("objects[1].material.colour")
    ),
    "too many photons": Case("render = {photons = 1e30}\n" + PLAIN, said("render.photons", "1e+12")),
}
GLASSES = {
    "unknown glass far from all": Case(
        VIEW + BALL + 'glass = "qqqqqq"\n' + FLOOR, said("objects[0].glass", "spectrasplat glass")
    ),
    "Sellmeier lengths": Case(glass("sellmeier = {B = [1, 1], C = [0.1]}"), said("sellmeier", "2 B and 1 C")),
    "Cauchy below 0": Case(glass("cauchy = [-1.5]"), said("objects[0].material.cauchy", "positive")),
    "csv missing": Case(glass('csv = "n.csv"'), said("objects[0].material.csv", "n.csv", "not a file")),
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
    "only degenerate": mesh_case(ply(CORNERS + "3 0 0 1\n", faces=1), "m.ply", "every triangle is degenerate"),
    "glb as a mesh": mesh_case(b"glTF", "objects[0].mesh", "open a .glb", name="m.glb"),
    "bare ply cut": file_case("m.ply", ply()[:-8], "promises 4 of 'face'"),
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
    "size of three": option_case("--size 4x4x4", "is not WIDTHxHEIGHT"),
    "a seed of twenty digits": option_case("--seed 99999999999999999999", "out of range", "between 0 and 4294967295"),
    "half a photon": option_case("--photons 1.5", "--photons '1.5' is not a whole number"),
    "photons infinite": option_case("--photons inf", "beyond what memory can hold"),
    "photons beyond counting": option_case("--photons 2e12", "beyond what can be counted"),
    "time NaN": option_case("--seconds nan", "--seconds 'nan' is not a number"),
    "time infinite": option_case("--seconds inf", "--seconds inf is out of range"),
    "method far from all": option_case("--method zzz", "known are srd, srd-photons, progressive, srd-lambda"),
    "layer nearly": option_case("--layer beuty", "did you mean 'beauty'"),
    "many bins": option_case("--bins 33", "between 4 and 32"),
    "bins in words": option_case("--bins four", "--bins 'four' is not a whole number"),
    "exposure infinite": option_case("--exposure inf", "--exposure inf is out of range"),
    "no samples": option_case("--spp 0", "--spp 0 is out of range"),
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
    "picture that it shows": Case(
        PLAIN + '[environment]\nkind = "map"\nfile = "sky.npy"\n',
        said("write sky.npy", "a file that this is made of", "another name"),
        files={"sky.npy": npy(np.full((2, 4, 3), 0.5, np.float32))},
        output="sky.npy",
    ),
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
