"""What a user names as a recording: a file of signals, or a CAN log that a bench file decodes."""

from collections.abc import Sequence
from itertools import groupby, pairwise
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.logged import LoggedRecording, read_logged
from observer_rt.foundation.errors import UserError
from observer_rt.recording.formats import is_log, read_recording
from observer_rt.recording.signals.recording import Recording
from observer_rt.terminal.console import progress_bar, say, say_if_compiling

Source = Recording | LoggedRecording


def read_source(path: Path, bench: Bench | None, from_channels: Sequence[str], console: Console) -> Source:
    """Read a file; what is odd about a log is said. from_channels: of the log, as `--from-channel` names them.

    Raises `UserError` for an unknown suffix, a file that will not do, and a log without a bench file.
    """
    if not is_log(path):
        return read_recording(path)
    if bench is None:
        raise UserError(
            "--bench", f"is missing: it says which signals the frames of {path} carry", "name a bench file"
        )
    say_if_compiling(console)
    with progress_bar(console, f"decoding {path.name}", 1.0) as progress:
        logged = read_logged(bench, path, from_channels, progress)
    for note in logged.notes:
        say(console, note)
    return logged


def signals_of(source: Source) -> Recording:
    """The signals, whatever they were read from."""
    return source.recording if isinstance(source, LoggedRecording) else source


def in_runs(sources: Sequence[Source]) -> list[Sequence[Source]]:
    """Sources of one history, apart where one observer could not go on: an observer is a run.

    Recordings are sent by a device of our own, one after another. A log goes on from that before it where its first
    sample index lies beyond the other's last, as in files a recorder began anew; else the device was restarted.
    """
    number = 0
    numbers = [0] * len(sources[:1])
    for before, after in pairwise(sources):
        number += not _goes_on(before, after)
        numbers.append(number)
    numbered = groupby(zip(numbers, sources, strict=True), key=lambda pair: pair[0])
    return [[source for _, source in pairs] for _, pairs in numbered]


def _goes_on(before: Source, after: Source) -> bool:
    if isinstance(before, LoggedRecording) and isinstance(after, LoggedRecording):
        return after.first_index >= before.first_index + before.recording.samples
    return isinstance(before, Recording) and isinstance(after, Recording)
