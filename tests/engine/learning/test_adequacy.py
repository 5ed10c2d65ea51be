"""What speaks against an event, and what does not."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from observer_rt.engine.estimation.parameters import SCALARS, Parameter
from observer_rt.engine.estimation.phases import PHASES, Phase, PhaseStatistics, no_statistics, phase_statistics
from observer_rt.engine.learning import adequacy
from observer_rt.engine.stream.state import Reason

LENGTHS = (50, 30, 60, 35, 295, 400)  # samples of an event's phases at 100 kHz
PHASES_OF_EVENT = np.repeat([0, 1, 2, 3, 4, 0], LENGTHS).astype(np.int8)
EVENTS = 3000


def pooled_over(noise: NDArray[np.float64]) -> list[PhaseStatistics]:
    """Statistics after every event, as the learner pools them; noise (events, samples) of variance 1."""
    statistics, result = no_statistics(), []
    for e in noise:
        statistics = adequacy.pooled(statistics, phase_statistics(e, 1.0, PHASES_OF_EVENT, 0))
        result.append(statistics)
    return result


def test_white_events_are_hardly_ever_refused() -> None:
    """At most one in a thousand; the limit is meant for one in ten thousand."""
    noise = np.random.default_rng(17).normal(size=(EVENTS, PHASES_OF_EVENT.size))
    alarms = [statistics for statistics in pooled_over(noise) if adequacy.inadequate_phase(statistics) is not None]
    assert len(alarms) <= EVENTS / 1000
    assert all(adequacy.tempering(statistics) < 3.0 for statistics in alarms)


@pytest.mark.parametrize("lengths", [(20, 8, 0, 8, 40, 0), (50, 30, 8, 35, 295, 400)], ids=["short", "usual"])
def test_first_events_with_few_samples_are_hardly_ever_refused(lengths: tuple[int, ...]) -> None:
    phases = np.repeat([0, 1, 2, 3, 4, 0], lengths).astype(np.int8)
    random = np.random.default_rng(18)
    alarms = 0
    for _ in range(EVENTS):
        statistics = phase_statistics(random.normal(size=phases.size), 1.0, phases, 0)
        alarms += adequacy.inadequate_phase(statistics) is not None
    assert alarms <= EVENTS / 1000


@pytest.mark.parametrize("phase", [Phase.STANDSTILL, Phase.OPEN, Phase.AFTER])
def test_a_coloured_phase_is_named(phase: Phase) -> None:
    """Neighbours correlated by 0.9, the variance as it should be."""
    random = np.random.default_rng(19)
    noise = random.normal(size=(100, PHASES_OF_EVENT.size))
    inside = np.equal(PHASES_OF_EVENT, phase)
    for e in noise:
        e[inside] = lfilter([np.sqrt(1 - 0.9**2)], [1.0, -0.9], random.normal(size=int(inside.sum())))
    result = [adequacy.inadequate_phase(statistics) for statistics in pooled_over(noise)]
    assert all(name in (phase, None) for name in result)
    assert np.mean([name is phase for name in result[5:]]) > 0.9


@pytest.mark.parametrize("phase", Phase)
def test_a_phase_that_is_always_off_is_named(phase: Phase) -> None:
    """Two standard deviations, 0.3 MPa at the usual noise, from the second such event on."""
    noise = np.random.default_rng(20).normal(size=(100, PHASES_OF_EVENT.size))
    noise[:, np.equal(PHASES_OF_EVENT, phase)] += 2.0
    result = [adequacy.inadequate_phase(statistics) for statistics in pooled_over(noise)]
    assert all(name is phase for name in result[1:])


def statistics_of(colour: float, variance: float, blocks: float, phase: Phase) -> PhaseStatistics:
    """White statistics everywhere but in one phase; `blocks` of 8 samples."""
    result = no_statistics()
    for p in range(PHASES):
        result.samples[p], result.squares[p] = 8 * blocks, 8 * blocks
        result.blocks[p], result.block_squares[p] = blocks, blocks
    result.squares[phase] *= variance
    result.block_squares[phase, 0] *= colour
    return result


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize(
    ("colour", "variance", "blocks", "refused"),
    [
        (1.5, 1.0, 1e5, False),  # significant beyond doubt, but too small to matter
        (1.7, 1.0, 1e5, True),
        (1.7, 1.0, 50.0, False),  # large enough to matter, but chance
        (3.3, 1.0, 20.0, True),  # once in 1.5 million
        (2.8, 1.0, 20.0, False),  # once in 40,000: there are many events, phases and statistics
        (9.0, 1.0, 2.0, False),  # once in 8,000
        (1.0, 1.14, 1e5, False),
        (1.0, 2.1, 1e5, True),
        (0.2, 0.2, 1e5, False),  # quieter than expected speaks for nothing
    ],
)
def test_a_phase_is_refused_when_it_is_significant_and_matters(
    phase: Phase, colour: float, variance: float, blocks: float, refused: bool
) -> None:
    statistics = statistics_of(colour, variance, blocks, phase)
    assert adequacy.inadequate_phase(statistics) == (phase if refused else None)
    expected = [adequacy.Objection(Reason.MODEL_INADEQUATE, phase)] if refused else []
    assert adequacy.objections(statistics, 0.0, 0.0) == expected


@pytest.mark.parametrize("phase", Phase)
def test_louder_white_noise_is_refused_where_the_needle_moves(phase: Phase) -> None:
    """Elsewhere the noise may have grown, and a needle that goes by commands move otherwise: both are allowed for."""
    statistics = statistics_of(1.0, 1.5, 1e5, phase)
    assert adequacy.inadequate_phase(statistics, by_commands=True) is None
    assert adequacy.inadequate_phase(statistics_of(1.0, 2.1, 1e5, phase), by_commands=True) is phase
    assert (adequacy.inadequate_phase(statistics) is phase) == (phase in {Phase.OPENING, Phase.CLOSING})
    assert adequacy.tempering(statistics) == pytest.approx(1.5)


def test_tempering_is_the_worst_significant_colour() -> None:
    assert adequacy.tempering(no_statistics()) == 1.0
    assert adequacy.tempering(statistics_of(1.5, 1.0, 1e5, Phase.OPEN)) == 1.0
    assert adequacy.tempering(statistics_of(2.5, 1.0, 5.0, Phase.OPEN)) == 1.0  # chance
    assert adequacy.tempering(statistics_of(2.5, 1.0, 100.0, Phase.OPEN)) == pytest.approx(2.5)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_offset_and_lag_limits(sign: float) -> None:
    white = statistics_of(1.0, 1.0, 1e3, Phase.OPEN)
    assert adequacy.objections(white, sign * 0.99 * adequacy.LARGEST_OFFSET, 0.99 * adequacy.LARGEST_LAG) == []
    assert adequacy.objections(white, sign * 1.01 * adequacy.LARGEST_OFFSET, 0.0) == [
        adequacy.Objection(Reason.PRESSURE_OFFSET)
    ]
    assert adequacy.objections(white, 0.0, 1.01 * adequacy.LARGEST_LAG) == [adequacy.Objection(Reason.SENSOR_LAG)]
    assert 0.8e6 < adequacy.LARGEST_OFFSET < 3e6  # what must be borne, and what must not be believed


def test_what_names_a_cause_comes_first() -> None:
    coloured = statistics_of(3.0, 1.0, 1e3, Phase.OPEN)
    assert adequacy.objections(coloured, 3e6, 1e-3) == [
        adequacy.Objection(Reason.PRESSURE_OFFSET),
        adequacy.Objection(Reason.SENSOR_LAG),
        adequacy.Objection(Reason.MODEL_INADEQUATE, Phase.OPEN),
    ]


@pytest.mark.parametrize("scale", [0.7, 0.8, 0.9, 1.1, 1.2, 1.3])
def test_healthy_injector_with_another_inertance_is_told(scale: float) -> None:
    """1 + N_H = s and 1 + r = 1/s, and what lies near it."""
    assert adequacy.looks_like_inertance(scale - 1.0, 1.0 / scale - 1.0)
    assert adequacy.looks_like_inertance(scale**0.8 - 1.0, 1.0 / scale - 1.0)


@pytest.mark.parametrize("size", [*np.linspace(-0.5, 0.5, 11), -0.3, 0.3, -1.0])
def test_wear_or_stiffness_alone_or_both_of_one_sign_are_no_inertance(size: float) -> None:
    """A nozzle that vanished is a number, too."""
    assert not any(adequacy.looks_like_inertance(size, stiffness) for stiffness in (0.0, 0.02, -0.02))
    if abs(size) <= 0.3:
        assert not any(adequacy.looks_like_inertance(n, size) for n in (0.0, 0.3 * np.sign(size), -0.18 * size))
    assert not adequacy.looks_like_inertance(-1.0, 0.1)


@pytest.mark.parametrize("column", [Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS])
def test_wear_at_its_limit_is_not_believed(column: Parameter) -> None:
    lowest, highest = SCALARS.bounds(1.0)
    theta = np.zeros(SCALARS.width)
    assert not adequacy.is_worn_beyond_limits(theta)
    for limit in (lowest[column], highest[column]):
        theta[column] = 0.99 * limit
        assert not adequacy.is_worn_beyond_limits(theta)
        theta[column] = limit
        assert adequacy.is_worn_beyond_limits(theta)
