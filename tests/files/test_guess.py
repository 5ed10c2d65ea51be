"""Which column is which signal, among others that look like it; and what is left open."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.files.formats import guessed
from observer_rt.files.guess.guess import Guess, guess_of
from observer_rt.files.guess.naming import known_unit, signals_named, unit_in_name
from observer_rt.files.signals.column import columns_of
from observer_rt.files.tables import recording_of
from observer_rt.foundation.errors import UserError
from tests.device import simulated
from tests.files.layouts import GERMAN, columns, text

OURS = simulated(3, 0.2, (60e6, 120e6), seed=5, measured_rate=True)
Arrays = dict[str, NDArray[np.float64]]


def german() -> Arrays:
    return columns(OURS, GERMAN, 1e6)


def guess(table: Arrays) -> Guess:
    return guess_of("table", columns_of(table))


def chosen(found: Guess) -> dict[str, str | int]:
    return {each.signal: each.column for each in found.columns}


NAMED = {
    "time": "Zeit",
    "rail_pressure": "p_Rail",
    "needle_lift": "Nadelhub",
    "line_pressure": "p_Leitung",
}


def test_other_columns_are_left_alone() -> None:
    assert OURS.injection_rate is not None
    is_open = OURS.needle_lift > 20e-6
    others = {
        "Nr": np.arange(OURS.samples) + 1.0,
        "p_Rail_Soll [bar]": np.where(OURS.rail_pressure > 90e6, 1200.0, 600.0),
        "Strom [A]": np.where(is_open, 18.0, 0.0),
        "T_Rail [°C]": np.full(OURS.samples, 60.0),
        "Takt": np.where(is_open, 1.0, 0.0),
        "Einspritzverlauf [mm3/ms]": OURS.injection_rate * 1e6,
        "Drehzahl [1/min]": np.full(OURS.samples, 1500.0),
    }
    found = guess({**others, **german()})
    assert found.doubts == ()
    assert chosen(found) == {**NAMED, "injection_rate": "Einspritzverlauf"}
    assert "T_Rail" in found.others
    assert found.layout.injection_rate is not None
    assert found.layout.injection_rate.unit == "mm3/ms"


def test_a_needle_that_stays_shut_is_no_doubt_where_names_and_units_tell() -> None:
    table = {**german(), "Nadelhub [µm]": np.random.default_rng(1).normal(0.0, 0.4, OURS.samples)}
    assert guess(table).doubts == ()


@pytest.mark.parametrize(
    ("change", "doubt"),
    [
        ({"p_Rail_gefiltert [bar]": OURS.rail_pressure / 1e5}, "rail_pressure: could be p_Rail_gefiltert, too"),
        ({"Nadelhub [µm]": 300.0 - OURS.needle_lift * 1e6}, "it goes down where the needle opens: inverted"),
        ({"p_Leitung [bar]": -OURS.line_pressure / 1e5}, "line_pressure: it is below zero: inverted"),
        ({"Zeit_2 [µs]": OURS.time * 1e6}, "time: could be Zeit_2, too"),
    ],
)  # fmt: skip
def test_a_second_choice_and_what_is_inverted_are_doubts(change: Arrays, doubt: str) -> None:
    found = guess({**german(), **change})
    assert doubt in "; ".join(found.doubts)
    assert chosen(found) == NAMED


def test_an_inverted_lift_that_rests_high_is_put_upright() -> None:
    found = guess({**german(), "Nadelhub [µm]": 300.0 - OURS.needle_lift * 1e6})
    lift = found.layout.needle_lift
    assert lift.factor == -1.0
    assert lift.offset == pytest.approx(300.0, abs=1.0)


@pytest.mark.parametrize("unit", ["V", "mV"])
def test_volts_ask_for_the_sensors_curve(unit: str) -> None:
    table = german()
    lift = table.pop("Nadelhub [µm]")
    found = guess({**table, f"U_Hub [{unit}]": lift / 100.0})
    assert any("state factor, offset and unit" in doubt for doubt in found.doubts)
    assert 'unit = "..."' in found.section()


@pytest.mark.parametrize(
    ("factor", "told"), [(1e-1, ("bar", "MPa")), (1.0, ("bar",)), (14.5, ("kPa", "psi"))]
)
def test_a_unit_is_guessed_only_where_one_is_possible(factor: float, told: tuple[str, ...]) -> None:
    """1200 is in bar; 120 could be MPa, or bar of a low-pressure system."""
    table = german()
    bare = {name.split(" [")[0]: values for name, values in table.items()}
    bare |= {name: factor * bare[name] for name in ("p_Rail", "p_Leitung")}
    found = guess(bare)
    doubted = "; ".join(found.doubts)
    assert ("unit is not stated: " + " or ".join(told) in doubted) is (len(told) > 1)


def test_without_names_what_signals_do_decides() -> None:
    table = dict(zip("abcd", german().values(), strict=True))
    order = ("d", "b", "a", "c")
    found = guess({name: table[name] for name in order})
    assert chosen(found) == {
        "time": "a", "rail_pressure": "b", "needle_lift": "c", "line_pressure": "d",
    }  # fmt: skip
    assert len(found.doubts) == 4


def test_a_column_without_a_name_has_all_given_by_place(tmp_path: Path) -> None:
    """As the index of a DataFrame in CSV."""
    path = tmp_path / "a.csv"
    path.write_text(text(OURS, ("", *GERMAN[1:])))
    found = guessed(path)
    assert found is not None
    assert chosen(found) == {
        "time": 1, "rail_pressure": 2, "needle_lift": 3, "line_pressure": 4,
    }  # fmt: skip
    assert found.doubts == ("time: its name does not say so",)
    assert found.layout.by_place


def test_a_rate_that_nothing_takes_is_told() -> None:
    table = {**german(), "Zeit [s]": OURS.time * 1e4}
    del table["Zeit [µs]"]
    found = guess(table)
    assert any("5 rows a second are too few or too many" in doubt for doubt in found.doubts)
    with pytest.raises(UserError, match="mind the time, and its unit"):
        _ = found.layout


@pytest.mark.parametrize(
    ("name", "signals"),
    [
        ("pRail", {"rail_pressure"}),
        ("CommonRailPressure", {"rail_pressure"}),
        ("Rail line pressure", {"rail_pressure"}),
        ("p_rail_set", set()),
        ("Raildruck Soll", set()),
        ("needle_lift", {"needle_lift"}),
        ("Düsennadelhub", {"needle_lift"}),
        ("daq/p_Leitung", {"line_pressure"}),
        ("p_inj", {"line_pressure"}),
        ("t", {"time"}),
        ("Temperature", set()),
        ("ROI", {"injection_rate"}),
        ("sample rate", {"injection_rate"}),
    ],
)
def test_names(name: str, signals: set[str]) -> None:
    assert signals_named(name) == signals


@pytest.mark.parametrize(
    ("signal", "unit", "known"),
    [
        ("rail_pressure", "Bar", "bar"),
        ("rail_pressure", "bar(g)", "bar"),
        ("rail_pressure", "bar abs", "bar"),
        ("rail_pressure", "mm", ""),
        ("needle_lift", "microns", "um"),
        ("time", "sec", "s"),
        ("line_pressure", "bar/s", ""),
    ],
)
def test_units(signal: str, unit: str, known: str) -> None:
    assert known_unit(signal, unit) == known


def test_units_at_the_end_of_names() -> None:
    assert unit_in_name("rail_pressure", "rail_pressure_MPa") == "MPa"
    assert unit_in_name("injection_rate", "injection_rate_mm3_per_ms") == "mm3/ms"
    assert unit_in_name("rail_pressure", "p_rail") == ""


def test_a_long_file_is_looked_at_only_at_its_beginning(tmp_path: Path) -> None:
    """As fast as that can be read, whatever follows."""
    head, *rows = text(OURS).splitlines()
    path = tmp_path / "long.csv"
    period = 1e6 / OURS.sample_rate
    rest = [f";{row.split(';', 1)[1]}" for row in rows] * 40
    path.write_text(head + "\n" + "\n".join(f"{k * period:.4f}{row}" for k, row in enumerate(rest)) + "\n")
    begin = time.process_time()
    found = guessed(path)
    assert time.process_time() - begin < 10.0
    assert found is not None
    assert found.doubts == ()
    assert found.rate == 50e3


def _odd(draw: st.DrawFn, size: int) -> NDArray[Any]:
    """A column as nobody would record it."""
    numbers = np.random.default_rng(draw(st.integers(0, 99)))
    kinds: tuple[Callable[[], NDArray[Any]], ...] = (
        lambda: np.arange(size) * 10.0 ** draw(st.integers(-9, 9)),
        lambda: np.full(size, draw(st.sampled_from((0.0, 1e300, np.nan, np.inf, 1000.0)))),
        lambda: numbers.normal(size=size) * 10.0 ** draw(st.integers(-300, 300)),
        lambda: 300.0 * (np.arange(size) % 50 < 5) * draw(st.sampled_from((-1.0, 1.0))),
        lambda: 1000.0 + numbers.normal(size=size),
        lambda: numbers.choice(np.array(["a", "1.000,5", "", "2026-01-01T00:00:00"], object), size),
        lambda: np.arange(size).astype("datetime64[us]"),
        lambda: numbers.integers(0, 2, size).astype(bool),
    )
    made: NDArray[Any] = draw(st.sampled_from(kinds))()
    return made


@st.composite
def odd_tables(draw: st.DrawFn) -> dict[str, NDArray[Any]]:
    names = st.sampled_from(
        ("t", "Zeit [ms]", "p_rail", "p_Line [bar]", "lift", "Hub [µm]", "rail [V]", "", "x")
    )
    size = draw(st.sampled_from((0, 1, 2, 3, 300, 3000)))
    return {name: _odd(draw, size) for name in draw(st.lists(names, min_size=1, max_size=6, unique=True))}


@settings(deadline=None)
@given(table=odd_tables())
def test_whatever_a_table_holds_it_is_read_or_refused_with_a_remedy(table: dict[str, NDArray[Any]]) -> None:
    try:
        samples = recording_of(table, name="odd").samples
    except UserError as error:
        told = str(error)
    else:
        assert samples >= 2
        return
    assert told.startswith("odd")
    assert "remedy: " in told
