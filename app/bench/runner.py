"""The bench, top to bottom: scene → reference → rigs → trials → every seed, every method, every budget → pictures.

All methods of a scene stay on the device at once. Within a seed they take turns, and who begins changes from seed
to seed, so that what disturbs the machine hits all alike. After every method and seed all is on disk.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..base.errors import UserError
from ..gpu.context import Context
from ..model.flat_faces import with_flat_faces
from ..model.panorama_lights import with_panorama_lights
from ..model.scene import Scene
from ..reference import metrics
from ..reference.metrics import ReferencePicture
from .curves import budget_at_time, complete_curve, speed_ups
from .measured_passes import MEASURED_PASSES
from .rendering import NothingToMeasure, Rendering, Rig
from .results import BenchSettings, Curve, Sample, SceneResult
from .store import Store
from .subjects import SUBJECTS, Progress, Subject
from .tuning import kernel_at, tune

POINTS = 10
"""Budgets a curve."""
DEFAULT_WIDTH = 480
_REFERENCE_SHARE = 0.15
"""Of a scene's progress bar."""


def run_bench(
    context: Context,
    scenes: dict[str, Scene],
    store: Store,
    progress: Progress,
    skipped: Callable[[str], None] | None = None,
    subject: Subject | None = None,
    start_seconds: float = 0.0,
) -> None:
    """Measure every scene by name that `store` does not hold yet; a KeyboardInterrupt loses one method's seed at most.
    `subject`: what is measured; None: the pass that the store's settings name. `start_seconds`: what a process takes
    before it begins with its scene.

    Raises `UserError` when a scene has changed since `store` was begun, and where there is nothing to measure, unless
    `skipped` takes the reason."""
    for index, (name, scene) in enumerate(scenes.items()):

        def share(fraction: float, text: str, done: int = index, name: str = name) -> None:
            progress((done + fraction) / len(scenes), f"{name}: {text}")

        try:
            one_pass = subject or SUBJECTS[store.result.settings.measured_pass]
            _SceneBench(context, name, scene, store, share, one_pass, start_seconds).run()
        except NothingToMeasure as reason:
            if skipped is None:
                raise
            skipped(str(reason))


def picture_size(scene: Scene, settings: BenchSettings) -> tuple[int, int]:
    """As the settings say, or `DEFAULT_WIDTH` in the scene's aspect."""
    if settings.size is not None:
        return settings.size
    return DEFAULT_WIDTH, max(1, round(DEFAULT_WIDTH * scene.render.height / scene.render.width))


class _SceneBench:
    """One scene's measurements."""

    def __init__(
        self,
        context: Context,
        name: str,
        scene: Scene,
        store: Store,
        progress: Progress,
        subject: Subject,
        start_seconds: float,
    ) -> None:
        self._context, self._store, self._progress, self._subject = context, store, progress, subject
        self._scene, self._start_seconds = with_flat_faces(with_panorama_lights(scene)), start_seconds
        self._settings = store.result.settings
        self._size = picture_size(scene, self._settings)
        key = subject.key(self._scene, *self._size)
        earlier = store.scene(name)
        if earlier is not None and earlier.reference is not None and earlier.reference.key != key:
            raise UserError(
                f"scene '{name}' has changed since {store.path} was made: give --fresh to begin anew, or another -o"
            )
        self._result = earlier or _empty_result(name, scene, self._size, self._settings)

    def run(self) -> None:
        """Do what is missing."""
        result, settings = self._result, self._settings
        if result.complete:
            return
        make = self._subject.rigs
        with make(
            self._context, self._scene, settings.methods, *self._size, lambda text: self._progress(0.0, text)
        ) as rigs:
            self._reference_image = self._reference()
            self._set_budgets(rigs)
            for number in range(settings.seeds):
                turn = number % len(rigs)
                methods = [*rigs][turn:] + [*rigs][:turn]
                for place, method in enumerate(methods):
                    done = (number * len(rigs) + place) / (settings.seeds * len(rigs))
                    self._measure_seed(rigs[method], self._curve(method), number + 1, done)
            for method, rig in rigs.items():
                self._progress(0.99, f"pictures of {method}")
                self._make_pictures(method, rig)
        result.complete = True
        self._store.save()
        self._store.drop_partial(result)

    def _reference(self) -> ReferencePicture:
        """The reference that this scene's samples are measured against: one and the same, also over interruptions."""
        result, store = self._result, self._store
        kept = store.load_reference(result.scene)
        if kept is not None and result.reference is not None and kept.xyz.shape[:2] == (self._size[1], self._size[0]):
            return kept
        reference_image, result.reference = self._subject.reference_image(
            self._scene,
            *self._size,
            self._settings.reference_seconds,
            lambda fraction, text: self._progress(_REFERENCE_SHARE * fraction, f"reference {text}"),
        )
        # What was measured against another reference cannot be gone on from.
        result.curves = []
        store.save_reference(result.scene, reference_image)
        result.pictures["reference"] = store.save_picture(result.scene, "reference", reference_image.xyz)
        store.put_scene(result)
        store.save()
        return reference_image

    def _set_budgets(self, rigs: Mapping[str, Rig]) -> None:
        """Budgets of the methods that have none yet."""
        for method, rig in rigs.items():
            if all(curve.method != method for curve in self._result.curves):
                self._progress(_REFERENCE_SHARE, f"trying {method}")
                curve = Curve(
                    method,
                    {"start": self._start_seconds} | rig.setup_seconds,
                    [],
                    buffers_mib=rig.buffers_mib,
                )
                if rig.goes_on:
                    self._tune(curve, rig)
                else:
                    curve.budgets = rig.budgets(self._settings.seconds, POINTS)
                self._result.curves.append(curve)
                self._store.save()

    def _tune(self, curve: Curve, rig: Rig) -> None:
        """Budgets up to the horizon, and kernels with which a baseline is at its best."""

        def judge(rendering: Rendering) -> tuple[float, float]:
            sample = self._sample(rendering, curve.method, 0, 0, None)
            return sample.photon_seconds, sample.metrics["relmse"]

        tuning = tune(
            rig,
            self._settings.seconds,
            max(self._settings.horizon_seconds, self._settings.seconds),
            POINTS,
            judge,
            lambda text: self._progress(_REFERENCE_SHARE, f"trying {curve.method}: {text}"),
        )
        curve.budgets, curve.kernels, curve.sweep = tuning.budgets, tuning.kernels, tuning.sweep

    def _curve(self, method: str) -> Curve:
        return next(curve for curve in self._result.curves if curve.method == method)

    def _measure_seed(self, rig: Rig, curve: Curve, seed: int, done: float) -> None:
        """All budgets of one method and seed, unless results.json has them already."""
        store, result, reference_image = self._store, self._result, self._reference_image
        if any(sample.seed == seed for sample in curve.samples):
            return
        earlier = (
            store.load_sums(result.scene, curve.method, seed - 1)
            if seed > 1
            else np.zeros((len(curve.budgets), *reference_image.xyz.shape), np.float32)
        )
        if earlier is None:
            raise UserError(
                f"{store.directory}/partial has lost what going on with '{result.scene}' needs: give --fresh to begin "
                "anew"
            )
        sums, samples = earlier, []
        for i, budget in enumerate(curve.budgets):
            step = (1.0 - _REFERENCE_SHARE) / (self._settings.seeds * len(self._settings.methods))
            self._progress(
                _REFERENCE_SHARE + (1.0 - _REFERENCE_SHARE) * done + step * i / len(curve.budgets),
                f"{curve.method}, seed {seed} of {self._settings.seeds}",
            )
            kernel = kernel_at(curve, budget)
            rendering = rig.render(budget, seed, kernel)
            samples.append(self._sample(rendering, curve.method, budget, seed, kernel))
            sums[i] += rendering.xyz - reference_image.xyz
        store.save_sums(result.scene, curve.method, seed, sums)
        curve.samples.extend(samples)
        complete_curve(
            curve, {n: sums[i].astype(np.float64) / seed for i, n in enumerate(curve.budgets)}, reference_image
        )
        result.speed_ups = speed_ups(result.curves)
        store.save()
        store.drop_sums(result.scene, curve.method, seed - 1)

    def _sample(self, rendering: Rendering, method: str, budget: int, seed: int, kernel: float | None) -> Sample:
        if not np.isfinite(rendering.xyz).all():
            raise RuntimeError(
                f"{method} gave a picture with numbers that are not finite ({self._result.scene}, {budget} "
                f"{MEASURED_PASSES[self._result.measured_pass].units}, seed {seed})"
            )
        return Sample(
            budget,
            seed,
            rendering.emitted,
            rendering.splats,
            rendering.seconds,
            metrics.measure(rendering.xyz, self._reference_image),
            kernel or 0.0,
        )

    def _make_pictures(self, method: str, rig: Rig) -> None:
        """Pictures at equal time, with FLIP."""
        result = self._result
        curve = self._curve(method)
        made: dict[
            int, tuple[Rendering, Sample]
        ] = {}  # a method whose shortest rendering takes longer than the early pictures has one for all
        for ending, share in MEASURED_PASSES[result.measured_pass].pictures:
            name = f"{method}{ending}"
            budget = rig.fitting(budget_at_time(curve.points, share * self._settings.seconds))
            if budget not in made:
                kernel = kernel_at(curve, budget)
                rendering = rig.render(budget, 1, kernel)
                made[budget] = rendering, self._sample(rendering, method, budget, 1, kernel)
                flip = metrics.flip(rendering.xyz, self._reference_image)
                if flip is not None:
                    made[budget][1].metrics["flip"] = flip
            rendering, sample = made[budget]
            result.pictures[name] = self._store.save_picture(result.scene, name, rendering.xyz)
            result.picture_samples[name] = sample


def _empty_result(name: str, scene: Scene, size: tuple[int, int], settings: BenchSettings) -> SceneResult:
    glasses = [o.material.dispersion for o in scene.objects if o.material.transmits]
    strongest = min(
        (g for g in glasses if g.is_dispersive and np.isfinite(g.V_d)), key=lambda g: abs(g.V_d), default=None
    )
    return SceneResult(
        name,
        scene.name,
        size,
        settings.seeds,
        settings.seconds,
        None,
        [],
        strongest_glass="" if strongest is None else strongest.name,
        strongest_abbe=0.0 if strongest is None else abs(strongest.V_d),
        equal_time=settings.seconds,
        measured_pass=settings.measured_pass,
    )
