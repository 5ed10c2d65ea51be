"""A campaign: cases worked through on a few processes, a row of facts each; figures of the rows beside their bars.

A row is a dict of columns, lists of single injections among them. An interrupted run goes on with the rows kept.
"""

import hashlib
import json
import math
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from scipy.special import bdtr, bdtrc

import observer_rt
from observer_rt.__main__ import LIBRARY_THREADS
from observer_rt.foundation.console import progress_bar
from observer_rt.foundation.errors import RunError
from tests.plants import plant

Row = dict[str, Any]
How = str | Callable[[pd.Series], Any]
"""How values are summed up: `p95`, `m95` of magnitudes, `of`, `spread`, what pandas has by name, or a function."""

INTERRUPTED = 130  # exit code
NOTHING = "-"  # in the place of a figure without values
CHANCE = 0.01  # of a coverage of 95 % showing what is seen: below it is another one
SOURCES = (Path(observer_rt.__file__).parent, Path(__file__).parent, Path(plant.__file__).parent)
SUFFIXES = {".py", ".pyx", ".pxd", ".pxi", ".c"}
messages = Console(stderr=True)


@dataclass(frozen=True)
class Bar:
    """A figure of the rows and its limits.

    of: query of the rows that count; by: column, of whose groups the worst is judged; from_values: fewer are not.
    """

    name: str
    column: str
    how: How
    least: float = -math.inf
    most: float = math.inf
    of: str = ""
    by: str = ""
    from_values: int = 1

    @property
    def limits(self) -> str:
        texts = ((f">= {self.least:g}", self.least), (f"<= {self.most:g}", self.most))
        return " ".join(text for text, limit in texts if math.isfinite(limit))


@cache
def state_of_the_code() -> str:
    digest = hashlib.sha256()
    for folder in SOURCES:
        for path in sorted(path for path in folder.rglob("*") if path.suffix in SUFFIXES):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def run_cases(
    what: str, work: Callable[..., Row], cases: Mapping[str, tuple[Any, ...]], jobs: int, out: Path
) -> pd.DataFrame:
    """A row for every case, by its label: `work`, a function of a module, called with its arguments in a process.

    A case that raises has its error in the column `failed`, and is worked again the next time. Raises RunError where
    a process is killed, `typer.Exit` when interrupted.
    """
    kept = out / f"{what}.jsonl"
    rows = {label: row for label, row in _kept_rows(kept).items() if label in cases}
    missing = {label: arguments for label, arguments in cases.items() if label not in rows}
    if rows and missing:
        messages.print(f"{what}: {len(rows)} of {len(cases)} are there already, in {kept}")
    out.mkdir(parents=True, exist_ok=True)
    os.environ.update(dict.fromkeys(LIBRARY_THREADS, "1"))  # the processes share the cores already
    ignored = (signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), signal.signal, ignored)
    with kept.open("a") as file, progress_bar(messages, what, len(missing)) as progress, pool:
        try:
            futures = {pool.submit(_attempt, work, each): label for label, each in missing.items()}
            for number, future in enumerate(as_completed(futures), 1):
                label = futures[future]
                rows[label] = {"label": label, **future.result()}
                if "failed" not in rows[label]:
                    file.write("\n" + json.dumps([state_of_the_code(), rows[label]]))
                    file.flush()
                progress(float(number))
        except BrokenProcessPool:
            raise RunError(f"a process of the bench was killed; {kept} is kept, run it again") from None
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            messages.print(f"interrupted; {kept} is kept, the same command goes on")
            raise typer.Exit(INTERRUPTED) from None
    return frame_of(rows[label] for label in cases if label in rows)


def frame_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as they are when read again, with a column of failures."""
    frame = pd.DataFrame(json.loads(json.dumps(list(rows))))
    return frame.assign(failed=frame.get("failed"))


def values_of(rows: pd.DataFrame, column: str) -> pd.Series:
    """Numbers of a column, lists taken apart, without those that are missing; none where no row has the column."""
    if column not in rows:
        return pd.Series(dtype=float)
    return rows[column].explode().dropna().infer_objects()


def summed_up(values: pd.Series, how: How) -> Any:
    """A figure of values: nan, or a dash, without any, but for a sum or a count."""
    if callable(how):
        return how(values) if len(values) else math.nan
    if how in ("of", "spread") and not len(values):
        return NOTHING
    if how == "of":
        return f"{int(values.sum())}/{len(values)}"
    if how == "spread":  # of magnitudes
        return " / ".join(f"{np.percentile(np.abs(list(values)), q):.3g}" for q in (50, 95, 100))
    if how[1:].isdigit():
        numbers = values.astype(float).abs() if how[0] == "m" else values.astype(float)
        return float(np.percentile(numbers, int(how[1:]))) if len(values) else math.nan
    return values.agg(how) if len(values) or how in ("sum", "count") else math.nan


def tally(values: pd.Series) -> str:
    """Values with how often they are there, the most frequent first."""
    return ", ".join(f"{value} {count}" for value, count in values.value_counts().items())


def chance_of_95(flags: pd.Series) -> float:
    """How likely intervals of 95 % hold as seldom, or as often, as these; least bar: CHANCE."""
    held, count = int(flags.sum()), len(flags)
    return min(1.0, 2.0 * float(min(bdtr(held, count, 0.95), bdtrc(held - 1, count, 0.95))))


def judged(frame: pd.DataFrame, bars: Sequence[Bar]) -> pd.DataFrame:
    """Figures by name: value, bar, met or not (None: nothing to judge), of how many values, where it is worst."""
    verdicts = []
    for bar in bars:
        rows = _counted(frame[frame["failed"].isna()].infer_objects(), bar)
        groups = dict(iter(rows.groupby(bar.by, sort=False))) if bar.by and len(rows) else {"": rows}
        values = {str(name): values_of(group, bar.column) for name, group in groups.items()}
        figures = {name: float(summed_up(numbers, bar.how)) for name, numbers in values.items()}
        measured = {name: figure for name, figure in figures.items() if not math.isnan(figure)}
        is_most = math.isfinite(bar.most)
        worst = (max if is_most else min)(measured, key=lambda name: measured[name]) if measured else ""
        value, is_judged = measured.get(worst, math.nan), is_most or math.isfinite(bar.least)
        is_judged = is_judged and bool(measured) and len(values[worst]) >= bar.from_values
        met = bool(bar.least <= value <= bar.most) if is_judged else None
        verdicts.append((bar.name, value, bar.limits, met, len(values.get(worst, ())), worst))
    columns = ["figure", "value", "bar", "met", "values", "worst"]
    return pd.DataFrame(verdicts, columns=columns).set_index("figure")


def table(frame: pd.DataFrame, by: str, columns: Mapping[str, tuple[str, How]]) -> pd.DataFrame:
    """A row for each value of a column, and one for all; columns: heading -> (column, how it is summed up)."""
    rows = frame[frame["failed"].isna()]
    groups = [*rows.groupby(by, sort=False), ("all", rows)] if len(rows) else []
    return pd.DataFrame(
        {
            name: {heading: summed_up(values_of(group, column), how) for heading, (column, how) in columns.items()}
            for name, group in groups
        }
    ).T.rename_axis(by)


def conclude(
    frame: pd.DataFrame, bars: Sequence[Bar], tables: Mapping[str, pd.DataFrame], out: Path, lines: Iterable[str] = ()
) -> None:
    """Print verdict, tables by title and lines, keep all in `out`. Raises `typer.Exit` with 1 if a bar is missed."""
    verdict, failed = judged(frame, bars), frame[frame["failed"].notna()]
    failures = [f"failed: {row.label}: {row.failed}" for row in failed.itertuples()]
    out.mkdir(parents=True, exist_ok=True)
    frame.to_csv(out / "rows.csv", index=False)
    verdict.to_csv(out / "figures.csv")
    shown = verdict.assign(met=verdict["met"].map({True: "met", False: "MISSED", None: ""}))
    for title, columns in {**tables, f"figures of {len(frame)} cases": shown}.items():
        print(f"\n{title}\n{columns.to_string(na_rep=NOTHING, float_format='{:.4g}'.format)}")
    print("", *lines, *failures, f"rows: {out / 'rows.csv'}", sep="\n")
    if failures or verdict["met"].eq(False).any():
        raise typer.Exit(1)


def _counted(rows: pd.DataFrame, bar: Bar) -> pd.DataFrame:
    try:
        return rows.query(bar.of) if bar.of and len(rows) else rows
    except pd.errors.UndefinedVariableError:  # nothing of it was measured
        return rows[:0]


def _kept_rows(path: Path) -> dict[str, Row]:
    """Rows of this state of the code; the line that an interrupted run was writing does not count."""
    rows = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            state, row = json.loads(line)
        except ValueError:
            continue
        if state == state_of_the_code():
            rows[row["label"]] = row
    return rows


def _attempt(work: Callable[..., Row], arguments: tuple[Any, ...]) -> Row:
    try:
        return work(*arguments)
    except Exception as error:  # whatever it is: the campaign tells of it, and goes on
        return {"failed": f"{type(error).__name__}: {error}"}
