"""Mean innovations of a healthy injector at the judged samples of a recording."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.healthy_course import EventStretch, expected
from observer_rt.identification.likelihood.events import JudgedEvent
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.baseline import HealthyShape


def stretches(measurement: Measurement) -> tuple[EventStretch, ...]:
    """Every event as a stretch of judged samples, with edges where the ramps of the lift meet 0."""
    return tuple(
        EventStretch(event.end - event.counted, measurement.interval, measurement.rail_pressure, _edges(event))
        for event in measurement.events
    )


def expected_of(shape: HealthyShape, measurement: Measurement) -> NDArray[np.float64]:
    """Mean innovation [Pa] of a healthy injector at the counted samples (n,) of a recording."""
    return np.concatenate([expected(shape, stretch) for stretch in stretches(measurement)])


def _edges(event: JudgedEvent) -> tuple[tuple[float, float], ...]:
    edges = []
    for opening in event.openings:
        opens, shuts = float(opening.first), float(opening.last)
        if opening.rising.slope > 0.0:
            opens -= opening.rising.lift / opening.rising.slope
        if opening.falling.slope > 0.0:
            shuts += opening.falling.lift / opening.falling.slope
        edges.append((opens - event.counted, shuts - event.counted))
    return tuple(edges)
