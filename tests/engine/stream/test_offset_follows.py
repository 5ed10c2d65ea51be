"""Between events the offset of x~ is what the standstill shows."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import FURTHEST_OFFSET
from observer_rt.foundation.units import MEGAPASCAL
from tests.engine.sample_stream import NOISE, RAIL, Stream

SAMPLES = 3000


def offset_after(difference: float, is_coloured: bool = False) -> float:
    """Of x~ [Pa] after 30 ms in which the line pressure is recorded by so much [Pa] too high."""
    random, stream = np.random.default_rng(2), Stream(keep=False)
    stream.observer.memory["judgement"]["offset_moves"] = not is_coloured
    rail = RAIL + random.normal(0.0, NOISE.rail_pressure, SAMPLES)
    line = RAIL + random.normal(0.0, NOISE.line_pressure, SAMPLES)
    stream.feed(rail, np.zeros(SAMPLES), line)
    stream.feed(rail, np.zeros(SAMPLES), line + difference)
    return (
        float(stream.observer.memory[0]["pair"]["offset"])
        * stream.observer.constants.coefficients.pressure_scale
    )


@pytest.mark.parametrize("difference", [0.0, 0.8 * MEGAPASCAL, -1.2 * MEGAPASCAL])
def test_offset_follows(difference: float) -> None:
    assert offset_after(difference) == pytest.approx(difference, abs=0.03 * MEGAPASCAL)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_no_offset_of_a_good_sensor_is_not_followed(sign: float) -> None:
    assert abs(offset_after(sign * 5.0 * MEGAPASCAL)) <= FURTHEST_OFFSET


def test_what_moves_on_and_on_is_followed_no_further() -> None:
    stream = Stream(keep=False)
    rail = np.full(20_000, RAIL)
    stream.feed(rail, np.zeros(20_000), rail + np.linspace(0.0, 5.0 * MEGAPASCAL, 20_000))
    scale = stream.observer.constants.coefficients.pressure_scale
    assert stream.observer.memory[0]["pair"]["offset"] * scale == pytest.approx(FURTHEST_OFFSET)


def test_slow_noise_is_not_followed() -> None:
    assert offset_after(0.8 * MEGAPASCAL, is_coloured=True) == 0.0
