"""How the camera's pilot weighs bands against single wavelengths: made-up pictures whose noise and bias are known."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.passes.spectrum_choice import (
    MIN_SAMPLES,
    SAMPLES_A_BAND,
    SINGLE_SPEED,
    PilotRender,
    Spectrum,
    choosing_spectrum,
    difference,
    grid_of,
    sure_bias,
)

SHAPE = (28, 50, 3)


class World:
    """A picture with chance of its own, detail within a pixel, single wavelengths' noise, and a bias that shrinks with
    the bands."""

    def __init__(self, chance: float = 0.02, detail: float = 0.1, single: float = 0.8, bias: float = 0.0) -> None:
        rng = np.random.default_rng(1)
        self.reference = rng.uniform(0.5, 1.5, SHAPE)
        self.wrong = rng.normal(size=SHAPE)
        self.moved = rng.normal(size=SHAPE)
        self.chance, self.detail, self.single, self.bias = chance, detail, single, bias
        self.looks: list[PilotRender] = []

    def picture(self, look: PilotRender) -> np.ndarray:
        self.looks.append(look)
        rng = np.random.default_rng(100 + len(self.looks))
        noise = self.single if look.spectrum.single else self.chance / np.sqrt(look.spectrum.bands)
        bias = 0.0 if look.spectrum.single else self.bias / look.spectrum.bands
        detail = self.detail if look.place != 0.5 else 0.0
        return self.reference * (1.0 + bias * self.wrong + detail * self.moved + noise * rng.normal(size=SHAPE))

    def choice(self, samples: int, may_be_single: bool = True) -> Spectrum:
        looks = choosing_spectrum(samples, may_be_single)
        picture: np.ndarray | None = None
        while True:
            try:
                picture = self.picture(looks.send(picture))  # type: ignore[arg-type]
            except StopIteration as stop:
                return stop.value


def test_few_samples_ask_for_nothing() -> None:
    world = World(bias=1.0)
    assert world.choice(MIN_SAMPLES - 1) == Spectrum() and not world.looks


@pytest.mark.parametrize("samples", [MIN_SAMPLES, 64, 1024])
@pytest.mark.parametrize("chance", [0.01, 0.3])
def test_chance_alone_is_no_reason_for_bands(samples: int, chance: float) -> None:
    """Pictures of one and of two bands differ by their chance, however large it is."""
    assert World(chance=chance).choice(samples) == Spectrum()


def test_bands_double_until_their_bias_is_below_the_noise() -> None:
    world = World(bias=0.05, detail=0.2)
    assert world.choice(8) == Spectrum()  # noise² 0.04 / 2 / 8 hides it
    few, many = world.choice(256, False), world.choice(65536, False)
    assert 1 < few.bands < many.bands <= 32
    assert few.bands * SAMPLES_A_BAND <= 256


def test_single_wavelengths_where_bands_fail() -> None:
    """Their noise against a bias that more samples do not cure; never without leave."""
    world = World(bias=0.8, single=0.3)
    assert world.choice(64) == Spectrum(single=True)
    assert not world.choice(64, may_be_single=False).single
    assert not World(bias=0.02, single=2.0).choice(64).single


def test_single_wavelengths_are_not_even_looked_at_without_bias() -> None:
    world = World()
    world.choice(256)
    assert not any(look.spectrum.single for look in world.looks)


def test_bias_is_found_without_its_noise() -> None:
    rng = np.random.default_rng(3)
    reference = rng.uniform(0.5, 1.5, SHAPE)

    def noisy(base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return base + 0.3 * rng.normal(size=SHAPE), base + 0.3 * rng.normal(size=SHAPE)

    assert sure_bias(noisy(reference), noisy(reference)) < 1e-3 < 0.1 < difference(*noisy(reference))
    biased = sure_bias(noisy(reference), noisy(1.4 * reference))
    assert 0.7 * biased < 0.4**2 / 1.2**2 < 1.6 * biased


def test_a_bright_pixel_does_not_speak_for_the_picture() -> None:
    a = np.ones(SHAPE)
    b = a.copy()
    b[0, 0] = 1e6
    assert difference(a, b) <= 10.0 / (SHAPE[0] * SHAPE[1])


def test_budgets_buy_whole_turns_or_more_wavelengths() -> None:
    assert [Spectrum(4).samples(n) for n in (1, 4, 5, 16)] == [4, 4, 8, 16]
    assert Spectrum(single=True).samples(10) == SINGLE_SPEED * 10


@pytest.mark.parametrize(
    ("size", "grid"),
    [((240, 135), (50, 28)), ((10, 4000), (10, 4000)), ((1920, 1080), (50, 28)), ((64, 8), (50, 6)), ((9, 1), (9, 2))],
)
def test_the_grid_has_the_pictures_shape_and_no_power_of_two(size: tuple[int, int], grid: tuple[int, int]) -> None:
    columns, rows = grid_of(*size)
    assert abs(rows - grid[1]) <= 1 and columns == grid[0]
    assert rows & (rows - 1) or rows <= 2
