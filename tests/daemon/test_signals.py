"""Signals are heard whatever the main thread is doing when they come."""

import signal
import sys
import threading
import time
from types import FrameType
from typing import Any, cast

from observer_rt.daemon.injector_service import InjectorService, serve_in_thread
from observer_rt.foundation.stop_request import SignalledEvent, stop_on_signals


class SignalledService:
    """A service that is sent a signal while the main thread waits for it; the signal wakes its own thread only."""

    was_stopped = False

    def run(self, stop: threading.Event) -> None:
        time.sleep(0.3)  # until the main thread waits
        signal.pthread_kill(threading.get_ident(), signal.SIGTERM)
        self.was_stopped = stop.wait(20.0)


def test_a_signal_that_does_not_interrupt_the_wait_for_the_service_is_heard() -> None:
    service, ended = SignalledService(), SignalledEvent()
    with stop_on_signals() as stop, stop.setting(ended):
        serve_in_thread(cast(InjectorService, service), ended, None)
    assert service.was_stopped


def test_an_event_can_be_set_at_every_step_of_a_wait_for_it() -> None:
    """As a signal's handler does, which runs between any two steps of the thread it interrupts."""
    event = SignalledEvent()

    def trace(frame: FrameType, what: str, argument: Any) -> Any:
        if frame.f_code.co_filename == threading.__file__ and frame.f_code.co_name == "wait":
            sys.settrace(None)
            event.set()
            sys.settrace(trace)
        return trace

    def wait_often() -> None:
        sys.settrace(trace)
        for _ in range(3):
            event.wait(0.001)
            event.clear()
        sys.settrace(None)

    thread = threading.Thread(target=wait_often, daemon=True)
    thread.start()
    thread.join(20.0)
    assert not thread.is_alive()
