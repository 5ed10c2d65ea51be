"""Fitted candidates on disk, so that an interrupted run goes on where it was."""

import hashlib
import json
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compilation import source_digest
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import added_digests
from observer_rt.model.parameters import InjectorParameters

FORMAT = 1


def problem_key(
    parameters: InjectorParameters, recording_hashes: Sequence[str], stated: Sequence[SizedEffect] = ()
) -> str:
    """What fits belong to: model, recordings (SHA-256 of each), effects added and this program, as one SHA-256.

    stated: what is known of the recordings' channels.
    """
    model = parameters.model_dump(
        mode="json", exclude={"format": True, "effects": {"__all__": {"origin", "evidence", "date"}}}
    )
    channels = [(each.effect.id, *each.values) for each in stated]
    content = json.dumps(
        [source_digest(), added_digests(), model, list(recording_hashes), channels], sort_keys=True
    )
    return hashlib.sha256(content.encode()).hexdigest()


class FitStore:
    """JSON lines: what the fits belong to, then a fit a line. A `candidates.FitMemory`, used by several threads."""

    def __init__(self, path: Path, key: str) -> None:
        """Take over the fits of this key; a file of another key, or none, is begun anew.

        Raises OSError when the file cannot be read or written.
        """
        self._lock = threading.Lock()
        self._fits = _read(path, key)
        self.taken_over = len(self._fits)
        """Fits there were already."""
        self._file = path.open("w", encoding="ascii")
        self._write({"format": FORMAT, "key": key})
        for ids, (theta, statistic) in self._fits.items():
            self._write_fit(ids, theta, statistic)

    def __enter__(self) -> "FitStore":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def kept(self) -> int:
        """How many fits there are."""
        return len(self._fits)

    def get(self, ids: tuple[str, ...]) -> tuple[NDArray[np.float64], float] | None:
        """theta (p,) and -2 log L of these effects; None when they were not fitted."""
        return self._fits.get(ids)

    def put(self, ids: tuple[str, ...], theta: NDArray[np.float64], statistic: float) -> None:
        """Keep a fit, at once on disk."""
        with self._lock:
            self._fits[ids] = theta, statistic
            self._write_fit(ids, theta, statistic)

    def _write_fit(self, ids: tuple[str, ...], theta: NDArray[np.float64], statistic: float) -> None:
        self._write({"ids": ids, "theta": theta.tolist(), "statistic": statistic})

    def _write(self, content: dict[str, Any]) -> None:
        self._file.write(json.dumps(content) + "\n")
        self._file.flush()


def _read(path: Path, key: str) -> dict[tuple[str, ...], tuple[NDArray[np.float64], float]]:
    """Fits of a file with this key; a line cut off while it was written ends it."""
    if not path.exists():
        return {}
    fits = {}
    header, *lines = path.read_text(encoding="ascii", errors="replace").splitlines() or [""]
    try:
        if json.loads(header) != {"format": FORMAT, "key": key}:
            return {}
        for line in lines:
            content = json.loads(line)
            fits[tuple(content["ids"])] = np.array(content["theta"], float), float(content["statistic"])
    except (ValueError, KeyError, TypeError):
        pass
    return fits
