"""Rights of a process: what it may ask for is what it gets."""

import os
import resource
import subprocess
import sys
import threading

from observer_rt.service.rights import PRIORITY, Rights, hurry, rights, take_time

LOCKED = """
from pathlib import Path
from observer_rt.service.rights import lock_memory, rights
granted = lock_memory(rights())
status = Path("/proc/self/status").read_text()
locked = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmLck"))
assert (locked > 0) == granted.may_lock_memory, (locked, granted)
"""
LIMITED = """
import os, resource
from observer_rt.service.rights import Rights, hurry, lock_memory, rights
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
if os.getuid() == 0:
    os.setresuid(65534, 65534, 65534)
assert not hurry()
assert lock_memory(rights()) == Rights(False, False)
"""


def in_thread_of_its_own() -> tuple[bool, int, int]:
    """Whether a thread was granted priority, and its policies before and after it took time."""
    found: list[tuple[bool, int, int]] = []

    def ask() -> None:
        granted = hurry()
        policy = os.sched_getscheduler(0)
        take_time()
        found.append((granted, policy, os.sched_getscheduler(0)))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return found[0]


def test_priority_is_that_of_one_thread() -> None:
    granted, hurried, slow = in_thread_of_its_own()
    assert granted == rights().may_hurry
    assert hurried == (os.SCHED_FIFO if granted else os.SCHED_OTHER)
    assert slow == os.SCHED_OTHER
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def run_alone(code: str) -> None:
    """In a process of its own, which keeps what it asks for."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0, done.stderr


def test_memory_is_locked_where_it_is_said_to_be() -> None:
    run_alone(LOCKED)


def test_a_process_without_rights_goes_on_without() -> None:
    run_alone(LIMITED)


def test_what_is_said() -> None:
    assert Rights(True, False).as_text() == f"real time: priority {PRIORITY} for the loop, memory not locked"
    assert resource.getrlimit(resource.RLIMIT_RTPRIO)[0] == resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
