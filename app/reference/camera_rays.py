"""The camera's geometry, compiled: from the picture to a ray, and from a point to the picture."""

from __future__ import annotations

import math

from .compiling import compiled, inlined


@inlined
def camera_ray(camera, column, row):
    """(origin (3), unit direction (3)) through the picture's point, pixels from its upper left corner."""
    x = camera.half_width * (2.0 * column / camera.width - 1.0)
    y = camera.half_height * (1.0 - 2.0 * row / camera.height)
    ax = x * camera.right[0] + y * camera.up[0]
    ay = x * camera.right[1] + y * camera.up[1]
    az = x * camera.right[2] + y * camera.up[2]
    ox, oy, oz = camera.position[0], camera.position[1], camera.position[2]
    dx, dy, dz = camera.forward[0], camera.forward[1], camera.forward[2]
    if camera.orthographic:
        return ox + ax, oy + ay, oz + az, dx, dy, dz
    dx, dy, dz = dx + ax, dy + ay, dz + az
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return ox, oy, oz, dx / length, dy / length, dz / length


@inlined
def lens_ray(camera, column, row, a, b):
    """`camera_ray` from the place on the thin lens that two numbers in [0, 1) draw: both meet in the plane of focus."""
    ox, oy, oz, dx, dy, dz = camera_ray(camera, column, row)
    if camera.lens_radius <= 0.0:
        return ox, oy, oz, dx, dy, dz
    radius, angle = camera.lens_radius * math.sqrt(a), 2.0 * math.pi * b
    x, y = radius * math.cos(angle), radius * math.sin(angle)
    sx = x * camera.right[0] + y * camera.up[0]
    sy = x * camera.right[1] + y * camera.up[1]
    sz = x * camera.right[2] + y * camera.up[2]
    depth = dx * camera.forward[0] + dy * camera.forward[1] + dz * camera.forward[2]
    reach = camera.focus_distance / depth
    dx, dy, dz = reach * dx - sx, reach * dy - sy, reach * dz - sz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return ox + sx, oy + sy, oz + sz, dx / length, dy / length, dz / length


@compiled
def project(camera, px, py, pz):
    """(row, column, film area per area across the way to the camera, toward the camera (3), its distance); row −1: not
    seen.

    The factor is 1/(d² cos³) for a pinhole and 1 for an orthographic camera; on a film at distance one.
    """
    rx, ry, rz = px - camera.position[0], py - camera.position[1], pz - camera.position[2]
    depth = rx * camera.forward[0] + ry * camera.forward[1] + rz * camera.forward[2]
    if depth <= 0.0:
        return -1, -1, 0.0, 0.0, 0.0, 0.0, 0.0
    x = rx * camera.right[0] + ry * camera.right[1] + rz * camera.right[2]
    y = rx * camera.up[0] + ry * camera.up[1] + rz * camera.up[2]
    if camera.orthographic:
        factor, distance = 1.0, depth
        tx, ty, tz = -camera.forward[0], -camera.forward[1], -camera.forward[2]
    else:
        x, y = x / depth, y / depth
        distance = math.sqrt(rx * rx + ry * ry + rz * rz)
        cosine = depth / distance
        factor = 1.0 / (distance * distance * cosine * cosine * cosine)
        tx, ty, tz = -rx / distance, -ry / distance, -rz / distance
    column = math.floor(0.5 * (1.0 + x / camera.half_width) * camera.width)
    row = math.floor(0.5 * (1.0 - y / camera.half_height) * camera.height)
    if column < 0 or column >= camera.width or row < 0 or row >= camera.height:
        return -1, -1, 0.0, 0.0, 0.0, 0.0, 0.0
    return int(row), int(column), factor, tx, ty, tz, distance
