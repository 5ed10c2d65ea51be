"""The learning observer's word beside discovery's."""

from dataclasses import replace

import pytest

from observer_rt.identification.discovery.findings import Opinion, contradictions, remark
from observer_rt.identification.discovery.search.results import (
    Consequence,
    Discovery,
    FittedEffect,
    FittedParameter,
    Verdict,
)
from observer_rt.model.baseline import Appearance
from tests.identification.discovery.conftest import Worn, opinion_of

QUIET = {"orifice_area": 0.002, "seat_area": 0.005, "guide_leakage": 0.0, "line_pressure_sensor_lag": 0.0}
"""Standard deviations of what was not learned."""


def _with(reasons: dict[str, int] | None = None, **changed: tuple[float, float]) -> Opinion:
    """changed: value and standard deviation [SI] by effect."""
    said = {name: (0.0, sigma) for name, sigma in QUIET.items()} | changed
    return opinion_of(said, reasons)


def _named(found: Discovery, effect_id: str, name: str, value: float, half: float) -> Discovery:
    parameter = FittedParameter(name, value, (value - half, value + half))
    return replace(found, effects=(FittedEffect(effect_id, (parameter,), 1000.0, (), Consequence(0.0, 0.0)),))


@pytest.mark.parametrize(("learned", "agrees"), [(0.1, True), (0.104, True), (0.2, False), (0.0, False)])
def test_sizes_are_compared(worn: Worn, learned: float, agrees: bool) -> None:
    found = worn.findings.discovery
    said = contradictions(found, _with(orifice_area=(learned, 0.002)))
    assert (said == ()) == agrees


def test_what_the_observer_learned_besides_is_told(worn: Worn) -> None:
    found = worn.findings.discovery
    (said,) = contradictions(found, _with(orifice_area=(0.1, 0.002), guide_leakage=(5e-14, 1e-15)))
    assert "guide_leakage" in said


def test_of_nothing_missing_nothing_is_learned(worn: Worn) -> None:
    nothing = replace(worn.findings.discovery, verdict=Verdict.NONE, effects=())
    assert contradictions(nothing, _with()) == ()
    assert contradictions(nothing, _with(seat_area=(0.2, 0.005)))
    assert contradictions(nothing, _with({"MODEL_INADEQUATE": 3}))
    # an indicator beyond its own uncertainty, but too small to matter
    assert contradictions(nothing, _with(orifice_area=(0.002, 1e-5))) == ()


def test_what_the_healthy_injector_appears_to_have_is_no_contradiction(worn: Worn) -> None:
    opinion = _with(orifice_area=(0.1, 0.002), line_pressure_sensor_lag=(20e-6, 1e-7))
    usual = {"line_pressure_sensor_lag": Appearance(mean=19.5, uncertainty=0.3, scatter=0.4, unit="us")}
    assert contradictions(worn.findings.discovery, opinion)
    assert contradictions(worn.findings.discovery, opinion, usual) == ()
    nothing = replace(worn.findings.discovery, verdict=Verdict.NONE, effects=())
    alone = _with(line_pressure_sensor_lag=(20e-6, 1e-7))
    assert contradictions(nothing, alone)
    assert contradictions(nothing, alone, usual) == ()


def test_an_effect_the_observer_has_no_term_for_is_no_contradiction(worn: Worn) -> None:
    found = _named(worn.findings.discovery, "lift_offset", "x_0", 20e-6, 1e-6)
    opinion = _with({"MODEL_INADEQUATE": 10}, seat_area=(1.1, 0.1))
    assert contradictions(found, opinion) == ()
    assert "lift_offset" in remark(found, opinion)


def test_of_something_unknown_nobody_can_disagree(worn: Worn) -> None:
    unknown = replace(worn.findings.discovery, verdict=Verdict.UNKNOWN, effects=())
    opinion = _with({"MODEL_INADEQUATE": 10}, seat_area=(1.1, 0.1))
    assert contradictions(unknown, opinion) == ()
    assert "inadequate" in remark(unknown, opinion)
