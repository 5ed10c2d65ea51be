"""Lines whose last state is the integral of p_L: what it is, what it leaves alone, and the line at rest."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.core.model.model import advance_state, steps_in
from observer_rt.model.effective import Coefficients, averaged, coefficients
from observer_rt.model.network import constant_network
from observer_rt.model.stability import substeps_needed
from observer_rt.model.wave_line import WaveLine
from tests.intervals import Interval
from tests.model.conftest import at_rest, with_line

PERIOD = 50e-6  # s
RAIL = 0.95
LIFTED = ([0.3e-3, 0.5e-3, 1.1e-3, 1.35e-3], [0.0, 1.39, 1.39, 0.0])  # a seat area over time
LINES: list[dict[str, Any]] = [
    {"model": "lump"},
    {"model": "wave", "wall_viscosity": 6e-6},
    {"model": "wave_two_part", "impedance_ratio": 1.4, "end_volume": 2e-8, "wall_viscosity": 3e-6},
]
NAMES = [str(line["model"]) for line in LINES]


def step(x: NDArray[np.float64], c: Coefficients, start: float, length: float, substeps: int) -> None:
    u = [(RAIL, float(np.interp(time, *LIFTED))) for time in (start, start + length)]
    advance_state(x, Interval(u[0], u[1], length, substeps), c, constant_network())


@pytest.mark.parametrize("line", LINES, ids=NAMES)
def test_the_integral_is_that_of_the_pressure_and_changes_nothing_else(line: dict[str, Any]) -> None:
    """Through an injection, against the same line in steps of the line's own that are summed up."""
    plain = coefficients(with_line(load_injector(), **line))
    fine = 10e-6
    # of a wave one implicit step each: the sac takes part of it, and the pressure has a middle only
    at_once, substeps = (steps_in(length) if isinstance(plain.line, WaveLine) else 40 for length in (PERIOD, fine))
    once, often = at_rest(averaged(plain)), at_rest(plain)
    differences = []
    for k in range(60):
        once[-1] = 0.0
        step(once, averaged(plain), k * PERIOD, PERIOD, at_once)
        pressures = [often[0]]
        for j in range(round(PERIOD / fine)):
            step(often, plain, k * PERIOD + j * fine, fine, substeps)
            pressures.append(often[0])
        differences.append(once[-1] / PERIOD - np.trapezoid(pressures) * fine / PERIOD)
        np.testing.assert_allclose(once[: plain.states], often, atol=2e-3)
        assert abs(once[-1] / PERIOD - once[0]) < 0.2
    assert np.abs(differences).max() < 1.5e-4
    assert abs(once[-1] / PERIOD - RAIL) > 1e-3  # it still rings


@pytest.mark.parametrize("line", LINES, ids=NAMES)
def test_transition_is_that_of_the_line_at_rest(line: dict[str, Any]) -> None:
    parameters = with_line(load_injector(), **({"loss_factor": 0.0} | line))
    c = averaged(coefficients(parameters))
    matrix, rail = c.line.transition(PERIOD)
    states = [i for i in range(c.states) if i != 2]  # without p_S
    small = 1e-4
    substeps = substeps_needed(parameters, 1 / PERIOD)

    def moved(x: NDArray[np.float64], pressure: float) -> NDArray[np.float64]:
        after = x.copy()
        after[-1] = 0.0
        advance_state(after, Interval((pressure, 0.0), (pressure, 0.0), PERIOD, substeps), c, constant_network())
        return after[states]

    x = at_rest(c)
    base = moved(x, RAIL)
    units = np.ones(c.states)
    units[-1] = PERIOD  # the integral is counted in seconds
    for column, state in enumerate(states):
        shifted = x.copy()
        shifted[state] += small
        slope = (moved(shifted, RAIL) - base) / small
        np.testing.assert_allclose(matrix[:, column] / units[states], slope / units[states], atol=2e-4)
    slope = (moved(x, RAIL + small) - base) / small
    np.testing.assert_allclose(rail / units[states], slope / units[states], atol=2e-4)
