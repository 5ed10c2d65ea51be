"""The closed loop by seeds: hidden effects refused by the daemon, found in its evidence, taken over, masses right."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from observer_rt.desk.demonstration.missing_effect import SPEED, EffectDemo, hidden_effect
from observer_rt.foundation.errors import ObserverError
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, conclude, run_cases, table

CASES = 20
UNLEARNED = 1  # injections before the first that may be valid
RIGHT_PCT, WRONG_PCT = 0.5, 3.0  # of every valid mass after the effect was taken over; of one at any time
BARS = (
    Bar("right_share", "right", "mean", least=0.9),
    Bar("wrong_and_valid", "wrong", "sum", most=0),
    Bar("error_after_max_pct", "error_after_pct", "max"),
    Bar("error_after_median_pct", "error_after_pct", "median"),
)
NOTHING = pd.DataFrame(columns=["amended", "valid", "error"], dtype=float)
COLUMNS: dict[str, tuple[str, How]] = {
    "said": ("said", ", ".join),
    "valid before": ("valid_before", "sum"),
    "valid after": ("valid_after", "sum"),
    "of": ("injections_after", "sum"),
    "largest error before, %": ("error_before_pct", "max"),
    "after, %": ("error_after_pct", "max"),
    "right": ("right", "of"),
    "wrong": ("wrong", "sum"),
    "s": ("seconds", "sum"),
}


def run_loop(seed: int, outside: bool) -> Row:
    """One loop: what was hidden and said, valid injections before and after, largest error of a valid mass [%]."""
    hidden, begin = hidden_effect(seed, outside), time.monotonic()
    with TemporaryDirectory() as folder:
        try:
            result = EffectDemo(Path(folder), hidden, seed, SPEED, lambda _: None).run()
        except ObserverError as error:
            said, rows = str(error).splitlines()[0], NOTHING
        else:
            named = " + ".join(effect["id"] for effect in result.findings["effects"])
            said = f"{result.findings['verdict']} {named}".strip()
            rows = result.injections
    before, after = rows[rows.amended == 0], rows[rows.amended == 1][UNLEARNED:]
    errors = rows.error.abs().where(rows.valid == 1, 0.0)
    then, now = (errors[each.index].max() if len(each) else 0.0 for each in (before, after))
    return {
        "hidden": f"{seed}: {hidden.words}",
        "said": said,
        "valid_before": int(before.valid.sum()),
        "valid_after": int(after.valid.sum()),
        "injections_after": len(after),
        "error_before_pct": then,
        "error_after_pct": now,
        "right": len(after) > 0 and bool(after.valid.all()) and now <= RIGHT_PCT,
        "wrong": max(then, now) > WRONG_PCT,
        "seconds": time.monotonic() - begin,
    }


@cli.app.command(epilog="Example: tools/vcan tools/bench loop --cases 20 --seed 100")
def loop(cases: cli.CasesOption = CASES, seed: cli.SeedOption = 1, out: cli.OutOption = None) -> None:
    """Hidden effects from the daemon's refusal to valid masses, by seeds; on vcan0 where there is one."""
    out = out or Path("build/loop")
    todo = {f"{seed + n}{' outside' * (n % 2)}": (seed + n, bool(n % 2)) for n in range(cases)}
    frame = run_cases("loop", run_loop, todo, 1, out)  # one after the other: in real time
    conclude(frame, BARS, {"the loop closed": table(frame, "hidden", COLUMNS)}, out)
