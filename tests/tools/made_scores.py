"""Scores made by hand."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.score import NOMINAL, OBSERVER, UKF, CaseScore, EstimatorScore


def score(mass_factor: NDArray[np.float64] | float = 1.0, **changes: object) -> CaseScore:
    """20 events of 50 mg, scored right unless told otherwise."""
    true = np.full(20, 50.0)
    made = CaseScore(
        class_name="orifice_area",
        master_seed=1,
        number=0,
        change_event=None,
        nozzle_wear=0.3,
        varying=False,
        true_mass_mg=tuple(true),
        window_samples=(200,) * 20,
        estimators=(
            EstimatorScore(OBSERVER, tuple(true * mass_factor), (0.01,) * 20, (1e-6,) * 20),
            EstimatorScore(NOMINAL, tuple(true * 0.8), (100.0,) * 20, (1e-4,) * 20),
        ),
        valid=(False, False, *(True,) * 18),
        reasons=("",) * 20,
        mass_ci95_mg=((49.0, 51.0),) * 20,
        training_ms=(5.0,) * 20,
        rate_judged=(100,) * 20,
        rate_covered=(95,) * 20,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


UKF_SCORE = EstimatorScore(UKF, (50.05,) * 20, (0.01,) * 20)


def factors(**at: float) -> NDArray[np.float64]:
    """1 for every event but those named event_N (from 1)."""
    result = np.ones(20)
    for name, value in at.items():
        result[int(name.removeprefix("event_")) - 1] = value
    return result
