"""What the discovery benchmark hides, and its oracle: blind, reproducible, true to the vocabulary, white."""

import numpy as np
import pytest

from observer_rt.model.effects import VOCABULARY, seen_in
from tools.benchmarks.discovery.cases import HEALTHY, HiddenCase, nominal_benches, nominal_cases
from tools.benchmarks.discovery.kinds import same_effect
from tools.benchmarks.discovery.oracle import best_statistic, record_all, residuals, statistic
from tools.benchmarks.discovery.rigs import GIVEN
from tools.benchmarks.discovery.scoring import faults_of
from tools.benchmarks.discovery.vocabulary import HIDDEN


def cases_of(name: str, with_rate: bool, count: int) -> list[HiddenCase]:
    """Cases of one effect, or healthy ones."""
    cases = nominal_cases(["seat_area" if name == HEALTHY else name], count, [with_rate], 1)
    return [case for case in cases if case.name == name]


NOT_HIDDEN = {"rail_pressure_skew", "control_flow"}  # the rail is at rest; a valve is a law of the plants


def test_every_effect_of_the_vocabulary_is_hidden_within_its_bounds() -> None:
    assert set(HIDDEN) == {effect.id for effect in seen_in(has_lift=True)} - NOT_HIDDEN
    for name, effect in HIDDEN.items():
        bounds = VOCABULARY[name].parameters
        assert [p.name for p in effect.parameters] == [p.name for p in bounds]
        for drawn, parameter in zip(effect.parameters, bounds, strict=True):
            assert drawn.highest <= parameter.highest
            assert parameter.lowest <= (drawn.most_negative or drawn.lowest)
            assert (drawn.most_negative < 0.0) == (parameter.lowest < 0.0)


@pytest.mark.parametrize("with_rate", [False, True])
@pytest.mark.parametrize(
    "name", [HEALTHY, "lift_offset", "bulk_modulus", "line_pressure_sensor_lag", "channel_skew", "fuel_density"]
)
def test_oracle_is_white_with_the_true_effect(name: str, with_rate: bool) -> None:
    case = cases_of(name, with_rate, 2)[1]
    recordings = [r for r, _ in record_all(nominal_benches(case, GIVEN), with_rate)]
    values = residuals(recordings, faults_of(case))
    assert np.mean(values**2) == pytest.approx(1.0, abs=4.5 * np.sqrt(2.0 / values.size))
    assert abs(np.mean(values[1:] * values[:-1])) < 4.5 / np.sqrt(values.size)


def test_rivals_of_an_exact_class_explain_alike_and_others_do_not() -> None:
    case = next(c for c in cases_of("bulk_modulus", False, 20) if abs(c.parts[0][1][0]) > 0.01)
    recordings = [r for r, _ in record_all(nominal_benches(case, GIVEN[3:4]), with_rate=False)]
    true, same, other = (best_statistic(recordings, e) for e in ("bulk_modulus", "line_volume", "seat_area"))
    assert same_effect("bulk_modulus", "line_volume")
    assert not same_effect("bulk_modulus", "entrained_air")
    assert abs(true - same) < 0.1
    assert other - true > 50.0
    assert true <= statistic(recordings, faults_of(case))
