"""`observer-rt run` in this process: its signals, its learned state, its exit codes."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.daemon import injector_service
from observer_rt.daemon.control_socket import Message, ask, socket_places
from observer_rt.daemon.journal import read_journal
from observer_rt.daemon.state_file import learned_beside, load_knowledge, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.formats import read_recording
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.errors import RunError
from observer_rt.model.accuracy import Accuracy
from tests.daemon.end_to_end import SUMMARY, ResultFrames, decoded
from tests.daemon.participants import BLOCK_ID, ScriptedLink, until
from tests.daemon.test_log import notifications
from tests.desk.cli.bench_engineer import run_and_stop
from tests.desk.cli.conftest import Command, module
from tests.desk.cli.injector_files import worn_file
from tests.device import frames_of
from tests.links import FakeLink


@pytest.fixture
def bench(bench: Path, tmp_path: Path) -> Path:
    text = bench.read_text().replace("lockstep = false", "lockstep = true")
    bench.write_text(text.replace('"can0"', f'"{tmp_path.name}"'))
    return bench


def valid_injections(results: ResultFrames) -> list[float]:
    return [decoded(SUMMARY, payload)["Valid"] for payload in results.summaries]


EARLIER = "2026-03-01T12:00:00.000+01:00 INFO stop: an earlier run"


def test_a_signal_ends_a_run_with_results_kept(command: Command, bench: Path, worn: Path, tmp_path: Path) -> None:
    """Without a terminal the view gives way to lines."""
    state, log, before = tmp_path / "learned.json", tmp_path / "run.log", signal.getsignal(signal.SIGTERM)
    bench.write_text(bench.read_text().replace('# journal = "injections.sqlite"', 'journal = "mine.sqlite"'))
    log.write_text(f"{EARLIER}\n")
    outcome, results = run_and_stop(command, bench, worn, "--view", "--json", "--log", log, "--state", state)
    assert outcome.code == 0
    for words in (
        *("no terminal for the view", f"no learned state at {state}", "ready", "time stamps: arrival"),
        *("stopped after", f"learned state saved in {state}", "4 injections in the journal"),
    ):
        assert words in outcome.err
    assert signal.getsignal(signal.SIGTERM) == before
    assert results.last_status()["SamplesProcessed"] == read_recording(worn).samples
    assert valid_injections(results) == [1, 1, 1, 1]
    records = [json.loads(line) for line in outcome.out.splitlines()]
    assert [(each["number"], each["valid"]) for each in records] == [(1, 1), (2, 1), (3, 1), (4, 1)]
    assert all(record["end_index"] > record["start_index"] > 0 for record in records)
    lines = log.read_text().splitlines()
    assert lines[0] == EARLIER
    assert lines[1:] == outcome.err.splitlines()
    rows = read_journal(tmp_path / "mine.sqlite").injections
    assert [row["reasons"] for row in rows] == [""] * 4
    for row in rows:
        record = f"INFO injection: injection {row['number']} at index {row['start_index']}: {row['mass_mg']:.2f} mg"
        assert sum(record in line for line in lines) == 1
    second, results = run_and_stop(command, bench, worn, "--state", state, number=signal.SIGINT)
    assert second.code == 0
    assert "learned state restored" in second.err
    assert "learned from 4 events" in second.err
    assert valid_injections(results) == [1, 1, 1, 1]
    restored = load_knowledge(state, load_injector()).knowledge
    assert restored is not None
    assert restored.state.events == 8


def test_signal_while_starting_is_not_lost(bench: Path, tmp_path: Path) -> None:
    """From the first message on the process can be stopped, ready or not."""
    state = tmp_path / "learned.json"
    process = module("run", "--bench", bench, "--state", state, environment={"HOME": str(tmp_path)})
    assert process.stderr is not None
    assert "no learned state" in process.stderr.readline()
    process.send_signal(signal.SIGTERM)
    _, messages = process.communicate(timeout=120)
    assert process.returncode == 0, messages
    assert "Traceback" not in messages
    assert "stop: " in messages


def said_in(capture: Path, text: str) -> bool:
    return capture.exists() and text in capture.read_text()


def test_hang_up_takes_over_a_bench_file_that_was_changed(
    command: Command, bench: Path, worn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Knowledge goes on without a file; a mistaken file or an unusable interface leaves the one before in force."""
    log = tmp_path / "run.log"
    text = bench.read_text()

    def changed_to(new: str, said: str, old: str = "bridge_ms = 0.5") -> None:
        bench.write_text(text.replace(old, new))
        os.kill(os.getpid(), signal.SIGHUP)
        until(lambda: said_in(log, said))

    def hang_up() -> bool:
        changed_to("bridge_ms = 50", "not taken over, the one before goes on")
        changed_to("bridge_ms = 0.5", "is as it was: nothing to take over")
        changed_to("bridge_ms = 0.75", "what was learned from 4 events goes on in force")
        until(lambda: log.read_text().count("start: ready") == 2)
        unusable = "cannot be served, the one before goes on: link.interface: 'vector'"
        changed_to('interface = "vector"', unusable, 'interface = "virtual"')
        until(lambda: log.read_text().count("start: ready") == 3)
        return True

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "6000000")
        outcome, _ = run_and_stop(command, bench, worn, "--injector=", "--log", log, meanwhile=hang_up)
        messages = notifications(manager)
    assert outcome.code == 0
    assert "sampling.bridge_ms: 50 is not allowed; remedy: it should be less than or equal to 5" in outcome.err
    assert "is taken over: sampling\n" in outcome.err
    assert outcome.err.count("stop: stopped after") == 3
    assert (messages[0], messages[-1]) == ("READY=1", "STOPPING=1")
    assert messages.count("STOPPING=1") == 1
    assert "WATCHDOG=1" in messages


def test_a_reload_goes_on_where_what_was_learned_cannot_be_saved(
    command: Command, bench: Path, worn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The log and the answer say so; it is saved again once there is room."""
    log, state, injector = tmp_path / "run.log", tmp_path / "learned.json", load_bench(bench).injector
    is_full = threading.Event()

    def save(path: Path, *knowledge: Any) -> None:
        if is_full.is_set():
            raise RunError(f"{path}: the learned state cannot be written: the disk is full")
        save_knowledge(path, *knowledge)

    monkeypatch.setattr("observer_rt.daemon.keeper.save_knowledge", save)
    answers: list[Message] = []

    def reload() -> bool:
        is_full.set()
        bench.write_text(bench.read_text().replace("bridge_ms = 0.5", "bridge_ms = 0.75"))
        asked = {"request": "reload", "model": model_hash(injector.parameters)}
        answers.extend(filter(None, (ask(file, asked) for file in socket_places(injector, state))))
        until(lambda: log.read_text().count("start: ready") == 2)
        is_full.clear()
        return True

    options = ("--log", log, "--state", state)
    outcome, _ = run_and_stop(command, bench, worn, *options, meanwhile=reload)
    assert outcome.code == 0
    assert [f"{state}: the learned state cannot be written" in answer["unsaved"] for answer in answers] == [True]
    assert "WARNING start: " in outcome.err
    assert "the reload goes on; what was learned with the model before is kept by this process only" in outcome.err
    assert "what was learned from 4 events goes on in force" in outcome.err
    assert f"learned state saved in {state}" in outcome.err


def test_an_amended_model_begins_with_what_was_learned_for_it_and_undo_with_what_was_before(
    command: Command, bench: Path, worn: Path, tmp_path: Path
) -> None:
    log, amended, text = tmp_path / "run.log", tmp_path / "amended.toml", bench.read_text()
    worn_file(amended)
    learned = evaluate(load_bench(bench, amended), [read_recording(worn)]).knowledge
    save_knowledge(learned_beside(amended), learned, load_injector(amended))

    def changed_to(new: str, said: str) -> None:
        ready = log.read_text().count("start: ready")
        bench.write_text(new)
        os.kill(os.getpid(), signal.SIGHUP)
        until(lambda: said_in(log, said))
        until(lambda: log.read_text().count("start: ready") > ready)

    def taken_over_and_undone() -> bool:
        changed_to(
            text.replace('# file = "injector.toml"', 'file = "amended.toml"'),
            f"learned state restored from {learned_beside(amended)}",
        )
        changed_to(text, "what was learned from 4 events goes on in force")
        return True

    outcome, _ = run_and_stop(command, bench, worn, "--log", log, meanwhile=taken_over_and_undone)
    assert outcome.code == 0
    assert "warning" not in outcome.err.lower()


def test_a_terminal_that_hangs_up_ends_it_in_order(bench: Path, tmp_path: Path) -> None:
    log, state = tmp_path / "run.log", tmp_path / "learned.json"
    ours, theirs = os.openpty()
    files = {"--bench": bench, "--log": log, "--state": state}
    words = [sys.executable, "-m", "observer_rt", "run", *(str(word) for pair in files.items() for word in pair)]
    buffered = os.environ | {"PYTHONUNBUFFERED": ""}  # so that something is left to be written at the end
    process = subprocess.Popen(
        words, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True, env=buffered
    )
    os.close(theirs)
    until(lambda: said_in(log, "start: ready"))
    os.close(ours)
    for _ in range(2):  # as kernel and shell do
        process.send_signal(signal.SIGHUP)
    assert process.wait(timeout=60) == 0
    assert said_in(log, "stop: stopped after")
    assert state.exists()


@pytest.mark.parametrize(
    ("option", "path"), [("--print-example-bench", EXAMPLE_BENCH), ("--print-example-injector", NOMINAL_INJECTOR)]
)
def test_examples_can_be_used_as_they_are(command: Command, tmp_path: Path, option: str, path: Path) -> None:
    outcome = command.done("run", option)
    assert outcome.out == path.read_text()
    (tmp_path / path.name).write_text(outcome.out)
    if option == "--print-example-bench":
        bench = load_bench(tmp_path / path.name)
        assert bench.config == load_bench().config
        assert bench.injector.config.signals.rail_pressure.accuracy_percent == 0.7
    else:
        injector = load_injector(tmp_path / path.name)
        assert injector.accuracy == Accuracy()
        assert injector == load_injector()


def test_an_interface_that_is_not_there_is_waited_for(
    command: Command, bench: Path, worn: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the start as later: a missing link is reported once, and the service begins as soon as it is there."""
    link = ScriptedLink(frames_of(bench, worn), RunError("that was it"))
    tries: list[str] = []
    monkeypatch.setattr(injector_service, "REOPEN", 0.02)

    def opened(_interface: str, channel: str, _fd: bool, wanted: list[tuple[int, bool]], *_: object) -> Link:
        tries.append(channel)
        if len(tries) < 4:
            raise LinkDownError(f"there is no interface {channel}\n  remedy: plug it in")
        return link if (BLOCK_ID, False) in wanted else FakeLink()

    monkeypatch.setattr(injector_service, "open_link", opened)
    outcome = command("run", "--bench", bench)
    assert outcome.code == 1
    channel = load_bench(bench).config.link.channel
    assert outcome.err.count(f"waiting for the interface: there is no interface {channel}; remedy: plug") == 1
    assert f"INFO link: {channel} is there" in outcome.err
    assert "injection 4 at index" in outcome.err


def test_another_sender_is_told_before_anything_is_sent_and_what_check_warns_of_starts(
    command: Command, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.write_text(bench.read_text().replace("needle_lift_um = 0.4", "needle_lift_um = 10"))
    other = TimedFrame(0.0, 0x202, False, True, bytes(64))

    def opened(_interface: str, _channel: str, _fd: bool, wanted: list[tuple[int, bool]], *_: object) -> Link:
        is_input = (BLOCK_ID, False) in wanted
        return ScriptedLink((), RunError("that was it")) if is_input else ScriptedLink([other])

    monkeypatch.setattr(injector_service, "open_link", opened)
    outcome = command("run", "--bench", bench)
    assert "WARNING sender: another node sends ObserverStatus 0x202 already; remedy: stop" in outcome.err
    assert outcome.err.index("sender:") < outcome.err.index("ready")
