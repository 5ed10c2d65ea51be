"""Keeps evidence: inputs of events that were refused or doubtful, and a fair sample of good ones, for `discover`.

The loop copies an event's samples out of its ring. A thread hands them to a process of its own, which writes them.
"""

import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import effects_after_alignment
from observer_rt.daemon.control_socket import OBSERVER
from observer_rt.daemon.lock import sole_writer
from observer_rt.daemon.state_file import model_hash
from observer_rt.engine.reports.evidence import LEAD, EventInputs, event_inputs, evidence_of
from observer_rt.engine.reports.injection_report import InjectionReport, injection_record
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.outputs import make_folder
from observer_rt.foundation.units import MILLISECOND

WRITER = "observer_rt.files.evidence_folder"  # module that runs as the process
MOST_WAITING = 64  # events that may wait for the disk
LONGEST = 60 * MILLISECOND  # s of an event that are copied
LAST_EVENTS = 5.0  # s for the last ones to be written


@contextmanager
def evidence_keeper(injector: BenchInjector, folder: Path, tell: Callable[[str], None]) -> Iterator["EvidenceKeeper"]:
    """Keeper of an injector's evidence in its own folder. Raises `UserError`: another daemon's, or unmakeable."""
    make_folder(injector.location("evidence.folder"), folder)
    with sole_writer(folder / OBSERVER):
        yield EvidenceKeeper(injector, folder, tell)


class _QueuedEvent(NamedTuple):
    """Event that waits to be written: its injections, its inputs, the constants in force."""

    reports: tuple[InjectionReport, ...]
    inputs: EventInputs
    constants: Constants


class EvidenceKeeper:
    """Listens to a daemon's reports, and has events kept."""

    def __init__(self, injector: BenchInjector, folder: Path, tell: Callable[[str], None]) -> None:
        self.kept = 0
        """Events that are on disk, or were until others took their place."""
        self.lost = 0
        """Events that could not be written, or not in time."""
        config = injector.config.evidence
        self._command = [sys.executable, "-m", WRITER, str(folder), f"{config.most_mib}", f"{config.per_point}"]
        self._folder = folder
        self._tell = tell
        self._model = {
            "injector_file": str(injector.parameters_path.absolute()),
            "model_sha256": model_hash(injector.parameters),
            "meaning": injector.config.sampling.meaning.value,
            "line_sensor": {
                stated.effect.id: list(stated.values)
                for stated in effects_after_alignment(injector.config.signals)
                if stated.effect.id in ("channel_skew", "line_pressure_sensor_lag")
            },
        }
        self._has_energizing = injector.config.signals.energizing is not None
        self._core: Core | None = None  # before it runs
        self._reports: list[InjectionReport] = []  # of one event
        self._inputs: EventInputs | None = None
        self._waiting: queue.Queue[_QueuedEvent | None] = queue.Queue(MOST_WAITING)
        self._lost_together = 0  # since an event was kept

    def watch(self, core: Core) -> None:
        """Take samples from a core from now on."""
        self._core = core

    def hear(self, news: News) -> None:
        """Note an injection; its event is handed on when an injection of another event comes, or at the end."""
        if not isinstance(news, InjectionReport) or self._core is None:
            return
        if self._reports and self._reports[0].event != news.event:
            self._hand_on()
        if not self._reports:
            constants = self._core.compiled.observer.constants
            start = news.start_position + constants.timing.window_lead - round(LEAD / constants.interval)
            end = min(self._core.processed, news.start_position + round(LONGEST / constants.interval))
            self._inputs = event_inputs(self._core.compiled.observer, start, end)
        self._reports.append(news)

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """While it lasts, events are written."""
        thread = threading.Thread(target=self._write_events, name="evidence", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._hand_on()
            with suppress(queue.Full):
                self._waiting.put(None, timeout=LAST_EVENTS)
            thread.join(LAST_EVENTS)

    def _hand_on(self) -> None:
        reports, inputs, core = self._reports, self._inputs, self._core
        self._reports, self._inputs = [], None
        if not reports or inputs is None or core is None:
            return
        try:
            self._waiting.put_nowait(_QueuedEvent(tuple(reports), inputs, core.compiled.observer.constants))
        except queue.Full:
            self.lost += 1

    def _write_events(self) -> None:
        """Hand waiting events to the process, which is started anew should it have ended."""
        process: subprocess.Popen[bytes] | None = None
        while (queued := self._waiting.get()) is not None:
            reports, inputs, constants = queued
            records = [injection_record(report, constants.coefficients, self._has_energizing) for report in reports]
            event = evidence_of(reports, inputs, constants, {**self._model, "injections": records})
            if event is None:  # of no kind that is kept
                continue
            if process is None or process.poll() is not None:
                process = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            if not self._folder.exists():
                self._tell(
                    f"warning: the evidence in {self._folder} was removed, and the folder with it\n"
                    "  remedy: nothing; it is made anew, and further events are kept"
                )
            try:
                answer = _answer_of(process, event.packed()) or "failed its process ended"
            except OSError as error:
                answer = f"failed {error}"
            self._take_answer(answer)
        if process is not None:
            assert process.stdin is not None
            with suppress(OSError):
                process.stdin.close()
            with suppress(subprocess.TimeoutExpired):
                process.wait(LAST_EVENTS)

    def _take_answer(self, answer: str) -> None:
        verdict, _, why = answer.partition(" ")
        self.kept += verdict == "kept"
        if verdict == "kept" and self._lost_together:
            self._tell(f"evidence is kept in {self._folder} again; {self._lost_together} events were lost")
            self._lost_together = 0
        if verdict != "failed":
            return
        self.lost += 1
        self._lost_together += 1
        if self._lost_together == 1:
            self._tell(
                f"warning: evidence cannot be kept in {self._folder}: {why}\n"
                "  remedy: make room there, or correct the folder's rights; the observer goes on"
            )


def _answer_of(process: "subprocess.Popen[bytes]", message: bytes) -> str:
    """Answer of the writing process to a message; empty: it ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(message)
    process.stdin.flush()
    return process.stdout.readline().decode("utf-8", "replace").strip()
