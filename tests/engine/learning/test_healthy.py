"""What a fitted model leaves of a healthy injector: its shape is found, and nothing objects to it."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.engine.estimation.phases import BLOCKS, PHASES, Phase, PhaseStatistics
from observer_rt.engine.learning.adequacy import Objection, inadequate_phase, objections
from observer_rt.engine.learning.healthy import (
    KNOTS,
    NOT_FITTED,
    ShapeFit,
    expected,
    healthy_of,
    together,
    with_remainder,
)
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape, Remainder
from tests.baselines import WHITE, baseline
from tests.engine.learning.test_healthy_course import stretch

COUNT = 4000.0  # samples of a phase
COLOUR = 3.0  # mean square of blocks in the opening, which the fitted model leaves
FITTED = {
    "variance": WHITE,
    "chi2": WHITE | {"opening": COLOUR, "standstill": 0.5},
    "colour": WHITE | {"opening": COLOUR},
}

SIGMA = 0.15 * MEGAPASCAL
TRUE = HealthyShape(
    opening=tuple((0.1 * np.sin(KNOTS / 60e-6) * np.exp(-KNOTS / 0.5e-3)).tolist()),
    opening_slope=tuple((0.05 * np.exp(-(((KNOTS - 0.2e-3) / 60e-6) ** 2))).tolist()),
    closing=tuple((-0.1 * np.exp(-np.abs(KNOTS) / 0.3e-3)).tolist()),
    closing_slope=(0.0,) * KNOTS.size,
)


def statistics(opening: float, standstill: float = 1.0) -> PhaseStatistics:
    """White innovations, but for the mean squares of blocks in two phases."""
    blocks = np.array([COUNT / length for length in BLOCKS])
    sums = np.tile(blocks, (PHASES, 1))
    sums[Phase.OPENING] *= opening
    sums[Phase.STANDSTILL] *= standstill
    return PhaseStatistics(np.full(PHASES, COUNT), np.full(PHASES, COUNT), sums, np.tile(blocks, (PHASES, 1)))


def test_the_residual_of_the_fit_is_not_held_against_an_event() -> None:
    healthy = healthy_of(baseline(**FITTED), 1e5)
    assert inadequate_phase(statistics(COLOUR)) is Phase.OPENING
    assert inadequate_phase(healthy.relative(statistics(COLOUR))) is None
    assert inadequate_phase(healthy.relative(statistics(2.0 * COLOUR))) is Phase.OPENING


def test_a_fitted_model_may_have_scattered_samples_at_an_edge_but_not_while_open() -> None:
    healthy = healthy_of(baseline(**FITTED), 1e5)
    white = statistics(1.0)
    for phase, variance, refused in ((Phase.CLOSING, 1.5, False), (Phase.OPEN, 2.5, True)):
        scattered = replace(white, squares=white.squares.copy())
        scattered.squares[phase] *= variance
        assert inadequate_phase(scattered) is phase
        assert (inadequate_phase(healthy.relative(scattered)) is phase) == refused


def test_a_phase_quieter_than_noise_does_not_make_others_loud() -> None:
    healthy = healthy_of(baseline(**FITTED), 1e5)
    assert inadequate_phase(healthy.relative(statistics(COLOUR, standstill=1.0))) is None


@pytest.mark.parametrize("rate", [2e4, 9.5e4])
def test_figures_of_another_sample_rate_are_not_compared(rate: float) -> None:
    healthy = healthy_of(baseline(**FITTED), rate)
    assert healthy.mass_share == 0.002
    assert inadequate_phase(healthy.relative(statistics(COLOUR))) is Phase.OPENING


def test_a_model_that_fits_no_healthy_injector_is_refused_unless_trusted() -> None:
    white = statistics(1.0)
    refused = [Objection(Reason.MODEL_INADEQUATE, None)]
    assert objections(white, 0.0, 0.0, healthy_of(baseline(**FITTED, adequate=False), 1e5)) == refused
    assert objections(white, 0.0, 0.0, healthy_of(baseline(**FITTED, adequate=False), 1e5, trusted=True)) == []
    assert objections(white, 0.0, 0.0, NOT_FITTED) == []


def _remainder(rate: float = 1e5) -> Remainder:
    return Remainder.model_validate(
        {
            "line_pressure_MPa": 0.2,
            "mass_share": 0.003,
            "sample_rate_Hz": rate,
            "variance": WHITE,
            "observer": {
                "variance": WHITE,
                "colour": WHITE | {"opening": COLOUR},
                "overdispersion": 2.0,
                "shape": dict.fromkeys(("opening", "opening_slope", "closing", "closing_slope"), (0.0,)),
            },
        }
    )


def test_the_remainder_of_terms_is_not_held_against_an_event_and_widens_masses() -> None:
    white = healthy_of(baseline(mass_share=0.004), 1e5)
    healthy = with_remainder(white, _remainder(), 1e5)
    assert inadequate_phase(white.relative(statistics(COLOUR))) is Phase.OPENING
    assert inadequate_phase(healthy.relative(statistics(COLOUR))) is None
    assert inadequate_phase(healthy.relative(statistics(2.0 * COLOUR))) is Phase.OPENING
    assert healthy.mass_share == pytest.approx(0.005)
    assert healthy.overdispersion == 2.0
    assert with_remainder(white, None, 1e5) is white


def test_a_remainder_at_another_sample_rate_widens_masses_only() -> None:
    healthy = with_remainder(NOT_FITTED, _remainder(rate=5e4), 1e5)
    assert healthy.mass_share == pytest.approx(0.003)
    assert inadequate_phase(healthy.relative(statistics(COLOUR))) is Phase.OPENING


RECORDINGS = [
    [stretch(pressure, 100.0 + phase, 100.0 + phase + open_for) for phase in np.linspace(0.0, 0.9, 8)]
    for pressure, open_for in ((60, 190), (100, 60), (140, 190))
]


def test_the_shape_is_found_in_noise() -> None:
    random = np.random.default_rng(0)
    seen = [
        [(event, expected(TRUE, event) / SIGMA + 0.1 * random.normal(size=event.samples)) for event in events]
        for events in RECORDINGS
    ]
    result = ShapeFit(seen, SIGMA).shape()
    for stretch_of_event in (stretch(80, 120.3, 220.7), stretch(120, 99.9, 260.2)):
        true = expected(TRUE, stretch_of_event)
        assert np.mean((expected(result, stretch_of_event) - true) ** 2) < 0.1 * np.mean(true**2)


def test_what_was_left_out_is_not_seen() -> None:
    silent = [[(one, np.zeros(one.samples)) for one in events] for events in RECORDINGS[:2]]
    loud = [(one, expected(TRUE, one) / SIGMA) for one in RECORDINGS[2]]
    fit = ShapeFit([*silent, loud], SIGMA)
    assert not any(fit.shape(left_out=2).opening)
    assert any(fit.shape().opening)


def test_shapes_add_up() -> None:
    event = RECORDINGS[0][0]
    assert expected(together(TRUE, TRUE), event) == pytest.approx(2.0 * expected(TRUE, event), abs=20.0)
