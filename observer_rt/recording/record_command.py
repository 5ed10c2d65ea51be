"""`observer-rt record`: a bus into a file, with a live line on the screen."""

from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.text import Text

from observer_rt.bus.link import open_link
from observer_rt.config import LinkConfig
from observer_rt.destinations import check_folder
from observer_rt.recording.recorder import RecordLimits, RecordStatistics, check_recording_path, record
from observer_rt.screen import say
from observer_rt.signals import stop_on_signals


def record_bus(
    config: LinkConfig, path: Path, limits: RecordLimits, force: bool, console: Console
) -> RecordStatistics:
    """Record until SIGINT, SIGTERM or a limit.

    Raises `UserError` for a file that must not be written, `RunError` when link or disk fail.
    """
    check_recording_path(path, limits, force)
    check_folder("--out", path.absolute().parent)
    with (
        stop_on_signals() as stop,
        open_link(config.interface, config.channel, config.fd) as link,
        Live(console=console, auto_refresh=False, transient=True) as live,
    ):
        say(console, f"recording {config.interface} {config.channel}")
        return record(link, config.channel, path, limits, stop, _Line(live, console))


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
