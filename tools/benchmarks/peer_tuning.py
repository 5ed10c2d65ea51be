"""How the joint filters' noise settings were chosen: a grid, on cases of a seed used for nothing else.

Criterion: the mean, over one case of every class that must be estimated well, of the logarithm of the rate's RMSE,
so that neither the easy nor the hopeless classes decide. The ten best settings differ by 1 % (0.594 to 0.599 mm3/ms);
of these, one whose v_H may walk fastest is used, for it follows wear best.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from rich.table import Table

from observer_rt.foundation.units import MEGAPASCAL, MM3_PER_MS
from tools.benchmarks.cases import CLASSES, Group, make_case
from tools.benchmarks.command_line import ruled
from tools.benchmarks.kalman_peers import FilterResult, Tuning
from tools.benchmarks.peer_inputs import PeerInputs, peer_inputs
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.score import SCORED
from tools.benchmarks.windows import windows_of

TUNING_SEED = 77
WEAR_WALKS = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4)
MODEL_NOISES = (1e4, 3e4, 1e5)  # Pa
LINE_NOISES = (1.0, 2.0, 4.0)
FAILED = 100.0  # mm3/ms, RMSE of a filter that broke down

Filter = Callable[[PeerInputs, Tuning], FilterResult]


@dataclass(frozen=True)
class Trial:
    """A setting, and how well it did: the geometric mean of the RMSEs [mm3/ms]."""

    tuning: Tuning
    rmse: float


def grid() -> tuple[Tuning, ...]:
    """All settings tried."""
    return tuple(Tuning(*values) for values in product(WEAR_WALKS, MODEL_NOISES, LINE_NOISES))


def trials(run: Filter) -> Iterator[Trial]:
    """Every setting of the grid, tried on the tuning cases."""
    names = [name for name, c in CLASSES.items() if c.group is Group.MAIN]
    outcomes = [record(make_case(name, TUNING_SEED, 0).bench) for name in names]
    inputs = [peer_inputs(outcome.measured) for outcome in outcomes]
    for tuning in grid():
        logs = [math.log(_rmse(o, run(i, tuning))) for o, i in zip(outcomes, inputs, strict=True)]
        yield Trial(tuning, math.exp(float(np.mean(logs))))


def tuning_table(tried: Sequence[Trial]) -> Table:
    """Settings and what they gave, in this order."""
    headings = (
        "v_H walk a sample",
        "model noise [MPa]",
        "line noise [x true]",
        "RMSE, geometric mean [mm3/ms]",
    )
    table = ruled(f"noise settings, seed {TUNING_SEED}", (), headings)
    for trial in tried:
        t = trial.tuning
        table.add_row(
            f"{t.wear_walk:.0e}", f"{t.model_noise / MEGAPASCAL:g}", f"{t.line_noise:g}", f"{trial.rmse:.4f}"
        )
    return table


def _rmse(outcome: Outcome, result: FilterResult) -> float:
    if not result.survived:
        return FAILED
    interval = float(outcome.measured.time[1] - outcome.measured.time[0])
    windows = windows_of(outcome, 1.0 / interval)
    squares = windows.mean_squares((result.rate - outcome.truth.injection_rate) / MM3_PER_MS)
    return math.sqrt(float(np.mean(squares[SCORED])))
