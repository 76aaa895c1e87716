"""Direct light under the cursor, found beside the interface: the float64 reference compiles when it is first asked."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError

if TYPE_CHECKING:
    from ..model.scene import Scene
    from ..reference.direct_light import DirectLight


class DirectLightQuery:
    """One question at a time; the last answer stays until the next one's."""

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._future: Future[np.ndarray | None] | None = None
        self._asked: tuple[object, ...] = ()
        self._scene: Scene | None = None
        self._made: DirectLight | None = None

    def gains(self, scene: Scene, place: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
        """Irradiance per unit of each light's quantity, (L,); None while it is not known, or cannot be."""
        key = (id(scene), *map(float, place), *map(float, normal))
        if key != self._asked and (self._future is None or self._future.done()):
            self._pool = self._pool or ThreadPoolExecutor(1, thread_name_prefix="direct light")
            self._asked, self._future = key, self._pool.submit(self._find, scene, np.array(place), np.array(normal))
        if key != self._asked or self._future is None or not self._future.done():
            return None
        return self._future.result()

    @property
    def is_hopeless(self) -> bool:
        """The last question has no answer."""
        return self._future is not None and self._future.done() and self._future.result() is None

    def _find(self, scene: Scene, place: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
        from ..reference.direct_light import DirectLight

        try:
            if scene is not self._scene or self._made is None:
                self._made, self._scene = DirectLight.of(scene), scene
        except UserError:
            return None
        return self._made.gains(place, normal)

    def release(self) -> None:
        """End the thread."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._future = None
