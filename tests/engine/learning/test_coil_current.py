"""What the coil's current adds to the line pressure is taken out once its end is clear, and not before."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning import coil_current

INTERVAL = 1e-5  # s
COUNT = 600
SIGMA = 1.5e-3  # p_0
OPENINGS = ((100, 250), (400, 460))
BEFORE, UNTIL = 25, 30
PRIOR = np.full(2, 100.0)


def window(output: NDArray[np.float64]) -> Window:
    inputs = np.zeros((COUNT, 2))
    inputs[99, 1] = -0.1  # beside an opening
    for opening, shut in OPENINGS:
        inputs[opening:shut, 1] = 1.0
    return Window(inputs, output, np.zeros(COUNT, np.bool_), np.zeros(4), OPENINGS[0][0])


K = np.arange(COUNT)
SLOPES = np.stack([np.where((K > 120) & (K < 250), 1.0, 0.0), np.sin(K / 40.0)], axis=1)
OTHER = coil_current.ThetaColumns.of(SLOPES, PRIOR)


def after(events: int, height: float, until: int = UNTIL) -> coil_current.CoilCurrent:
    current, ends = coil_current.CoilCurrent(), coil_current.pulse_ends(INTERVAL)
    for seed in range(events):
        noise = window(SIGMA * np.random.default_rng(seed).normal(size=COUNT))
        recorded = coil_current.CoilPulse(-height * SIGMA, BEFORE, until).taken_out(noise)
        current = current.after(  # innovations of a predictor that slowly takes what it sees for its own
            recorded, BEFORE, lambda seen: lfilter([1.0, -1.0], [1.0, -0.97], seen.output / SIGMA), OTHER, ends
        )
    return current


@pytest.mark.parametrize("height", [1.5, -1.0])
def test_end_and_height_of_the_pulse_are_found(height: float) -> None:
    pulse = after(20, height).pulse
    assert pulse is not None
    assert (pulse.before, pulse.until) == (BEFORE, UNTIL)
    assert pulse.height == pytest.approx(height * SIGMA, rel=0.1)


def test_nothing_is_taken_out_while_its_end_is_not_clear() -> None:
    assert after(1, 0.3).pulse is None
    assert (after(1, 6.0).pulse, after(1, 6.0).witnesses) == (None, 1)
    assert after(2, 6.0).pulse is not None
    beyond = after(20, 1.5, until=-10)
    assert beyond.pulse is None
    assert beyond.undone(window(np.ones(COUNT))).output.min() == 1.0


def test_the_less_is_known_of_it_the_wider_theta_is() -> None:
    few, many = after(3, 1.5).covariance, after(30, 1.5).covariance
    assert few is not None
    assert many is not None
    assert 0.0 < np.trace(many) < np.trace(few)


def test_an_edge_is_as_clear_after_many_events_and_forgotten_once_it_ends() -> None:
    places, search = coil_current.edge_places(INTERVAL), coil_current.EdgeSearch()
    sums = np.stack([1.5 * (np.arange(places.all) == BEFORE), np.ones(places.all)])  # 1.5 sigma in every event
    edges = []
    for event in range(240):
        search = search.after(sums if event < 200 else sums * [[0.0], [1.0]])
        edges.append(search.edge(places))
    assert (edges[60], edges[199], edges[-1]) == (BEFORE, BEFORE, None)
