"""What is said of recordings before `fit` and `discover` judge them."""

import io
from pathlib import Path

from rich.console import Console

from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.files.tables import signals_of
from observer_rt.identification.likelihood.reading import read_measured
from tests.device import simulated

RIGHT = simulated(3, 0.2, (60e6, 120e6), seed=5)
SECTION = {
    "time": {"column": "t", "unit": "s"},
    "rail_pressure": {"column": "p1", "unit": "Pa"},
    "needle_lift": {"column": "x", "unit": "m"},
    "line_pressure": {"column": "p2", "unit": "Pa"},
}


def said(source: SignalStream) -> str:
    console = Console(file=io.StringIO(), width=200)
    read_measured([Path("a.csv")], lambda _: source, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_exchanged_columns_are_named_by_what_they_do() -> None:
    table = {"t": RIGHT.time, "p1": RIGHT.line_pressure, "x": RIGHT.needle_lift, "p2": RIGHT.rail_pressure}
    assert "'p2' does what a rail's does, 'p1' what a line's does" in said(signals_of(table, SECTION))


def test_nothing_is_said_of_a_recording_as_it_should_be() -> None:
    assert said(HeldSignals(RIGHT)) == ""
