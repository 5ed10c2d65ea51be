"""Fits of a search on disk: an interrupted run goes on where it was."""

import hashlib
import json
import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.outputs import replacing
from observer_rt.identification.discovery.search.fits import Fit
from observer_rt.model.effect import SizedEffect
from observer_rt.model.parameters import InjectorParameters

FORMAT = 2
_PACKAGE = Path(__file__).parents[3]
_SOURCES = (".py", ".pyx", ".pxd", ".pxi")


def source_digest() -> str:
    """SHA-256 (hexadecimal) of the package's source: two states of it never have the same."""
    digest = hashlib.sha256()
    for path in sorted(each for each in _PACKAGE.rglob("*.p*") if each.suffix in _SOURCES):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def problem_key(
    parameters: InjectorParameters, recording_hashes: Sequence[str], stated: Sequence[SizedEffect] = ()
) -> str:
    """Hashes the problem that fits belong to: model, recordings (SHA-256 of each) and this program.

    stated: delays and lags of the recordings' channels.
    """
    why = {"__all__": {"origin", "evidence", "date"}}
    model = parameters.model_dump(mode="json", exclude={"format": True, "effects": why, "terms": why})
    channels = [(each.effect.id, *each.values) for each in stated]
    content = json.dumps([source_digest(), model, list(recording_hashes), channels], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


class FitStore(dict[tuple[str, ...], Fit]):
    """JSON lines: what the fits belong to, then a fit a line. A `FitMemory`, used by several threads."""

    def __init__(self, path: Path, key: str) -> None:
        """Take over the fits of this key; a file of another key, or none, is begun anew.

        Raises OSError when the file cannot be read or written.
        """
        self._lock = threading.Lock()
        super().__init__(_read(path, key))
        self.taken_over = len(self)
        """Fits there were already."""
        header = json.dumps({"format": FORMAT, "key": key}) + "\n"
        with replacing(path) as part:
            part.write_text(header + "".join(_line(ids, *fit) for ids, fit in self.items()), "ascii")
        self._file = path.open("a", encoding="ascii")

    def __enter__(self) -> "FitStore":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __setitem__(self, ids: tuple[str, ...], fit: Fit) -> None:
        """Keep a fit, at once on disk."""
        with self._lock:
            super().__setitem__(ids, fit)
            self._file.write(_line(ids, *fit))
            self._file.flush()


def _line(ids: tuple[str, ...], theta: NDArray[np.float64], statistic: float, spread: float) -> str:
    return json.dumps({"ids": ids, "theta": theta.tolist(), "statistic": statistic, "spread": spread}) + "\n"


def _read(path: Path, key: str) -> dict[tuple[str, ...], Fit]:
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
            statistic, spread = (float(content[name]) for name in ("statistic", "spread"))
            fits[tuple(content["ids"])] = np.array(content["theta"], float), statistic, spread
    except (ValueError, KeyError, TypeError):
        pass
    return fits
