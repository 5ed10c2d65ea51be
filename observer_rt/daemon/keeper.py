"""The daemon's files: learned state and journal, written beside the loop."""

import contextlib
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.daemon.journal import JournalWriter, require_journal
from observer_rt.daemon.lock import sole_writer
from observer_rt.daemon.state_file import save_knowledge
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.news import Listener
from observer_rt.foundation.errors import ObserverError, RunError, UserError
from observer_rt.foundation.outputs import JOURNAL, LEARNED_STATE, check_folder, check_own_file

IMPLAUSIBLE = "check the sensors and their units; what was kept before stays"
Tell = Callable[[str], None]
"""Says a message to whoever runs the daemon; called from the thread that writes."""
KnowledgeSource = Callable[[], Knowledge]
"""All that was learned so far: another value whenever something was, never one that changes."""


class UnsavedError(RunError):
    """The last write failed: of what was learned, or of the journal."""


class RetryingWriter:
    """Tries to write a file; reports the beginning and the end of a failure once each."""

    def __init__(self, file: "LearnedState | JournalWriter", interval: float, tell: Tell) -> None:
        """interval [s]: until the next attempt, for the message."""
        self.failures = 0
        self._file = file
        self._interval = interval
        self._tell = tell
        self._failures_before = 0  # failures before those that go on
        self._reported = ""

    def attempt(self) -> None:
        """Write once."""
        try:
            self._file.write()
        except ObserverError as error:
            self.failures += 1
            if str(error) != self._reported:
                self._reported = str(error)
                is_of_disk = isinstance(error.__cause__, OSError | sqlite3.Error)
                remedy = "make room there, or mend the folder's rights" if is_of_disk else IMPLAUSIBLE
                self._tell(
                    f"warning: {error}\n  remedy: {remedy}; the observer goes on, and it is tried again every "
                    f"{self._interval:g} s"
                )
        else:
            if self._reported:
                failed = self.failures - self._failures_before
                self._tell(f"{self._file.name} is written again, after {failed} failed attempts")
                self._failures_before, self._reported = self.failures, ""

    def finish(self) -> str:
        """Write a last time; returns the problem, empty where there was none."""
        failed = f" ({self.failures} attempts failed before)" if self.failures else ""
        try:
            self._tell(f"{self._file.finish()}{failed}")
        except ObserverError as error:
            return f"{error}{failed}"
        return ""


class Keeper:
    """Writes learned state and journal in a thread of its own, so that the loop never waits for a disk."""

    def __init__(
        self, injector: BenchInjector, state: Path | None, journal: JournalWriter | None, tell: Tell
    ) -> None:
        """state: where the learned state is kept; None, as for the journal: nowhere."""
        self.state = state
        self.listeners: Sequence[Listener] = [] if journal is None else [journal]
        """Listeners to the daemon's reports and notices."""
        self._injector = injector
        self._journal = journal
        self._tell = tell
        self._writers: Sequence[RetryingWriter] = ()

    @property
    def failures(self) -> int:
        """Attempts to write that failed so far."""
        return sum(writer.failures for writer in self._writers)

    @contextlib.contextmanager
    def keeping(self, source: KnowledgeSource) -> Iterator[None]:
        """While it lasts, write new results within `save_within_s`; at the end, a last time, or `UnsavedError`."""
        interval = self._injector.config.state.save_within_s / 2  # what comes just after a write waits for the next
        state = LearnedState(self.state, self._injector, source) if self.state is not None else None
        files = (file for file in (state, self._journal) if file is not None)
        self._writers = [RetryingWriter(file, interval, self._tell) for file in files]
        stop = threading.Event()
        thread = threading.Thread(target=self._write_repeatedly, args=(interval, stop), name="keeping")
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()
            problems = [problem for writer in self._writers if (problem := writer.finish())]
            if problems:
                raise UnsavedError("\n".join(problems))

    def _write_repeatedly(self, interval: float, stop: threading.Event) -> None:
        wait = 0.0
        while not stop.wait(wait):
            began = time.monotonic()
            for writer in self._writers:
                writer.attempt()
            wait = max(interval - (time.monotonic() - began), 0.0)


class LearnedState:
    """Learned state in a state file."""

    def __init__(self, path: Path, injector: BenchInjector, source: KnowledgeSource) -> None:
        self.name = f"learned state in {path}"
        self._path = path
        self._model = injector.parameters
        self._source = source
        self._written = source()

    def write(self) -> None:
        """Replace the file if something was learned since. Raises `RunError`; a later call tries it again."""
        if self._source() is not self._written:
            self.finish()

    def finish(self) -> str:
        """Replace the file; returns a text about it. Raises `RunError`."""
        knowledge = self._source()
        save_knowledge(self._path, knowledge, self._model)
        self._written = knowledge
        return f"learned state saved in {self._path}"


class KeptFiles(NamedTuple):
    """Paths of learned state and journal; None: not on disk."""

    state: Path | None
    journal: Path | None


def kept_files(injector: BenchInjector, state: Path | None = None, journal: Path | None = None) -> KeptFiles:
    """Files that an injector keeps, by command line or bench file. Raises `UserError` for other kinds."""
    owners = {path.resolve(): str(path) for path in (injector.file.path, injector.parameters_path)}
    files = KeptFiles(state or injector.state, journal or injector.journal)
    options = (
        "--state" if state else injector.location("state.file"),
        "--journal" if journal else injector.location("state.journal"),
    )
    for option, path, kind in zip(options, files, (LEARNED_STATE, JOURNAL), strict=True):
        if path is None:
            continue
        if other := owners.get(path.resolve()):
            raise UserError(option, f"{path} is {other} already", "name another file")
        owners[path.resolve()] = option
        check_own_file(option, path, kind)
        check_folder(option, path.absolute().parent)
    if files.journal is not None:
        require_journal(files.journal)
    return files


@contextlib.contextmanager
def keeper_of(bench: Bench, state: Path | None, journal: Path | None, tell: Tell) -> Iterator[Keeper]:
    """Keeper of files, the bench file's where none is given. Raises `UserError` for unfit files and those in use."""
    files = kept_files(bench.injector, state, journal)
    with contextlib.ExitStack() as locks:
        if files.state is not None:
            locks.enter_context(sole_writer(files.state))
        writer = JournalWriter(files.journal, bench, tell) if files.journal is not None else None
        yield Keeper(bench.injector, files.state, writer, tell)
