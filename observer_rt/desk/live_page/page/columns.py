"""Columns by name that the panels of the page draw of an injector."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.desk.live_page.injector import Seen
from observer_rt.desk.live_page.samples import SampleCurves

Columns: TypeAlias = Mapping[str, NDArray[np.floating]]
"""By name, (n,) each, nan: nothing to be drawn; the first is the x of all others, and rises. None: nothing at all."""
SURE = 1.96  # standard deviations of a 95 % interval
_OVERLAID = 8  # injections, the one shown included
_POINTS = 300  # of a curve, at the most: a screen shows no more
Panels: TypeAlias = Mapping[str, Callable[[Seen], Columns]]


def rate_columns(seen: Seen) -> Columns:
    """The rate of the last injection and of those before it, its 95 % band and the nominal one [mm3/ms].

    The band is that of the mass: the rate is as sure as the mass.
    """
    columns = _overlaid(("rate",), ("nominal",), seen)
    if not columns:
        return {}
    said = seen.injections[-1].summary
    rate = columns["rate"]
    band = np.abs(rate) * (SURE * said.mass_sigma / said.mass if said.mass else np.nan)
    return {**columns, "low": rate - band, "high": rate + band}


def mass_columns(seen: Seen) -> Columns:
    """Masses of all injections by their numbers [mg], valid ones and others, with 95 % intervals."""
    said = _in_order(seen)
    is_valid = said["valid"] == 1.0
    return {
        "number": said["injection_number"],
        "nominal": said["nominal_mass"],
        **_banded("valid", np.where(is_valid, said["mass"], np.nan), said["mass_sigma"]),
        **_banded("refused", np.where(is_valid, np.nan, said["mass"]), said["mass_sigma"]),
    }


def wear_columns(seen: Seen) -> Columns:
    """Wear of nozzle and seat over all injections by their numbers [%], with 95 % intervals."""
    said = _in_order(seen)
    return {
        "number": said["injection_number"],
        **_banded("nozzle", 100.0 * said["nozzle_wear"], 100.0 * said["nozzle_wear_sigma"]),
        **_banded("seat", 100.0 * said["seat_wear"], 100.0 * said["seat_wear_sigma"]),
    }


def _in_order(seen: Seen) -> NDArray[np.void]:
    """History by rising numbers: an observer that was started anew counts from 1 again."""
    numbered = seen.history[np.isfinite(seen.history["injection_number"])]
    order = np.argsort(numbered["injection_number"], kind="stable")
    return np.take(numbered, order)


def _banded(name: str, mean: NDArray[np.floating], sigma: NDArray[np.floating]) -> Columns:
    return {name: mean, f"{name}_low": mean - SURE * sigma, f"{name}_high": mean + SURE * sigma}


def _overlaid(overlaid: Sequence[str], shown: Sequence[str], seen: Seen) -> Columns:
    """Time [ms], curves of the last injection, and of those before: `NAME_before_K` is that of K injections ago."""
    drawn = [each.curves for each in seen.injections[-_OVERLAID:] if each.curves is not None]
    if (
        not drawn or drawn[-1] is not seen.injections[-1].curves
    ):  # those of another one are not to stand for it
        return {}
    longest = max((each.time for each in drawn), key=len)
    step = -(-longest.size // _POINTS)
    time = longest[::step]

    def thinned(curves: SampleCurves, name: str) -> NDArray[np.float32]:
        values = getattr(curves, name)[::step]
        return np.pad(values, (0, time.size - values.size), constant_values=np.nan)

    *before, last = drawn
    columns = {name: thinned(last, name) for name in (*overlaid, *shown)}
    for ago, curves in enumerate(reversed(before), 1):
        columns |= {f"{name}_before_{ago}": thinned(curves, name) for name in overlaid}
    return {"time": time, **columns}


DETAILS: Panels = {
    "line_pressure": partial(_overlaid, ("line_pressure",), ()),
    "rail_pressure": partial(_overlaid, ("rail_pressure",), ()),
    "needle_lift": partial(_overlaid, ("needle_lift",), ()),
    "phi": partial(_overlaid, (), ("phi_1", "phi_2", "phi_3")),
}
"""Details of an injection, by panel: pressures [MPa], lift [um], phi [1/s]."""
HISTORY: Panels = {"mass": mass_columns, "wear": wear_columns}
"""History of an injector, by panel."""
