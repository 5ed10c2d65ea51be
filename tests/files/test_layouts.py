"""One recording in many layouts: the same signals, or a refusal with the section to write."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.files.formats import read_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.files.tables_in_memory import signals_of
from observer_rt.foundation.errors import UserError
from observer_rt.model.surroundings import Surroundings
from tests.device import simulated
from tests.files.layouts import LAYOUTS, Layout, text

OURS = simulated(3, 0.2, (60e6, 120e6), seed=5)


def read(made: Any) -> Recording:
    return read_recording(made) if isinstance(made, Path) else signals_of(made).collected()


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.name)
def test_a_layout_gives_the_same_recording(tmp_path: Path, layout: Layout) -> None:
    recording = read(layout.make(tmp_path, OURS))
    assert recording.sample_rate == pytest.approx(OURS.sample_rate, rel=1e-9)
    assert recording.samples == OURS.samples
    np.testing.assert_allclose(recording.rail_pressure, OURS.rail_pressure, atol=20.0)
    np.testing.assert_allclose(recording.line_pressure, OURS.line_pressure, atol=20.0)
    np.testing.assert_allclose(recording.needle_lift, OURS.needle_lift, atol=1e-10)


@pytest.mark.parametrize(
    ("names", "problem", "lacking"),
    [
        (("Zeit", "pRail", "Hub", "pLeitung"), "rail_pressure: 'pRail' has no unit", "unit"),
        (("Zeit [ms]", "A [bar]", "Hub [um]", "p_line_bar"), "rail_pressure: no heading names it", "column"),
        (("Zeit [ms]", "Rail [V]", "Hub [um]", "p_line_bar"), "'V' of 'Rail' is no unit of it", "column"),
    ],
)
def test_vague_headings_name_the_section(tmp_path: Path, names: tuple[str, ...], problem: str, lacking: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text(OURS, names, time=1e3, form=".5f"))
    with pytest.raises(UserError, match="do not say which column is which") as raised:
        read_recording(path)
    assert problem in raised.value.problem
    section = "[recording]" + raised.value.remedy.partition("[recording]")[2]
    places = section.partition("[recording.rail_pressure]")[2].partition("[recording.")[0]
    assert f"\n{lacking} = ..." in places or f'\n{lacking} = "..."' in places


def test_energizing_stands_for_the_lift_and_surroundings_have_names_of_their_own() -> None:
    table = {f"{name}_Pa": OURS.signals[name] for name in ("rail_pressure", "line_pressure")} | {"time_s": OURS.time}
    around = {
        "chamber_pressure_bar": np.full(OURS.samples, 50.0),
        "Fuel temperature [degC]": np.full(OURS.samples, 40),
    }
    recording = signals_of({**table, **around, "energizing": np.ones(OURS.samples)}).collected()
    assert recording.recorded == ("rail_pressure", "line_pressure", "energizing", *Surroundings._fields[::-1])
    assert [recording.signals[name][0] for name in Surroundings._fields] == [313.15, 5e6]


def test_a_table_without_a_time_is_read_by_its_rate() -> None:
    table = {
        "p_rail_bar": OURS.rail_pressure / 1e5,
        "lift_um": OURS.needle_lift * 1e6,
        "p_line_bar": OURS.line_pressure / 1e5,
    }
    with pytest.raises(UserError, match=r"(?s)time: no heading names it.*remedy: .*rate_hz"):
        signals_of(table).collected()
    units = zip(("rail_pressure", "needle_lift", "line_pressure"), table, ("bar", "um", "bar"), strict=True)
    mapping = {"rate_hz": 50e3, **{s: {"column": c, "unit": u} for s, c, u in units}}
    result = signals_of(table, mapping).collected()
    np.testing.assert_allclose(result.line_pressure, OURS.line_pressure)
    assert result.sample_rate == 50e3
    with pytest.raises(UserError, match="has neither needle_lift nor energizing"):
        signals_of(table, {**mapping, "needle_lift": None})
