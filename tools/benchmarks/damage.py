"""Damaged files of every format, given to the commands: what becomes of them, and that nothing crashes.

Files are made whole, damaged by a seed, and converted as a user would; databases are mapped as a bench names them.
With `flips`, damage is a single bit of an MF4 or Parquet file: how much of it shows nowhere, kind by kind.
"""

import contextlib
import os
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from operator import ne
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.table import Table

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.desk.cli.app import main
from observer_rt.files import formats
from observer_rt.foundation.errors import UserError
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Crash, run_tasks
from tools.benchmarks.damage_files import DATABASE, makers, write_database
from tools.benchmarks.report import put_out, table_of
from tools.benchmarks.scoring import bench_text

JUDGED = (".mf4",)  # whose readers lose no frame in silence; text may lose whole lines
BINARY = (".mf4", ".parquet")
CHECKED = tuple(
    f"{what}{suffix}" for what, suffix in (("frames", ".mf4"), *(("signals", each) for each in BINARY))
)
"""Kinds that we write with a checksum: no single bit of them is read otherwise in silence."""
LONG = 30.0  # s, for one of these small files, on a machine that has other work


class Became(StrEnum):
    """What became of a damaged file."""

    REFUSED = "refused"
    TOLD = "read, something told"
    SAME = "read as undamaged"
    CHANGED = "one frame or sample otherwise, nothing told"
    MANY = "more otherwise, nothing told"
    FAULT = "fault"


class Task(NamedTuple):
    """A file to be damaged: the kind, and what determines the damage, be it a single bit or any."""

    kind: str
    seed: int
    number: int
    is_flip: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of one file, in how many seconds; `said` on the screen, or of the fault."""

    task: Task
    became: Became
    seconds: float
    said: str = ""


def faults_of(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Tracebacks, output on stdout, results that cannot be read, frames lost in silence, files that took long."""
    return [each for each in outcomes if each.became is Became.FAULT]


def run_damage(files: int, seed: int, workers: int, flips: bool = False) -> tuple[Outcome, ...]:
    """Damage so many files, the kinds in turn. Raises `RunError` where a process of ours was ended by one."""
    kinds = [kind for kind in makers() if not flips or kind.endswith(BINARY)]
    tasks = [Task(kinds[number % len(kinds)], seed, number, flips) for number in range(files)]
    results = cli.tracked(run_tasks(one_file, tasks, workers, _warm_up), "damaging", files)
    return tuple(
        Outcome(each.task, Became.FAULT, 0.0, each.message) if isinstance(each, Crash) else each
        for each in results
    )


def _by_kind(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """The outcomes of the kinds that there are, in their order."""
    found = {kind: [each for each in outcomes if each.task.kind == kind] for kind in makers()}
    return {kind: outcomes for kind, outcomes in found.items() if outcomes}


def damage_document(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The outcomes for a program."""
    return {
        "figures": _figures(outcomes),
        "kinds": {kind: _figures(outcomes) for kind, outcomes in _by_kind(outcomes).items()},
        "faults": [[*each.task, each.said] for each in faults_of(outcomes)],
    }


def _figures(outcomes: Sequence[Outcome]) -> dict[str, int]:
    counts = Counter(each.became for each in outcomes)
    return {"files": len(outcomes)} | {b.name.lower(): counts[b] for b in Became}


def damage_table(outcomes: Sequence[Outcome]) -> Table:
    """The outcomes for a screen, kind by kind."""
    rows = {
        kind: {**_figures(chosen), "longest": max(each.seconds for each in chosen)}
        for kind, chosen in {**_by_kind(outcomes), "all": outcomes}.items()
    }
    columns = {"files": "{[files]}", **{str(b): f"{{[{b.name.lower()}]}}" for b in Became}}
    return table_of("damaged files", "kind", rows, {**columns, "longest s": "{[longest]:.2f}"})


@cli.app.command(epilog="Example: tools/bench damage --files 5000 --seed 1")
def damage(
    files: Annotated[int, typer.Option(min=1, help="Damaged files.")] = 5000,
    flips: Annotated[bool, typer.Option("--flips", help="Single bits, of MF4 and Parquet only.")] = False,
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    as_json: cli.JsonOption = False,
) -> None:
    """What becomes of damaged files of every format; exit code 1 if one crashes, or shows a traceback."""
    outcomes = run_damage(files, seed, workers, flips)
    put_out(as_json, damage_document(outcomes), [damage_table(outcomes)])
    for fault in faults_of(outcomes):
        cli.messages.print(f"{fault.task}: {fault.said}", markup=False, highlight=False, soft_wrap=True)
    if faults_of(outcomes):
        raise typer.Exit(1)


def one_file(task: Task) -> Outcome:
    """Damage a file and give it to the command that reads its kind."""
    with tempfile.TemporaryDirectory(prefix="damage-") as name:
        folder = Path(name)
        path = folder / task.kind
        damage = random.Random(f"{task.seed} {task.number}")
        whole = _whole(task.kind)
        path.write_bytes(_flipped(whole, damage) if task.is_flip else _damaged(whole, damage))
        begun = time.perf_counter()
        became, said = (_mapped if task.kind == DATABASE else _converted)(path, task.number)
        seconds = time.perf_counter() - begun
        if seconds > LONG:
            became, said = Became.FAULT, f"took {seconds:.1f} s; {said}"
        if task.is_flip and task.kind in CHECKED and became in (Became.CHANGED, Became.MANY):
            became, said = Became.FAULT, became
        return Outcome(task, became, seconds, said)


def _damaged(data: bytes, chance: random.Random) -> bytes:
    """Some of a file's bytes changed, missing, repeated, or its end cut off."""
    size = len(data)
    place = chance.randrange(size)
    length = min(chance.choice((1, 2, 8, 64, 500)), size - place)
    kind = chance.choice(("bit", "bit", "bits", "byte", "noise", "zero", "gone", "twice", "cut", "link"))
    if kind in ("bit", "bits"):
        for _ in range(1 if kind == "bit" else chance.randrange(2, 20)):
            data = _flipped(data, chance)
        return data
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


def _flipped(data: bytes, chance: random.Random) -> bytes:
    """One bit changed."""
    changed = bytearray(data)
    changed[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(changed)


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
    whole = _whole_content(path.name, target.suffix)
    if content == whole:
        return Became.SAME, ""
    lost = len(whole) - len(content)
    if path.suffix in JUDGED and formats.is_log(path) and lost > 0 and not _is_cut(path, content, whole):
        return Became.FAULT, f"{lost} of {len(whole)} frames are lost, nothing told"
    other = abs(lost) + sum(map(ne, content, whole))
    return (Became.MANY if other > 1 else Became.CHANGED), f"{other} of {len(whole)} otherwise"


def _is_cut(path: Path, content: Sequence[object], whole: Sequence[object]) -> bool:
    """Whether a file is shorter than it was, and so is what it holds: nobody can tell that from one that was cut."""
    return path.stat().st_size < len(_whole(path.name)) and content == whole[: len(content)]


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
    return list(zip(*(values.tolist() for values in recording.arrays.values()), strict=True))


@cache
def _whole(kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / kind
        makers()[kind](path)
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
    lenient = f"lenient = {str(is_lenient).lower()}"
    return bench_text(('file = "observer_fd.dbc"', f'file = "{DATABASE}"'), ("lenient = false", lenient))


@cache
def _whole_map() -> str:
    with tempfile.TemporaryDirectory() as folder:
        bench = Path(folder) / "bench.toml"
        write_database(Path(folder) / DATABASE)
        bench.write_text(_bench(False))
        return repr(map_bus(load_bench(bench)))


def _warm_up() -> None:
    """Have what reads MDF4 files started."""
    one_file(Task("frames.mf4", 0, 0))
