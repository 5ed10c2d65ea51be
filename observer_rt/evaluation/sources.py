"""What a user names as recordings, files and CAN logs: opened, without truths, in runs of one observer."""

from collections.abc import Sequence
from itertools import groupby, pairwise
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.foundation.errors import UserError
from observer_rt.recording.formats import is_log, open_recording
from observer_rt.recording.signals.plausible import refuse_implausible
from observer_rt.recording.signals.recording import TRUTH_SUFFIX
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.terminal.compiling import show_compiling
from observer_rt.terminal.console import progress_bar, say


def open_source(
    path: Path, bench: Bench | None, from_channels: Sequence[str], console: Console, in_one_go: bool = False
) -> SignalStream:
    """Look through a file; what is odd about it is said. from_channels: of a log, as `--from-channel` names them.

    in_one_go: as of `open_recording`; `refuse_implausible` is then for whoever has read it.

    Raises `UserError` for an unknown suffix, a file that will not do, signals that are no injector's, and a log
    without a bench file.
    """
    if not is_log(path):
        with progress_bar(console, f"looking through {path.name}", None):
            source = open_recording(path, None if bench is None else bench.injector, in_one_go)
    elif bench is None:
        raise UserError(
            "--bench", f"is missing: it says which signals the frames of {path} carry", "name a bench file"
        )
    else:
        show_compiling(console)
        with progress_bar(console, f"decoding {path.name}", 1.0) as progress:
            source = LoggedSignals(bench, path, from_channels, progress)
    if not in_one_go:
        refuse_implausible(path, source.survey, source.names)
    for note in source.notes:
        say(console, note)
    return source


def without_truths(paths: Sequence[Path], console: Console) -> list[Path]:
    """The files without the truths beside simulated recordings, which `*.csv` catches, too."""
    kept = [path for path in paths if not path.name.endswith(TRUTH_SUFFIX)]
    if kept and len(kept) < len(paths):
        say(
            console,
            f"left out: {len(paths) - len(kept)} files {TRUTH_SUFFIX[1:]}, which are not for the observer",
        )
    return kept or list(paths)


def in_runs(sources: Sequence[SignalStream]) -> list[Sequence[SignalStream]]:
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


def _goes_on(before: SignalStream, after: SignalStream) -> bool:
    if isinstance(before, LoggedSignals) and isinstance(after, LoggedSignals):
        return after.logged[0].first_index > before.logged[-1].last_index
    return not isinstance(before, LoggedSignals) and not isinstance(after, LoggedSignals)
