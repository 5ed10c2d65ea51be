"""The columns of a batch's table of injections."""

from typing import Any

import pyarrow as pa

from observer_rt.evaluation.injections import RESULT_FIELDS, InjectionResult
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_record import FIELDS, INDICATORS, Output, columns_of, row_of

_KINDS = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
_COLUMNS = {**columns_of(FIELDS, Output.PARQUET), **columns_of(RESULT_FIELDS, Output.PARQUET)}
SCHEMA = pa.schema(
    [
        ("file", pa.string()),
        ("sha256", pa.string()),
        ("injector", pa.string()),
        ("time", pa.timestamp("us", tz="UTC")),
        *((name, _KINDS[kind]) for name, kind in _COLUMNS.items()),
    ]
)
"""time: of the injection's begin."""
OLD_NAMES = {
    "mass_ci95_low_mg": "mass_low_mg",
    "mass_ci95_high_mg": "mass_high_mg",
    **{
        column: f"{each.name}{end}"
        for each in INDICATORS
        for column, end in zip(each.columns, ("", "_low", "_high"), strict=True)
        if column != each.name
    },
}
"""What columns were called before they had the journal's names."""


def table_row(result: InjectionResult, c: Coefficients) -> dict[str, Any]:
    """What is said of an injection, by column; file, hash, injector and time are for whoever knows them."""
    report = row_of(FIELDS, Output.PARQUET, result.report, c)
    return {**report, **row_of(RESULT_FIELDS, Output.PARQUET, result, c)}
