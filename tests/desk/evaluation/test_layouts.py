"""One recording in fifty layouts: the same masses, or a refusal with the section that gives them."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.config.injector import RecordingConfig
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.formats import guessed, read_recording
from observer_rt.files.guess.guess import guess_of
from observer_rt.files.signals.column import columns_of
from observer_rt.files.signals.recording import Recording
from observer_rt.files.tables import recording_of
from observer_rt.foundation.errors import UserError
from tests.device import simulated
from tests.files.layouts import LAYOUTS, Layout

OURS = simulated(3, 0.2, (60e6, 120e6), seed=5)


def masses(recording: Recording) -> list[float]:
    """What is injected [kg]."""
    (evaluation,) = evaluate(load_bench(), [recording]).evaluations
    return [report.mass for report in evaluation.reports]


def read(made: Any, layout: RecordingConfig | None = None, folder: Path = Path()) -> Recording:
    """A file or a table, by a section of the bench file or without."""
    if not isinstance(made, Path):
        return recording_of(made, layout)
    if layout is None:
        return read_recording(made)
    bench = load_bench(folder / "bench.toml", off_bus=True)
    return read_recording(made, bench.injector)


@pytest.fixture(scope="module")
def known() -> list[float]:
    return masses(OURS)


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.name)
def test_a_layout_gives_the_same_masses(tmp_path: Path, layout: Layout, known: list[float]) -> None:
    made = layout.make(tmp_path, OURS)
    if layout.told:
        with pytest.raises(UserError, match=layout.told) as raised:
            read(made)
        section = "[recording]" + raised.value.remedy.partition("[recording]")[2]
        (tmp_path / "bench.toml").write_text(section)
        stated = RecordingConfig.model_validate(tomllib.loads(section)["recording"])
        found = read(made, stated, tmp_path)
    else:
        found = read(made)
    assert found.sample_rate == pytest.approx(OURS.sample_rate, rel=1e-9)
    assert found.samples == OURS.samples
    np.testing.assert_allclose(found.line_pressure, OURS.line_pressure, atol=20.0)
    np.testing.assert_allclose(found.needle_lift, OURS.needle_lift, atol=1e-10)
    np.testing.assert_allclose(masses(found), known, atol=1e-9)  # 1e-3 mg
    assert len(known) == 3


def test_a_table_without_a_time_names_the_rate_to_state() -> None:
    table = {
        "p_rail_bar": OURS.rail_pressure / 1e5,
        "lift_um": OURS.needle_lift * 1e6,
        "p_line_bar": OURS.line_pressure / 1e5,
    }
    with pytest.raises(UserError, match="time: no column looks like it") as raised:
        recording_of(table)
    assert "rate_hz = ..." in raised.value.remedy
    guess = guess_of("table", columns_of(table))
    section = {each.signal: dict(each.entries()) for each in guess.columns}
    found = recording_of(table, {**section, "rate_hz": 50e3})
    np.testing.assert_allclose(found.line_pressure, OURS.line_pressure)
    assert found.sample_rate == 50e3


def test_a_file_of_ours_needs_no_guess(tmp_path: Path) -> None:
    assert guessed(LAYOUTS[27].make(tmp_path, OURS)) is None
