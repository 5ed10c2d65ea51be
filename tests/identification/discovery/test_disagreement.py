"""The map of disagreement."""

import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.gaps import disagreements
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.discovery.search.verdict import SearchOptions, name_effects
from observer_rt.identification.likelihood.likelihood import Signal, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import Equation
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.conftest import Worn
from tests.identification.discovery.hidden import NOMINAL, recordings


def test_wear_shows_while_the_needle_is_open(worn: Worn) -> None:
    where = worn.findings.where
    assert {item.before.signal for item in where} == set(Signal)
    for item in where:
        if item.before.signal is Signal.LINE_PRESSURE and item.before.phase is Phase.STANDSTILL:
            assert item.before.excess < 5.0
            assert item.equation is None
        if item.before.phase is Phase.OPEN:
            assert item.before.excess > 5.0
            assert item.equation is Equation.LINE_PRESSURE


def test_nothing_significant_is_left_with_the_amended_model(worn: Worn) -> None:
    assert max(item.after.excess for item in worn.findings.where) < 5.0


@pytest.mark.slow
def test_each_of_two_effects_has_its_places() -> None:
    hidden = (sized("orifice_area", v_H=0.15), sized("line_pressure_sensor_offset", o=0.1e6))
    measured = measurements(recordings(hidden))
    nominal = effective_model(NOMINAL)
    discovery = name_effects(nominal, measured, SearchOptions(workers=2))
    where = disagreements(discovery, discovery.named, joint_likelihood(measured, nominal), nominal)
    shut = {item.equation for item in where if item.before.phase is Phase.STANDSTILL}
    opened = {item.equation for item in where if item.before.phase is Phase.OPEN}
    assert shut <= {Equation.OUTPUT, Equation.INPUT}
    assert opened == {Equation.LINE_PRESSURE}


def test_a_healthy_map_is_empty() -> None:
    measured = measurements(recordings())
    nominal = effective_model(NOMINAL)
    discovery = name_effects(nominal, measured, SearchOptions(workers=2))
    assert discovery.verdict is Verdict.NONE
    where = disagreements(discovery, discovery.named, joint_likelihood(measured, nominal), nominal)
    assert {item.equation for item in where} == {None}
    assert all(item.before == item.after for item in where)
