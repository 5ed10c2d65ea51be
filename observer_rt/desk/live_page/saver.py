"""Saves injections that browsers ask for: a table of curves and a document with the values of each."""

import json
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.foundation.errors import ObserverError, file_errors
from observer_rt.foundation.files import replacing, write_text

MOST_SAVED = 1000  # injections, for whoever reaches the page may ask for it


class Saver:
    """Saves injections in a folder for all browsers: one at a time, beside the page's loop, and each once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._saved: dict[tuple[str, int], Path] = {}
        self._thread = ThreadPoolExecutor(1, "saving")

    def save(self, injection: ShownInjection, name: str) -> Future[str]:
        """Save an injection later; the result is its place, or the reason of a failure. name: of the injector."""
        return self._thread.submit(self._save, injection, name)

    def close(self) -> None:
        """Save no more."""
        self._thread.shutdown(cancel_futures=True)

    def _save(self, injection: ShownInjection, name: str) -> str:
        path = self._saved.get((name, injection.count))
        try:
            with file_errors(self._folder):
                if path is None or not path.exists():
                    if len(self._saved) >= MOST_SAVED:
                        return f"not saved: {MOST_SAVED} injections are already; start `observer-rt monitor` anew"
                    path = self._saved[name, injection.count] = save_injection(injection, self._folder, name)
        except ObserverError as error:
            return str(error)
        return f"saved: {path}, .json"


def save_injection(shown: ShownInjection, folder: Path, name: str) -> Path:
    """Write `injection_[NAME_]NUMBER[_AGAIN].csv`, a new file, and `.json` beside it. Returns the table's path.

    name: of the injector, empty for the only one. Raises `ObserverError` when they cannot be written.
    """
    stem = f"injection_{f'{name}_' if name else ''}{shown.values['number']}"
    path, again = folder / f"{stem}.csv", 1
    while path.exists() or path.with_suffix(".json").exists():  # numbers begin anew with each daemon
        again += 1
        path = folder / f"{stem}_{again}.csv"
    masses = {f"{reference}_mass_mg": mass for reference, mass in shown.references.items()}
    document = {**shown.values, **masses, "moment_ns": shown.moment}
    columns = np.column_stack([*shown.curves.values()]) if shown.curves else np.empty((0, 0))
    with file_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            np.savetxt(part, columns, "%.7g", ",", header=",".join(shown.curves), comments="")
    write_text(path.with_suffix(".json"), json.dumps(document, indent=2, allow_nan=False))
    return path
