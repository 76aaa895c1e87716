"""Fresnel's reflectance and the column of a refracted ray as textbooks have them, in float64: derived
otherwise than `spectrasplat.reference.optics`, so that each checks the other."""

from __future__ import annotations

import numpy as np
from spectrasplat.reference.optics import Array, dot, times, transmitted_cosine2


def fresnel_reflectance(direction: Array, normal: Array, eta_it: Array) -> Array:
    """Unpolarised reflectance by Fresnel's tangent and sine laws' cosine form; 1 at total reflection."""
    n_i, n_t = np.asarray(eta_it, np.float64), 1.0
    cosine_i = -dot(direction, normal)
    cosine2_t = transmitted_cosine2(direction, normal, eta_it)
    cosine_t = np.sqrt(np.maximum(cosine2_t, 0.0))
    senkrecht = (n_i * cosine_i - n_t * cosine_t) / (n_i * cosine_i + n_t * cosine_t)
    parallel = (n_t * cosine_i - n_i * cosine_t) / (n_t * cosine_i + n_i * cosine_t)
    return np.where(cosine2_t > 0.0, 0.5 * (senkrecht**2 + parallel**2), 1.0)


def refract_column_textbook(
    direction: Array, ddirection: Array, normal: Array, dnormal: Array, eta_it: Array, deta_it: Array
) -> Array:
    """∂(refracted direction): Igehy 1999, eq. 18–19, with the ∂eta terms of Elek et al. 2014."""
    eta = np.asarray(eta_it, np.float64)
    deta = np.asarray(deta_it, np.float64)
    theta = dot(direction, normal)
    omega = np.sqrt(1.0 - eta**2 * (1.0 - theta**2))
    mu = eta * theta + omega
    dtheta = dot(ddirection, normal) + dot(direction, dnormal)
    # omega² = 1 - eta² (1 - theta²), differentiated.
    domega = (eta**2 * theta * dtheta - eta * deta * (1.0 - theta**2)) / omega
    dmu = deta * theta + eta * dtheta + domega
    return times(deta, direction) + times(eta, ddirection) - times(dmu, normal) - times(mu, dnormal)
