"""The closed loop by seeds: hidden effects refused by the daemon, found in its evidence, taken over, masses right."""

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from observer_rt.desk.demonstration.missing_effect import SPEED, EffectDemo, hidden_effect
from observer_rt.foundation.errors import ObserverError
from tools.benchmarks.command_line import JsonOption, SeedOption, app, tracked
from tools.benchmarks.report import Columns, put_out, table_of

UNLEARNED = 1  # injections before the first that may be valid
RIGHT_PCT = 0.5  # of every valid mass after the effect was taken over
WRONG_PCT = 3.0  # of a valid mass at any time


@dataclass(frozen=True)
class Loop:
    """One run: what was hidden and said, valid injections before and after, largest error of a valid mass [%]."""

    hidden: str
    said: str
    valid_before: int
    valid_after: int
    injections_after: int
    error_before_pct: float
    error_after_pct: float
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether all injections that can be are valid afterwards, and right."""
        return self.valid_after == self.injections_after > 0 and self.error_after_pct <= RIGHT_PCT

    @property
    def is_wrong(self) -> bool:
        """Whether anything was valid and wrong."""
        return max(self.error_before_pct, self.error_after_pct) > WRONG_PCT


COLUMNS: Columns[Loop] = {
    "hidden": "{.hidden}",
    "said": "{.said}",
    "valid before": "{.valid_before}",
    "valid after": lambda run: f"{run.valid_after} of {run.injections_after}",
    "largest error before, %": "{.error_before_pct:.2f}",
    "after, %": "{.error_after_pct:.2f}",
    "right": lambda run: "yes" if run.is_right else "WRONG" if run.is_wrong else "no",
    "s": "{.seconds:.0f}",
}


def looped(seed: int, outside: bool) -> Loop:
    """Run one loop, in a process of its own: it is stopped by a signal, as a daemon is."""
    hidden, begin = hidden_effect(seed, outside), time.monotonic()
    with TemporaryDirectory() as folder:
        try:
            result = EffectDemo(Path(folder) / "demo", hidden, seed, SPEED, lambda _: None).run()
        except ObserverError as error:
            return Loop(hidden.words, str(error).splitlines()[0], 0, 0, 0, 0.0, 0.0, time.monotonic() - begin)
    before = [row for row in result.injections if not row.amended]
    after = [row for row in result.injections if row.amended][UNLEARNED:]
    then, now = (
        max((abs(100.0 * (row.mass / row.true - 1.0)) for row in rows if row.valid), default=0.0)
        for rows in (before, after)
    )
    named = " + ".join(effect["id"] for effect in result.findings["effects"])
    return Loop(
        hidden.words,
        f"{result.findings['verdict']} {named}".strip(),
        sum(row.valid for row in before),
        sum(row.valid for row in after),
        len(after),
        then,
        now,
        time.monotonic() - begin,
    )


@app.command(epilog="Example: tools/vcan tools/bench loop --cases 20 --seed 100")
def loop(
    cases: Annotated[
        int, typer.Option(min=1, help="Runs; every second effect is outside the vocabulary.")
    ] = 20,
    seed: SeedOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Hidden effects from the daemon's refusal to valid masses, by seeds; on vcan0 where there is one."""
    runs: dict[str, Loop] = {}
    spawned = multiprocessing.get_context("spawn")
    for number in tracked(range(cases), "loops"):
        with ProcessPoolExecutor(1, spawned) as alone:
            name = f"{seed + number}{' outside' * (number % 2)}"
            runs[name] = alone.submit(looped, seed + number, bool(number % 2)).result()
    figures: dict[str, Any] = {
        "cases": cases,
        "right": sum(run.is_right for run in runs.values()),
        "wrong_and_valid": sum(run.is_wrong for run in runs.values()),
    }
    said = "right: {right} of {cases}; wrong while valid: {wrong_and_valid}".format(**figures)
    put_out(as_json, {"figures": figures}, [table_of("the loop closed", "seed", runs, COLUMNS), said])
