"""`observer-rt record`: the buses of a bench into a file, with a live line on the screen."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.text import Text

from observer_rt.bus.links.open import open_link
from observer_rt.config.links import NamedLink
from observer_rt.recording.record.recorder import RecordLimits, RecordStatistics, check_recording_path, record
from observer_rt.terminal.console import say
from observer_rt.terminal.destinations import check_folder
from observer_rt.terminal.stop import stop_on_signals


def record_buses(
    buses: Sequence[NamedLink], path: Path, limits: RecordLimits, force: bool, console: Console
) -> RecordStatistics:
    """Record all buses into one log until SIGINT, SIGTERM or a limit.

    Raises `UserError` for a file that must not be written, `RunError` when link or disk fail.
    """
    check_recording_path(path, limits, force)
    check_folder("--out", path.absolute().parent)
    channels = [bus.config.channel for bus in buses]
    names = [
        bus.name if channels.count(bus.config.channel) > 1 and bus.name else bus.config.channel
        for bus in buses
    ]
    with (
        stop_on_signals() as stop,
        ExitStack() as stack,
        Live(console=console, auto_refresh=False, transient=True) as live,
    ):
        links = [
            stack.enter_context(
                open_link(
                    bus.config.interface, bus.config.channel, bus.config.fd, computer_time=len(buses) > 1
                )
            )
            for bus in buses
        ]
        say(console, f"recording {', '.join(f'{bus.config.interface} {bus.label}' for bus in buses)}")
        further = list(zip(links[1:], names[1:], strict=True))
        return record(links[0], names[0], path, limits, stop, _Line(live, console), further)


class _Line:
    """Frames so far, and how many came in a second of late; on a terminal only."""

    def __init__(self, live: Live, console: Console) -> None:
        self._live = live if console.is_terminal else None
        self._frames = 0
        self._moment = 0.0

    def __call__(self, so_far: RecordStatistics) -> None:
        if self._live is None:
            return
        passed = so_far.duration - self._moment
        rate = (so_far.frames - self._frames) / passed if passed else 0.0
        self._frames, self._moment = so_far.frames, so_far.duration
        name = so_far.files[-1].name if so_far.files else "waiting for frames"
        line = f"{name}: {so_far.frames} frames, {rate:.0f} a second, {so_far.lost} lost, {so_far.duration:.0f} s"
        self._live.update(Text(line), refresh=True)
