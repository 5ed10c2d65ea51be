"""Damaged files of every format, given to the commands: what becomes of them, and that nothing crashes.

Files are made whole, damaged by a seed, and converted as a user would; databases are mapped as a bench names them.
"""

import contextlib
import gzip
import os
import random
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.cli.app import main
from observer_rt.config.bench import EXAMPLE_BENCH, PACKAGE_DATA, load_bench
from observer_rt.foundation.errors import UserError
from observer_rt.recording import formats
from observer_rt.recording.canlog.can_log import LogFrame
from observer_rt.recording.signals.recording import Recording
from observer_rt.terminal.console import progress_bar
from tools.benchmarks.logger_file import Field, write_logger_file
from tools.benchmarks.pool import Crash, run_tasks

FRAMES = 40
SAMPLES = 60
START = 1_700_000_000_000_000_000  # ns since 1970
STORED = (
    Field("ID", 29),
    Field("IDE", 1),
    Field("DataLength", 7),
    Field("EDL", 1),
    Field("BRS", 1),
    Field("ESI", 1),
    Field("Dir", 1),
    Field("BusChannel", 0, offset=1),
)
DATABASE = "database.dbc"
LONG = 30.0  # s, for one of these small files, on a machine that has other work


class Became(StrEnum):
    """What became of a damaged file."""

    REFUSED = "refused"
    TOLD = "read, something told"
    SAME = "read as undamaged"
    CHANGED = "read otherwise, nothing told"
    FAULT = "fault"


class Task(NamedTuple):
    """A file to be damaged: the kind, and what determines the damage."""

    kind: str
    seed: int
    number: int


@dataclass(frozen=True)
class Outcome:
    """What became of one file, in how many seconds; `said` on the screen, or of the fault."""

    task: Task
    became: Became
    seconds: float
    said: str = ""


@dataclass
class Campaign:
    """All outcomes so far."""

    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def faults(self) -> list[Outcome]:
        """Tracebacks, output on stdout, results that cannot be read, and files that took long."""
        return [each for each in self.outcomes if each.became is Became.FAULT]


def run_damage(files: int, seed: int, workers: int, console: Console) -> Campaign:
    """Damage so many files, the kinds in turn. Raises `RunError` where a process of ours was ended by one."""
    kinds = list(_makers())
    tasks = [Task(kinds[number % len(kinds)], seed, number) for number in range(files)]
    campaign = Campaign()
    with progress_bar(console, "damaging", float(files)) as progress:
        for result in run_tasks(one_file, tasks, workers, _warm_up):
            if isinstance(result, Crash):
                result = Outcome(result.task, Became.FAULT, 0.0, result.message)
            campaign.outcomes.append(result)
            progress(float(len(campaign.outcomes)))
    return campaign


def damage_table(campaign: Campaign) -> Table:
    """The outcomes for a screen, kind by kind."""
    table = Table(box=None, pad_edge=False)
    for heading in ("kind", "files", *Became, "longest s"):
        table.add_column(heading, justify="left" if heading == "kind" else "right")
    for kind in (*_makers(), "all"):
        chosen = [each for each in campaign.outcomes if kind in (each.task.kind, "all")]
        if chosen:
            counts = Counter(each.became for each in chosen)
            longest = max(each.seconds for each in chosen)
            table.add_row(kind, str(len(chosen)), *(str(counts[b]) for b in Became), f"{longest:.2f}")
    return table


def damage_document(campaign: Campaign) -> dict[str, Any]:
    """The outcomes for a program."""
    counts = Counter(each.became for each in campaign.outcomes)
    figures = {"files": len(campaign.outcomes)} | {b.name.lower(): counts[b] for b in Became}
    return {"figures": figures, "faults": [[*each.task, each.said] for each in campaign.faults]}


def one_file(task: Task) -> Outcome:
    """Damage a file and give it to the command that reads its kind."""
    with tempfile.TemporaryDirectory(prefix="damage-") as name:
        folder = Path(name)
        path = folder / task.kind
        damage = random.Random(f"{task.seed} {task.number}")
        path.write_bytes(_damaged(_whole(task.kind), damage))
        begun = time.perf_counter()
        became, said = (_mapped if task.kind == DATABASE else _converted)(path, task.number)
        seconds = time.perf_counter() - begun
        if seconds > LONG:
            became, said = Became.FAULT, f"took {seconds:.1f} s; {said}"
        return Outcome(task, became, seconds, said)


def _damaged(data: bytes, chance: random.Random) -> bytes:
    """Some of a file's bytes changed, missing, repeated, or its end cut off."""
    size = len(data)
    place = chance.randrange(size)
    length = min(chance.choice((1, 2, 8, 64, 500)), size - place)
    kind = chance.choice(("bit", "bit", "bits", "byte", "noise", "zero", "gone", "twice", "cut", "link"))
    if kind in ("bit", "bits"):
        changed = bytearray(data)
        for _ in range(1 if kind == "bit" else chance.randrange(2, 20)):
            changed[chance.randrange(size)] ^= 1 << chance.randrange(8)
        return bytes(changed)
    if kind == "link":  # what is 8 bytes long and leads somewhere, leads elsewhere
        place = place // 8 * 8
        other = chance.choice((0, size, size - 8, place, chance.randrange(size), 1 << chance.randrange(64)))
        return data[:place] + other.to_bytes(8, "little") + data[place + 8 :]
    new = {
        "byte": chance.randbytes(1),
        "noise": chance.randbytes(length),
        "zero": bytes(length),
        "gone": b"",
        "twice": data[place : place + length] * 2,
        "cut": b"",
    }[kind]
    end = size if kind == "cut" else place + (1 if kind == "byte" else length)
    return data[:place] + new + data[end:]


def _converted(path: Path, number: int) -> tuple[Became, str]:
    """What `convert` makes of a file of signals or frames."""
    suffixes = [".csv"] if path.name.startswith("signals") else [".log", ".blf", ".asc", ".mf4"]
    target = path.with_name(f"out{suffixes[number % len(suffixes)]}")
    code, out, err = _run("convert", path, target)
    if code not in (0, 1, 2) or "Traceback" in out + err or ".part" in err:
        return Became.FAULT, f"exit code {code}: {out}{err}"
    if code != 0:
        named = path.name in err or target.name in err
        return (Became.REFUSED, err) if named and not out else (Became.FAULT, f"unnamed: {out}{err}")
    if out.count("\n") != 1:
        return Became.FAULT, f"on stdout: {out}"
    try:
        content = _content(target)
    except Exception as error:  # whatever is wrong with what was written
        return Became.FAULT, f"writes what cannot be read: {error}"
    if err:
        return Became.TOLD, err
    return (Became.SAME if content == _whole_content(path.name, target.suffix) else Became.CHANGED), ""


def _mapped(path: Path, number: int) -> tuple[Became, str]:
    """What a bench makes of a damaged database, read strictly or leniently."""
    bench = path.with_name("bench.toml")
    bench.write_text(_bench(number % 2 == 0))
    try:
        found = map_bus(load_bench(bench))
    except UserError as error:
        is_named = str(path.parent) in str(error)
        return (Became.REFUSED if is_named else Became.FAULT), str(error)
    except Exception:  # what would be a traceback on a user's screen
        return Became.FAULT, traceback.format_exc()
    return (Became.SAME if repr(found) == _whole_map() else Became.CHANGED), ""


def _run(*arguments: object) -> tuple[int | str | None, str, str]:
    """Run a command: exit code, stdout, stderr, of foreign code too."""
    sys.argv = ["observer-rt", *map(str, arguments)]
    with _captured() as screen:
        try:
            main()
            code: int | str | None = 0
        except SystemExit as end:
            code = end.code or 0
        except BaseException:
            traceback.print_exc()
            code = "exception"
    out, err = screen
    return code, out, err


@contextlib.contextmanager
def _captured() -> Iterator[list[str]]:
    """What is written to the two outputs meanwhile, by whatever code."""
    texts: list[str] = []
    with (
        tempfile.TemporaryFile("w+", errors="replace") as out,
        tempfile.TemporaryFile("w+", errors="replace") as err,
    ):
        kept = os.dup(1), os.dup(2)
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                yield texts
        finally:
            for number, (descriptor, file) in enumerate(zip(kept, (out, err), strict=True), start=1):
                os.dup2(descriptor, number)
                os.close(descriptor)
                file.seek(0)
                texts.append(file.read())


def _content(path: Path) -> Sequence[object]:
    if formats.is_log(path):
        return [(entry.frame, entry.is_sent) for entry in formats.open_log(path)]
    recording = formats.read_recording(path)
    return [values.tolist() for values in recording.signals.values()]


@cache
def _whole(kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / kind
        _makers()[kind](path)
        return path.read_bytes()


@cache
def _whole_content(kind: str, suffix: str) -> Sequence[object]:
    """What `convert` makes of the undamaged file."""
    with tempfile.TemporaryDirectory() as folder:
        path, target = Path(folder) / kind, Path(folder) / f"out{suffix}"
        path.write_bytes(_whole(kind))
        _run("convert", path, target)
        return _content(target)


def _bench(is_lenient: bool) -> str:
    """The example bench with the database beside it."""
    text = EXAMPLE_BENCH.read_text().replace('file = "observer_fd.dbc"', f'file = "{DATABASE}"')
    return text.replace("lenient = false", f"lenient = {str(is_lenient).lower()}")


@cache
def _whole_map() -> str:
    with tempfile.TemporaryDirectory() as folder:
        bench = Path(folder) / "bench.toml"
        _write_database(Path(folder) / DATABASE)
        bench.write_text(_bench(False))
        return repr(map_bus(load_bench(bench)))


def _warm_up() -> None:
    """Have what reads MDF4 files started."""
    one_file(Task("frames.mf4", 0, 0))


@cache
def _makers() -> dict[str, Callable[[Path], None]]:
    """The kinds of files by their name: every format that is written, files of loggers, a database."""
    logs = formats.suffixes_of(formats.written(formats.log_formats()))
    signals = formats.suffixes_of(formats.written(formats.signal_formats()))
    makers: dict[str, Callable[[Path], None]] = {f"frames{suffix}": _write_frames for suffix in logs}
    makers |= {f"signals{suffix}": _write_signals for suffix in signals}
    makers |= {"card.mf4": _write_card, "card_fixed.mf4": _write_fixed_card, "saved.mf4": _write_saved}
    makers |= {"busmaster.log": _write_busmaster, "screen.log": _write_screen, "packed.asc.gz": _write_packed}
    return makers | {DATABASE: _write_database}


def _write_database(path: Path) -> None:
    shutil.copy(PACKAGE_DATA / "observer_fd.dbc", path)


def _write_frames(path: Path) -> None:
    frames = _frames(formats.log_format(path).keeps_fd)
    with formats.open_writer(path, START) as writer:
        for frame in frames:
            writer.write(frame)


def _write_signals(path: Path) -> None:
    noise = np.random.default_rng(1).normal(size=(3, SAMPLES))
    recording = Recording(
        np.arange(SAMPLES) / 1e5, 100e6 + 1e5 * noise[0], 4e-7 * noise[1], 100e6 + 1e5 * noise[2]
    )
    formats.write_recording(path, recording)


def _write_card(path: Path) -> None:
    write_logger_file(path, _frames(True), list(STORED), START)


def _write_fixed_card(path: Path) -> None:
    write_logger_file(path, _frames(True), list(STORED), START, finalised=True, data_width=64)


def _write_saved(path: Path) -> None:
    """As asammdf saves what it finalised."""
    from asammdf import MDF

    card = path.with_name("unsaved.mf4")
    _write_card(card)
    with MDF(card) as file:
        file.save(path, compression=0)


def _write_busmaster(path: Path) -> None:
    lines = [
        "***BUSMASTER Ver 3.2.2***",
        "***START DATE AND TIME 14:11:2023 22:13:20:000***",
        "***HEX***",
        "***ABSOLUTE MODE***",
    ]
    for frame, channel, is_sent in _frames(False):
        seconds, rest = divmod(frame.stamp_ns - START, 10**9)
        lines.append(
            f"00:00:{seconds:02d}:{rest // 10**5:04d} {'Tx' if is_sent else 'Rx'} {channel} 0x{frame.frame_id:X} "
            f"{'x' if frame.is_extended else 's'} {len(frame.payload)} {frame.payload.hex(' ').upper()}".rstrip()
        )
    path.write_text("\n".join([*lines, "***[STOP LOGGING SESSION]***", ""]))


def _write_screen(path: Path) -> None:
    lines = []
    for frame, _, is_sent in _frames(True):
        seconds, rest = divmod(frame.stamp_ns, 10**9)
        size = f"{len(frame.payload):02d}" if frame.is_fd else str(len(frame.payload))
        flags = f"{'TX' if is_sent else 'RX'} {'B' if frame.bit_rate_switch else '-'} -"
        lines.append(
            f" ({seconds}.{rest // 1000:06d})  can0  {flags}  {frame.frame_id:0{8 if frame.is_extended else 3}X}   "
            f"[{size}]  {frame.payload.hex(' ').upper()}\n"
        )
    path.write_text("".join(lines))


def _write_packed(path: Path) -> None:
    text = path.with_name("frames.asc")
    _write_frames(text)
    path.write_bytes(gzip.compress(text.read_bytes(), mtime=0))


def _frames(with_fd: bool) -> list[LogFrame]:
    """Frames of all kinds on one channel."""
    chance = random.Random(1)
    frames = []
    for number in range(FRAMES):
        is_fd, is_extended = with_fd and chance.random() < 0.5, chance.random() < 0.5
        payload = chance.randbytes(chance.choice(FD_LENGTHS if is_fd else FD_LENGTHS[:9]))
        identifier = chance.randrange(0x2000_0000 if is_extended else 0x800)
        stamp = START + number * 1_234_567_000
        frame = Frame(identifier, payload, stamp, is_extended, is_fd, is_fd and chance.random() < 0.5)
        frames.append(LogFrame(frame, "1", chance.random() < 0.5))
    return frames
