"""Lines of the service: their form, where they go, what a manager hears; who does not read them holds nothing up."""

import io
import json
import os
import re
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.daemon.log import CAPACITY, EventLogger, ServiceLog, one_line
from observer_rt.daemon.notifier import Notifier
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.words import Topic
from observer_rt.model.effects import effective_model
from tests.daemon.participants import until

STAMPED = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d "


def lines_of(path: Path) -> list[str]:
    return path.read_text().splitlines()


@pytest.fixture
def err(tmp_path: Path) -> Console:
    return Console(file=(tmp_path / "err").open("w"), width=80)


def test_lines_have_time_level_and_topic(tmp_path: Path, err: Console) -> None:
    with ServiceLog(err, tmp_path / "log") as log:
        log.say(Topic.START, "ready")
        log.say(Topic.INPUT, "Block 0x1 (lift): no frame\n  remedy: check it")
        log.say(Topic.INPUT, "comes again", is_over=True)
        log.say(Topic.KEPT, "warning: not saved")
    expected = [
        "INFO start: ready",
        "WARNING input: Block 0x1 (lift): no frame; remedy: check it",
        "INFO input: comes again",
        "WARNING kept: not saved",
    ]
    for path in (tmp_path / "err", tmp_path / "log"):
        assert all(re.match(STAMPED, line) for line in lines_of(path))
        assert [line.split(" ", 1)[1] for line in lines_of(path)] == expected


def test_the_journal_gets_priorities_and_no_time(tmp_path: Path, err: Console) -> None:
    status = os.fstat(err.file.fileno())
    with ServiceLog(err, environment={"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"}) as log:
        log.say(Topic.START, "ready")
        log.say(Topic.SENDER, "another node")
    assert lines_of(tmp_path / "err") == ["<6>start: ready", "<4>sender: another node"]


def test_a_journal_that_is_not_this_stream_changes_nothing(tmp_path: Path, err: Console) -> None:
    with ServiceLog(err, environment={"JOURNAL_STREAM": "1:2"}) as log:
        log.say(Topic.START, "ready")
    assert re.match(STAMPED, lines_of(tmp_path / "err")[0])


def test_beside_the_view_only_what_it_does_not_show(tmp_path: Path, err: Console) -> None:
    with ServiceLog(err, tmp_path / "log", quiet=True) as log:
        log.say(Topic.INJECTION, "injection 1")
        log.say(Topic.LINK, "can0 is back")
    assert [line.split(" ", 2)[2] for line in lines_of(tmp_path / "err")] == ["link: can0 is back"]
    assert len(lines_of(tmp_path / "log")) == 2


def test_records_are_lines_of_json_with_their_time(tmp_path: Path, err: Console) -> None:
    stream = io.StringIO()
    with ServiceLog(err, stream=stream) as log:
        log.record({"number": 1, "mass_mg": None})
        log.record({"number": 2, "mass_mg": 3.5})
    records = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [(r["number"], r["mass_mg"]) for r in records] == [(1, None), (2, 3.5)]
    assert all(re.fullmatch(STAMPED.strip(), record["time"]) for record in records)


def test_a_log_that_was_moved_away_is_begun_anew(tmp_path: Path, err: Console) -> None:
    with ServiceLog(err, tmp_path / "log") as log:
        log.say(Topic.START, "before")
        until(lambda: len(lines_of(tmp_path / "log")) == 1)
        (tmp_path / "log").rename(tmp_path / "log.1")
        log.say(Topic.START, "after")
    assert lines_of(tmp_path / "log.1")[0].endswith("before")
    assert lines_of(tmp_path / "log")[0].endswith("after")


def test_a_disk_that_is_full_is_told_once_and_again_when_it_comes_back(tmp_path: Path, err: Console) -> None:
    with ServiceLog(err, Path("/dev/full")) as log:
        for number in range(5):
            log.say(Topic.START, f"line {number}")
        until(lambda: log.lost >= 5)
    lines = [line for line in lines_of(tmp_path / "err") if " stream: " in line]
    assert len(lines) == 1
    assert "lines for /dev/full are lost: [Errno 28]" in lines[0]


def test_a_reader_that_stops_reading_holds_nothing_up(tmp_path: Path, err: Console) -> None:
    source, sink = os.pipe()
    stream = os.fdopen(sink, "w")
    with ServiceLog(err, stream=stream) as log:
        start = time.monotonic()
        for number in range(CAPACITY + 5000):
            log.record({"number": number})
        assert time.monotonic() - start < 5.0
        assert log.lost >= 1
        os.close(source)  # else the rest would wait for it for ever
    with pytest.raises(BrokenPipeError):
        stream.close()
    assert any("records on stdout are lost: too slow a reader" in line for line in lines_of(tmp_path / "err"))


def test_a_reader_that_is_gone_is_told_once(tmp_path: Path, err: Console) -> None:
    source, sink = os.pipe()
    os.close(source)
    stream = os.fdopen(sink, "w")
    with ServiceLog(err, stream=stream) as log:
        for number in range(3):
            log.record({"number": number})
    with pytest.raises(BrokenPipeError):
        stream.close()
    lines = lines_of(tmp_path / "err")
    assert len(lines) == 1
    assert "Broken pipe" in lines[0]


@given(st.text())
def test_a_message_is_one_line_whatever_it_holds(text: str) -> None:
    assert len(one_line(text).splitlines()) <= 1
    assert "\x1b" not in one_line(f"{text}\x1b[2J")


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(5.0)
        yield listening


def environment(manager: socket.socket, **more: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": str(manager.getsockname()), **more}


def notifications(manager: socket.socket) -> list[str]:
    manager.setblocking(False)
    messages = []
    while True:
        try:
            messages.append(manager.recv(1000).decode())
        except BlockingIOError:
            return messages


def test_what_is_told(manager: socket.socket) -> None:
    notifier = Notifier(environment(manager))
    notifier.ready()
    notifier.status("waiting for can0\n  remedy: plug it in")
    notifier.alive()  # nobody watches
    notifier.stopping()
    assert notifications(manager) == ["READY=1", "STATUS=waiting for can0", "STOPPING=1"]


def test_a_manager_hears_of_state_and_links(manager: socket.socket, err: Console) -> None:
    c = effective_model(load_injector()).coefficients
    with ServiceLog(err) as log:
        logger = EventLogger(log, Notifier(environment(manager)), c, "")
        for topic in (Topic.STATE, Topic.INPUT, Topic.LINK):
            logger.hear(Notice(topic, f"{topic.name}\n  remedy: none"))
    assert notifications(manager) == ["STATUS=STATE", "STATUS=LINK"]


def test_the_watchdog_is_fed_three_times_in_its_time_out(manager: socket.socket) -> None:
    notifier = Notifier(environment(manager, WATCHDOG_USEC="300000", WATCHDOG_PID=str(os.getpid())))
    end = time.monotonic() + 0.55
    while time.monotonic() < end:
        notifier.alive()
        time.sleep(0.001)
    assert 4 <= len(notifications(manager)) <= 6


@pytest.mark.parametrize(
    ("timeout", "process", "messages"), [("300000", "1", 0), ("", "", 0), ("soon", "", 0), ("300000", "", 1)]
)
def test_only_a_watchdog_of_its_own_is_fed(manager: socket.socket, timeout: str, process: str, messages: int) -> None:
    Notifier(environment(manager, WATCHDOG_USEC=timeout, WATCHDOG_PID=process)).alive()
    assert len(notifications(manager)) == messages


def test_an_abstract_socket() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        name = f"observer-rt-test-{os.getpid()}"
        listening.bind(f"\0{name}")
        Notifier({"NOTIFY_SOCKET": f"@{name}"}).ready()
        assert listening.recv(100) == b"READY=1"


@pytest.mark.parametrize("settings", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_a_manager_nothing_happens(settings: dict[str, str]) -> None:
    notifier = Notifier(settings)
    notifier.ready()
    notifier.alive()
