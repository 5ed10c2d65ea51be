"""Figures of latencies."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from observer_rt.foundation.units import MICROSECOND
from tools.benchmarks.figures import COLOURS
from tools.benchmarks.speed.measure import Speed
from tools.benchmarks.speed.roundtrip import BUSY, ECHO, LEAN, OURS, PACES, PEER

_STYLE = {OURS: 0, ECHO: 1, PEER: 2, LEAN: 3, BUSY: 4}
_BINS = 60


def save_histograms(speed: Speed, folder: Path) -> Path | None:
    """Share of the answers by latency, a panel for each pace and one for the socket pair; None without any."""
    panels: dict[str, Mapping[str, NDArray[np.float64]]] = {}
    if speed.roundtrips:
        named = speed.roundtrips.latencies
        for pace in PACES:
            of_pace = {party: named[f"{pace}, {party}"] for party in _STYLE}
            panels[f"round trip on {speed.roundtrips.link}, needle open, a frame every {pace}"] = of_pace
    if speed.sustained:
        panels["socket pair, a frame every 90 us"] = {OURS: speed.sustained.latencies}
    if not panels:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    height = 3.0 * len(panels)
    figure, axes = plt.subplots(
        len(panels), 1, figsize=(12.0, height), layout="constrained", squeeze=False, sharex=True
    )
    for axis, (title, found) in zip(axes[:, 0], panels.items(), strict=True):
        _panel(axis, title, found)
    axes[-1, 0].set_xlabel("from the last input frame needed to the rate frame [us]")
    path = folder / "latency.png"
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return path


def _panel(axis: Axes, title: str, found: Mapping[str, NDArray[np.float64]]) -> None:
    every = np.concatenate(list(found.values())) / MICROSECOND
    bins = np.geomspace(max(every.min(), 1.0), every.max() * 1.01, _BINS).tolist()
    for party, seconds in found.items():
        if seconds.size:
            microseconds = seconds / MICROSECOND
            share = np.full(seconds.size, 1.0 / seconds.size)
            label = f"{party}: median {np.median(microseconds):.0f} us"
            colour = COLOURS[_STYLE[party]]
            axis.hist(microseconds, bins, weights=share, histtype="step", label=label, color=colour, lw=1.4)
    axis.set(title=title, xscale="log", ylabel="share of answers")
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
