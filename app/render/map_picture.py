"""A receiver's caustic map as a picture: what `--layer map:RECEIVER` shows and what a bake writes."""

from __future__ import annotations

import numpy as np

from ..model.geometry.charts import ChartAtlas
from ..model.optics.colorimetry import xyz_to_rgb709
from ..passes.picture_channels import Channels
from .light_pass import LightPass


def map_picture(light: LightPass) -> tuple[np.ndarray, np.ndarray | None]:
    """Irradiance (or reflected light, where the reflectance is spectral) on the receiver of the settings' layer, row 0
    on top: linear Rec.709 float32 (H, W, 3), lm/unit² for white, and W/unit² a bin (H, W, bins), or None."""
    assert light.map_receiver is not None
    tile, areas = light.layout.tiles[light.map_receiver][0], texel_areas(light, light.map_receiver)
    edges_nm = light.bin_edges_nm
    is_xyz = edges_nm is None
    bins = np.empty((tile.height, tile.width, 3 if is_xyz else 4 * light.features.targets), np.float32)
    for target in range(1 if is_xyz else light.features.targets):
        for first, rows in light.maps.portions(tile, target):
            covers = areas if len(areas) == 1 else areas[first : first + len(rows)]
            texels = rows.astype(float) * light.maps.scale / covers
            # Row 0 of the map is the picture's last.
            above = slice(tile.height - first - len(rows), tile.height - first)
            if is_xyz:
                bins[above] = xyz_to_rgb709(texels[::-1, :, :3])
            else:
                bins[above, :, 4 * target : 4 * target + 4] = texels[::-1]
    if edges_nm is None:
        return bins, None
    channels = Channels(tuple(edges_nm.tolist()))
    return channels.to_rgb709(bins), channels.to_spectral(bins)


def texel_areas(light: LightPass, receiver: int) -> np.ndarray:
    """What the texels of a receiver's finest map cover, unit²: (1, 1, 1), or (height, width, 1) where charts differ
    from triangle to triangle; row 0 at texel y = 0."""
    charts = light.layout.charts.get(receiver)
    if charts is None:
        return light.layout.placements["texel_area"][light.layout.receivers[receiver]["placement"]].reshape(1, 1, 1)
    # Gutters hold what is across their seam, measured in texels of their own chart's edge.
    return charts.texel_area[np.maximum(_nearest_owner(charts), 0)][..., None]


def _nearest_owner(charts: ChartAtlas) -> np.ndarray:
    """Triangle of each texel; in gutters that of the place across the seam, else -1 (nothing landed there)."""
    owner = charts.owner.copy()
    x, y = charts.gutter_texel_xy.T
    to_x, to_y = charts.destination_xy.T
    kept = to_x >= 0
    owner[y[kept], x[kept]] = charts.owner[to_y[kept], to_x[kept]]
    return owner
