"""The table of a rate meter: time and injection rate, with headings that may stand behind #, in any dialect."""

from pathlib import Path

import numpy as np

from observer_rt.config.injector import RecordingConfig, TimeConfig
from observer_rt.files.signals.csv_dialect import dialect_of
from observer_rt.files.signals.csv_table import CsvTable
from observer_rt.files.signals.naming import chosen, entries
from observer_rt.files.signals.table import TIME
from observer_rt.files.signals.table_signals import MASS_RATE_UNITS, UNITS
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors

RATE = "injection_rate"
_HEADED = "write names and units of both columns above the numbers, such as: # time [ms], rate [mg/ms]"


def mass_of_rate(path: Path, density: float) -> float:
    """Mass [kg] that a rate meter's table holds: the trapezoidal integral of the rate over the time.

    density: of the fuel [kg/m3]. Raises `UserError` for headings that do not say which column is which, in which
    unit, and for a row that is no measurement, with its line.
    """
    with file_errors(path):
        dialect = dialect_of(path, None, fewest=2)
        choices = {signal: chosen(signal, dialect.headings) for signal in (TIME, RATE)}
        if problems := [f"{name}: {choice.problem}" for name, choice in choices.items() if choice.problem]:
            raise UserError(f"{path}, line {dialect.heading}", "; ".join(problems), _HEADED)
        columns = {name: TimeConfig.model_validate(dict(entries(choice))) for name, choice in choices.items()}
        others = ("rail_pressure", "needle_lift", "line_pressure")  # which a meter has not
        table = CsvTable(path, RecordingConfig.model_construct(None, **dict.fromkeys(others), **columns))
        parts = list(table.parts(0))
    time = np.concatenate([part.time for part in parts])
    rate = np.concatenate([part.signals[RATE] for part in parts])
    bad = np.flatnonzero(~np.isfinite(rate + time) | (np.diff(time, prepend=-np.inf) <= 0.0))
    if bad.size or time.size < 2:
        problem = "the time does not rise, or a value is missing" if bad.size else "holds one row only"
        location = table.location(int(bad[0]) if bad.size else 0, 0)
        raise UserError(location, problem, "give one row for each instant, in the order of time")
    unit = choices[RATE].unit
    factor = UNITS[TIME].get(choices[TIME].unit, 1.0) * UNITS[RATE][unit]
    return float(np.trapezoid(rate, time)) * factor * (1.0 if unit in MASS_RATE_UNITS else density)
