"""The definitions of the accuracy figures, on recordings made by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.plants.plant import Measured, Outcome, Truth
from tests.plants.windows import Windows, windows_of
from tests.tools.made_scores import estimator, factors, score
from tools.benchmarks.bars import recovered, useful_at_third
from tools.benchmarks.campaign import Store
from tools.benchmarks.score import NOMINAL, OBSERVER, CaseScore, Injection, covered_samples

RATE = 100e3
DENSITY = 830.0


def outcome_of(openings: list[tuple[int, int]], event_of: list[int], samples: int = 2000) -> Outcome:
    """A recording with the needle open over ranges of samples, the injection rate 40 mm3/ms there."""
    lift, time = np.zeros(samples), np.arange(samples) / RATE
    for first, last in openings:
        lift[first : last + 1] = 2e-4
    flat = np.zeros(samples)
    return Outcome(
        Measured(time, flat, lift, flat),
        Truth(np.where(lift > 0.0, 40e-6, 0.0), flat, lift, flat, flat),
        np.array(openings),
        np.array(event_of),
    )


def test_window_is_lead_opening_and_tail() -> None:
    windows = windows_of(outcome_of([(500, 599)], [0]), RATE)
    assert windows.ranges == (slice(485, 651),)


def test_window_ends_where_the_next_opening_begins() -> None:
    windows = windows_of(outcome_of([(500, 549), (580, 699)], [0, 0]), RATE)
    assert windows.ranges == (slice(485, 581), slice(565, 751))
    assert windows.union(0).tolist() == list(range(485, 751))


@pytest.fixture
def two_events() -> tuple[Outcome, Windows]:
    outcome = outcome_of([(500, 549), (600, 699), (1500, 1599)], [0, 0, 1])
    return outcome, windows_of(outcome, RATE)


def test_masses_are_trapezoids_over_windows(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    masses = windows.event_masses_mg(outcome.truth.injection_rate, DENSITY)
    # 50 samples at 40 mm3/ms, 100 more and the one half under which the first window ends; then 100
    first_window_end = 0.5
    assert masses[0] == pytest.approx((150 + first_window_end) * 1e-5 * 40e-6 * DENSITY * 1e6)
    assert masses[1] == pytest.approx(100 * 1e-5 * 40e-6 * DENSITY * 1e6)


def test_rate_errors_count_every_sample_of_the_union_once(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    error = np.zeros(outcome.truth.injection_rate.size)
    error[590:600] = 2.0  # in both windows of the first event
    squares = windows.mean_squares(error)
    assert squares[0] == pytest.approx(10 * 4.0 / windows.union(0).size)
    assert squares[1] == 0.0


def test_errors_are_of_single_valid_injections_from_the_fifth_event_on() -> None:
    made = score(factors(event_4=2.0, event_5=1.1, event_20=0.9, event_7=3.0))
    made = replace(made, injections=tuple(replace(i, valid=i.event != 6) for i in made.injections))
    errors = made.errors_pct()
    assert errors.size == 15
    assert (errors.min(), errors.max()) == (pytest.approx(-10.0), pytest.approx(10.0))
    assert made.largest_error_pct() == pytest.approx(10.0)
    assert made.sum_error_pct() == pytest.approx(0.0)
    assert made.largest_error_pct(NOMINAL) == pytest.approx(20.0)
    assert score(valid=(False,) * 20).errors_pct().size == 0
    assert score(valid=(False,) * 20).sum_error_pct() is None


def test_openings_of_an_event_do_not_cancel_unless_the_observer_reports_them_as_one() -> None:
    made = score()
    apart = replace(
        made,
        true_opening_mass_mg=(*(50.0,) * 19, 45.0, 5.0),
        estimators=(replace(made.estimators[0], opening_mass_mg=(*(50.0,) * 19, 45.4, 4.6)),),
        injections=(*made.injections, Injection(19, (20,), valid=True)),
    )
    assert apart.largest_error_pct() == pytest.approx(8.0)
    assert apart.wrong_valid == 1
    together = replace(apart, injections=(*made.injections[:19], Injection(19, (19, 20), valid=True)))
    assert together.largest_error_pct() == pytest.approx(0.0, abs=1e-9)
    assert together.wrong_valid == 0


def test_only_valid_events_can_be_wrong_while_valid() -> None:
    assert score(factors(event_1=1.5, event_2=1.5)).wrong_valid == 0
    assert score(factors(event_3=1.031)).wrong_valid == 1
    assert score(factors(event_3=1.029)).wrong_valid == 0
    rough = estimator(OBSERVER, np.full(20, 50.0), 9.1, 1e-6)
    assert score(estimators=(rough, score().estimator(NOMINAL))).wrong_valid == 18


def test_coverage() -> None:
    assert score().covered(14) is True
    assert score(mass_ci95_mg=((50.1, 51.0),) * 20).covered(14) is False
    assert score(mass_ci95_mg=(None,) * 20).covered(14) is None


def test_interval_of_the_rate_is_judged_while_the_needle_is_open(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    error, sigma = np.zeros(outcome.truth.injection_rate.size), np.full(2000, 0.5)
    error[[500, 549]] = 0.97, -0.99  # within 1.96 sigma, and beyond
    error[[499, 550, 1400]] = 5.0  # shut
    sigma[1500:1510] = np.nan  # not available
    judged, covered = covered_samples(error, sigma, windows)
    assert judged == (150, 90)
    assert covered == (149, 90)


def test_third_event_and_recovery() -> None:
    assert useful_at_third(score(factors(event_2=2.0)))
    assert not useful_at_third(score(factors(event_3=1.011)))
    jumped = score(factors(event_8=1.5, event_9=1.5, event_10=1.5), change_event=7)
    assert recovered(jumped)
    assert not recovered(score(factors(event_11=1.5), change_event=7))


def test_interrupted_runs_go_on(tmp_path: Path) -> None:
    path = tmp_path / "results" / "observer.jsonl"
    store = Store(path, CaseScore, "now")
    first, second = score(), score(number=1, mass_ci95_mg=(None,) * 20, change_event=3)
    store.add(first)
    store.add(second)
    assert store.load() == [first, second]
    path.write_text(path.read_text()[:-40])  # killed while writing
    assert store.load() == [first]
    store.add(second)
    assert store.load() == [first, second]
    assert Store(path, CaseScore, "changed").load() == []
