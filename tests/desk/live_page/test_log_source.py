"""A log is shown from some time to another, at its own pace; one that is not there is refused at once."""

import threading
from pathlib import Path

import pytest

from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.config.bench import load_bench
from observer_rt.desk.live_page.watching import LogSource
from observer_rt.foundation.errors import UserError
from tests.desk.live_page.traffic import write_log

BUSES = load_bench().config.buses


def test_a_part_of_a_log(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    write_log(log, [BusFrame(0, Frame(0x100, bytes(8), 10**18 + n * 10**9)) for n in range(10)], ["can0"])
    came: list[int] = []
    source = LogSource(log, BUSES, (), 1e6, (3.0, 6.5))
    source.run(lambda _, now: came.append(now), threading.Event())
    assert [(now - 10**18) // 10**9 for now in came] == [3, 4, 5, 6]


def test_a_log_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such file"):
        LogSource(tmp_path / "nofile.blf", BUSES)
