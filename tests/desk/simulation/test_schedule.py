"""Option texts of `simulate`, the schedules they make, and needle strokes in closed form."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.core.model.needle import CORNER_ROUNDING, NeedleStroke, lift_of_stroke
from observer_rt.desk.simulation.schedule import (
    Schedule,
    Shot,
    make_schedule,
    parse_energizing_times,
    parse_rail_pressures,
    parse_shots,
    stroke,
    strokes,
)
from observer_rt.foundation.errors import UserError


@given(st.lists(st.floats(1.0, 100.0), min_size=1, max_size=8))
def test_rail_pressures_in_mpa_and_energizing_times_in_ms(values: list[float]) -> None:
    text = " , ".join(map(repr, values))
    assert parse_rail_pressures(text) == pytest.approx([value * 1e6 for value in values])
    assert parse_energizing_times(text) == pytest.approx([value * 1e-3 for value in values])


@given(st.lists(st.tuples(st.floats(0.001, 100.0), st.floats(-100.0, 100.0)), min_size=1, max_size=8))
def test_shots_in_ms(values: list[tuple[float, float]]) -> None:
    shots = parse_shots(",".join(f"{duration!r}@{offset!r}" for duration, offset in values))
    assert [shot.duration for shot in shots] == pytest.approx([duration * 1e-3 for duration, _ in values])
    assert [shot.offset for shot in shots] == pytest.approx([offset * 1e-3 for _, offset in values])


@given(st.text(max_size=20))
def test_parsers_give_values_or_a_user_error(text: str) -> None:
    for parse in (parse_rail_pressures, parse_energizing_times, parse_shots):
        with suppress(UserError):
            assert len(parse(text)) == text.count(",") + 1


@pytest.mark.parametrize(
    ("parse", "option", "texts"),
    [
        (parse_energizing_times, "--energizing-time", ["0", "-1", "1900", "1.9ms", ""]),
        (parse_shots, "--shots", ["0.3", "0.3@", "@1", "0@1", "0.3@-1.5,1.0", "0.3@1@2"]),
        (parse_rail_pressures, "--rail-pressure: '' is not a number", ["60,,100"]),
        (parse_rail_pressures, "--rail-pressure: '60;100' is not a number", ["60;100"]),
        (parse_rail_pressures, "--rail-pressure: 'nan' is not a number", ["nan"]),
        (parse_rail_pressures, "--rail-pressure: 0 MPa is out of range", ["0"]),
        (parse_rail_pressures, "--rail-pressure: -5 MPa is out of range", ["-5"]),
        (parse_rail_pressures, "--rail-pressure: 6e\\+07 MPa is out of range", ["60e6"]),
    ],
)
def test_bad_texts_are_named(parse: Callable[[str], object], option: str, texts: list[str]) -> None:
    for text in texts:
        with pytest.raises(UserError, match=option):
            parse(text)


@given(pressures=st.integers(1, 4), times=st.integers(1, 4), injections=st.integers(1, 20))
def test_events_cycle_through_pressures_and_times(pressures: int, times: int, injections: int) -> None:
    rail = [50e6 + 10e6 * i for i in range(pressures)]
    energizing = [0.5e-3 + 0.1e-3 * i for i in range(times)]
    events = make_schedule(rail, injections, 0.05, energizing).events
    assert [event.rail_pressure for event in events] == [rail[i % pressures] for i in range(injections)]
    assert [event.shots[0].duration for event in events] == [energizing[i % times] for i in range(injections)]
    assert [event.start for event in events] == pytest.approx([0.15 + 0.05 * i for i in range(injections)])


def test_shots_replace_energizing_times_and_are_sorted() -> None:
    shots = parse_shots("1.0@0,0.3@-1.5")
    schedule = make_schedule([100e6], 2, 0.05, [1.9e-3], shots)
    assert schedule.events[1].shots == (Shot(0.3e-3, -1.5e-3), Shot(1.0e-3, 0.0))


@pytest.mark.parametrize(("period", "tail"), [(0.1, 0.1), (0.01, 0.05)])
def test_the_last_event_has_time_to_close(period: float, tail: float) -> None:
    schedule = make_schedule([100e6], 3, period, [1e-3])
    assert schedule.duration == pytest.approx(0.15 + 2 * period + tail)


@pytest.mark.parametrize(
    ("arguments", "location"),
    [
        ({"injections": 0}, "--injections"),
        ({"period": 0.0}, "--period"),
        ({"period": float("nan")}, "--period"),
        ({"rail_pressures": []}, "--rail-pressure"),
        ({"energizing_times": []}, "--energizing-time"),
        ({"period": 0.001}, "--period"),
        ({"shots": [Shot(1e-3, 0.0), Shot(1e-3, 1e-3)]}, "--shots"),
        ({"shots": [Shot(1e-3, 0.0), Shot(1e-3, -0.5e-3)]}, "--shots"),
        ({"shots": [Shot(1e-3, -0.151)]}, "--shots"),
        ({"shots": [Shot(1e-3, 0.0), Shot(1e-3, 49.5e-3)]}, "--period"),
    ],
)
def test_impossible_schedules(arguments: dict[str, object], location: str) -> None:
    valid = {"rail_pressures": [100e6], "injections": 3, "period": 0.05, "energizing_times": [1e-3]}
    with pytest.raises(UserError, match=f"^{location}: "):
        make_schedule(**{**valid, **arguments})  # type: ignore[arg-type]


def test_rail_pressure_holds_during_events_and_moves_smoothly_between() -> None:
    schedule = make_schedule([60e6, 140e6, 100e6], 4, 0.05, [1.0e-3])
    time = np.arange(0.0, schedule.duration, 1e-5)
    pressure = schedule.rail_pressure(time)
    for event in schedule.events:
        around = (time > event.first_energizing - 5e-3) & (time < event.last_energizing + 5e-3)
        np.testing.assert_allclose(pressure[around], event.rail_pressure, rtol=1e-12)
    first_gap = (time > 0.151) & (time < 0.2)
    assert (np.diff(pressure[first_gap]) >= 0.0).all()
    assert np.interp(0.1755, time, pressure) == pytest.approx(100e6, rel=1e-6)
    # a ramp of 80 MPa in 24.5 ms, at most 1.875 times as steep as a straight one
    assert np.abs(np.diff(pressure)).max() == pytest.approx(1.875 * 80e6 / 24.5e-3 * 1e-5, rel=1e-3)


NOMINAL = load_injector()
START = 0.15


def placed(duration: float, rail_pressure: float = 100e6, offset: float = 0.0) -> NeedleStroke:
    result = stroke(Shot(duration, offset), START, rail_pressure, NOMINAL)
    assert result is not None
    return result


@pytest.mark.parametrize("rail_pressure", [40e6, 100e6, 160e6])
def test_full_stroke_keeps_delays_and_speeds(rail_pressure: float) -> None:
    s = placed(1.9e-3, rail_pressure, offset=-1e-3)
    energized = START - 1e-3
    rise = 0.3e-3 / (0.80 * (rail_pressure / 100e6) ** 0.4)
    fall = 0.3e-3 / (0.90 * (rail_pressure / 100e6) ** 0.3)
    assert s.opening == pytest.approx(energized + 0.32e-3, abs=1e-12)
    assert s.top - s.opening == pytest.approx(rise, rel=1e-9)
    assert s.closing == pytest.approx(energized + 1.9e-3 + 0.27e-3, abs=1e-12)
    assert s.closed - s.closing == pytest.approx(fall, rel=1e-9)


@pytest.mark.parametrize("rail_pressure", [40e6, 100e6, 160e6])
def test_an_opening_delay_that_falls_with_the_pressure(rail_pressure: float) -> None:
    changed = NOMINAL.needle.model_copy(update={"delay_exponent": 0.3})
    s = stroke(Shot(1.9e-3), START, rail_pressure, NOMINAL.model_copy(update={"needle": changed}))
    assert s is not None
    assert s.opening == pytest.approx(START + 0.32e-3 * (rail_pressure / 100e6) ** -0.3, abs=1e-12)
    assert s.closing == placed(1.9e-3, rail_pressure).closing


def test_ballistic_stroke_turns_before_the_stop() -> None:
    s = placed(0.25e-3)
    rise = 0.25e-3 + 0.27e-3 - 0.32e-3
    assert s.top == s.closing
    assert (peak := s.opening_speed * (s.top - s.opening)) == pytest.approx(0.8 * rise, rel=1e-6)
    assert peak < 0.3e-3
    assert s.closed - s.opening == pytest.approx(rise + 0.8 * rise / 0.9, rel=1e-6)
    highest = max(lift_of_stroke(time, s) for time in np.linspace(s.opening, s.closed, 2001))
    assert 0.9 * peak < highest < peak  # rounded


@pytest.mark.parametrize("duration", [0.01e-3, 0.049e-3])
def test_energizing_shorter_than_the_delays_allow_lifts_nothing(duration: float) -> None:
    assert stroke(Shot(duration), START, 100e6, NOMINAL) is None


@given(duration=st.floats(0.06e-3, 3e-3), rail_pressure=st.floats(20e6, 200e6), share=st.floats(-0.1, 1.1))
def test_rounded_lift_is_the_mean_of_the_straight_one(duration: float, rail_pressure: float, share: float) -> None:
    s = placed(duration, rail_pressure)
    time = s.opening + share * (s.closed - s.opening)
    window = time + CORNER_ROUNDING * (np.arange(2000) + 0.5 - 1000) / 2000
    peak = s.opening_speed * (s.top - s.opening)
    straight = np.interp(window, [s.opening, s.top, s.closing, s.closed], [0.0, peak, peak, 0.0])
    assert lift_of_stroke(time, s) == pytest.approx(straight.mean(), abs=1e-11)


@pytest.mark.parametrize(
    ("schedule", "option"),
    [
        (make_schedule([100e6], 1, 0.02, shots=[Shot(1e-3), Shot(0.3e-3, 1.1e-3)]), "--shots"),
        (make_schedule([100e6], 2, 1.2e-3, [1.1e-3]), "--period"),
    ],
)
def test_a_needle_that_has_no_time_to_close(schedule: Schedule, option: str) -> None:
    with pytest.raises(UserError, match=f"{option}: the needle has not closed"):
        strokes(schedule, NOMINAL)


def test_the_remedy_is_enough() -> None:
    shots = [Shot(1e-3), Shot(0.3e-3, 1.1e-3)]
    with pytest.raises(UserError) as raised:
        strokes(make_schedule([100e6], 1, 0.02, shots=shots), NOMINAL)
    later = float(raised.value.remedy.split("at least ")[1].split(" ms")[0]) * 1e-3
    shots[1] = Shot(0.3e-3, 1.1e-3 + later + 1e-6)
    assert len(strokes(make_schedule([100e6], 1, 0.02, shots=shots), NOMINAL)) == 2
