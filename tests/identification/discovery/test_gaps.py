"""The gap before and after, on operating points the sizes were not fitted to, and the map of disagreement."""

import numpy as np
import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.injections import LINE_PRESSURE, MASS, RATE, gaps_of, mass_changes
from observer_rt.identification.discovery.search.adequacy import Disagreement, disagreements
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.open_loop import mass, simulated
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from tests.identification.discovery.conftest import WEAR, Worn
from tests.identification.discovery.hidden import MODEL, NOMINAL, recordings


def test_the_amended_model_leaves_little_more_than_noise(worn: Worn) -> None:
    gaps = worn.findings.gaps.by_name
    assert gaps.keys() == {LINE_PRESSURE, RATE, MASS}
    assert all(gap.after < 0.5 * gap.before for gap in gaps.values())
    for gap in (gaps[LINE_PRESSURE], gaps[RATE]):
        assert 0.8 * gap.noise_floor < gap.after < 1.25 * gap.noise_floor


def test_mass_is_off_by_what_wear_changes(worn: Worn) -> None:
    gaps, worn_model = worn.findings.gaps, effective_model(NOMINAL, (sized("orifice_area", v_H=WEAR),))
    density = worn_model.coefficients.density
    changes = []
    for number in gaps.held_out:
        measurement = worn.task.measured[number]
        before, after = (simulated(measurement, model) for model in (MODEL, worn_model))
        masses = [[mass(measurement, run, density) for run in runs] for runs in (before, after)]
        changes += np.diff(masses, axis=0)[0].tolist()
    assert gaps.by_name[MASS].before * MILLIGRAM == pytest.approx(np.sqrt(np.mean(np.square(changes))), rel=0.15)


def test_what_is_shown_was_not_fitted(worn: Worn) -> None:
    gaps = worn.findings.gaps
    assert set(gaps.held_out).isdisjoint(gaps.fitted_on)
    assert sorted(gaps.held_out + gaps.fitted_on) == [0, 1]
    assert [point.recording for point in gaps.points] == list(gaps.held_out)
    assert worn.findings.points == worn.findings.files  # with one point each


def test_one_operating_point_is_fitted_and_shown() -> None:
    measured = measurements(recordings(points=((100e6, 1.0e-3),)))
    gaps = gaps_of(name_effects(MODEL, measured, workers=2).shown, measured, MODEL)
    assert gaps.held_out == gaps.fitted_on == (0,)
    assert gaps.by_name.keys() == {LINE_PRESSURE, MASS}
    pressure = gaps.by_name[LINE_PRESSURE]
    assert pressure.before == pressure.after == pytest.approx(pressure.noise_floor, rel=0.25)


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


def disagreed(measured: tuple[Measurement, ...]) -> tuple[Verdict, tuple[Disagreement, ...]]:
    discovery = name_effects(MODEL, measured, workers=2)
    return discovery.verdict, disagreements(discovery, discovery.named, joint_likelihood(measured, MODEL), MODEL)


@pytest.mark.slow
def test_each_of_two_effects_has_its_places() -> None:
    hidden = (sized("orifice_area", v_H=0.15), sized("line_pressure_sensor_offset", o=0.1e6))
    _, where = disagreed(measurements(recordings(hidden)))
    shut = {item.equation for item in where if item.before.phase is Phase.STANDSTILL}
    opened = {item.equation for item in where if item.before.phase is Phase.OPEN}
    assert shut <= {Equation.OUTPUT, Equation.INPUT}
    assert opened == {Equation.LINE_PRESSURE}


def test_a_healthy_map_is_empty() -> None:
    verdict, where = disagreed(measurements(recordings()))
    assert verdict is Verdict.NONE
    assert {item.equation for item in where} == {None}
    assert all(item.before == item.after for item in where)


def test_a_mass_has_an_interval_where_a_size_has_none(worn: Worn) -> None:
    area, measured = Hypothesis((VOCABULARY["orifice_area"],)), worn.task.measured[:1]
    narrow, wide = (
        mass_changes(Candidate(area, (WEAR,), 0.0, half=(half,)), measured, MODEL)[0] for half in (0.01, np.inf)
    )
    assert 5.0 * narrow.half < wide.half < wide.nominal
