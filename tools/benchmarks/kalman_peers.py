"""Peers: joint unscented and extended Kalman filters, v_H as a fourth state, on every sample.

Their noise settings were chosen from a grid, on cases of a seed used for nothing else. Criterion: the mean, over one
case of every class that must be estimated well, of the logarithm of the rate's RMSE, so that neither the easy nor the
hopeless classes decide. The ten best settings differ by 1 % (0.594 to 0.599 mm3/ms); of these, one whose v_H may walk
fastest is used, for it follows wear best.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np
import typer

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MM3_PER_MS
from tests.plants.arrays import Array
from tests.plants.plant import LINE_NOISE, RAIL_NOISE, Outcome, record
from tests.plants.windows import windows_of
from tools.benchmarks.cases import CLASSES, Group, make_case
from tools.benchmarks.command_line import app, tracked
from tools.benchmarks.peer_equations import (
    PRESSURE_SCALE,
    PeerInputs,
    Start,
    extended,
    peer_inputs,
    unscented,
)
from tools.benchmarks.report import Columns, list_of, put_out
from tools.benchmarks.score import SCORED

UNSCENTED_SHAPE = (0.5, 2.0, 0.0)  # alpha, beta, kappa
TUNING_SEED = 77
WEAR_WALKS = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4)
MODEL_NOISES = (1e4, 3e4, 1e5)  # Pa
LINE_NOISES = (1.0, 2.0, 4.0)
FAILED = 100.0  # mm3/ms, RMSE of a filter that broke down


@dataclass(frozen=True)
class Tuning:
    """Noise settings of a joint filter; sigmas per sample at 100 kHz.

    wear_walk: of v_H; model_noise: of p_L and p_S, for what the model does not know [Pa]; line_noise: of the
    measurement, as a multiple of the true one.
    """

    wear_walk: float
    model_noise: float
    line_noise: float


@dataclass(frozen=True, eq=False)
class FilterResult:
    """Rate [m3/s] and states (n, 4) [x1, x2, x3, v_H]; from where the filter broke down on, its last rate is 0."""

    rate: Array
    states: Array
    survived: bool


def start_of(inputs: PeerInputs, tuning: Tuning) -> Start:
    """The line at rest, v_H within +-0.5; a sample adds rail noise through the line's inertia, wear, model."""
    m, t, line = inputs.model, inputs.stream.interval, LINE_NOISE / PRESSURE_SCALE
    rail = np.array([0.5 * m.a1 * m.a3 * t * t, m.a3 * t, 0.0, 0.0]) * RAIL_NOISE / PRESSURE_SCALE
    scale = t / 1e-5
    model = (tuning.model_noise / PRESSURE_SCALE) ** 2 * scale
    return Start(
        np.array([inputs.stream.output[0], 0.0, 0.0, 0.0]),
        np.diag([line**2, 0.1**2, 1e-10, 0.3**2]),
        np.outer(rail, rail) + np.diag([model, 0.0, model, tuning.wear_walk**2 * scale]),
        (tuning.line_noise * LINE_NOISE / PRESSURE_SCALE) ** 2,
    )


def joint_ukf(inputs: PeerInputs, tuning: Tuning) -> FilterResult:
    """The joint UKF over a recording."""
    return _filtered(inputs, tuning, lambda *given: unscented(*given[:3], UNSCENTED_SHAPE, given[3]))


def joint_ekf(inputs: PeerInputs, tuning: Tuning) -> FilterResult:
    """The joint EKF over a recording."""
    return _filtered(inputs, tuning, extended)


def _filtered(inputs: PeerInputs, tuning: Tuning, run: Callable[..., bool]) -> FilterResult:
    states = np.full((inputs.stream.output.size, 4), np.nan)
    survived = run(inputs.stream, inputs.model, start_of(inputs, tuning), states)
    sac = states[:, 2]
    difference = sac / np.sqrt(np.sqrt(sac**2 + inputs.model.transition**2))
    rate = inputs.model.nozzle_flow * (1.0 + states[:, 3]) * difference
    return FilterResult(np.nan_to_num(rate), states, survived)


Filter = Callable[[PeerInputs, Tuning], FilterResult]


@dataclass(frozen=True)
class Trial:
    """A setting, and how well it did: the geometric mean of the RMSEs [mm3/ms]."""

    tuning: Tuning
    rmse: float


def trials(run: Filter) -> Iterator[Trial]:
    """Every setting of the grid, tried on the tuning cases."""
    names = [name for name, c in CLASSES.items() if c.group is Group.MAIN]
    outcomes = [record(make_case(name, TUNING_SEED, 0).bench) for name in names]
    inputs = [peer_inputs(outcome.measured) for outcome in outcomes]
    for values in tracked(list(product(WEAR_WALKS, MODEL_NOISES, LINE_NOISES)), "tuning"):
        tuning = Tuning(*values)
        logs = [math.log(_rmse(o, run(i, tuning))) for o, i in zip(outcomes, inputs, strict=True)]
        yield Trial(tuning, math.exp(float(np.mean(logs))))


COLUMNS: Columns[Trial] = {
    "v_H walk a sample": "{.tuning.wear_walk:.0e}",
    "model noise [MPa]": lambda trial: f"{trial.tuning.model_noise / MEGAPASCAL:g}",
    "line noise [x true]": "{.tuning.line_noise:g}",
    "RMSE, geometric mean [mm3/ms]": "{.rmse:.4f}",
}


def _rmse(outcome: Outcome, result: FilterResult) -> float:
    if not result.survived:
        return FAILED
    interval = float(outcome.measured.time[1] - outcome.measured.time[0])
    windows = windows_of(outcome, 1.0 / interval)
    squares = windows.mean_squares((result.rate - outcome.truth.injection_rate) / MM3_PER_MS)
    return math.sqrt(float(np.mean(squares[SCORED])))


FILTERS: dict[str, Filter] = {"ukf": joint_ukf, "ekf": joint_ekf}


@app.command(epilog="Example: tools/bench peer-tuning --peer ekf")
def peer_tuning(peer: Annotated[str, typer.Option(help="Which filter: ukf or ekf.")] = "ukf") -> None:
    """The grid the joint Kalman filters' noise settings were chosen from, best first (minutes)."""
    if peer not in FILTERS:
        raise UserError("--peer", f"unknown filter '{peer}'", f"known: {', '.join(FILTERS)}")
    found = sorted(trials(FILTERS[peer]), key=lambda trial: trial.rmse)
    put_out(False, None, [list_of(f"noise settings, seed {TUNING_SEED}", [found], COLUMNS, names=0)])
