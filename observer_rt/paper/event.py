"""One simulated injection as the paper looks at it: noise-free signals, the truth, the true fault (27)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.foundation.units import MICROMETRE
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import constant_network
from observer_rt.model.right_hand_side import fault_and_rate
from observer_rt.model.seat import normalised_area
from observer_rt.observer.observer import LEARNING_LEAD, SETTLE, WINDOW_LEAD, WINDOW_TAIL, Durations
from observer_rt.simulation.plant import Truth

SHUT = 1 * MICROMETRE  # lift up to which the needle counts as shut


@dataclass(frozen=True)
class InjectionWindow:
    """Samples first..last (last excluded) over which an injection is scored, and where the needle opens and shuts."""

    first: int
    last: int
    opening: int
    shut: int

    @property
    def span(self) -> slice:
        """The samples as a slice."""
        return slice(self.first, self.last)


def injection_windows(needle_lift: NDArray[np.float64], sample_rate: float) -> list[InjectionWindow]:
    """Windows of all strokes in a noise-free lift [m] (n,): 0.15 ms before opening to 0.5 ms after shutting."""
    is_open = np.concatenate([[False], needle_lift > SHUT, [False]])
    edges = np.flatnonzero(np.diff(is_open))
    lead, tail = round(WINDOW_LEAD * sample_rate), round(WINDOW_TAIL * sample_rate)
    return [
        InjectionWindow(int(opening) - lead, int(shut) + tail + 1, int(opening), int(shut))
        for opening, shut in zip(edges[::2], edges[1::2], strict=True)
    ]


def true_states(truth: Truth, c: Coefficients) -> NDArray[np.float64]:
    """x of (24) (n, 3)."""
    return np.column_stack(
        [
            (truth.line_pressure - c.chamber_pressure) / c.pressure_scale,
            truth.line_flow / c.flow_scale,
            (truth.sac_pressure - c.chamber_pressure) / c.pressure_scale,
        ]
    )


def inputs(truth: Truth, c: Coefficients) -> NDArray[np.float64]:
    """u of (24) (n, 2)."""
    area = [normalised_area(lift, c.seat) for lift in truth.needle_lift]
    return np.column_stack([(truth.rail_pressure - c.chamber_pressure) / c.pressure_scale, np.array(area)])


def true_fault(
    x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients, nozzle_wear: float
) -> NDArray[np.float64]:
    """Phi of (27) (n, 3) [1/s] for v_H, v_S = 0, along the true x (n, 3) and u (n, 2)."""
    network = constant_network(nozzle=nozzle_wear)
    return np.array(
        [
            fault_and_rate((row[0], row[1], row[2]), (col[0], col[1]), c, network)[0]
            for row, col in zip(x, u, strict=True)
        ]
    )


def learning_window(
    truth: Truth, injection: InjectionWindow, c: Coefficients, sample_rate: float
) -> tuple[Window, int]:
    """The event round one injection for the paper's pair, and the position of its first sample.

    From 1 ms before the opening to the end of the event gap; y = x_1 without noise, the line at its true state.
    """
    first = injection.opening - round(LEARNING_LEAD * sample_rate)
    last = injection.shut + round(Durations().event_gap * sample_rate)
    samples = np.arange(first, last)
    x, u = true_states(truth, c)[first:last], inputs(truth, c)[first:last]
    settled = injection.shut + round(SETTLE * sample_rate)
    window = Window(
        inputs=u,
        output=x[:, 0].copy(),
        resting=(samples < injection.opening) | (samples > settled),
        start=np.array([x[0, 0], x[0, 1], 0.0, x[0, 0]]),
        opening=injection.opening - first,
    )
    return window, first
