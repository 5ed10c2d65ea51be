"""What a fit states in an injector file of how well its model fits."""

from typing import Any

from observer_rt.engine.estimation.phases import Phase
from observer_rt.model.baseline import Baseline

WHITE = {phase.label: 1.0 for phase in Phase}
"""Of a model that leaves nothing but noise."""


def baseline(**changes: Any) -> Baseline:
    """Of an adequate model fitted to 36 injections at 100 kHz; changes: fields that differ."""
    stated: dict[str, Any] = {
        "adequate": True,
        "level": "file",
        "mass_share": 0.002,
        "sample_rate_Hz": 1e5,
        "injections": 36,
        "rail_pressure_MPa": (60.0, 140.0),
        "variance": WHITE,
        "chi2": WHITE,
        "colour": WHITE,
        "noise": {"rail_pressure_MPa": 0.1, "line_pressure_MPa": 0.15, "needle_lift_um": 0.4},
    }
    return Baseline.model_validate(stated | changes)
