"""The columns of an injection's row, with units in their names."""

from typing import Any

import pyarrow as pa

from observer_rt.estimation.scalars import SCALARS
from observer_rt.evaluation.injections import InjectionResult
from observer_rt.evaluation.results import injection_json
from observer_rt.model.coefficients import Coefficients

_INDICATORS = tuple(shown.key or shown.effect for _, shown in SCALARS.shown())
_NUMBERS = (
    "start_s",
    "end_s",
    "rail_pressure_MPa",
    "energizing_time_us",
    "fuel_temperature_degC",
    "mass_mg",
    "mass_low_mg",
    "mass_high_mg",
    "nominal_mass_mg",
    "measured_mass_mg",
    "rate_rmse_mm3_per_ms",
    "nominal_rate_rmse_mm3_per_ms",
    *(f"{name}{bound}" for name in _INDICATORS for bound in ("", "_low", "_high")),
)
SCHEMA = pa.schema(
    [
        ("file", pa.string()),
        ("sha256", pa.string()),
        ("injector", pa.string()),
        ("time", pa.timestamp("us", tz="UTC")),
        ("number", pa.int64()),
        ("event", pa.int64()),
        *((name, pa.float64()) for name in _NUMBERS),
        ("valid", pa.bool_()),
        ("reasons", pa.string()),
        ("state", pa.string()),
        ("phi_version", pa.int64()),
    ]
)
"""`_low`, `_high`: 95 % intervals; time: of its begin; indicators have the units of `observer-rt evaluate --json`."""
_NAMES = tuple(SCHEMA.names)


def row_of(result: InjectionResult, has_energizing: bool, c: Coefficients) -> dict[str, Any]:
    """What is said of an injection, by column; file, hash, injector and time are for whoever knows them."""
    said = injection_json(result, has_energizing, c)
    low, high = said["mass_ci95_mg"] or (None, None)
    row = {
        **said,
        "mass_low_mg": low,
        "mass_high_mg": high,
        "reasons": " ".join(said["reasons"]),
        "energizing_time_us": (said.get("energizing") or {}).get("energizing_time_us"),
    }
    for name, estimate in said["indicators"].items():
        bounds = estimate["ci95"] or (None, None)
        row |= {name: estimate["value"], f"{name}_low": bounds[0], f"{name}_high": bounds[1]}
    return {name: row.get(name) for name in _NAMES}
