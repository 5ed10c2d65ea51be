"""The definitions of the accuracy figures, on recordings made by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.plants.plant import Outcome, Signals, Truth
from tests.plants.windows import Windows, windows_of
from tools.benchmarks.cases import make_case
from tools.benchmarks.scoring import FROM, NOMINAL, OBSERVER, Estimate, Injection, Score

EVENTS = 20
RATE = 100e3
DENSITY = 830.0


def factors(**at: float) -> np.ndarray:
    """1 for every event but those named event_N (from 1)."""
    result = np.ones(EVENTS)
    for name, value in at.items():
        result[int(name.removeprefix("event_")) - 1] = value
    return result


def score(mass_factor: Any = 1.0, **changes: Any) -> Score:
    """Events of one injection of 50 mg, by default scored right, valid from the third on."""
    true = np.full(EVENTS, 50.0)
    valid = changes.setdefault("valid", (False, False, *(True,) * 18))
    made = Score(
        case=make_case("orifice_area", 1, 0),
        of_event=tuple((event,) for event in range(EVENTS)),
        true_masses=true,
        window_samples=np.full(EVENTS, 200),
        injections=tuple(Injection(event, (event,), each) for event, each in enumerate(valid)),
        valid=valid,
        reasons=tuple("" if each else "SUDDEN_CHANGE" for each in valid),
        mass_ci95_mg=((49.0, 51.0),) * EVENTS,
        rate_judged=np.full(EVENTS, 100),
        rate_covered=np.full(EVENTS, 95),
        estimates={
            OBSERVER: Estimate(true * mass_factor, np.full(EVENTS, 0.01), np.full(EVENTS, 1e-6)),
            NOMINAL: Estimate(true * 0.8, np.full(EVENTS, 100.0), np.full(EVENTS, 1e-4)),
        },
    )
    return replace(made, **changes)


def outcome_of(openings: list[tuple[int, int]], event_of: list[int], samples: int = 2000) -> Outcome:
    """A recording with the needle open over ranges of samples, the injection rate 40 mm3/ms there."""
    lift, time = np.zeros(samples), np.arange(samples) / RATE
    for first, last in openings:
        lift[first : last + 1] = 2e-4
    flat = np.zeros(samples)
    return Outcome(
        Signals(time, flat, lift, flat),
        Truth(np.where(lift > 0.0, 40e-6, 0.0), flat, lift, flat, flat),
        np.array(openings),
        np.array(event_of),
    )


def test_windows_that_reach_into_each_other_part_where_least_flows() -> None:
    windows = windows_of(outcome_of([(500, 549), (580, 699)], [0, 0]), RATE)
    assert windows.ranges == (slice(485, 566), slice(565, 751))
    assert windows.union(0).tolist() == list(range(485, 751))


@pytest.fixture
def two_events() -> tuple[Outcome, Windows]:
    outcome = outcome_of([(500, 549), (600, 699), (1500, 1599)], [0, 0, 1])
    return outcome, windows_of(outcome, RATE)


def test_masses_are_trapezoids_over_windows(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    masses = windows.by_event(windows.masses(outcome.truth.injection_rate, DENSITY))
    # 50 samples at 40 mm3/ms and 100 more; then 100
    assert masses == pytest.approx([150 * 1e-5 * 40e-6 * DENSITY, 100 * 1e-5 * 40e-6 * DENSITY])


def test_rate_errors_count_every_sample_of_the_union_once(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    error = np.zeros(outcome.truth.injection_rate.size)
    error[590:600] = 2.0  # in the second window of the first event
    squares = windows.mean_squares(error)
    assert squares[0] == pytest.approx(10 * 4.0 / windows.union(0).size)
    assert squares[1] == 0.0


def test_errors_are_of_single_valid_injections_from_the_fifth_event_on() -> None:
    made = score(factors(event_4=2.0, event_5=1.1, event_20=0.9, event_7=3.0))
    made = replace(made, injections=tuple(replace(i, valid=i.event != 6) for i in made.injections))
    facts = made.facts()
    errors = facts["observer_errors_pct"]
    assert len(errors) == 15
    assert (min(errors), max(errors)) == (pytest.approx(-10.0), pytest.approx(10.0))
    assert facts["sum_error_pct"] == pytest.approx(0.0)
    assert max(map(abs, facts["nominal_errors_pct"])) == pytest.approx(20.0)
    refused = score(valid=(False,) * EVENTS).facts()
    assert refused["observer_errors_pct"] == []
    assert "sum_error_pct" not in refused
    assert refused["refused"] == ["SUDDEN_CHANGE"] * (EVENTS - FROM)


def test_openings_of_an_event_do_not_cancel_unless_the_observer_reports_them_as_one() -> None:
    made = score()
    masses = np.array([*(50.0,) * 19, 45.4, 4.6])
    estimates = {name: replace(each, masses=masses) for name, each in made.estimates.items()}
    apart = replace(
        made,
        of_event=(*made.of_event[:19], (19, 20)),
        true_masses=np.array([*(50.0,) * 19, 45.0, 5.0]),
        estimates=estimates,
        injections=(*made.injections, Injection(19, (20,), valid=True)),
    )
    together = replace(apart, injections=(*made.injections[:19], Injection(19, (19, 20), valid=True)))
    for case, largest, wrong in ((apart, 8.0, 1), (together, 0.0, 0)):
        facts = case.facts()
        assert max(map(abs, facts["observer_errors_pct"])) == pytest.approx(largest, abs=1e-9)
        assert facts["wrong_valid"] == wrong


@pytest.mark.parametrize(
    ("made", "wrong"),
    [
        (score(factors(event_1=1.5, event_2=1.5)), 0),  # not valid
        (score(factors(event_3=1.031)), 1),
        (score(factors(event_3=1.029)), 0),
    ],
)
def test_only_valid_events_can_be_wrong_while_valid(made: Score, wrong: int) -> None:
    assert made.facts()["wrong_valid"] == wrong
    ours = replace(made.estimates[OBSERVER], rate_squares=np.full(EVENTS, 9.1))
    assert replace(made, estimates=made.estimates | {OBSERVER: ours}).facts()["wrong_valid"] == 18


def test_intervals_hold_the_true_mass_or_not() -> None:
    for interval, holds in (((49.0, 51.0), True), ((50.1, 51.0), False), (None, None)):
        facts = score(mass_ci95_mg=(interval,) * EVENTS).facts()
        assert facts["covered"] is holds
        assert facts["held"] == ([] if holds is None else [holds] * (EVENTS - FROM))
    assert score().facts()["rate_coverage"] == pytest.approx(0.95)
