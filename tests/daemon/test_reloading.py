"""The bench file is read again when a signal asks for it."""

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from observer_rt.config.bench import load_bench
from observer_rt.daemon.reloading import Reloading
from observer_rt.foundation.stop_request import StopRequest
from tests.daemon.participants import until


def test_a_signal_has_the_file_taken_over_where_it_was_changed(bench: Path) -> None:
    served, said, stop = load_bench(bench), list[str](), StopRequest()
    service: Any = SimpleNamespace(model="", other_bench=None, is_between_events=True)
    changed = served.with_sections(learning=served.injector.config.learning.model_copy(update={"event_gap_ms": 5.0}))
    files = iter((served, changed))
    with (
        ExitStack() as stack,
        Reloading(stop, lambda: next(files), said.append, stack).watching(served, service) as (ended, successor),
    ):
        stop.reload.set()
        until(lambda: bool(said), 5.0)
        assert (successor(), ended.is_set()) == (None, False)
        stop.reload.set()
        assert ended.wait(5.0)
        assert successor() is changed
    assert [line.partition(" is ")[2] for line in said] == ["as it was: nothing to take over", "taken over: learning"]
