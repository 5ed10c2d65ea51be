"""Injections whose commands are lost, without a lift: rows of their own, with the mass that was injected."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.desk.evaluation.curves import InjectionResult
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.simulation.schedule import Schedule, Shot, energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.units import Floats
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import sized
from tests.desk.cli.injector_files import injector
from tests.desk.evaluation.documents import recording_json, screen_text

BENCH = load_bench().exact
JITTER = 8e-6  # s, of the needle's answers


class Lost(NamedTuple):
    """Evaluations of a recording with all commands and without those of some events, and the truth."""

    complete: Evaluation
    lacking: Evaluation
    made: Simulation

    def true_mass(self, row: InjectionResult) -> float:
        window = slice(row.start_index - self.lacking.first_index, row.end_index + 1 - self.lacking.first_index)
        volume = float(np.trapezoid(self.made.truth.injection_rate[window])) / self.made.recording.sample_rate
        return volume * row.density


def lost(model: Path, schedule: Schedule, events: Sequence[int], v_h: float, sample_rate: float = 50e3) -> Lost:
    """The recording of a worn injector, the commands of whose events, by number from 0, are lost."""
    bench = BENCH.with_parameters(load_injector(model))
    effects = (sized("orifice_area", v_H=v_h),)
    made = simulate(bench.injector.parameters, schedule, sample_rate, effects, SimulatedNoise(), seed=8)
    time = made.recording.time
    commands = energized(schedule, time, JITTER, 8)
    starts = [schedule.events[number].start for number in events]
    kept: Floats = commands * np.all([np.abs(time - start) > 5e-3 for start in starts], axis=0)
    recordings = [replace(made.recording, energizing=level).without_lift() for level in (commands, kept)]
    complete, lacking = (evaluate(bench, [recording]).evaluations[0] for recording in recordings)
    return Lost(complete, lacking, made)


@pytest.mark.parametrize(
    ("line", "v_h", "events"),
    [
        ("lump", 0.3, (0, 3)),
        pytest.param("wave", 0.3, (2, 5), marks=pytest.mark.slow),
        pytest.param("lump", -0.3, (5,), marks=pytest.mark.slow),
        pytest.param("wave", 0.0, (0, 1), marks=pytest.mark.slow),
    ],
)
def test_the_mass_is_that_injected_and_others_are_as_with_all_commands(
    line: str, v_h: float, events: Sequence[int], tmp_path: Path
) -> None:
    schedule = make_schedule([60e6, 140e6], 6, 0.06, [0.5e-3, 1.9e-3])
    case = lost(
        injector(tmp_path / "injector.toml", line, "seat" if line == "wave" else "nozzle"), schedule, events, v_h
    )
    rows = case.lacking.injections
    assert [row.number for row in rows] == [row.event for row in rows] == [1, 2, 3, 4, 5, 6]
    assert [row.number - 1 for row in rows if row.reason is Reason.NO_COMMAND] == [*events]
    for row, usual in zip(rows, case.complete.injections, strict=True):
        assert row.start == pytest.approx(usual.start, abs=0.05e-3)
        assert row.mass == pytest.approx(usual.mass, abs=usual.mass_bound)
        if row.reason is Reason.NO_COMMAND:
            assert not row.valid
            assert row.mass == pytest.approx(case.true_mass(row), rel=0.01)
            assert row.mass == pytest.approx(case.true_mass(row), abs=row.mass_bound)
    text = screen_text(case.lacking, coefficients(load_injector()))
    assert f"{len(events)} of 6 injections without a command: by the line pressure alone " in text
    assert f"mg of {sum(row.mass for row in rows) * 1e6:.2f} mg in all" in text


@pytest.mark.parametrize("line", ["lump", pytest.param("wave", marks=pytest.mark.slow)])
def test_shots_of_an_event_are_told_apart(line: str, tmp_path: Path) -> None:
    """Before the first event is known at all; at twice the sample rate as well."""
    shots = [Shot(0.35e-3, -2.5e-3), Shot(1.1e-3, 0.0), Shot(0.4e-3, 2.0e-3)]
    path = injector(tmp_path / "injector.toml", line, "seat" if line == "wave" else "nozzle")
    case = lost(path, make_schedule([120e6], 1, 0.06, shots=shots), [0], 0.3, 100e3)
    rows = case.lacking.injections
    assert [(row.number, row.event, row.reason) for row in rows] == [(k, 1, Reason.NO_COMMAND) for k in (1, 2, 3)]
    assert [row.mass for row in rows] == pytest.approx([case.true_mass(row) for row in rows], rel=0.015)


def test_an_injection_that_the_pressure_does_not_tell_has_no_mass() -> None:
    """A line that an injection lets fall swings; this one is 6 MPa lower for 4 ms."""
    schedule = make_schedule([100e6], 3, 0.1, [0.8e-3])
    sound = simulate(load_injector(), schedule, 50e3, (), SimulatedNoise(), seed=3).recording
    since = sound.time - 0.21
    dip = np.where((since > 0.0) & (since < 4e-3), 6e6 * np.sin(since * math.pi / 4e-3), 0.0)
    odd = replace(sound, line_pressure=sound.line_pressure - dip, energizing=energized(schedule, sound.time))
    (evaluation,) = evaluate(BENCH, [odd.without_lift()]).evaluations
    c = coefficients(load_injector(NOMINAL_INJECTOR))
    before, row, *after = recording_json(evaluation, c)["injections"]
    assert (row["number"], row["mass_mg"], row["nominal_mass_mg"], row["reasons"]) == (2, None, None, ["NO_COMMAND"])
    assert row["start_s"] == pytest.approx(0.21, abs=1e-3)
    assert row["rail_pressure_MPa"] == pytest.approx(100.0, abs=0.6)
    assert [each["valid"] for each in (before, *after)] == [True] * 3
    assert "; 1 without a mass, which no sum has" in screen_text(evaluation, c)


def test_an_injection_that_a_lift_does_not_show_is_counted() -> None:
    schedule = make_schedule([100e6], 5, 0.06, [0.8e-3])
    seen = simulate(load_injector(), schedule, 50e3, (), SimulatedNoise(), seed=8).recording
    shut = np.roll(seen.needle_lift, round(20e-3 * 50e3))
    lift = np.where(np.abs(seen.time - schedule.events[3].start) > 5e-3, seen.needle_lift, shut)
    (evaluation,) = evaluate(BENCH, [replace(seen, needle_lift=lift)]).evaluations
    assert (len(evaluation.reports), evaluation.counters.unseen_injections) == (4, 1)
    assert "injections: 1 more that the lift did not show" in screen_text(evaluation, coefficients(load_injector()))
