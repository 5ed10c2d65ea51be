"""The paper's Figs. 3-5 from our numbers, in its layout; the documentation says where they differ, and why."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from observer_rt.desk.paper.table import Estimator, Study, WearCase
from observer_rt.desk.simulation.schedule import FIRST_EVENT
from observer_rt.foundation.figures import save_figure
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MILLISECOND

TRUE, MODEL, PAPER, OURS = "#222222", "#1f77b4", "#ff7f0e", "#d62728"
LOOK: dict[Estimator, dict[str, Any]] = {
    Estimator.MODEL: {"label": "model without observer", "color": MODEL, "ls": "--"},
    Estimator.PAPER: {"label": "paper's scheme, one training", "color": PAPER, "ls": "-"},
    Estimator.OURS: {"label": "ours, one training", "color": OURS, "ls": (0, (4, 2))},
}
SHOWN = 6 * MILLISECOND  # of Fig. 3, after the start of energizing
MILLIGRAM_PER_MS = 1e-3  # kg/s
PER_MS = 1e3  # 1/s
TIME = "time from start of energizing [ms]"


def draw_figure_3(path: Path, study: Study) -> None:
    """Inputs and outputs of the model at the paper's three rail pressures."""
    figure, axes = plt.subplots(4, 3, figsize=(12, 9), sharex=True, sharey="row", layout="constrained")
    for column, truth in enumerate(study.healthy):
        shown = np.abs(truth.time - FIRST_EVENT - 0.5 * SHOWN) <= 0.5 * SHOWN + MILLISECOND
        time = (truth.time[shown] - FIRST_EVENT) / MILLISECOND
        mass_rate = truth.injection_rate * study.coefficients.density
        rows = (
            ("rail pressure\n$p_R$ [MPa]", truth.rail_pressure / MEGAPASCAL),
            ("needle lift\n$x_N$ [mm]", truth.needle_lift / MILLIMETRE),
            ("line pressure\n$p_L$ [MPa]", truth.line_pressure / MEGAPASCAL),
            ("mass injection rate\n$\\dot m$ [mg/ms]", mass_rate / MILLIGRAM_PER_MS),
        )
        for row, (label, values) in enumerate(rows):
            panel = axes[row, column]
            panel.plot(time, values[shown], color=TRUE if row < 2 else MODEL, lw=1.4)
            panel.grid(alpha=0.3)
            panel.set_xlim(time[0], time[-1])
            if column == 0:
                panel.set_ylabel(label)
        axes[0, column].set_title(f"rail pressure {truth.rail_pressure[0] / MEGAPASCAL:.0f} MPa")
        axes[3, column].set_xlabel(TIME)
    axes[0, 0].set_ylim(0, 160)
    axes[0, 2].legend(axes[0, 2].lines + axes[2, 2].lines, ["input", "model"], loc="lower right", frameon=False)
    figure.suptitle(
        "Fig. 3: simplified injector model, energizing time 1.9 ms\n"
        "our nominal parameters; no measurement is published, so there is none to compare with"
    )
    _save(path, figure)


def draw_figure_4(path: Path, case: WearCase) -> None:
    """One worn injection: x3 left, the identified fault right."""
    figure = plt.figure(figsize=(13, 6.5), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.15, 1))
    states = figure.add_subplot(grid[:, 0])
    _draw_x_3(states, case)
    states.set(title="(a) state $x_3$", xlabel=TIME, ylabel="$x_3 = (p_S - p_C)/p_0$ [-]")
    states.legend(frameon=False, loc="lower center")
    time = case.time / MILLISECOND
    first = None
    for row in range(3):
        panel = figure.add_subplot(grid[row, 1], sharex=first)
        first = first or panel
        panel.plot(time, case.truth.phi[:, row] / PER_MS, color=TRUE, lw=2.6, label="true fault (27)")
        for estimator in (Estimator.PAPER, Estimator.OURS):
            panel.plot(time, case.estimates[estimator].phi[:, row] / PER_MS, **LOOK[estimator])
        panel.set_ylabel(f"$\\phi_{row + 1}$ [1/ms]")
        panel.grid(alpha=0.3)
        panel.tick_params(labelbottom=row == 2)
        if row == 0:
            panel.set_title("(b) identified network output")
        if row == 1:
            panel.set_ylim(-0.4, 0.4)
            panel.legend(frameon=False, loc="upper center", ncols=3, fontsize=8)
        if row == 2:
            panel.set_xlabel(TIME)
    figure.suptitle(
        f"Fig. 4: nozzle wear $v_H$ = {case.nozzle_wear:g}, $v_S$ = 0, rail pressure 100 MPa, "
        "energizing time 1.9 ms, noise-free"
    )
    _save(path, figure)


def draw_figure_5(path: Path, study: Study) -> None:
    """x3 at the extremes of wear left, its mean squared error over v_H right."""
    figure = plt.figure(figsize=(13, 7.5), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.1, 1))
    for row, wear in enumerate((0.5, -0.5)):
        panel = figure.add_subplot(grid[row, 0])
        _draw_x_3(panel, study.case(wear))
        panel.set(title=f"(a) $x_3$ at $v_H$ = {wear:+g}", ylabel="$x_3$ [-]")
        if row == 0:
            panel.legend(frameon=False, loc="lower center")
        else:
            panel.set_xlabel(TIME)
    wears = np.array([case.nozzle_wear for case in study.cases])
    for row, scale in enumerate(("linear", "log")):
        panel = figure.add_subplot(grid[row, 1])
        for estimator, look in LOOK.items():
            panel.plot(wears, np.array([case.mse(estimator) for case in study.cases]), marker="o", ms=4, **look)
        panel.set(yscale=scale, ylabel="MSE of $x_3$ (28) [-]", xticks=wears)
        panel.grid(alpha=0.3)
        if row == 0:
            panel.set_title("(b) mean squared error of $x_3$ over nozzle wear")
            panel.legend(frameon=False, loc="upper center")
        else:
            panel.set(title="the same, logarithmic", xlabel="$v_H$ [-]")
    figure.suptitle(
        "Fig. 5: nozzle wear $v_H$ from -0.5 to 0.5, rail pressure 100 MPa, energizing time 1.9 ms, noise-free"
    )
    _save(path, figure)


def _draw_x_3(axes: Axes, case: WearCase) -> None:
    time = case.time / MILLISECOND
    axes.plot(time, case.truth.x_3, color=TRUE, lw=2.6, label="true (worn plant)")
    for estimator, look in LOOK.items():
        axes.plot(time, case.estimates[estimator].x_3, lw=1.4, **look)
    axes.set_xlim(time[0], time[-1])
    axes.grid(alpha=0.3)


def _save(path: Path, figure: plt.Figure) -> None:
    save_figure(figure, path, 120)
    plt.close(figure)
