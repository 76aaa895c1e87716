"""What cannot run is not in the text that the driver gets; stripped texts on disk; changes of files are noticed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from spectrasplat.base import paths
from spectrasplat.gpu import dead_code, stripped_store
from spectrasplat.gpu.dead_code import stripped
from spectrasplat.gpu.glsl_conditionals import Line
from spectrasplat.gpu.schema import Field, Struct
from spectrasplat.gpu.shader import ShaderError, load_source

NO_SWITCHES: frozenset[str] = frozenset()


def stripped_source(text: str) -> list[str]:
    return [
        line.text.strip() for line in stripped([Line(line, "t", i + 1) for i, line in enumerate(text.splitlines())])
    ]


def chosen(condition: str, defines: str = "") -> bool:
    """Whether the branch of `condition` is taken; fails when it is not resolved."""
    kept = stripped_source(f"{defines}\n#if {condition}\n#pragma yes\n#else\n#pragma no\n#endif")
    assert kept in (["#pragma yes"], ["#pragma no"])
    return kept == ["#pragma yes"]


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


@pytest.mark.parametrize(
    ("statement", "reference"),
    [
        ("if (ON) { f(); }", "f();"),
        ("if (OFF) { f(); } else { g(); }", "g();"),
        ("if (OFF) f(); else g();", "g();"),
        ("if (OFF) f(); g();", "g();"),
        ("if (a) { f(); } else if (OFF) { g(); }", "if (a) { f(); }"),
        ("if (a) { f(); } else if (ON) { g(); } else { h(); }", "if (a) { f(); } else { g(); }"),
        ("if (OFF) { f(); } else if (a) { g(); } else { h(); }", "if (a) { g(); } else { h(); }"),
        ("for (;;) if (OFF) f();", "for (;;) ;"),
        ("if (ON && a) f();", "if (a) f();"),
        ("if (a || OFF) f();", "if (a) f();"),
        ("if (a && (OFF || b)) f();", "if (a && b) f();"),
        ("if (a && (b || c && ON)) f();", "if (a && (b || c)) f();"),
        ("if (!(OFF || a)) f();", "if (!a) f();"),
        ("if (!OFF) { if (OFF) f(); g(); }", "g();"),
        ("if (COUNT > 1 && !(COUNT == 3)) f();", "f();"),
        ("if (f() || ON) g();", "if (f() || true) g();"),  # f may do something
        ("if (i < COUNT) f();", "if (i < COUNT) f();"),
        ("x = ON ? a : b;", "x = a;"),
        ("x = OFF ? a : b ? c : d;", "x = b ? c : d;"),
        ("x = 2 * (ON && OFF ? a : b);", "x = 2 * (b);"),
        ("f(a, OFF || b); x = ON && b; return OFF;", "f(a, b); x = b; return false;"),
        ("if (ON) { int x = 1; f(x); }", "int x = 1; f(x);"),
        ("if (ON) { int x = 1; f(x); } int x = 2;", "{ int x = 1; f(x); } int x = 2;"),
        ("int x[1 + OFF];", "int x[1 + OFF];"),
        ("x = float(COUNT) * a;", "x = float(COUNT) * a;"),
    ],
)
def test_constants_decide(statement: str, reference: str) -> None:
    text = f"#define ON 1\n#define COUNT 2\nvoid main()\n{{\n{statement}\n}}"
    lines = [Line(line, "t", 1) for line in text.splitlines()]
    kept = [line.text for line in stripped(lines, frozenset({"ON", "OFF", "COUNT"}))]
    assert " ".join(" ".join(kept[kept.index("{") + 1 : -1]).split()) == reference
    assert ("#define OFF 0" in kept) == ("OFF" in reference)


def test_a_switch_that_is_off_is_zero_to_conditionals_too() -> None:
    lines = [Line(line, "t", 1) for line in ("#if OFF || !ON", "#pragma a", "#else", "#pragma b", "#endif")]
    assert [line.text for line in stripped(lines, frozenset({"ON", "OFF"}))] == ["#pragma a"]


def test_chains_nest_and_the_first_true_branch_wins() -> None:
    text = """
#define A
#ifndef A
  #if nonsense
  #endif
  #pragma a
#elif defined(B)
  #pragma b
#elif defined(A)
  #ifdef B
    #pragma c
  #else
    #pragma d
    #undef A
  #endif
#else
  #pragma e
#endif
#ifdef A
  #pragma f
#endif"""
    assert stripped_source(text) == ["#define A", "#pragma d", "#undef A"]


def test_comments_go_and_hide_directives() -> None:
    text = "uniform int a; // b\n/* #ifdef X\n#endif */ uniform int c; /* d */ uniform int e;\nvoid main() { a + e; }"
    assert [line.split() for line in stripped_source(text)] == [
        ["uniform", "int", "a;"],
        ["uniform", "int", "c;", "uniform", "int", "e;"],
        ["void", "main()", "{", "a", "+", "e;", "}"],
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


INTERFACE = """
#define PICKED(x) (ON ? x.seen : x.missed)
#define COUNT 3
struct Stored { uint a; uint padding; };
struct Listed { uint a; uint b; };
struct Held {
    float seen;
    float missed, chosen;  // by nobody
    vec3 turned[2], unread;
    Forgotten forgotten;
};
struct Forgotten { float x; };
layout(std430, binding = BIND_KEPT) buffer Kept { Stored stored[]; };
layout(std140, binding = 1) uniform Unused {
    float first;
    vec4 second[COUNT];
};
layout(std140, binding = 2) uniform Named { Stored first; } named;
layout(rgba32f, binding = 3) uniform readonly restrict image2D read, never_read;
layout(binding = 4) uniform sampler2D picture;
layout(local_size_x = 8) in;
flat in vec4 edges[2 * COUNT];
shared float sums[COUNT], others;
float counter = 0.0;
uint flag = 1u;
const uint chosen = ON ? 5u : wrong(6u);
float distance_to(vec3 place);
"""


def test_globals_bindings_and_members_stay_where_their_names_are_used() -> None:
    main = "void main() { Held h; f(PICKED(h), h.turned, stored[0].a, read, sums, flag, Listed(1u, 2u), chosen); }"
    text = [Line(line, "t", 1) for line in (INTERFACE + main).splitlines()]
    kept = "\n".join(line.text for line in stripped([Line("#define ON 1", "<features>", 1), *text], frozenset({"ON"})))
    for present in (
        "uint padding",
        "uint b",
        "float seen",
        "turned[2], unread",
        "Kept",
        "image2D read",
        "local_size_x",
        "sums[COUNT]",
        "flag",
        "chosen = 5u",
        "distance_to",
        "PICKED(x) (x.seen)",
    ):
        assert present in kept, present
    for absent in ("missed", "forgotten", "Forgotten", "Unused", "second", "Named", "picture", "edges", "counter"):
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
        "wrong = used();",
        "}",
    ]
    assert source.explain("0:4(5): error") == "main.comp:6 (5): error"
    assert source.explain("0(2) : error") == "lib.glsl:4  : error"
    with pytest.raises(ShaderError, match="nowhere.glsl included by main.comp:1"):
        (tmp_path / "main.comp").write_text('#include "nowhere.glsl"\n')
        load_source("main.comp", {}, (), tmp_path)


TEXTS = (
    "#define USED 1",
    "float unused() { return 2.0; } // never",
    "#ifdef USED",
    "void main() { int é = 1; }",
    "#endif",
)


def lines(shift: int = 0) -> list[Line]:
    return [Line(text, "ab"[n % 2], n + shift) for n, text in enumerate(TEXTS)]


@pytest.fixture
def stripping(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[int]:
    """A folder of its own; how many lines were stripped, each time that happened."""
    monkeypatch.setattr(paths, "cache_dir", lambda: tmp_path)
    counts: list[int] = []
    real = dead_code.stripped

    def counted(given: Sequence[Line], switches: frozenset[str]) -> list[Line]:
        counts.append(len(given))
        return real(given, switches)

    monkeypatch.setattr(dead_code, "stripped", counted)
    return counts


def test_the_second_time_is_read(stripping: list[int]) -> None:
    first, second = stripped_store.stripped(lines(), NO_SWITCHES), stripped_store.stripped(lines(), NO_SWITCHES)
    assert first == second == [line for line in first if "main" in line.text]
    assert len(stripping) == 1


def test_other_places_of_the_same_text_are_another_text(stripping: list[int]) -> None:
    assert stripped_store.stripped(lines(), NO_SWITCHES) != stripped_store.stripped(lines(7), NO_SWITCHES)
    assert len(stripping) == 2


def test_other_code_strips_anew(stripping: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    stripped_store.stripped(lines(), NO_SWITCHES)
    monkeypatch.setattr(stripped_store, "_version", lambda: b"newer")
    stripped_store.stripped(lines(), NO_SWITCHES)
    assert len(stripping) == 2


def test_sources_are_the_same_from_the_disk(stripping: list[int]) -> None:
    defines = {"COLUMNS": 0, "TARGETS": 1}
    assert load_source("camera/average.comp", defines) == load_source("camera/average.comp", defines)
    assert len(stripping) == 1
