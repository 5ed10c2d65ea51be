"""Before the daemon is ready, all that an event calls has been called."""

import threading
from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.foundation.errors import RunError
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.warm_up import INJECTIONS, learning_compiled_beside, warm_up
from tests.service.participants import bench_file


def test_injections_were_learned_from_and_judged(bench: Path) -> None:
    loaded = load_bench(bench)
    core = warm_up(loaded, map_bus(loaded))
    counters = core.counters
    assert (counters.injections, counters.adoptions) == (INJECTIONS, INJECTIONS)
    assert core.state == (State.ADAPTED, Reason.NONE)


@pytest.fixture
def deaf(tmp_path: Path) -> Path:
    """A bench whose rates have the identifier of its samples: what it sends to itself never seems to come."""
    path = bench_file(tmp_path, "0", "descriptor")
    text = path.read_text()
    assert "# injection_rate_id = 0x200" in text
    path.write_text(text.replace("# injection_rate_id = 0x200", "injection_rate_id = 0x100"))
    return path


@pytest.mark.slow
def test_frames_that_do_not_come_through_are_an_error(deaf: Path) -> None:
    loaded = load_bench(deaf)
    with pytest.raises(
        RunError, match="0 came through, then none for 10 s\n  remedy: see what `observer-rt check`"
    ):
        warm_up(loaded, map_bus(loaded))


def test_it_ends_when_it_is_told_to_while_it_waits(deaf: Path) -> None:
    loaded = load_bench(deaf)
    bus = map_bus(loaded)
    stop = threading.Event()
    ended = threading.Event()

    def waiting() -> None:
        warm_up(loaded, bus, stop)
        ended.set()

    threading.Thread(target=waiting, daemon=True).start()
    assert not ended.wait(3.0)
    stop.set()
    assert ended.wait(60.0)


def test_nothing_is_observed_once_it_is_to_stop(bench: Path) -> None:
    loaded = load_bench(bench)
    stop = threading.Event()
    stop.set()
    assert warm_up(loaded, map_bus(loaded), stop).processed == 0


def test_another_process_compiles_what_learning_calls(bench: Path) -> None:
    """It learns from the bench's own injections without a failure."""
    with learning_compiled_beside(load_bench(bench).injector) as wait:
        assert wait() == 0
