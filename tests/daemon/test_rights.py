"""Real-time rights of a process, and processors of its loops: they are used where they are granted."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.daemon.rights import Processors, drop_priority, hurry, numbers_in, processors, rights
from tests.daemon.participants import until

LOCKED = """
from pathlib import Path
from observer_rt.daemon.rights import lock_memory, rights
granted = lock_memory(rights(50))
status = Path("/proc/self/status").read_text()
locked = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmLck"))
assert (locked > 0) == granted.may_lock_memory, (locked, granted)
"""
LIMITED = """
import os, resource
from observer_rt.daemon.rights import Rights, hurry, lock_memory, rights
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
if os.getuid() == 0:
    os.setresuid(65534, 65534, 65534)
assert not hurry(None, 0)
assert not hurry(None, 50)
assert lock_memory(rights(50)) == Rights(False, False, 50)
"""


def in_thread_of_its_own() -> tuple[bool, int, int]:
    """Whether a thread was granted priority, and its policies before and after it took time."""

    def ask() -> tuple[bool, int, int]:
        granted = hurry(None, 50)
        policy = os.sched_getscheduler(0)
        drop_priority()
        return granted, policy, os.sched_getscheduler(0)

    with ThreadPoolExecutor(1) as executor:
        return executor.submit(ask).result()


def test_priority_is_that_of_one_thread() -> None:
    granted, hurried, slow = in_thread_of_its_own()
    assert granted == rights(50).may_hurry
    assert (hurried, slow) == (os.SCHED_FIFO if granted else os.SCHED_OTHER, os.SCHED_OTHER)
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def run_alone(code: str) -> None:
    """Run code in a process of its own, because rights cannot be given back."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0, done.stderr


def test_memory_is_locked_where_it_is_said_to_be() -> None:
    run_alone(LOCKED)


def test_a_process_without_rights_goes_on_without() -> None:
    run_alone(LIMITED)


NOT_THERE = 8191


def test_what_is_not_there_is_said_and_the_rest_used() -> None:
    mine = min(os.sched_getaffinity(0))
    granted = processors([NOT_THERE, mine, mine], 3)
    assert (granted.own, granted.refused) == ((mine,), (NOT_THERE,))
    assert [granted.of(loop) for loop in range(3)] == [mine] * 3
    assert f"CPU {NOT_THERE} of realtime.cpus" in granted.trouble


def test_none_are_taken_where_none_are_asked_for() -> None:
    none = processors([], 2)
    assert none == Processors()
    assert none.of(0) is None
    assert none.trouble == ""
    assert processors(None, 0).own == ()


def test_no_more_than_there_are_loops() -> None:
    allowed_cpus = sorted(os.sched_getaffinity(0))
    assert processors(allowed_cpus, 1).own == (allowed_cpus[0],)


def test_isolated_ones_are_taken_without_being_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = max(os.sched_getaffinity(0))
    isolated = tmp_path / "isolated"
    isolated.write_text(f"{mine},{NOT_THERE}\n")
    monkeypatch.setattr("observer_rt.daemon.rights._ISOLATED", isolated)
    granted = processors(None, 2)
    assert (granted.own, granted.refused) == ((mine,), ())
    assert processors([], 2).own == ()
    isolated.write_text("\n")
    assert processors(None, 2).own == ()


def as_linux_writes(numbers: Iterable[int]) -> str:
    runs = groupby(enumerate(sorted(numbers)), lambda each: each[1] - each[0])
    ends = [[number for _, number in run] for _, run in runs]
    return ",".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in ends) + "\n"


@given(st.sets(st.integers(0, 300)))
def test_lists_of_linux(numbers: set[int]) -> None:
    assert numbers_in(as_linux_writes(numbers)) == tuple(sorted(numbers))


def test_the_loop_of_a_daemon_is_alone_on_its_processor(tmp_path: Path) -> None:
    own_cpus = os.sched_getaffinity(0)
    mine = max(own_cpus)
    bench = tmp_path / "bench.toml"
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    link = f'interface = "descriptor"\nchannel = "{ours.fileno()}"'
    text = EXAMPLE_BENCH.read_text().replace('interface = "socketcan"', link).replace('channel = "can0"', "")
    bench.write_text(f"{text}\n[realtime]\ncpus = [{mine}, {NOT_THERE}]\n")
    command = [sys.executable, "-m", "observer_rt", "run", "--bench", str(bench)]
    with (
        ours,
        theirs,
        subprocess.Popen(command, stderr=subprocess.PIPE, text=True, pass_fds=[ours.fileno()]) as daemon,
    ):
        assert daemon.stderr is not None
        said = []
        for line in daemon.stderr:
            said.append(line)
            if line.endswith("ready\n"):
                break
        until(lambda: {mine} in allowed(daemon.pid))
        cpus_by_thread = allowed(daemon.pid)
        daemon.terminate()
        said += daemon.stderr.readlines()
    others = own_cpus - {mine} or own_cpus
    assert sorted(map(sorted, cpus_by_thread)) == sorted([[mine], *[sorted(others)] * (len(cpus_by_thread) - 1)])
    assert any(f"the loop on CPU {mine}" in line for line in said), said
    assert any(f"WARNING start: CPU {NOT_THERE} of realtime.cpus cannot be used" in line for line in said)
    assert daemon.returncode == 0, said


def allowed(process: int) -> list[set[int]]:
    return [set(os.sched_getaffinity(int(task.name))) for task in Path(f"/proc/{process}/task").iterdir()]


TOUCHED = """
import resource
import numpy as np
from observer_rt.daemon.rights import touch
arrays = (np.zeros(1 << 20), (np.zeros(3, [("a", "f8"), ("b", "i1", 3)]), 5), np.broadcast_to(0.0, (1 << 40,)))
touch(arrays)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
arrays[0][::512] = 1.0
assert resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before < 100
assert not arrays[1][0]["b"].any()
"""


def test_memory_that_was_touched_is_there() -> None:
    run_alone(TOUCHED)
