"""Scores made by hand."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.score import NOMINAL, OBSERVER, UKF, CaseScore, EstimatorScore, Injection


def score(mass_factor: NDArray[np.float64] | float = 1.0, **changes: object) -> CaseScore:
    """20 events of one injection of 50 mg, scored right unless told otherwise, valid from the third on."""
    true = np.full(20, 50.0)
    valid = changes.setdefault("valid", (False, False, *(True,) * 18))
    assert isinstance(valid, tuple)
    made = CaseScore(
        class_name="orifice_area",
        master_seed=1,
        number=0,
        change_event=None,
        nozzle_wear=0.3,
        varying=False,
        true_mass_mg=tuple(true),
        true_opening_mass_mg=tuple(true),
        injections=tuple(Injection(event, (event,), each) for event, each in enumerate(valid)),
        window_samples=(200,) * 20,
        estimators=(
            estimator(OBSERVER, true * mass_factor, 0.01, 1e-6),
            estimator(NOMINAL, true * 0.8, 100.0, 1e-4),
        ),
        valid=valid,
        reasons=("",) * 20,
        mass_ci95_mg=((49.0, 51.0),) * 20,
        training_ms=(5.0,) * 20,
        rate_judged=(100,) * 20,
        rate_covered=(95,) * 20,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def estimator(
    name: str, masses: NDArray[np.float64], rate_square_error: float, *x3_square_error: float
) -> EstimatorScore:
    """An estimator's masses of 20 events [mg], and its errors, the same at every event."""
    each = tuple(masses.tolist())
    return EstimatorScore(name, each, each, (rate_square_error,) * 20, x3_square_error * 20)


UKF_SCORE = estimator(UKF, np.full(20, 50.05), 0.01)


def factors(**at: float) -> NDArray[np.float64]:
    """1 for every event but those named event_N (from 1)."""
    result = np.ones(20)
    for name, value in at.items():
        result[int(name.removeprefix("event_")) - 1] = value
    return result
