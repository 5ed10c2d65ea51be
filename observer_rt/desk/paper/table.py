"""Ours beside the paper's scheme: quantities, scores, and the table on screen, as CSV."""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pandas as pd
from rich.table import Table

from observer_rt.desk.simulation.plant import Truth
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.units import Floats
from observer_rt.model.effective import Coefficients


class Estimator(StrEnum):
    """Estimators compared; the number counts the trainings before the injection."""

    MODEL = "model"
    PAPER = "paper, 1"
    PAPER_TRAINED_ON = "paper, 10"
    OURS = "ours, 1"
    OURS_TRAINED_ON = "ours, 10"


class EstimatorCurves(NamedTuple):
    """One injection as an estimator sees it, n samples: x3, phi (n, 3) [1/s], rate [m3/s]."""

    x_3: Floats
    phi: Floats
    rate: Floats


class WearCase(NamedTuple):
    """One injection of a nozzle worn by v_H: truth and estimates over its window; time [s] since energizing."""

    nozzle_wear: float
    time: Floats
    truth: EstimatorCurves
    estimates: dict[Estimator, EstimatorCurves]

    def mse(self, estimator: Estimator) -> float:
        """Mean squared error of x3 (28)."""
        return float(np.mean((self.estimates[estimator].x_3 - self.truth.x_3) ** 2))

    def mse_ratio(self, estimator: Estimator) -> float:
        """MSE of the model over that of an estimator; nan for the healthy nozzle, which leaves no error."""
        return self.mse(Estimator.MODEL) / self.mse(estimator) if self.nozzle_wear else float("nan")

    def mass_error(self, estimator: Estimator) -> float:
        """Relative error of the injected mass."""
        return float(np.trapezoid(self.estimates[estimator].rate) / np.trapezoid(self.truth.rate)) - 1.0


class Study(NamedTuple):
    """Everything the figures and the table are made of."""

    coefficients: Coefficients
    healthy: tuple[Truth, ...]
    """One injection of the model at every pressure of Fig. 3."""
    cases: tuple[WearCase, ...]

    def case(self, nozzle_wear: float) -> WearCase:
        """The case of one v_H of the sweep."""
        return next(case for case in self.cases if case.nozzle_wear == nozzle_wear)


OBSERVERS = tuple(estimator for estimator in Estimator if estimator is not Estimator.MODEL)


def _ratio(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 100.0 else f"{float(f'{value:.3g}'):.0f}"


def _printed(study: Study) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "v_H": f"{case.nozzle_wear:+.1f}",
            "MSE of x3, model": f"{case.mse(Estimator.MODEL):.2e}",
            **{f"MSE ratio: {observer}": _ratio(case.mse_ratio(observer)) for observer in OBSERVERS},
            **{f"mass error [%]: {estimator}": f"{100 * case.mass_error(estimator):+.2f}" for estimator in Estimator},
        }
        for case in study.cases
    )


def screen_table(study: Study) -> Table:
    """Table for a terminal of 160 columns."""
    title = (
        "x3-MSE of the model over that of each observer, and errors of the injected mass [%], by nozzle wear; "
        "the number is that of trainings"
    )
    printed = _printed(study)
    headings = [heading.replace(": ", "\n").replace(", ", "\n") for heading in printed]
    return plain_table(headings, printed.itertuples(index=False), range(len(headings)), gap=1, title=title)


def csv_table(study: Study) -> str:
    """Every number of the table, and the MSE of every estimator, to six digits."""
    rows = [
        {
            "v_H": str(case.nozzle_wear),
            **{f"x3_mse_{_key(estimator)}": case.mse(estimator) for estimator in Estimator},
            **{f"x3_mse_ratio_{_key(observer)}": case.mse_ratio(observer) for observer in OBSERVERS},
            **{f"mass_error_pct_{_key(estimator)}": 100 * case.mass_error(estimator) for estimator in Estimator},
        }
        for case in study.cases
    ]
    return str(pd.DataFrame(rows).to_csv(index=False, float_format="%.6g", lineterminator="\r\n"))


def _key(estimator: Estimator) -> str:
    return estimator.replace(", ", "_").replace(" ", "_")
