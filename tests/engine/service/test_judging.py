"""Events that come faster than they can be learned from: each is judged, and what was learned takes force."""

from collections import deque
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

from observer_rt.engine.estimation.parameters import NOZZLE
from observer_rt.engine.reports.evidence import EvidenceKind, kind_of
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.judging import InlineExecutor
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.replay.framing import Span, windows_of
from observer_rt.files.signals.recording import Recording
from tests.benches import sample_bench
from tests.device import Device, Notes, core_of, hand, simulated

INJECTIONS = 8
V_H = 0.25


class Slow(Executor):
    def __init__(self) -> None:
        self.jobs: deque[tuple[Future[Any], Any, Any]] = deque()
        self.most = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.jobs.append((future, fn, args))
        self.most = max(self.most, len(self.jobs))
        return future

    def work(self) -> None:
        while self.jobs:
            future, fn, args = self.jobs.popleft()
            future.set_result(fn(*args))


@pytest.fixture(scope="module")
def worn() -> Recording:
    return simulated(INJECTIONS, V_H, seed=5)


def served(folder: Path, recording: Recording, work_after: range) -> tuple[Core, Notes, Slow]:
    """A core that learns after the events given only, by number, and then long after they were due."""
    path, notes, slow = sample_bench(folder), Notes(), Slow()
    core = core_of(path, executor=slow, listeners=[notes])
    for frame in Device(path).send(recording):
        hand(core, [frame])
        if core.counters.events in work_after:
            slow.work()
    return core, notes, slow


def test_without_learning_in_time_every_event_is_judged_and_none_a_fault(tmp_path: Path, worn: Recording) -> None:
    core, notes, slow = served(tmp_path, worn, range(0))
    reports = notes.injections
    assert len(reports) >= INJECTIONS - 1
    assert {report.reason for report in reports} == {Reason.TOO_FEW_EVENTS, Reason.LEARNING_LATE}
    assert core.state == (State.DEGRADED, Reason.LEARNING_LATE)
    assert kind_of(reports) is EvidenceKind.DOUBTFUL  # and not refused
    assert slow.most == 1  # no queue grows
    assert (core.counters.adoptions, core.counters.late_adoptions) == (0, 1)
    assert core.counters.unlearned_events == core.counters.events - 2  # and one would be next


def exhaust(*_: Any) -> None:
    raise MemoryError("none left")


class Failing(InlineExecutor):
    left = 4

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.left -= 1
        return super().submit(fn if self.left else exhaust, *args, **kwargs)


def test_learning_that_fails_costs_its_event_only(tmp_path: Path, worn: Recording) -> None:
    path, notes = sample_bench(tmp_path), Notes()
    core = core_of(path, executor=Failing(), listeners=[notes])
    for frame in Device(path).send(worn):
        hand(core, [frame])
    [notice] = notes.notices
    assert "MemoryError: none left" in notice.text
    assert "remedy" in notice.text
    assert Reason.NOT_JUDGED not in [report.reason for report in notes.injections]
    assert notes.injections[-1].valid
    assert core.counters.adoptions >= INJECTIONS - 3


def test_what_is_late_takes_force_with_the_next_event(tmp_path: Path, worn: Recording) -> None:
    """Learning ends after its event was taken, always."""
    core, notes, _ = served(tmp_path, worn, range(3, INJECTIONS))
    assert core.counters.adoptions > 0
    assert core.counters.late_adoptions > 0
    last = notes.injections[-1]
    assert last.phi_version > 0
    assert core.knowledge.phi_version == core.counters.adoptions
    assert last.indicators[NOZZLE].value == pytest.approx(V_H, abs=0.1)


def test_a_windowed_source_is_judged_and_learned_from(tmp_path: Path, worn: Recording) -> None:
    """That an event is over only the next window shows, when it is long due; learning takes until after its start."""
    path, notes, slow = sample_bench(tmp_path), Notes(), Slow()
    core = core_of(path, executor=slow, listeners=[notes])
    device = Device(path)
    for span in windows_of([worn]):
        for number, frame in enumerate(device.send(worn, Span(span.start, span.end + 1))):
            hand(core, [frame])
            if number == 5:
                slow.work()
    assert core.counters.events >= INJECTIONS - 2
    assert Reason.NOT_JUDGED not in [report.reason for report in notes.injections]
    assert core.counters.adoptions >= INJECTIONS - 3
    assert [report.valid for report in notes.injections[2:]] == [True] * (len(notes.injections) - 2)
