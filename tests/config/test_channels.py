"""Delays and lags that a bench file states: where each of them is undone, and which are refused."""

from pathlib import Path

import pytest

from observer_rt.config.bench import BenchInjector, load_bench
from observer_rt.config.signals import (
    Role,
    as_observed,
    as_sent,
    effects_after_alignment,
    effects_on_one_raster,
    undone_in_alignment,
)
from observer_rt.foundation.errors import UserError
from observer_rt.model.effect import SizedEffect
from tests.config.test_bench import BENCH, bench_file

ALL = {
    "rail_pressure": "filter_delay_us = 20",
    "needle_lift": "filter_delay_us = 12\nlag_us = 15.9",
    "line_pressure": "filter_delay_us = 5\nlag_us = 3",
}


def stated(folder: Path, **keys: str) -> BenchInjector:
    return load_bench(bench_file(folder, with_keys(BENCH, **keys))).injector


def with_keys(text: str, **keys: str) -> str:
    for role, lines in keys.items():
        text = text.replace(f"[signals.{role}]\n", f"[signals.{role}]\n{lines}\n")
    return text


def sizes(effects: tuple[SizedEffect, ...]) -> dict[str, float]:
    return {each.effect.id: round(1e6 * each.values[0], 9) for each in effects}


def on_one_raster(injector: BenchInjector) -> tuple[SizedEffect, ...]:
    return effects_on_one_raster(injector.config.signals, injector.location)


def test_nothing_stated_changes_nothing(tmp_path: Path) -> None:
    injector = stated(tmp_path)
    assert on_one_raster(injector) == effects_after_alignment(injector.config.signals) == ()
    assert undone_in_alignment(injector.config.signals, Role.NEEDLE_LIFT) == 0.0


def test_alignment_moves_a_message_the_model_knows_the_rest(tmp_path: Path) -> None:
    injector = stated(tmp_path, **ALL)
    signals = injector.config.signals
    for role in (Role.RAIL_PRESSURE, Role.NEEDLE_LIFT):
        assert undone_in_alignment(signals, role) == pytest.approx(12e-6)
    lags = {"needle_lift_sensor_lag": 15.9, "line_pressure_sensor_lag": 3.0}
    assert sizes(effects_after_alignment(signals)) == {"rail_pressure_skew": 8.0, "channel_skew": 5.0, **lags}
    assert sizes(on_one_raster(injector)) == {"rail_pressure_skew": 8.0, "channel_skew": -7.0, **lags}


def test_a_rail_pressure_of_its_own_message_is_moved_by_its_own_delay(tmp_path: Path) -> None:
    text = with_keys(BENCH, rail_pressure="filter_delay_us = 20", needle_lift="filter_delay_us = 12")
    text = text.replace('message = "SampleBlock"', 'message = "RailBlock"', 1)
    signals = load_bench(bench_file(tmp_path, text)).injector.config.signals
    assert undone_in_alignment(signals, Role.RAIL_PRESSURE) == pytest.approx(20e-6)
    assert effects_after_alignment(signals) == ()


def test_too_far_apart_for_recordings(tmp_path: Path) -> None:
    injector = stated(tmp_path, line_pressure="filter_delay_us = 90", needle_lift="filter_delay_us = 20")
    with pytest.raises(UserError, match=r": signals\.line_pressure\.filter_delay_us: .*70 us"):
        on_one_raster(injector)


def test_what_is_stated_goes_away_in_samples_as_sent(tmp_path: Path) -> None:
    signals = stated(tmp_path, needle_lift="filter_delay_us = 12\nlag_us = 15.9").config.signals
    assert as_sent(signals) == stated(tmp_path).config.signals


def test_evidence_leaves_only_the_line_pressure_to_be_mended(tmp_path: Path) -> None:
    mended = as_observed(stated(tmp_path, **ALL).config.signals)
    assert undone_in_alignment(mended, Role.NEEDLE_LIFT) == 0.0
    assert sizes(effects_after_alignment(mended)) == {"channel_skew": 5.0, "line_pressure_sensor_lag": 3.0}
