"""The camera pass of a live rendering: camera samples within a time budget, and the last picture worth showing.

A picture is published when every pixel has a whole sample. The first ones of a view show what is seen directly at
full resolution, and glass and mirrors as coarsely as the time that is left requires (`MovingPicture`); once still these
become finer in steps, until every pixel has its own path, and then samples are added up.

Where glass disperses, a sample of a fine picture sees one band of the spectrum only, and such a picture is whole after
as many samples as there are bands; before that it has grain in all colours. So samples of the whole spectrum, coarser
along it but smooth, come first, in motion alone; pictures of bands are shown after whole cycles only.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator
from functools import partial

import moderngl
import numpy as np

from ...gpu import shader
from ...gpu.context import Context
from ...gpu.map_channels import MapChannels
from ...gpu.scene_buffers import SceneBuffers
from ...gpu.texture_store import TextureStore
from ...model.scene import Camera, Scene
from ...passes.camera import MAX_TAPS, CameraPass
from ...passes.caustic_maps import CausticMaps
from ...passes.first_surfaces import FirstSurfaces
from ...passes.moving_picture import MovingPicture
from ...passes.spectrum_choice import Spectrum
from ..sampling import CameraSampling, whole_cycles
from .glass_steps import GlassSteps, blended
from .schedule import CameraState

SCALES = (1.0, 0.5, 1 / 3, 0.25)
"""Sides of a picture in motion over the side wanted: less than 1 only where what is seen directly takes a device
longer than DIRECT_S."""
DIRECT_S = 0.5
MOVED_S = 0.1
"""`DIRECT_S` while things are moved, whose light and tree take time as well."""
DISPATCH_SECONDS = 0.008
_SIDE = 8
"""Side of a work group of `camera/average.comp`."""
FIRST_S = 0.06
"""What glass may take in the first picture of a view that nothing moves in."""
SETTLED = 8
"""Samples at most that a better map waits for before its picture replaces the one shown."""
MOVING_TAPS = 8
"""Lookups along one spectral sweep at most, in a picture that must be there at once."""
SMOOTH_SHARE = 1 / 4
"""Samples of the whole spectrum that come before bands, over the number of these: edges are smooth while the bands are
awaited."""


class LiveCamera:
    """Owns the camera pass of the shown scene and the published picture."""

    def __init__(self, context: Context, target_samples: int = 32) -> None:
        self._context = context
        self.target_samples = target_samples
        self._pass: CameraPass | None = None
        self._pictures: TextureStore | None = None
        self._looks = 1
        """Lookups of a sample at what is seen directly."""
        self._surfaces: FirstSurfaces | None = None
        self._moving: MovingPicture | None = None
        self._geometry: object = None
        """What `_surfaces` are of."""
        self._ladder: list[int] = []
        """Blocks of glass that are still to be shown of this view, before samples are added up."""
        self._drawn: moderngl.Texture | None = None
        """Picture that what is seen directly was drawn into, for these maps; None before that."""
        self._spare: moderngl.Texture | None = None
        self._average = shader.compute(context.ctx, "camera/average.comp")
        self._steps: Iterator[float] | None = None
        self._choosing: Iterator[float] | None = None
        self._maps: CausticMaps | None = None
        self._camera: Camera | None = None
        self._size = (0, 0)
        self._moving_scale = 1.0
        self._is_first = True
        """What is seen directly was never drawn with these programs."""
        self._is_preview = False
        """The picture that runs is a preview of a movement."""
        self._is_smooth = False
        """Its samples are of the whole spectrum: the picture until there are bands."""
        self._bands: int | None = None
        """Stretches of the spectrum that this view of this scene needs; None until that is found out."""
        self._bands_view: object = None
        self._taken = 0
        self._publish_from = self._settled = 1
        """Samples from which on this picture replaces the one shown, and those that it has."""
        self._owes = False
        self._shows_other = False
        """What is shown is of another scene than the one that was taken last."""
        self._shows_whole = False
        """What is shown is no preview and no mere first sample."""
        self._direct_rate: float | None = None
        """Pixels per second, of what is seen directly in motion."""
        self._glass = GlassSteps()
        self.picture: moderngl.Texture | None = None
        """RGBA32F, linear Rec.709, top row first; None before the first sample."""
        self.shown_samples = 0
        self.shown_bands = 1
        """Stretches of the spectrum that the shown picture is made of."""
        self.fallbacks: dict[str, int] = {}
        """What `CameraPass.fallbacks` counted up to the shown picture."""
        self.version = 0
        """Counts what was published."""
        self.scale = 1.0
        """Side of the shown picture over the side wanted, where glass and mirrors are seen."""
        self.direct_scale = 1.0
        """Side of the shown picture over the side wanted, elsewhere."""

    def take_scene(
        self, buffers: SceneBuffers, scene: Scene, reflectances: list[np.ndarray | None], maps: MapChannels
    ) -> None:
        """Take the scene as it is shown: `buffers` hold its geometry, `scene` its colours, glass, lights and pictures;
        `maps` is what caustic maps hold.

        Raises `ShaderError`, and `UserError` where pictures do not fit the device; then everything stays as it was."""
        shown = copy.copy(buffers)
        shown.scene = scene
        kept, before = self._pictures, self._pass
        pictures = self._store_of(shown)
        if pictures is not kept or before is None or not before.take(shown, reflectances, maps):
            try:
                self._pass = CameraPass(self._context, shown, "beauty", reflectances, maps, pictures)
            except BaseException:
                if pictures is not kept:
                    pictures.release()
                elif before is not None:
                    kept.follow(before.scene.scene, before.scene.first_triangle, before.scene.corner_turn)
                raise
            self._pictures = pictures
            self._pass.dispatch_seconds = DISPATCH_SECONDS
            self._looks = self._pass.primary_samples
            self._take_moving(buffers)
            shader.release(before, kept if kept is not pictures else None)
        self._steps = self._choosing = self._bands = None
        self._ladder, self._drawn = [], None
        self._shows_other = True

    def move(self, buffers: SceneBuffers, scene: Scene) -> None:
        """Objects or lights have moved: `buffers` were moved in place, nothing else of `scene` differs."""
        assert self._pass is not None
        shown = copy.copy(buffers)
        shown.scene = scene
        self._pass.move(shown)
        self.pause()

    def _take_moving(self, buffers: SceneBuffers) -> None:
        assert self._pass is not None
        shader.release(self._moving)
        if self._geometry is not buffers.texels:
            shader.release(self._surfaces)
            self._surfaces, self._geometry = FirstSurfaces(self._context.ctx, buffers), buffers.texels
        assert self._surfaces is not None
        self._moving = MovingPicture(self._pass, self._surfaces)
        self._is_first = True

    def _store_of(self, shown: SceneBuffers) -> TextureStore:
        """The textures and the environment on the device: those that are there, unless others are shown."""
        place = shown.scene, shown.first_triangle, shown.corner_turn
        if self._pictures is not None and self._pictures.follow(*place):
            return self._pictures
        return TextureStore(self._context.ctx, *place)

    def restart(
        self,
        camera: Camera,
        width: int,
        height: int,
        maps: CausticMaps,
        *,
        seconds: float | None = None,
        same_view: bool = False,
        finer_maps: bool = False,
        direct_s: float = DIRECT_S,
    ) -> None:
        """Start over. `seconds`: be done with a first picture in about that time, however coarse glass is in it.
        `direct_s`: what is seen directly becomes coarser where it takes longer.

        `same_view`: only the maps are better: what is shown stays until the new picture is as smooth. `finer_maps`: so
        much better that more bands of the spectrum may be distinguished in them."""
        assert self._pass is not None
        keeps = same_view and self.scale == 1.0 and not self._shows_other
        is_drawn = self._drawn is not None and (camera, maps) == (self._camera, self._maps) and self.scale < 1.0
        is_drawn = is_drawn and seconds is None and self._drawn is not None and self._drawn.size == (width, height)
        self._camera, self._maps = camera, maps
        self._is_preview = seconds is not None
        scale = self._direct_scale(width, height, direct_s) if self._is_preview else 1.0
        self._size = (width, height) if scale == 1.0 else (_side(width * scale), _side(height * scale))
        self._moving_scale = scale
        view = camera, width, height
        if finer_maps or view != self._bands_view:
            self._bands = None
        self._bands_view = view
        self._owes = True
        smooth = not self._is_preview and self._needed_bands != 1 and not (keeps and self._shows_whole)
        self._settled = 1
        if keeps and not (smooth and self._needed_bands is None):
            self._settled = max(1, min(self.shown_samples, self._smooth_samples if smooth else SETTLED))
        self._begin(smooth=smooth)
        self._drawn = self._drawn if is_drawn else None
        if seconds is not None:
            self._ladder = [self._glass.within(seconds)]
        elif keeps:
            self._ladder = []
        elif is_drawn:
            self._ladder = self._glass.after(1.0 / self.scale)
        else:
            first = self._glass.within(FIRST_S)
            if same_view and not self._shows_other:
                first = min(first, round(1.0 / self.scale))
            self._ladder = [first, *self._glass.after(first)]

    def _direct_scale(self, width: int, height: int, seconds: float) -> float:
        most = float("inf") if self._direct_rate is None else self._direct_rate * seconds
        return next((s for s in SCALES if s * s * width * height <= most), SCALES[-1])

    @property
    def is_paused(self) -> bool:
        """It has no maps to look up."""
        return self._maps is None

    def pause(self) -> None:
        """Leave the maps alone, which are about to go; what is shown stays until `restart`."""
        self._maps = self._steps = self._choosing = self._drawn = None
        self._ladder = []

    @property
    def state(self) -> CameraState:
        """How far the picture is."""
        return CameraState(
            self._is_preview,
            self.owes_picture,
            self.is_within_cycle,
            self.is_done,
            is_full_size=not self._is_preview,
            is_whole=self.scale == 1.0,
            owes_first=self.owes_picture and self._shows_none,
        )

    @property
    def _shows_none(self) -> bool:
        """There is no picture of this scene yet."""
        return self.picture is None or self._shows_other

    @property
    def _sampling(self) -> CameraSampling:
        return CameraSampling.live(self.target_samples)

    @property
    def owes_picture(self) -> bool:
        """Nothing of what was requested last is shown yet."""
        return self._maps is not None and self._owes

    @property
    def is_within_cycle(self) -> bool:
        """Part of the bands of the first whole picture since `restart` are there, or glass is becoming finer: with
        other maps that would be lost."""
        if self._maps is not None and self._ladder and not (self._is_preview or self._owes):
            return True
        begun = self._maps is not None and not (self._is_preview or self._is_smooth) and self._cycle > 1
        return begun and self._taken < self._publish_from

    @property
    def is_becoming_whole(self) -> bool:
        """Glass of a view that nothing moves in is becoming finer, and will soon be as fine as it gets."""
        if self._maps is None or not self._ladder or self._is_preview:
            return False
        return self._glass.are_soon_done

    @property
    def is_done(self) -> bool:
        """Every sample is taken, in full size."""
        return self._maps is None or not (
            self._is_preview or self._ladder or self._is_smooth or self._choosing or self._taken < self._target
        )

    def advance(self, deadline: float, *, one_sample: bool = False) -> float:
        """Take samples until `deadline` (`time.perf_counter`), `one_sample` not beyond the next published one; returns
        the seconds it took."""
        started = now = time.perf_counter()
        published = False
        while (
            now < deadline
            and (self._ladder or self._choosing is not None or self._taken < self._target)
            and not (published and one_sample)
        ):
            published = self._step()
            now = time.perf_counter()
        return now - started

    # ---- bands of the spectrum ---------------------------------------------------------------

    @property
    def _needed_bands(self) -> int | None:
        """Bands of a fine picture; None while they are not known."""
        assert self._pass is not None
        return self._sampling.fixed_bands(self._pass) or self._bands

    @property
    def _cycle(self) -> int:
        """Samples after which the picture that runs is whole."""
        return 1 if self._is_preview or self._is_smooth else self._needed_bands or 1

    @property
    def _target(self) -> int:
        """Samples after which the picture that runs is finished."""
        if self._is_preview:
            return 0
        if self._is_smooth:
            return 1 if self._needed_bands is None else self._smooth_samples
        return whole_cycles(self.target_samples, self._cycle)

    @property
    def _smooth_samples(self) -> int:
        return max(1, int(SMOOTH_SHARE * (self._needed_bands or 1)))

    def _begin(self, *, smooth: bool) -> None:
        """Forget the samples; find the number of bands where it is needed first."""
        assert self._pass is not None and self._camera is not None and self._maps is not None
        self._is_smooth = smooth
        self._taken = 0
        self._steps = self._choosing = None
        self._publish_from = whole_cycles(self._settled, self._cycle)
        if not (smooth or self._is_preview) and self._needed_bands is None:
            self._pass.max_taps = MAX_TAPS
            self._choosing = self._sampling.choosing(self._pass, self._camera, *self._size, self._maps)

    # ---- samples -----------------------------------------------------------------------------

    def _step(self) -> bool:
        """One dispatch; whether it completed a picture that was published."""
        if self._ladder:
            return self._move()
        if self._choosing is not None:
            if next(self._choosing, None) is None:
                assert self._pass is not None
                self._bands = self._pass.spectrum.bands
                again = not self._shows_whole and self._smooth_samples > self.shown_samples
                self._settled = self.shown_samples + 1 if again else self._settled
                self._begin(smooth=again)
            return False
        if self._dispatch():
            return False
        self._steps = None
        self._taken += 1
        if self._taken < self._publish_from or self._taken % self._cycle:
            return False
        self._publish()
        if self._is_smooth and self._taken >= self._target:
            # The picture of bands replaces it in its own time.
            self._settled = 1
            self._begin(smooth=False)
        return True

    def _dispatch(self) -> bool:
        """A band of rows of one sample; False when the sample has them all."""
        assert self._pass is not None and self._camera is not None and self._maps is not None
        width, height = self._size
        if self._steps is None:
            self._pass.spectrum = Spectrum(self._cycle)
            self._pass.max_taps = MOVING_TAPS if self._is_smooth else MAX_TAPS
            # A first picture has rough outlines for a moment, and comes in half the time.
            self._pass.primary_samples = 1 if self._is_smooth and self._shows_none else self._looks
            self._steps = self._pass.samples(self._camera, width, height, 1, self._taken, self._maps)
        return next(self._steps, None) is not None

    # ---- pictures in motion ------------------------------------------------------------------

    def _move(self) -> bool:
        """One part of a picture in motion; whether it was published."""
        assert self._maps is not None and self._camera is not None and self._moving is not None
        assert self._pass is not None
        if self._drawn is None:
            self._drawn = self._spare_of(self._size)
            learn = None if self._is_first else partial(self._learn_direct, self._size[0] * self._size[1])
            with self._context.timers.timing("camera", learn):
                self._moving.direct(self._drawn, self._camera, self._maps, MOVING_TAPS)
            self._is_first = False  # drivers compile at the first use
            self._glass.pixels = self._specular
            if not self._glass.pixels:
                self._ladder = [1]
            return False
        step = self._ladder[0]
        if self._steps is None:
            self._steps, self._spent_s = self._moving.glass(self._drawn, self._maps, step), 0.0
        if self._context.traits.work_is_queued and self._is_preview:
            # Nobody waits to count the paths: each block has one at most.
            with self._context.timers.timing("camera", partial(self._glass.learn, self._glass.pixels / step**2)):
                for _ in self._steps:
                    pass
        else:
            started = time.perf_counter()
            goes_on = next(self._steps, None) is not None
            self._spent_s += time.perf_counter() - started
            if goes_on:
                return False
            if not self._context.traits.work_is_queued and (followed := self._pass.listed.count):
                self._glass.learn(followed, self._spent_s)
        self._steps = None
        self._ladder.pop(0)
        if self._pass.has_haze:
            # Glass is still to become finer in what was drawn.
            self._show(self._drawn, 1.0)
            assert self.picture is not None
            self._pass.add_haze(self.picture, self._camera, coarse=self._is_preview)
        elif self.picture is not self._drawn:
            self._spare, self.picture = self.picture, self._drawn
        self.shown_samples = self.shown_bands = 1
        self.scale, self.direct_scale = self._moving_scale / step, self._moving_scale
        self._shows_whole = self._shows_other = self._owes = False
        self.version += 1
        return True

    @property
    def _specular(self) -> int:
        """Pixels of the picture in motion that see glass or mirrors; at most, where asking would wait."""
        assert self._moving is not None
        if not self._moving.follows:
            return 0
        return self._size[0] * self._size[1] if self._context.traits.work_is_queued else self._moving.specular

    def _learn_direct(self, pixels: int, seconds: float) -> None:
        self._direct_rate = blended(self._direct_rate, pixels, seconds)

    def _spare_of(self, size: tuple[int, int]) -> moderngl.Texture:
        """A picture that is not shown."""
        if self._spare is None or self._spare.size != size:
            shader.release(self._spare)
            self._spare = self._context.ctx.texture(size, 4, dtype="f4")
        return self._spare

    # ---- what is shown -----------------------------------------------------------------------

    def _publish(self) -> None:
        assert self._pass is not None
        (sums,) = self._pass.sums
        self._show(sums, 1.0 / self._taken)
        self.shown_samples, self.shown_bands = self._taken, self._cycle
        self.scale = self.direct_scale = 1.0
        self._shows_whole, self._shows_other = not self._is_smooth, False
        self._owes = False
        self.fallbacks = self._pass.fallbacks
        self.version += 1

    def _show(self, radiance: moderngl.Texture, scale: float) -> None:
        """`scale` times this, copied, is the picture from now on."""
        if self.picture is None or self.picture.size != radiance.size:
            shader.release(self.picture)
            self.picture = self._context.ctx.texture(radiance.size, 4, dtype="f4")
        radiance.bind_to_image(0, read=True, write=False)
        self.picture.bind_to_image(1, read=False, write=True)
        self._average["scale"].value = scale
        self._average.run(-(-radiance.width // _SIDE), -(-radiance.height // _SIDE))
        self._context.ctx.memory_barrier()

    def release(self) -> None:
        """Free everything."""
        shader.release(self._average)
        if self._spare is self.picture:
            self._spare = None
        shader.release(self._moving, self._surfaces, self._pass, self._pictures, self.picture, self._spare)
        self._pass = self._pictures = self.picture = self._spare = self._moving = self._surfaces = None


def _side(pixels: float) -> int:
    """Whole pixels of a picture in motion. Mesa's software renderer compiles its programs once more for textures whose
    side is a power of two."""
    side = max(9, round(pixels))
    return side + 1 if side & (side - 1) == 0 else side
