"""The table of shots beside a recording, as an ECU exports it: when the injector was energized, a row a shot."""

from pathlib import Path

import numpy as np

from observer_rt.config.injector_sections import RecordingConfig, TimeConfig
from observer_rt.files.signals.csv_dialect import dialect_of
from observer_rt.files.signals.csv_table import CsvTable
from observer_rt.files.signals.naming import unit_of
from observer_rt.files.signals.table import TIME
from observer_rt.files.signals.table_signals import TableSignals
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.units import MILLISECOND, TIME_UNITS

_START, _LENGTH = ("start", "beginn", "début", "debut"), ("length", "duration", "dauer", "länge", "durée", "duree")
_HEADED = "write names and units of both above the numbers: start_s,length_us"


def take_shots(path: Path, stream: TableSignals) -> None:
    """Tell the signals of a recording, by the table beside it, when the injector was energized.

    Raises `UserError` for a recording that a table cannot tell of, for headings without names or units, and for a row
    that is no shot of the recording after the one above it.
    """
    bounds = np.ravel([(part.start, part.start + part.samples / stream.sample_rate) for part in stream.stretches])
    if "energizing" in stream.optional or np.any(np.diff(bounds) < 0.0):
        problem = "is beside a recording that has a column 'energizing', or whose time begins anew"
        raise UserError(str(path), problem, "rename or delete this table or the column; or split the file there")
    with file_errors(path):
        dialect = dialect_of(path, None, fewest=2, remedy=_HEADED)
        timed = {heading: unit for heading in dialect.headings if (unit := unit_of(TIME, heading))}
        named = [[column for column in timed if column.name.lower().startswith(words)] for words in (_START, _LENGTH)]
        if [len(found) for found in named] != [1, 1]:
            problem = f"no start and length with units of time: {', '.join(head.name for head in dialect.headings)}"
            raise UserError(f"{path}, line {dialect.heading}", problem, _HEADED)
        columns = [TimeConfig(column=heading.name) for (heading,) in named]
        layout = dict.fromkeys(("rail_pressure", "line_pressure")) | {TIME: columns[0], "energizing": columns[1]}
        # as in our own layouts every line below the names is a row
        table = CsvTable(path, RecordingConfig.model_construct(None, **layout), is_own=True, may_be_cut=False)
        parts = [(part.time, part.signals["energizing"]) for part in table.parts(0)]
    start, length = np.concatenate(parts, axis=1) * [[TIME_UNITS[timed[heading]]] for (heading,) in named]
    end = start + length
    before = np.concatenate((bounds[:1], end[:-1]))
    is_shot = (start >= before) & (length * stream.sample_rate >= 1.0) & (end <= bounds[-1])
    for row in np.flatnonzero(~is_shot)[:1].tolist():
        problem = f"{start[row]:.6g} to {end[row]:.6g} s is no shot between {before[row]:.6g} and {bounds[-1]:.6g} s"
        remedy = "give start and length, of a sample at least, one after the other, by the time of the recording"
        raise UserError(table.location(row, 0), problem, remedy)
    note = f"{path}: {end.size} shots of {length.min() / MILLISECOND:.4g} to {length.max() / MILLISECOND:.4g} ms"
    stream.edges, stream.optional = np.ravel((start, end), order="F"), (*stream.optional, "energizing")
    stream.notes += (note,)
    stream.details = (*(stream.details or (f"{stream.path}: our own layout",)), note)
