"""Notes on recordings before `fit` and `discover` judge them."""

import io
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.files.tables_in_memory import signals_of
from observer_rt.identification.likelihood.reading import measured_recordings, without_copies
from tests.device import simulated

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
