"""Wear that moves between recordings has no single size: the latest stretch is asked in which it stands still."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from observer_rt.engine.reports.injection_report import WEAR

STEADY = 0.015  # by which the flow of one and the same nozzle or seat may differ between recordings
SIGNIFICANT = 4.0  # standard deviations
NORMAL_975 = 1.96
COLUMNS = ("valid", "number", *(column for each in WEAR for column in each.columns))
"""Columns of a batch's rows that wear is read from."""


@dataclass(frozen=True)
class SteadyStretch:
    """The latest recordings, by SHA-256, in which wear has one size; says: what moved before, empty: nothing did."""

    recordings: tuple[str, ...]
    says: str = ""


def steady_stretch(rows: pd.DataFrame, latest_first: Sequence[str]) -> SteadyStretch:
    """The latest recordings of an injector between which neither nozzle nor seat has changed.

    rows: of its injections, with `sha256` and COLUMNS; latest_first: its recordings. A recording without a valid
    injection says nothing against it.
    """
    says, end = "", len(latest_first)
    for each in WEAR:
        known = list(_sizes(rows, latest_first, each.columns))
        moved = _first_move(known)
        if moved is not None and moved < end:
            (_, latest, _), *_, (_, earliest, _) = known
            name, end = each.value.heading.partition("\n")[0], moved
            path = f"from {earliest:+.1%} to {latest:+.1%}"
            says = f"{name} flow has moved {path} over {len(known)} recordings: see trend"
    return SteadyStretch(tuple(latest_first[:end]), says)


def _sizes(
    rows: pd.DataFrame, latest_first: Sequence[str], columns: Sequence[str]
) -> Iterator[tuple[int, float, float]]:
    """Place, size and standard deviation where a recording's last valid injection knows it."""
    value, low, high = columns
    valid = rows[rows["valid"] & rows[value].notna()].sort_values("number").groupby("sha256").last()
    for place, sha256 in enumerate(latest_first):
        if sha256 in valid.index:
            row = valid.loc[sha256]
            half = 0.5 * (row[high] - row[low]) / NORMAL_975
            yield place, float(row[value]), float(half) if math.isfinite(half) else 0.0


def _first_move(known: Sequence[tuple[int, float, float]]) -> int | None:
    """The latest place at which a size differs from the latest one; None: nowhere."""
    for place, value, sigma in known[1:]:
        _, latest, its_sigma = known[0]
        if abs(value - latest) > max(STEADY, SIGNIFICANT * math.hypot(sigma, its_sigma)):
            return place
    return None
