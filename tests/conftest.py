"""Shared by all tests: the `vcan` fixture, and the count of tests that really used SocketCAN."""

from __future__ import annotations

import os
import signal
import socket
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from observer_rt.__main__ import calculate_in_one_thread, collect_seldom
from tests.interface import OwnInterface, own_interfaces

collect_seldom()
calculate_in_one_thread()  # before a test imports numpy, as the command does

# how long an example takes says nothing on a machine that does something else, too
examples = int(os.environ.get("OBSERVER_RT_TEST_EXAMPLES", "25"))
settings.register_profile(  # and what examples write anew may lie in one folder
    "unhurried", deadline=None, max_examples=examples, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
settings.load_profile("unhurried")

INTERFACE = "vcan0"
CAN_FD_MTU = 72
FLAG_UP = 1
OPENED = "opened a SocketCAN socket on"  # property of a test's report
# Names a file for `passed failed skipped opened`: tests that did, and tests that opened a socket on vcan0.
COUNTS_VARIABLE = "OBSERVER_RT_TEST_COUNTS"


def interface_ready() -> bool:
    folder = Path("/sys/class/net", INTERFACE)
    try:
        flags = int((folder / "flags").read_text(), 16)
        mtu = int((folder / "mtu").read_text())
    except OSError:
        return False
    return bool(flags & FLAG_UP) and mtu >= CAN_FD_MTU


@pytest.fixture
def vcan() -> str:
    """Name of a SocketCAN interface that is up and carries CAN FD; without one the test fails."""
    if not interface_ready():
        pytest.fail(f"no CAN FD interface {INTERFACE} here: run this test by `tools/vcan pytest ...`", pytrace=False)
    return INTERFACE


@pytest.fixture
def own_interface(vcan: str) -> Iterator[OwnInterface]:
    with own_interfaces("vcan9") as (interface,):
        yield interface


class SocketCounter:
    """Notes which tests bind a SocketCAN socket to vcan0, in several processes, counted where all reports come."""

    def __init__(self) -> None:
        self.tests: set[str] = set()
        self.seconds = defaultdict[str, float](float)
        self._running: pytest.Item | None = None
        sys.addaudithook(self._audit)

    def _audit(self, event: str, arguments: tuple[object, ...]) -> None:
        if event != "socket.bind" or self._running is None:
            return
        # The hook is called before the kernel answers; binding to a CAN interface that exists succeeds.
        match arguments:
            case (socket.socket(family=socket.AF_CAN), (str(name), *_)) if name == INTERFACE:
                if any(name == existing for _, existing in socket.if_nameindex()):
                    self._running.user_properties.append((OPENED, INTERFACE))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._running = item
        try:
            return (yield)
        finally:
            self._running = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up seconds of a folder, and count a test whose socket was seen, be it in another process."""
        self.seconds["/".join(report.nodeid.partition("::")[0].split("/")[1:-1][:2])] += report.duration
        if any(name == OPENED for name, _ in report.user_properties):
            self.tests.add(report.nodeid)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print folders by their seconds, the count where there could be any, and leave all counts for tools/test."""
        slowest = sorted(self.seconds.items(), key=lambda folder: -folder[1])[:12]
        terminalreporter.write_line(", ".join(f"{folder or 'tests'} {spent:.0f} s" for folder, spent in slowest))
        if interface_ready():
            terminalreporter.write_line(f"{INTERFACE}: {len(self.tests)} of these tests opened a socket on it")
        if COUNTS_VARIABLE in os.environ:
            stats = terminalreporter.stats
            passed, failed, errors, skipped = (
                len(stats.get(name, [])) for name in ("passed", "failed", "error", "skipped")
            )
            Path(os.environ[COUNTS_VARIABLE]).write_text(f"{passed} {failed + errors} {skipped} {len(self.tests)}\n")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the cases of a test as slow that follow its decisive ones."""
    cases = Counter[str]()
    for item in items:
        cases[test := item.nodeid.partition("[")[0]] += 1
        if (decisive := item.get_closest_marker("decisive")) and cases[test] > decisive.args[0]:
            item.add_marker(pytest.mark.slow)


def pytest_configure(config: pytest.Config) -> None:
    """Start counting; an interrupt counts, too, which a shell has ignored by what it starts in the background."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    config.pluginmanager.register(SocketCounter(), "socket-counter")
