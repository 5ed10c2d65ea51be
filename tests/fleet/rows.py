"""Rows as a batch writes them, made up."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import pyarrow as pa

from observer_rt.fleet.job import SCHEMA

BEGIN = datetime(2026, 1, 1, tzinfo=UTC)


def rows(sha256: str, injector: str, nozzle: Sequence[float], day: int = 0, **more: Any) -> pa.Table:
    """Injections of one recording, a second apart, that estimate these v_H with a sigma of .01."""
    made = [
        {
            "file": f"{sha256}.csv",
            "sha256": sha256,
            "injector": injector,
            "time": BEGIN + timedelta(days=day, seconds=number),
            "number": number,
            "valid": True,
            "nozzle_v_H": value,
            "nozzle_v_H_ci95_low": value - 0.0196,
            "nozzle_v_H_ci95_high": value + 0.0196,
            "seat_v_S": 0.0,
            "seat_v_S_ci95_low": -0.0196,
            "seat_v_S_ci95_high": 0.0196,
            **more,
        }
        for number, value in enumerate(nozzle, 1)
    ]
    return pa.Table.from_pylist(made, SCHEMA)
