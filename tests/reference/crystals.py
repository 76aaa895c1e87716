"""Interfaces of crystals in float64, by Berreman's matrix: waves are its eigenvectors, and amplitudes follow from the
fields that are continuous [Berreman 1972]. No formula of shaders/lib/crystal.glsl."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


def permittivity(axis: Array, n_o: float, n_e: float) -> Array:
    """(3, 3) of a uniaxial crystal; of an isotropic one with s and p just told apart."""
    n_e = n_e if n_e != n_o else n_o * (1.0 + 1e-7)
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return n_o**2 * np.eye(3) + (n_e**2 - n_o**2) * np.outer(axis, axis)


@dataclass(frozen=True)
class Waves:
    """Four waves of one tangential wave vector (q, 0): two that go forwards, then two backwards; ordinary first."""

    forward: Array
    """Complex (4,): forward parts of their wave vectors."""
    fields: Array
    """Complex (4, 4), a column each: E along x, E along y, H along x, H along y; of unit power where they pass."""
    passes: Array

    def poynting(self, number: int, q: float, epsilon: Array) -> Array:
        """Unit vector (3,) along which its energy flows."""
        k = np.array([q, 0.0, self.forward[number]])
        e = _electric(self.fields[:, number], q, epsilon)
        s = np.cross(e, np.cross(k, e).conj()).real
        return s / np.linalg.norm(s)


def _electric(fields: Array, q: float, epsilon: Array) -> Array:
    """E with its third part: k × H = -ε E along z gives q H_y = -ε_zx E_x - ε_zy E_y - ε_zz E_z."""
    e_x, e_y, _, h_y = fields
    e_z = -(q * h_y + epsilon[2, 0] * e_x + epsilon[2, 1] * e_y) / epsilon[2, 2]
    return np.array([e_x, e_y, e_z])


def waves(epsilon: Array, q: float, n_o: float) -> Waves:
    """The waves of a medium, z forwards."""
    e, zz = epsilon, epsilon[2, 2]
    # ξ E_x = H_y + q E_z, ξ E_y = -H_x, ξ H_y = ε_x· E, ξ H_x = q H_z - ε_y· E with H_z = q E_y.
    matrix = np.zeros((4, 4))
    z_of = -np.array([e[2, 0], e[2, 1], 0.0, q]) / zz  # E_z of (E_x, E_y, H_x, H_y)
    matrix[0] = q * z_of + np.array([0.0, 0.0, 0.0, 1.0])
    matrix[1, 2] = -1.0
    matrix[2] = -(np.array([e[1, 0], e[1, 1], 0.0, 0.0]) + e[1, 2] * z_of) + np.array([0.0, q**2, 0.0, 0.0])
    matrix[3] = np.array([e[0, 0], e[0, 1], 0.0, 0.0]) + e[0, 2] * z_of
    forward, fields = np.linalg.eig(matrix)
    power = (fields[0] * fields[3].conj() - fields[1] * fields[2].conj()).real
    passes = np.abs(forward.imag) < 1e-9 * np.abs(forward)
    ahead = np.where(passes, power > 0.0, forward.imag > 0.0)
    ordinary = np.sqrt(complex(n_o**2 - q**2))
    order = []
    for side, of_side in ((1.0, np.flatnonzero(ahead)), (-1.0, np.flatnonzero(~ahead))):
        first = of_side[np.argmin(np.abs(forward[of_side] - side * ordinary))]
        order += [first, *[i for i in of_side if i != first]]
    fields, forward, passes = fields[:, order], forward[order], passes[order]
    power = (fields[0] * fields[3].conj() - fields[1] * fields[2].conj()).real
    fields = fields / np.sqrt(np.where(passes, np.abs(power), 1.0))
    return Waves(forward, fields, passes)


def plane_polarised(n: float, q: float, side: float = 1.0) -> Array:
    """Fields (4, 2) of unit power of s = k × normal and of p = k × s in an isotropic medium, with the normal against z;
    `side`: 1 forwards, -1 backwards."""
    ahead = side * np.sqrt(n**2 - q**2)
    return np.array([[0.0, -ahead / n], [1.0, 0.0], [-ahead, 0.0], [0.0, -n]]) / np.sqrt(abs(ahead))


def amplitudes(before: Waves, behind: Waves, incident: Array) -> Array:
    """Complex (4, c): of reflected and transmitted waves, squared powers, for incident fields (4, c)."""
    solved = np.linalg.solve(np.hstack([before.fields[:, 2:], -behind.fields[:, :2]]), -incident)
    return solved * np.concatenate([before.passes[2:], behind.passes[:2]])[:, None]


def refracted(media: list[Array], extraordinary: tuple[bool, bool], ray: Array, ahead: Array) -> Array:
    """The ray (3,) that a ray becomes behind an interface of two permittivities, `ahead` its normal."""
    first, second = (np.linalg.eigvalsh(epsilon) for epsilon in media)
    n_o = [float(np.sqrt(v[1])) for v in (first, second)]  # twice among three eigenvalues
    wave = n_o[0] * ray
    if extraordinary[0]:
        wave = np.linalg.solve(media[0], ray)
        wave *= np.sqrt(np.linalg.det(media[0])) / n_o[0] / np.sqrt(ray @ wave)
    along = wave - (wave @ ahead) * ahead
    q = float(np.linalg.norm(along))
    frame = np.stack([along / q, np.cross(ahead, along / q), ahead])
    epsilon = frame @ media[1] @ frame.T
    return frame.T @ waves(epsilon, q, n_o[1]).poynting(int(extraordinary[1]), q, epsilon)
