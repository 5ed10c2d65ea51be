"""What the values of columns do: rise evenly, rest and open, fall while the needle is open; and in which unit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.signal_survey import LARGEST_LIFT, OPEN, PRESSURES
from observer_rt.files.signals.column import Values
from observer_rt.files.signals.pacing import Stamps
from observer_rt.files.signals.table_signals import UNITS

RATES = (1e3, 1e6)  # Hz, of what can be read
_OPEN = 0.3  # of the largest lift, above which a needle is open
_MOST_OPENINGS = 60
_LOWEST_PSI = 3000.0  # of a common rail; less is bar more likely
_AFTER = 0.5  # of an opening's length, in which the line still answers
_PLAUSIBLE_UNITS = {
    "time": ("s", "ms", "us"),
    "rail_pressure": ("Pa", "kPa", "bar", "MPa"),
    "needle_lift": ("m", "mm", "um"),
}


@dataclass(frozen=True)
class Pulses:
    """A signal that rests most of the time. rest: where; height: of the pulses from there, negative for downwards."""

    rest: float
    height: float

    @property
    def is_inverted(self) -> bool:
        """Whether it falls where a lift would rise."""
        return self.height < 0.0


def pulses_of(values: Values) -> Pulses | None:
    """The pulses of a signal (n,); None where it does not rest on one side of all else."""
    known = values[np.isfinite(values)]
    if known.size < 2:
        return None
    low, rest, high = (float(each) for each in np.percentile(known, (0.05, 50.0, 99.95)))
    up, down = high - rest, rest - low
    height = up if up > down else -down
    if height == 0.0 or min(up, down) > 0.2 * abs(height):
        return None
    resting = np.count_nonzero(np.abs(known - rest) < 0.2 * abs(height)) / known.size
    return Pulses(rest, height) if resting > 0.5 else None


def openings_of(lift: Values, pulses: Pulses) -> list[slice]:
    """Samples while the needle is open and a little after, of some injections."""
    is_open = (lift - pulses.rest) * np.sign(pulses.height) > _OPEN * abs(pulses.height)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_open, [False]))))
    spans = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    longest = max((end - begin for begin, end in spans), default=0)
    kept = [(begin, end) for begin, end in spans if end - begin > longest / 20]
    chosen = kept[:: max(1, len(kept) // _MOST_OPENINGS)]
    return [slice(begin, end + int(_AFTER * (end - begin)) + 1) for begin, end in chosen]


def movement(values: Values, openings: list[slice]) -> float:
    """Typical swing of a signal while the needle is open; NaN where it is not known."""
    swings = [np.ptp(part) for each in openings if (part := _known(values[each])).size]
    return float(np.median(swings)) if swings else np.nan


def _known(values: Values) -> Values:
    return values[np.isfinite(values)]


def is_pressure(values: Values) -> bool:
    """Whether a signal is far from zero beside what it moves: of one sign, the middle far from nothing."""
    known = _known(values)
    if known.size < 2:
        return False
    low, middle, high = np.percentile(known, (1.0, 50.0, 99.0))
    return bool(low * high > 0.0 and min(abs(low), abs(high)) > 0.1 * abs(middle))


def units_possible(signal: str, values: Values) -> tuple[str, ...]:
    """Units in which values of a signal would be an injector's; of a lift from where it rests."""
    known = _known(values)
    if not known.size:
        return ()
    kind = "rail_pressure" if signal == "line_pressure" else signal
    lowest, highest = (OPEN, LARGEST_LIFT) if kind == "needle_lift" else PRESSURES
    size = abs(float(np.percentile(np.abs(known), 99.9)))
    possible = [
        unit for unit in _PLAUSIBLE_UNITS.get(kind, ()) if lowest <= size * UNITS[kind][unit] <= highest
    ]
    if kind == "rail_pressure" and _LOWEST_PSI <= size <= highest / UNITS[kind]["psi"]:
        possible.append("psi")
    return tuple(possible)


def time_units_possible(stamps: Stamps) -> tuple[str, ...]:
    """Units in which a time would have a rate that can be read."""
    lowest, highest = RATES
    rates = {unit: 1.0 / (stamps.period * UNITS["time"][unit]) for unit in _PLAUSIBLE_UNITS["time"]}
    return tuple(unit for unit, rate in rates.items() if lowest * 0.99 <= rate <= highest * 1.01)


def on_stamps(values: Values, time: Values | None, others: Values | None) -> NDArray[np.float64]:
    """Values (n,) of one axis at the stamps of another; as they are without stamps."""
    if time is None or others is None or time is others:
        return values
    return np.interp(others, time, values)
