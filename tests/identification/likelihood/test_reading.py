"""Notes on recordings before `fit` and `discover` judge them."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.files.tables_in_memory import signals_of
from observer_rt.identification.likelihood.coverage import coverage
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.provenance import without_copies
from observer_rt.identification.likelihood.reading import measured_recordings
from tests.device import simulated
from tests.identification.discovery.hidden import recordings

POINT = ((100e6, 1.0e-3),)
RIGHT = simulated(3, 0.2, (60e6, 120e6), seed=5)
SECTION = {
    "time": {"column": "t", "unit": "s"},
    "rail_pressure": {"column": "p1", "unit": "Pa"},
    "needle_lift": {"column": "x", "unit": "m"},
    "line_pressure": {"column": "p2", "unit": "Pa"},
}


def said(source: SignalStream) -> str:
    output = io.StringIO()
    measured_recordings([source], load_injector(), Console(file=output, width=200))
    return output.getvalue()


def test_exchanged_columns_are_named_by_what_they_do() -> None:
    table = {"t": RIGHT.time, "p1": RIGHT.line_pressure, "x": RIGHT.needle_lift, "p2": RIGHT.rail_pressure}
    assert "'p2' does what a rail's does, 'p1' what a line's does" in said(signals_of(table, SECTION))
    assert said(HeldSignals(RIGHT)) == ""


def test_copies_are_left_out_and_named(tmp_path: Path) -> None:
    first, second, copy = (tmp_path / name for name in ("one.csv", "other.csv", "copy.csv"))
    for path, text in ((first, "1"), (second, "2"), (copy, "1")):
        path.write_text(text)
    output = io.StringIO()
    assert without_copies([first, second, copy, first], Console(file=output, width=500)) == [first, second, first]
    assert output.getvalue() == f"warning: {copy} is left out: a copy of {first}\n"


def test_gaps_and_what_they_cost_are_named() -> None:
    (recording,) = recordings(points=POINT)
    (complete,) = measurements([recording])
    opening = complete.events[1].openings[0]
    rail, lift = recording.rail_pressure.copy(), recording.needle_lift.copy()
    rail[:27] = np.nan  # far from any injection
    lift[opening.first + 20 : opening.first + 29] = np.nan
    (measurement,) = measurements([replace(recording, rail_pressure=rail, needle_lift=lift)])
    first, second = coverage(measurement).splitlines()
    assert first.endswith("36 missing, 1 of 2 injections judged")
    assert second == (f"  left out, samples are missing in it or beside it: at {recording.time[opening.first]:.4f} s")
    assert coverage(complete).endswith("samples at 100000 Hz, none missing, 2 of 2 injections judged")
