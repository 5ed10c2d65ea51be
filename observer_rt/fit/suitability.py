"""Recordings that cannot calibrate a model, refused, and what is odd about those that can, said."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import POINT_DURATION, Measurement, open_time, rail_pressure_before
from observer_rt.evidence.operating_points import distinct
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

_RUN = 5  # equal samples at the edge of a range that are no chance
_FINE = 0.2  # share of equal neighbours, below which a signal is so noisy that a run of them is none
_FEW = 6  # injections, below which intervals are wide
BETWEEN_SAMPLES = 0.005  # of a mass, by instants SLOW apart: of the richer plant, every fifth sample
FAST, SLOW = 10e-6, 50e-6  # s between samples: edges of the lift lost nothing, and that
WORTH_A_WORD = 0.001  # of a mass


def refuse_clipped(found: Sequence[Measurement]) -> None:
    """Raise `UserError` for a signal that stays at the edge of its range."""
    for one in found:
        recording = one.recording
        signals = (
            ("rail_pressure", recording.rail_pressure, MEGAPASCAL, "MPa", True),
            ("line_pressure", recording.line_pressure, MEGAPASCAL, "MPa", True),
            ("needle_lift", recording.needle_lift, MICROMETRE, "um", False),  # clipped at 0 it serves
        )
        for name, values, unit, symbol, both in signals:
            clipped = _clipped(values, both)
            if clipped is not None:
                level, count = clipped
                raise UserError(
                    f"{recording.path or 'recording'}, {name}",
                    f"is clipped: {count} samples in a row are exactly {level / unit:.6g} {symbol}, the edge of "
                    "its range",
                    "record with a wider range",
                )


def _clipped(values: NDArray[np.float64], both: bool) -> tuple[float, int] | None:
    """The edge at which a noisy signal stays, and its longest run there; None where it does not."""
    present = values[np.isfinite(values)]
    if present.size < 2 or float(np.mean(np.diff(present) == 0.0)) > _FINE:
        return None  # so coarse, or so smooth, that equal samples say nothing
    for edge in (np.max, np.min)[: 2 if both else 1]:
        level = float(edge(present))
        steps = np.flatnonzero(np.diff(np.concatenate(([False], present == level, [False]))))
        longest = int(np.max(steps[1::2] - steps[::2]))
        if longest >= _RUN:
            return level, longest
    return None


def share_between_samples(one: Measurement) -> float:
    """Standard deviation of a mass, as a share: instants far apart miss where the needle leaves and meets its seat.

    A mean over the sample period does not, for it holds what flowed in between.
    """
    return 0.0 if one.means else BETWEEN_SAMPLES * max(0.0, (one.interval - FAST) / (SLOW - FAST))


def warnings(found: Sequence[Measurement]) -> list[str]:
    """What makes the result less sure, in sentences."""
    result = []
    events = [(one, event) for one in found for event in one.events]
    pressures = distinct(rail_pressure_before(event, one.recording) for one, event in events)
    durations = np.array([open_time(event, one.recording) for one, event in events])
    one_duration = float(np.ptp(durations)) < POINT_DURATION
    if pressures == 1 and one_duration:
        result.append(
            "one operating point only: what is fitted holds there and nowhere else for sure; add recordings at other "
            "rail pressures and energizing times, such as 60, 100 and 140 MPa by 0.6 and 1.9 ms"
        )
    elif pressures == 1:
        result.append("one rail pressure only: add recordings at others, such as 60 and 140 MPa")
    elif one_duration:
        result.append("one energizing time only: add recordings with others, such as 0.6 and 1.9 ms")
    if len(events) < _FEW:
        result.append(f"{len(events)} injections only: intervals are wide; record {_FEW} or more")
    between = max(map(share_between_samples, found))
    if between > WORTH_A_WORD:
        result.append(
            f"samples are instants at {found[0].recording.sample_rate:g} Hz: between them the edges of the lift are "
            f"lost, and masses are {between:.1%} (1 sigma) less sure, even if the verdict is adequate. Fit at "
            "the full rate of the bench (100 kHz); if samples are means over the sample period, state it: "
            'meaning = "mean" in [sampling] of the bench file (--bench)'
        )
    return result
