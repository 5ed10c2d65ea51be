"""The daemon's files: the learned state, its lock and the journal, written beside the loop at a bounded rate."""

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.foundation.errors import RunError
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.service.core.learners import refuse_state
from observer_rt.service.keeping.chore import Chore, Keepsake, Tell
from observer_rt.service.keeping.lock import sole_writer
from observer_rt.service.keeping.notebook import Notebook
from observer_rt.service.reports.news import Listener
from observer_rt.service.state_file import model_hash, save_knowledge
from observer_rt.terminal.destinations import check_destination, check_folder


class Knowing(Protocol):
    """What learns, such as a daemon's core."""

    @property
    def knowledge(self) -> Knowledge:
        """All that was learned so far: another value whenever something was, never one that changes."""


class Keeper:
    """Keeps what a daemon learns. The loop only lends it what it has: nothing here is done in the loop's time."""

    def __init__(
        self, fitted: BenchInjector, state: Path | None, notebook: Notebook | None, tell: Tell
    ) -> None:
        """state: where the learned state is kept; None, as for the notebook: nowhere."""
        self.state = state
        self._fitted = fitted
        self._notebook = notebook
        self._tell = tell
        self._chores: Sequence[Chore] = ()

    @property
    def failures(self) -> int:
        """Attempts to write that failed so far."""
        return sum(chore.failures for chore in self._chores)

    @property
    def listeners(self) -> Sequence[Listener]:
        """Who wants to hear the daemon's news."""
        return [] if self._notebook is None else [self._notebook]

    @contextlib.contextmanager
    def keeping(self, core: Knowing) -> Iterator[None]:
        """While it lasts, write what is new, within `save_within_s`; at the end, a last time.

        Raises `RunError` when the last write fails.
        """
        # what comes just after a write waits for the next one, and for its end
        interval = self._fitted.config.state.save_within_s / 2
        self._chores = chores = [Chore(each, interval, self._tell) for each in self._keepsakes(core)]
        stop = threading.Event()
        writer = threading.Thread(target=self._write, args=(chores, interval, stop), name="keeping")
        writer.start()
        try:
            yield
        finally:
            stop.set()
            writer.join()
            self._finish(chores)

    def _write(self, chores: Sequence[Chore], interval: float, stop: threading.Event) -> None:
        """Write again and again, `interval` seconds from begin to begin, until stopped."""
        wait, is_told = 0.0, False
        while not stop.wait(wait):
            began = time.monotonic()
            for chore in chores:
                chore.attempt()
            took = time.monotonic() - began
            wait = max(interval - took, 0.0)
            if took > interval and not is_told:
                is_told = True
                self._tell(
                    f"warning: it took {took:.1f} s to write what is kept: a kill may cost more than save_within_s\n"
                    "  remedy: keep it on a faster disk, or raise save_within_s in [state]"
                )

    def _keepsakes(self, core: Knowing) -> Iterator[Keepsake]:
        if self.state is not None:
            yield LearnedState(self.state, self._fitted, core)
        if self._notebook is not None:
            yield self._notebook

    def _finish(self, chores: Sequence[Chore]) -> None:
        """Write everything a last time, one whether or not another fails."""
        problems: list[str] = []
        for chore in chores:
            failed = f" ({chore.failures} attempts failed before)" if chore.failures else ""
            try:
                self._tell(f"{chore.keepsake.finish()}{failed}")
            except RunError as error:
                problems.append(f"{error}{failed}")
        if problems:
            raise RunError("\n".join(problems))


class LearnedState:
    """What the core knows, in a state file."""

    def __init__(self, path: Path, fitted: BenchInjector, core: Knowing) -> None:
        self.name = f"learned state in {path}"
        self._path = path
        self._model = model_hash(fitted.parameters)
        self._pressure_scale = fitted.parameters.scaling.pressure
        self._core = core
        self._written = core.knowledge

    def write(self) -> None:
        """Replace the file if something was learned since."""
        knowledge = self._core.knowledge
        if knowledge is not self._written:
            self._save(knowledge)

    def finish(self) -> str:
        """Replace the file."""
        self._save(self._core.knowledge)
        return f"learned state saved in {self._path}"

    def _save(self, knowledge: Knowledge) -> None:
        save_knowledge(self._path, knowledge, self._model, self._pressure_scale)
        self._written = knowledge


@contextlib.contextmanager
def keeper_of(bench: Bench, state: Path | None, journal: Path | None, tell: Tell) -> Iterator[Keeper]:
    """What keeps the files of a daemon, theirs alone while it lasts; those the bench file names where none is given.

    Raises `UserError` for files that cannot be kept, or are another daemon's.
    """
    fitted = bench.injector
    state, journal = state or fitted.state, journal or fitted.journal
    with contextlib.ExitStack() as locks:
        if state is not None:
            refuse_state(fitted, "--state")
            check_folder("--state", state.absolute().parent)
            locks.enter_context(sole_writer(state))
        if journal is not None:
            check_destination("--journal", journal)
            check_folder("--journal", journal.absolute().parent)
        notebook = None if journal is None else Notebook(journal, bench, tell)
        yield Keeper(fitted, state, notebook, tell)
