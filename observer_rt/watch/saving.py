"""An injection that was seen, kept as files: its samples as a table, its summary for programs."""

import json
from pathlib import Path

import numpy as np

from observer_rt.foundation.file_errors import file_errors
from observer_rt.service.reports.injection_record import known
from observer_rt.watch.injection import SeenInjection

_HEADER = (
    "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa,"
    "published_rate_mm3_per_ms,nominal_rate_mm3_per_ms,phi1,phi2,phi3"
)


def save_injection(seen: SeenInjection, folder: Path, name: str) -> Path:
    """Write `injection_[NAME_]NUMBER.csv`, and `.json` beside it. Returns the table's path.

    name: of the injector, empty for the only one. Raises `ObserverError` when they cannot be written.
    """
    number = f"{seen.summary.injection_number:.0f}"
    path = folder / f"injection_{f'{name}_' if name else ''}{number}.csv"
    curves = seen.curves
    columns = [
        curves.time.astype(np.float64) * 1e-3,
        curves.rail_pressure,
        curves.needle_lift * 1e-3,
        curves.line_pressure,
        curves.rate,
        curves.nominal,
        *curves.phi,
    ]
    said = seen.summary._asdict() | {"nominal_mass": seen.nominal_mass}
    document = {key: known(value) for key, value in said.items()} | {"moment_ns": seen.moment}
    with file_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=_HEADER, comments="")
        path.with_suffix(".json").write_text(json.dumps(document, indent=2, allow_nan=False))
    return path
