"""The columns of a batch's table of injections."""

import pyarrow as pa

from observer_rt.evaluation.injections import RESULT_FIELDS
from observer_rt.service.reports.injection_record import INDICATORS, Output, columns_of

_KINDS = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
SCHEMA = pa.schema(
    [
        ("file", pa.string()),
        ("sha256", pa.string()),
        ("injector", pa.string()),
        ("time", pa.timestamp("us", tz="UTC")),
        *((name, _KINDS[kind]) for name, kind in columns_of(RESULT_FIELDS, Output.PARQUET).items()),
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
