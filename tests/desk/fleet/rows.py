"""Rows as a batch writes them, made up, and what should be in them."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.fleet.job import SCHEMA
from observer_rt.files.formats import open_recording

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


def masses(path: Path, model: Path | None = None, learning: bool = True) -> list[float]:
    bench = load_bench(model=model)
    source = open_recording(path, bench.injector)
    (alone,) = evaluate(bench, [source], learning=learning, traces=()).evaluations
    return [1e6 * report.mass for report in alone.reports]


def campaign(injector: str, change: float) -> pa.Table:
    """Twelve recordings, ten days apart, between which nozzle flow changes so much."""
    return pa.concat_tables(rows(f"{injector}_{k}", injector, [change * k], day=10 * k) for k in range(12))
