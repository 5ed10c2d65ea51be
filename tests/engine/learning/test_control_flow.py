"""A servo injector by other equations, whose pilot valve moves otherwise than the model's, learned from nothing."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from observer_rt.daemon.log import injection_line
from observer_rt.engine.stream.state import Reason
from observer_rt.model.accuracy import Accuracy
from tests.engine.plant_runs import in_turn
from tests.observed_plants import ObservedRun, bench_at, observed
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Needle, Signals, Step, Surroundings

RAIL_PRESSURES, DURATIONS = (60e6, 100e6, 140e6), (1.1e-3,) * 3 + (1.9e-3,) * 3  # Pa, s
FIRST = 6  # events, after which every point was seen
MM3_PER_MS = 1e-6
WRONG = 0.03
UNDISTURBED = Surroundings()


def control_flow(result: ObservedRun) -> tuple[float, float]:
    """As it is believed after the last event, and its standard deviation [mm3/ms]; Q_0 is 60."""
    flow = result.reports[-1].indicators["control_flow"]
    assert flow.sigma is not None
    return 60.0 * flow.value, 60.0 * flow.sigma


@cache
def learned(
    flow: float,
    faults: Faults,
    events: int = 24,
    laws: Laws = NO_LAWS,
    seed: int = 3,
    accuracy: Accuracy | None = None,
    around: Surroundings = UNDISTURBED,
    first: int = FIRST,
) -> ObservedRun:
    """The events after the first pass over the points; flow: at 100 MPa [mm3/ms]; accuracy: None: of a simulation."""
    schedule = in_turn(events, lambda _: faults, RAIL_PRESSURES, DURATIONS)
    laws = laws._replace(control_flow=flow * MM3_PER_MS)
    bench = Bench(Injector(), Needle(), schedule, seed=seed, laws=laws, around=around)
    observer = bench_at(bench.sample_rate)
    if accuracy is not None:
        observer = observer.with_parameters(observer.injector.parameters.model_copy(update={"accuracy": accuracy}))
    return observed(bench, observer)[first:]


@pytest.mark.decisive(2)
@pytest.mark.parametrize(
    ("flow", "faults", "laws"),
    [
        (0.0, Faults(orifice_area=0.1), NO_LAWS),  # none at all
        (1.5, Faults(orifice_area=-0.15), NO_LAWS),
        (4.0, Faults(orifice_area=0.1), NO_LAWS),
        (8.0, Faults(seat_area=0.1), NO_LAWS),
        (4.0, Faults(), Laws(needle_area=1e-6)),  # a needle that displaces fuel beside it
    ],
)
def test_it_is_found_beside_wear_and_no_mass_is_refused_or_wrong(flow: float, faults: Faults, laws: Laws) -> None:
    run = learned(flow, faults, 18, laws)
    assert all(run.valid)
    assert np.mean(run.inside) >= 0.9
    assert np.abs(run.errors).max() < 0.01
    size, sigma = control_flow(run)
    assert size == pytest.approx(flow, abs=max(4.0 * sigma, 0.02 * flow))
    assert sigma < 0.2


def test_what_is_in_step_with_the_needle_is_in_the_interval() -> None:
    """A tenth of 6 mm3/ms leaves the line exactly while the needle is open: read as flow of the nozzle."""
    laws = Laws(lift_leakage=6e-15)
    exact = Accuracy(line_diameter_percent=0.0, line_length_percent=0.0, parallel_flow_percent=0.0)
    stated = learned(6.0, Faults(), 14, laws, accuracy=exact)
    unstated = learned(6.0, Faults(), 14, laws)
    assert all(stated.valid + stated.inside)
    assert np.mean(unstated.inside) < 0.5


def with_coil_pulse(height: float) -> Step:
    """A line sensor that hears the coil's current, 30 samples before an opening to 45 before the closing [Pa]."""

    def step(seen: Signals) -> Signals:
        pressure, is_open = seen.line_pressure.copy(), seen.needle_lift > 1e-6
        edges = np.flatnonzero(np.diff(is_open))
        for opening, shut in zip(edges[::2], edges[1::2], strict=True):
            pressure[opening - 30 : shut - 45] += height
        return replace(seen, line_pressure=pressure)

    return step


@pytest.mark.decisive(1)
@pytest.mark.parametrize(("flow", "height"), [(0.0, -0.3e6), (4.0, -0.3e6), (4.0, 0.3e6), (4.0, 0.15e6)])
def test_the_coil_is_not_taken_for_control_flow(flow: float, height: float) -> None:
    """Left in, it makes masses up to 5.7 % wrong; it is taken out as soon as its end is likely."""
    around = Surroundings(before_noise=(with_coil_pulse(height),))
    run = learned(flow, Faults(orifice_area=0.1), around=around, first=0)
    assert "the coil's current" in "".join(map(injection_line, run.reports))
    run = run[FIRST:]
    assert np.abs(run.errors[run.valid]).max() < WRONG
    assert sum(run.valid) >= 9
    assert control_flow(run)[0] == pytest.approx(flow, abs=0.4)


def test_a_pilot_valve_that_opens_gradually_is_not_taken_for_the_coil() -> None:
    run = learned(8.0, Faults(), 8, Laws(control_moves=0.4e-3), first=0)
    assert not {Reason.COIL_CURRENT, Reason.CONTRADICTED}.intersection(*(report.reasons for report in run.reports))
