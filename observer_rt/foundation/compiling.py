"""Shows that Numba compiles, which keeps the first command of a version waiting: a line and, on a terminal, a bar."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress

from numba.core import event
from rich.console import Console
from rich.errors import LiveError

from observer_rt.foundation.compilation import compiled_code
from observer_rt.foundation.console import progress_bar, say

PATIENCE = 1.0  # s of compiling before a word is said of it
IDLE = 0.5  # s without anything compiled, after which the bar goes
USUAL = 430  # functions of a first command, about
_LOOK = 0.1  # s
_COMPILE = "numba:compile"


class CompilingShown(event.Listener):
    """Hears of every function that this process compiles, and says so once."""

    def __init__(
        self,
        tell: Callable[[str], None],
        console: Console | None = None,
        is_stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """tell: takes the line; console: where the bar is drawn, None: nowhere; is_stopped: see `tell_compiling`."""
        self._tell = tell
        self._is_stopped = is_stopped
        self._console = console
        self._at_work = 0  # functions begun and not ended, of all threads
        self._functions = 0
        self._begun = self._heard = 0.0
        self._told = self._drawn = False
        self._lock = threading.Lock()

    def on_start(self, event: event.Event) -> None:
        """A function is begun; those it calls follow before it ends. Raises `KeyboardInterrupt` once stopped."""
        if self._is_stopped():
            raise KeyboardInterrupt
        with self._lock:
            self._at_work += 1
            self._begun = self._begun or time.monotonic()

    def on_end(self, event: event.Event) -> None:
        """A function is compiled."""
        with self._lock:
            self._at_work -= 1
            self._functions += 1
            self._heard = time.monotonic()
            if self._drawn or self._heard - self._begun < PATIENCE:
                return
            is_news, self._told = not self._told, True
            self._drawn = True
        if is_news:
            self._tell("compiling what this needs: once for this version and a kind of line, up to a minute")
        if self._console is not None:
            threading.Thread(target=self._draw, name="compiling", daemon=True).start()

    def _draw(self) -> None:
        assert self._console is not None
        with suppress(LiveError), progress_bar(self._console, "compiling functions", USUAL) as progress:
            while self._at_work or time.monotonic() - self._heard < IDLE:
                progress(min(self._functions, USUAL - 1))
                time.sleep(_LOOK)
        with self._lock:
            self._drawn, self._begun = False, 0.0


def show_compiling(console: Console) -> None:
    """Show whatever is compiled from here on; to be called before the first compiled function."""
    tell_compiling(lambda text: say(console, text), console)
    if trouble := compiled_code().trouble:
        say(console, f"warning: {trouble}\n  remedy: {compiled_code().remedy}")


def tell_compiling(
    tell: Callable[[str], None],
    console: Console | None = None,
    is_stopped: Callable[[], bool] = lambda: False,
) -> None:
    """The same by whatever takes a line, in place of who took it before; console: where a bar is, if anywhere.

    is_stopped: whether to go on no further; what then compiles gets a `KeyboardInterrupt`, between two functions.
    """
    for before in _listening:
        event.unregister(_COMPILE, before)
    _listening[:] = [CompilingShown(tell, console, is_stopped)]
    event.register(_COMPILE, _listening[0])


_listening: list[CompilingShown] = []  # one at most
