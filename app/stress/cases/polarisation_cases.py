"""Polarised light over long ways: many surfaces whose planes of incidence turn, some of them near Brewster's angle.

The functions of shaders/lib/polarisation.glsl follow a ray in float32, electric fields in float64 the same one.
Bounds are running error bounds: with u = `EPSILON`, m the larger of an event's shares of s and p and w the share that
goes on, an error of the state grows by m / w at each event (what is left of it is made 1 again), and an event adds

    u (4 m / w + 2 / sin² θ)

its own roundings, and those of the plane of incidence, whose s is d × n over its length.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...gpu.context import Context
from ...reference import polarised
from ...reference.optics import unit
from ..case import Case, Measurement
from ..judging import EPSILON, judged, not_finite
from ..rigs import glsl_function
from ..rigs.glsl_function import as_f32

ROWS = 100
INDEX = 1.7
_CHAIN = 0
"""Binding of the chains."""
BODY = """
    Polarisation state = unpolarised(chain[row * EVENTS * 3u].xyz);
    float power = scale;
    for (uint k = 0u; k < EVENTS; ++k) {
        uint at = (row * EVENTS + k) * 3u;
        vec3 d = chain[at].xyz, n = chain[at + 1u].xyz, turned = chain[at + 2u].xyz;
        vec3 theta = vec3(chain[at].w), eta = vec3(chain[at + 1u].w);
        FresnelPair pair = fresnel_reflection(theta, eta, transmitted_cosine2(theta, eta));
        if (chain[at + 2u].w == 0.0) pair = fresnel_transmission(pair);
        vec3 axis = incidence_axis(d, n, state.axis), s[3] = vec3[](axis, axis, axis);
        Polarisation seen = in_plane(state, d, s);
        power *= polarised_share(seen, pair).y;
        state = out_of_plane(behind_interface(seen, pair), turned, s);
    }
    left = power;
    stokes = vec3(state.q.y, state.u.y, state.v.y);
    axis_left = state.axis;
"""


def chains(events: int, seed: int) -> np.ndarray:
    """(ROWS, events, 3, 4): direction and d·n, normal and eta, direction after and whether it is a reflection."""
    rng = np.random.default_rng(seed)
    found = np.zeros((ROWS, events, 3, 4))
    for row in range(ROWS):
        d = unit(rng.normal(size=3))
        for k in range(events):
            cosine = rng.uniform(0.08, 0.98)
            n = np.sqrt(1.0 - cosine**2) * unit(np.cross(d, rng.normal(size=3))) - cosine * d
            eta = rng.choice([1.0 / INDEX, INDEX])
            cosine2 = 1.0 - eta**2 * (1.0 - cosine**2)
            reflects = cosine2 <= 1e-3 or rng.random() < 0.3
            turned = d + 2.0 * cosine * n if reflects else eta * d + (eta * cosine - np.sqrt(cosine2)) * n
            found[row, k, 0], found[row, k, 1] = (*d, -cosine), (*n, eta)
            d = unit(turned)
            found[row, k, 2] = (*d, float(reflects))
    return as_f32(found)


def exact(chain: np.ndarray) -> tuple[float, np.ndarray, float, float]:
    """(share that is left, fields (2, 3), bounds of the state's error and of the share's, relative) of one chain
    (events, 3, 4)."""
    field = np.zeros((2, 3), complex)
    polarised.begin_unpolarised(field, *unit(chain[0, 0, :3]))
    left, of_state, of_share = 1.0, 0.0, 0.0
    for (*d, theta), (*n, eta), (*after, reflects) in chain:
        d, after = unit(np.array(d)), unit(np.array(after))
        r_s, r_p, t_s, t_p = polarised.amplitudes(-theta, eta)
        a_s, a_p = (complex(r_s), complex(r_p)) if reflects else (complex(t_s), complex(t_p))
        s = polarised.senkrecht(*d, *n)
        share = polarised.share_of(field, *d, *s, a_s, a_p)
        polarised.turn_fields(field, *d, *after, *s, a_s, a_p)
        left *= share
        sizes = abs(a_s) ** 2, abs(a_p) ** 2
        of_state += 2.0 * EPSILON / (1.0 - theta**2)
        of_share += (abs(sizes[0] - sizes[1]) * of_state + 4.0 * EPSILON * max(sizes)) / share
        of_state = (of_state + 4.0 * EPSILON) * max(sizes) / share
    return left, field, of_state, of_share


def measure_chain(context: Context) -> Iterator[Measurement]:
    for events in (1, 4, 16, 64):
        chain = chains(events, seed=events)
        known = [exact(one) for one in chain]
        scale = 1.0 / np.array([each[0] for each in known])
        got = glsl_function.evaluate(
            context.ctx,
            ["lib/optics.glsl", "lib/polarisation.glsl"],
            BODY,
            {"scale": scale},
            {"left": "float", "stokes": "vec3", "axis_left": "vec3"},
            {"EVENTS": f"{events}u"},
            buffers={_CHAIN: chain.astype(np.float32)},
            declarations=f"layout(std430, binding = {_CHAIN}) readonly buffer Chains {{ vec4 chain[]; }};",
        )
        ends = zip(known, chain, got["axis_left"], strict=True)
        stokes = np.array([_stokes(each[1], one[-1, 2, :3], axis) for each, one, axis in ends])
        of_state, of_share = (np.array([each[k] for each in known]) for k in (2, 3))
        # No state is off by more than all of it.
        rows = {
            "state": (np.abs(got["stokes"] - stokes).max(axis=1), np.minimum(of_state, 2.0)),
            "share": (np.abs(got["left"] - 1.0), of_share),
        }
        errors, bounds = judged(rows)
        yield Measurement(float(events), f"{events} surfaces", not_finite(got.values()), errors, bounds)


def _stokes(field: np.ndarray, direction: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """q, u, v of fields (2, 3) from an axis."""
    along, beside = field @ axis, field @ np.cross(direction, axis)
    product = 2.0 * np.sum(along * beside.conj())
    return np.array([np.sum(np.abs(along) ** 2 - np.abs(beside) ** 2), product.real, product.imag])


CASES = (
    Case(
        "polarised-chain",
        "Polarised light that meets many surfaces, whose planes of incidence turn at random",
        "A state is made 1 again after every event, so what rounding errs grows where little goes on: reflection near "
        "Brewster's angle of light that swings in the plane of incidence. Rotations into planes of incidence, total "
        "reflection's phases and the axis that states count from must not drift over many events.",
        "surfaces met",
        measure_chain,
        steps=4,
    ),
)
