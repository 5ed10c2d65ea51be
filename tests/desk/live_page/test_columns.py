"""What is drawn: the last injections over each other on one axis of time, masses and wear of all by their numbers."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from observer_rt.bus.mapping.output_signals import SummaryValues
from observer_rt.desk.live_page.injector import HISTORY, Seen
from observer_rt.desk.live_page.page.columns import DETAILS, Columns, mass_columns, rate_columns, wear_columns
from observer_rt.desk.live_page.samples import SampleCurves, SeenInjection


def seen(*numbers: float, samples: Mapping[float, int] | None = None) -> Seen:
    """Injections of 10 mg times their number, ± 1 mg, even ones not valid; curves count from 1 to their samples."""
    injections, rows = [], []
    for number in numbers:
        curve = np.arange(1.0, (samples or {}).get(number, 0) + 1.0, dtype=np.float32)
        said = SummaryValues._make([number] * len(SummaryValues._fields))
        said = said._replace(mass=10.0 * number, mass_sigma=1.0 / 1.96, valid=number % 2 == 1)
        curves = SampleCurves._make([curve] * len(SampleCurves._fields)) if curve.size else None
        injections.append(SeenInjection(said, 0, curves))
        rows.append((*said, 2.0 * number))
    return Seen("", tuple(injections), np.array(rows, HISTORY), None, (), 0)


def test_masses_stand_by_number_and_validity() -> None:
    mass = mass_columns(seen(1, 2))
    assert mass["number"].tolist() == [1.0, 2.0]
    assert mass["nominal"].tolist() == [2.0, 4.0]
    np.testing.assert_array_equal(mass["valid"], [10.0, np.nan])
    np.testing.assert_array_equal(mass["refused"], [np.nan, 20.0])
    np.testing.assert_allclose(mass["valid_low"], [9.0, np.nan])
    np.testing.assert_allclose(mass["refused_high"], [np.nan, 21.0])


@pytest.mark.parametrize("columns", [mass_columns, wear_columns])
def test_numbers_rise_whoever_counted(columns: Callable[[Seen], Columns]) -> None:
    """An observer that was started anew begins at 1; one whose summaries have no number has no history."""
    assert columns(seen(8, 9, 1, 2))["number"].tolist() == [1.0, 2.0, 8.0, 9.0]
    assert {each.size for each in columns(seen(math.nan)).values()} == {0}
    assert {each.size for each in columns(seen()).values()} == {0}


def test_injections_lie_over_each_other_from_their_beginnings_on() -> None:
    columns = rate_columns(seen(1, 2, 3, samples={1: 4, 2: 2, 3: 3}))
    assert columns["time"].tolist() == [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_array_equal(columns["rate"], [1.0, 2.0, 3.0, np.nan])
    np.testing.assert_array_equal(columns["rate_before_1"], [1.0, 2.0, np.nan, np.nan])
    np.testing.assert_array_equal(columns["rate_before_2"], [1.0, 2.0, 3.0, 4.0])
    assert "nominal_before_1" not in columns
    np.testing.assert_allclose(columns["high"][:3], columns["rate"][:3] * (1.0 + 1.0 / 30.0), rtol=1e-6)


def test_an_injection_without_curves_is_not_drawn_with_those_of_another() -> None:
    """Its number stands in the title, and its mass beside."""
    without = seen(1, 2, samples={1: 4})
    assert rate_columns(without) == DETAILS["needle_lift"](without) == rate_columns(seen()) == {}


def test_a_long_injection_is_thinned_as_the_others_are() -> None:
    last = seen(1, 2, samples={1: 10, 2: 2000})
    lift, phi = DETAILS["needle_lift"](last), DETAILS["phi"](last)
    assert {values.size for values in (*lift.values(), *phi.values())} == {lift["time"].size}
    assert lift["time"].size <= 300
    assert phi["phi_3"][-1] > 1990.0
    assert lift["needle_lift_before_1"][1] == lift["needle_lift"][1]
