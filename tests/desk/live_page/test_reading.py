"""Daemons as the page reads them: what they say, whether it is of now."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.daemon.control_socket import Message, control_socket, socket_places
from observer_rt.daemon.snapshot import SNAPSHOT, BusStatus, ShownInjection, Snapshot, Status, StatusLevel
from observer_rt.desk.live_page.reading import InjectorSnapshot, Watching
from tests.daemon.participants import bench_file, until
from tests.desk.live_page.daemons import daemons_of
from tests.device import frames_of, worn_recording

Answers = Mapping[str, Callable[[Message], Iterator[bytes] | Message]]


@contextmanager
def watching(path: Path, answers: Answers | None = None) -> Iterator[Watching]:
    bench = load_bench(path)
    with ExitStack() as stack:
        for alone in bench.per_injector:
            if (answer := (answers or {}).get(alone.injector.name)) is not None:
                stack.enter_context(control_socket(socket_places(alone.injector)[0], {SNAPSHOT: answer}))
        view = Watching(bench)
        stack.callback(view.close)
        yield view


def said(*injections: ShownInjection, age: float = 0.0) -> Callable[[Message], Iterator[bytes]]:
    """What a daemon answers that last looked at itself some time ago [s]."""

    def answer(_: Message) -> Iterator[bytes]:
        moment = time.time_ns() - round(age * 1e9)
        status = Status(7, moment, "ADAPTED", (), "well", StatusLevel.GOOD, "injector.toml")
        return Snapshot(Status(**{**vars(status), "buses": (BusStatus("can0"),)}), injections).pieces()

    return answer


def first(view: Watching) -> InjectorSnapshot:
    return view.readers[0].seen()


def test_injections_of_a_daemon_that_is_started_anew_come_after_those_before(tmp_path: Path) -> None:
    path = bench_file(tmp_path, "read")
    frames = frames_of(path, worn_recording(4))
    with watching(path) as view:
        assert first(view).state == "no status yet"
        for times in (1, 2):
            with daemons_of(path, frames):
                until(lambda times=times: view.readers[0].count == 4 * times)  # type: ignore[misc]
                until(lambda: first(view).level is StatusLevel.GOOD)
            until(lambda: first(view).silent)
        (fault,) = first(view).faults
        assert f"start `observer-rt run --bench {path}`" in fault.remedy
        assert 0.5 < (time.time_ns() - fault.since) * 1e-9 < 60.0
        assert view.buses() == []
        kept = view.readers[0].injections()
        assert [each.values["number"] for each in kept] == [1, 2, 3, 4, 1, 2, 3, 4]
        assert [each.count for each in view.readers[0].injections(since=6)] == [7, 8]


@pytest.mark.parametrize(("age", "is_silent"), [(0.0, False), (2.0, True)])
def test_a_loop_that_hangs_is_silent_though_its_process_answers(tmp_path: Path, age: float, is_silent: bool) -> None:
    with watching(bench_file(tmp_path, "read"), {"": said(age=age)}) as view:
        until(lambda: bool(view.readers[0].injections() or first(view).state != "no status yet"))
        assert first(view).silent == is_silent
        assert first(view).state == ("OBSERVER SILENT" if is_silent else "ADAPTED")


@pytest.mark.parametrize(
    ("answer", "words"), [({"error": "not now"}, "not now"), ({"injections": "?"}, "another version")]
)
def test_a_daemon_that_gives_no_snapshot_is_a_fault(tmp_path: Path, answer: Message, words: str) -> None:
    with watching(bench_file(tmp_path, "read"), {"": lambda _: answer}) as view:
        until(lambda: words in str(first(view).faults))
