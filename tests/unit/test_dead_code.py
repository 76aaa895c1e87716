"""What cannot run is not in the text that the driver gets; what can run is, in its order and with its line numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from spectrasplat.gpu.dead_code import stripped
from spectrasplat.gpu.glsl_conditionals import Line
from spectrasplat.gpu.schema import Field, Struct
from spectrasplat.gpu.shader import ShaderError, load_source


def stripped_source(text: str) -> list[str]:
    return [
        line.text.strip() for line in stripped([Line(line, "t", i + 1) for i, line in enumerate(text.splitlines())])
    ]


def chosen(condition: str, defines: str = "") -> bool:
    """Whether the branch of `condition` is taken; fails when it is not resolved."""
    kept = stripped_source(f"{defines}\n#if {condition}\nuniform int yes;\n#else\nuniform int no;\n#endif")
    assert kept in (["uniform int yes;"], ["uniform int no;"])
    return kept == ["uniform int yes;"]


@pytest.mark.parametrize(
    ("condition", "reference"),
    [
        ("GROUPS > 0", True),
        ("GROUPS == 2 && !defined(TREE)", True),
        ("GROUPS - 2", False),
        ("defined TREE || defined(GROUPS)", True),
        ("1 + 2 * 3 == 7", True),
        ("(1 + 2) * 3 == 7", False),
        ("0x10 >> 2 == 4u", True),
        ("-GROUPS < -1", True),
        ("7 / 2 == 3 && 7 % 2", True),
        ("TWICE == 4", True),
        ("!(GROUPS >= 3) // really", True),
        ("1 << 3 <= 7", False),
    ],
)
def test_conditions(condition: str, reference: bool) -> None:
    assert chosen(condition, "#define GROUPS 2\n#define TWICE (2 * GROUPS)") is reference


@pytest.mark.parametrize(
    "condition",
    ["UNSEEN > 0", "__VERSION__ >= 430", "defined(GL_ARB_gpu_shader5)", "LOOP == 1", "1 / 0", "1 +", "2 $ 3"],
)
def test_what_only_the_driver_can_tell_stays_whole(condition: str) -> None:
    text = (
        f"#define LOOP LOOP\n#if {condition}\n#define MAYBE 1\nvoid unused() {{}}\n#elif 1\n#endif\n#ifdef MAYBE\n"
        "int i;\n#endif"
    )
    assert stripped_source(text) == text.splitlines()


def test_chains_nest_and_the_first_true_branch_wins() -> None:
    text = """
#define A
#ifndef A
  #if nonsense
  #endif
  uniform int a;
#elif defined(B)
  uniform int b;
#elif defined(A)
  #ifdef B
    uniform int c;
  #else
    uniform int d;
    #undef A
  #endif
#else
  uniform int e;
#endif
#ifdef A
  uniform int f;
#endif"""
    assert stripped_source(text) == ["#define A", "uniform int d;", "#undef A"]


def test_comments_go_and_hide_directives() -> None:
    text = "uniform int a; // b\n/* #ifdef X\n#endif */ uniform int c; /* d */ uniform int e;\n"
    assert [line.split() for line in stripped_source(text)] == [
        ["uniform", "int", "a;"],
        ["uniform", "int", "c;", "uniform", "int", "e;"],
    ]


LIBRARY = """
#define PI 3.14
#define UNUSED_TOO PI
#define STEP(x) { \\
    total += helper(x); \\
}
const float table[2] = float[](
    1.0,
    PI);
const int forgotten = 3;
struct Ray { vec3 p; };
struct Photon
{
    Ray ray;
};
void pack(Ray ray) { pack_texel(ray.p); }
void pack(Photon photon) { pack_photon(photon); }
void pack_texel(vec3 p) {}
void pack_photon(Photon photon) {}
float helper(float x)
{
    if (x > 0.0) { return table[0]; }
    return x;
}
float helper(vec3 x) { return 0.0; }
float lonely(float x) { return loner(x); }
float loner(float x) { return lonely(x); }
layout(std430, binding = 0) buffer Out { Ray rays[]; };
"""


def test_only_what_main_and_the_interface_reach_is_left() -> None:
    kept = "\n".join(
        stripped_source(LIBRARY + "void main()\n{\n    float total = 0.0;\n    STEP(1.0)\n    pack(rays[0]);\n}\n")
    )
    macros, constants, structs = (
        ("define PI", "STEP(x)", "total += helper"),
        ("const float table", "1.0,"),
        ("struct Ray",),
    )
    functions = ("pack(Ray", "pack_texel(vec3", "float helper(float", "float helper(vec3", "buffer Out")
    for present in (*macros, *constants, *structs, *functions):
        assert present in kept, present
    for absent in ("UNUSED_TOO", "forgotten", "Photon", "lonely", "loner"):
        assert absent not in kept, absent


def test_messages_still_name_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "lib.glsl").write_text("// a library\nfloat unused() { return 0.0; }\n\nfloat used() { return 1.0; }\n")
    (tmp_path / "main.comp").write_text(
        '#include "lib.glsl"\n#ifdef MISSING\nint gone;\n#endif\nvoid main() {\n    wrong = used();\n}\n'
    )
    source = load_source("main.comp", {"SPARE": 1}, (Struct("Spare", (Field("a", "vec4"),)),), tmp_path)
    assert source.text.splitlines() == [
        "#version 430 core",
        "float used() { return 1.0; }",
        "void main() {",
        "    wrong = used();",
        "}",
    ]
    assert (
        source.explain("0:4(5): error") == "main.comp:6 (5): error"
        and source.explain("0(2) : error") == "lib.glsl:4  : error"
    )
    with pytest.raises(ShaderError, match="nowhere.glsl asked for by main.comp:1"):
        (tmp_path / "main.comp").write_text('#include "nowhere.glsl"\n')
        load_source("main.comp", {}, (), tmp_path)
