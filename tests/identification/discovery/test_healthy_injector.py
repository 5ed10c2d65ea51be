"""Recordings compared with the healthy injector: its own effects are not missing, and only new ones are named."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.engine.learning.healthy import KNOTS, NOT_FITTED, Healthy
from observer_rt.identification.discovery.discover import DiscoveryTask, answer
from observer_rt.identification.discovery.search.results import Discovery, Verdict
from observer_rt.identification.discovery.search.verdict import healthy_baseline, name_effects
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.baseline import HealthyShape
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import sized
from tests.baselines import WHITE, baseline
from tests.identification.discovery.conftest import WORN_POINTS as POINTS
from tests.identification.discovery.hidden import MODEL, NOMINAL, recordings

OWN = sized("orifice_area", v_H=0.02)
"""What the model lacks of the healthy injector."""


def _discover(*effects: SizedEffect, healthy: Healthy = NOT_FITTED) -> Discovery:
    return name_effects(MODEL, measurements(recordings(effects, points=POINTS, seed=2)), workers=2, baseline=healthy)


@pytest.fixture(scope="module")
def healthy() -> Healthy:
    return healthy_baseline(MODEL, measurements(recordings((OWN,), points=POINTS)), workers=2)[0]


@pytest.mark.slow
def test_what_the_healthy_injector_has_is_not_named(healthy: Healthy) -> None:
    assert [one.id for one in _discover(OWN).effects] == ["orifice_area"]  # it is there to be seen
    result = _discover(OWN, healthy=healthy)
    assert result.verdict is Verdict.NONE
    assert result.effects == ()


def test_what_is_new_is_named_by_its_difference() -> None:
    baseline, _ = healthy_baseline(MODEL, measurements(recordings((OWN,))), workers=2)
    worn = measurements(recordings((sized("orifice_area", v_H=0.10),), seed=2))
    result = name_effects(MODEL, worn, workers=2, baseline=baseline)
    (named,) = result.effects
    assert named.id == "orifice_area"
    low, high = named.parameters["v_H"].ci95
    assert low - 0.01 < 0.08 < high + 0.01


@pytest.mark.slow
def test_a_size_is_no_surer_than_a_fitted_model_is_exact(healthy: Healthy) -> None:
    hidden = sized("bulk_modulus", r=0.1)
    (surely,), (named,) = _discover(hidden).effects, _discover(OWN, hidden, healthy=healthy).effects
    widths = [np.ptp(size.ci95) / size.value for size in (surely.parameters["r"], named.parameters["r"])]
    assert widths[0] < 0.03 < widths[1] < 0.06


@pytest.mark.slow
def test_the_smallest_size_that_could_be_seen_is_seen(healthy: Healthy) -> None:
    """And half of it is not: at six standard deviations a size is named, at less than three it is not."""
    smallest = {one.id: one.size for one in _discover(OWN, healthy=healthy).smallest_visible}
    assert len(smallest) > 15
    twice, half = ((OWN, sized("guide_leakage", c=factor * smallest["guide_leakage"])) for factor in (2.0, 0.4))
    assert [one.id for one in _discover(*twice, healthy=healthy).effects] == ["guide_leakage"]
    assert _discover(*half, healthy=healthy).effects == ()


@pytest.mark.slow
def test_more_injections_show_smaller_effects() -> None:
    few = _discover()
    made = [recording for seed in range(3, 7) for recording in recordings(points=POINTS, seed=seed)]
    many = name_effects(MODEL, measurements(made), workers=2)
    before, after = ({one.id: one.size for one in discovery.smallest_visible} for discovery in (few, many))
    assert before.keys() == after.keys()
    assert all(after[effect] <= size for effect, size in before.items())
    assert after["guide_leakage"] / before["guide_leakage"] == pytest.approx(0.5, rel=0.2)  # four times as many


@pytest.mark.slow
def test_what_shows_where_it_was_fitted_only_is_not_named() -> None:
    """Every second operating point is held out: a nozzle worn at the others only does not pay there."""
    worn = recordings((sized("orifice_area", v_H=0.03),), points=POINTS)
    new = recordings(points=POINTS)
    mixed = [worn[0], new[1], new[2], worn[3]]  # like the squares of a chessboard
    discovery = name_effects(MODEL, measurements(mixed), workers=2)
    assert "orifice_area" not in [one.id for one in discovery.effects]


def test_gain_and_offset_of_the_sensor_at_the_fit_are_both_undone() -> None:
    made = recordings((sized("orifice_area", v_H=0.05),))
    changed = [replace(one, line_pressure=1.006 * (one.line_pressure + 0.3e6)) for one in made]
    shape = dict.fromkeys(HealthyShape.model_fields, (0.0,) * KNOTS.size)
    left = {"variance": WHITE, "colour": WHITE, "shape": shape, "line_pressure_offset_MPa": 0.3}
    fitted = NOMINAL.model_copy(update={"baseline": baseline(healthy=left, line_pressure_sensor_gain=0.006)})
    findings = answer(DiscoveryTask(fitted, measurements(changed), (), {"a": "0", "b": "1"}), lambda _: None)
    assert [one.id for one in findings.effects] == ["orifice_area"]
    assert all(one.passed for one in findings.checks if one.id == "rail_line_offset")


def test_recordings_of_one_point_hold_nothing_out() -> None:
    measured = measurements(recordings((sized("orifice_area", v_H=0.05),), points=POINTS[:1]))
    discovery = name_effects(MODEL, measured, workers=2)
    assert "orifice_area" in [one.id for one in discovery.effects]
