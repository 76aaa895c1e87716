"""Float64 references of the light-at-a-surface functions, written from the papers and not from the shaders.

Arrays of 3-vectors have shape (..., 3), scalars (...); everything broadcasts. As in the
shaders `normal` faces the incoming ray (direction · normal < 0) and eta_it = n_incident /
n_transmitted.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def dot(a: Array, b: Array) -> Array:
    """Scalar product over the last axis."""
    return np.sum(np.asarray(a, np.float64) * b, axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Vector product over the last axis (numpy's own takes ten times as long for single vectors)."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    (ax, ay, az), (bx, by, bz) = ((v[..., 0], v[..., 1], v[..., 2]) for v in (a, b))
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = ay * bz - az * by
    product[..., 1] = az * bx - ax * bz
    product[..., 2] = ax * by - ay * bx
    return product


def times(factor: Array, vector: Array) -> Array:
    """A scalar (...) times a vector (..., 3)."""
    return np.asarray(factor)[..., None] * vector


def unit(vector: Array) -> Array:
    """The vector divided by its length."""
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def transmitted_cosine2(direction: Array, normal: Array, eta_it: Array) -> Array:
    """Squared cosine of the transmitted angle by Snell's law, from the sine itself; <= 0: total reflection."""
    sine_i = np.linalg.norm(cross(direction, normal), axis=-1)
    sine_t = eta_it * sine_i
    return (1.0 - sine_t) * (1.0 + sine_t)


def refract(direction: Array, normal: Array, eta_it: Array) -> Array:
    """Refracted direction, built from Snell's law: the tangential part scales by eta_it."""
    tangential = eta_it_times_tangential(direction, normal, eta_it)
    cosine = np.sqrt(transmitted_cosine2(direction, normal, eta_it))
    return tangential - times(cosine, normal)


def eta_it_times_tangential(direction: Array, normal: Array, eta_it: Array) -> Array:
    """eta_it times the part of the direction along the surface (n × (d × n))."""
    return times(eta_it, cross(normal, cross(direction, normal)))


def reflect(direction: Array, normal: Array) -> Array:
    """Mirrored direction."""
    return direction - times(2.0 * dot(direction, normal), normal)


def transfer_column(dposition: Array, ddirection: Array, direction: Array, normal_g: Array, distance: Array) -> Array:
    """∂(hit point): Igehy 1999, eq. 10 and 12, with the derivative of the distance written out."""
    ddistance = -dot(dposition + times(distance, ddirection), normal_g) / dot(direction, normal_g)
    return dposition + times(distance, ddirection) + times(ddistance, direction)


def reflect_column(direction: Array, ddirection: Array, normal: Array, dnormal: Array) -> Array:
    """∂(mirrored direction): the product rule on d - 2 (d·n) n."""
    theta = dot(direction, normal)
    dtheta = dot(ddirection, normal) + dot(direction, dnormal)
    return ddirection - times(2.0 * dtheta, normal) - times(2.0 * theta, dnormal)


def refract_column_stable(
    direction: Array, ddirection: Array, normal: Array, dnormal: Array, eta_it: Array, deta_it: Array
) -> Array:
    """∂(refracted direction): Igehy 1999, eq. 18–19, with the ∂eta terms of Elek et al. 2014, arranged so that nothing
    cancels at eta_it near 1: with omega² = (1-eta)(1+eta) + eta²theta², mu is (1-eta)(1+eta) / (omega - eta theta)
    instead of the difference eta theta + omega."""
    eta = np.asarray(eta_it, np.float64)
    theta = dot(direction, normal)
    sine2 = (1.0 - theta) * (1.0 + theta)
    omega = np.sqrt((1.0 - eta) * (1.0 + eta) + (eta * theta) ** 2)
    mu = (1.0 - eta) * (1.0 + eta) / (omega - eta * theta)
    dtheta = dot(ddirection, normal) + dot(direction, dnormal)
    spectral = times(omega, direction - times(theta, normal)) + times(eta * sine2, normal)
    return (
        times(np.asarray(deta_it) / omega, spectral)
        + times(eta, ddirection)
        - times(eta * mu / omega * dtheta, normal)
        - times(mu, dnormal)
    )


def normalised_derivative(vector: Array, dvector: Array) -> Array:
    """∂(v/|v|)."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    direction = vector / length
    return (dvector - times(dot(direction, dvector), direction)) / length
