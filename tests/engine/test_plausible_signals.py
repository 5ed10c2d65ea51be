"""Signals in a wrong unit are refused with the column and the likely unit, all others are not; notes on a lift."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from observer_rt.config.bench import load_injector
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.signal_survey import Survey, implausible, refuse_implausible, swapped
from observer_rt.files.signals.doubts import doubts, refuse_dead
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import sized
from tests.baselines import baseline


@cache
def recorded(pressure: float = 100e6, noise: bool = True) -> Recording:
    schedule = make_schedule([pressure], 2, 0.03, [1.1e-3])
    levels = SimulatedNoise() if noise else None
    return simulate(load_injector(), schedule, 50e3, (sized("orifice_area", v_H=0.3),), levels).recording


def problems(recording: Recording) -> list[str]:
    return [each.signal for each in implausible(HeldSignals(recording).survey)]


def test_pressures_that_are_swapped_from_the_middle_on() -> None:
    short = recorded()
    repeated = {name: np.tile(values, 6) for name, values in short.signals.items()}
    time = np.arange(6 * short.samples, dtype=np.float64) / short.sample_rate
    made = short.with_arrays({"time": time, **repeated})
    later = np.arange(made.samples) >= made.samples // 2
    pressures = np.array([made.rail_pressure, made.line_pressure])
    rail, line = np.where(later, pressures[::-1], pressures)
    exchanged = made.with_arrays({"rail_pressure": rail, "line_pressure": line})
    assert swapped(HeldSignals(exchanged).survey) is None
    assert "most likely the two are swapped" in doubt_text(exchanged)
    assert "swapped" not in doubt_text(made)


@pytest.mark.parametrize("noise", [True, False])
@pytest.mark.parametrize("pressure", [15e6, 30e6, 100e6, 200e6, 280e6])
def test_recordings_as_they_should_be(pressure: float, noise: bool) -> None:
    assert problems(recorded(pressure, noise)) == []


@pytest.mark.parametrize(
    ("signals", "factor", "unit"),
    [
        (("rail_pressure", "line_pressure"), 10.0, "bar"),
        (("rail_pressure", "line_pressure"), 1e3, "kPa"),
        (("rail_pressure", "line_pressure"), 1e6, "Pa"),
        (("rail_pressure", "line_pressure"), 1e-6, "MPa, if read as Pa"),
        (("rail_pressure", "line_pressure"), 1e299, "check the unit"),
        (("line_pressure",), 10.0, "bar"),
        (("line_pressure",), 0.1, "MPa, if read as bar"),
        (("needle_lift",), 1e3, "um"),
        (("needle_lift",), 1e-3, "mm, if read as um"),
    ],
)
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("pressure", [60e6, 150e6])
def test_a_wrong_unit_is_named(signals: tuple[str, ...], factor: float, unit: str, pressure: float) -> None:
    right = recorded(pressure)
    wrong = right.with_arrays({name: right.signals[name] * factor for name in signals})
    with pytest.raises(UserError, match=rf"(?s)a\.csv, ({'|'.join(signals)}).*: .*remedy: .*{unit}"):
        refuse_implausible(Path("a.csv"), HeldSignals(wrong).survey)


def test_low_pressures_ten_times_too_large_on_one_sensor_are_seen_beside_the_other() -> None:
    right = recorded(30e6)
    assert problems(right.with_arrays({"line_pressure": right.line_pressure * 10.0})) == ["line_pressure"]
    assert problems(right.with_arrays({"rail_pressure": right.rail_pressure * 10.0})) == ["line_pressure"]


def test_an_inverted_lift() -> None:
    right = recorded()
    assert problems(right.with_arrays({"needle_lift": -right.needle_lift})) == ["needle_lift"]
    assert problems(right.with_arrays({"needle_lift": 0.3e-3 - right.needle_lift})) == ["needle_lift"]


def test_a_dead_or_frozen_signal_is_for_the_observer_to_judge() -> None:
    right = recorded()
    nothing, missing = np.zeros(right.samples), np.full(right.samples, np.nan)
    for name in ("rail_pressure", "line_pressure"):
        assert problems(right.with_arrays({name: nothing})) == []
        assert problems(right.with_arrays({name: missing})) == []
        assert problems(right.with_arrays({name: right.signals[name] + 8e6})) == []
    assert problems(right.with_arrays({"needle_lift": nothing})) == []
    assert problems(right.with_arrays({"needle_lift": np.full(right.samples, 0.2e-3)})) == []


def test_noise_of_a_shut_needle_is_no_lift_in_a_wrong_unit() -> None:
    noise = np.random.default_rng(0).normal(0.0, 0.4e-6, recorded().samples)
    assert problems(recorded().with_arrays({"needle_lift": noise})) == []


def test_the_column_of_the_file_is_named() -> None:
    wrong = recorded().with_arrays({"needle_lift": recorded().needle_lift * 1e3})
    with pytest.raises(UserError, match=r"a\.csv, Nadelhub \(needle_lift\)"):
        refuse_implausible(Path("a.csv"), HeldSignals(wrong).survey, {"needle_lift": "Nadelhub"})


def test_pressures_that_are_swapped_or_negative() -> None:
    """A line rings beyond the rail at both ends."""
    made = recorded()
    assert swapped(HeldSignals(made).survey) is None
    exchanged = made.with_arrays({"rail_pressure": made.line_pressure, "line_pressure": made.rail_pressure})
    odd = swapped(HeldSignals(exchanged).survey)
    assert odd is not None
    assert "swapped" in odd[0]
    assert problems(made.with_arrays({"line_pressure": -made.line_pressure})) == ["line_pressure"]


def doubt_text(recording: Recording, fitted: tuple[float, float] | None = None) -> str:
    of = None if fitted is None else baseline(rail_pressure_MPa=fitted)
    return "; ".join(doubt.problem for doubt in doubts(HeldSignals(recording).survey, of))


@pytest.mark.parametrize("noise", [True, False])
def test_nothing_is_doubted_of_a_recording_as_it_should_be(noise: bool) -> None:
    assert doubt_text(recorded(100e6, noise), (60.0, 140.0)) == ""


@pytest.mark.parametrize("name", ["rail_pressure", "line_pressure"])
def test_a_pressure_that_never_moves_is_doubted(name: str) -> None:
    complete = recorded(100e6, True)
    held = complete.with_arrays({name: np.full(complete.samples, 100e6)})
    assert f"{name} is 100 MPa all the time, though the needle opens" in doubt_text(held)


def test_pressures_far_from_those_fitted_at_are_doubted() -> None:
    text = doubt_text(recorded(10e6, True), (59.8, 140.4))
    assert "is 10 MPa in the mean, and the model was fitted at 59.8 to 140.4 MPa" in text


def test_missing_values_are_told() -> None:
    complete = recorded(100e6, True)
    line = complete.line_pressure.copy()
    line[::7] = np.nan
    often = complete.with_arrays({"line_pressure": line})
    gaps = -(-complete.samples // 7)
    assert f"line_pressure: {gaps} of {complete.samples} values are missing, in {gaps} gaps" in doubt_text(often)
    line = complete.line_pressure.copy()
    line[200:400] = np.nan
    once = complete.with_arrays({"line_pressure": line})
    assert "200 of" in doubt_text(once)


def test_a_signal_without_values_and_one_that_never_moves_are_refused() -> None:
    complete = recorded(100e6, True)
    values = ("rail_pressure", np.nan), ("needle_lift", np.nan), ("needle_lift", 0.0), ("line_pressure", 1e8)
    for name, value in values:
        dead = complete.with_arrays({name: np.full(complete.samples, value)})
        with pytest.raises(UserError, match=name):
            refuse_dead(None, HeldSignals(dead).survey)
    refuse_dead(None, HeldSignals(complete).survey)


@pytest.mark.parametrize("name", ["rail_pressure", "line_pressure"])
def test_a_lift_exchanged_with_a_pressure_is_named_from_what_both_do(name: str) -> None:
    made = recorded()
    mixed = made.with_arrays({name: made.needle_lift * 3e11, "needle_lift": made.signals[name] * 3e-12})
    (first, *_) = implausible(HeldSignals(mixed).survey)
    assert first.signal == name
    assert "opens as a needle's lift does" in first.problem


def test_a_ratio_of_units_names_both_columns_units() -> None:
    """Rail pressure in MPa, read as bar: it, or the line's, is in another unit."""
    made = recorded()
    (first,) = implausible(HeldSignals(made.with_arrays({"rail_pressure": made.rail_pressure / 10.0})).survey)
    assert "line_pressure is likely bar, or that of rail_pressure MPa, if read as bar" in first.remedy


@given(
    lift=arrays(np.float64, st.integers(1, 80), elements=st.floats(-5e-6, 60e-6)),
    opens=st.floats(2e-6, 50e-6),
    cuts=st.lists(st.integers(1, 79), max_size=4),
)
def test_the_needle_never_opens_more_often_than_told(
    lift: np.ndarray[tuple[int], np.dtype[np.float64]], opens: float, cuts: list[int]
) -> None:
    survey = Survey()
    for part in np.split(lift, sorted(cuts)):
        survey.take("needle_lift", part)
    is_open, openings = False, 0
    for value in lift:
        openings += int(not is_open and value > opens)
        is_open = bool(value > (0.5 * opens if is_open else opens))
    assert openings <= survey.openings.most <= lift.size


def test_a_value_that_is_missing_is_no_movement() -> None:
    lift = np.tile([0.0, np.nan, 30e-6, np.nan, 200e-6, 0.0], 7)
    survey = Survey()
    survey.take("needle_lift", lift)
    assert survey.openings.most == 7
