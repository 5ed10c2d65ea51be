"""Damaged files of every format that is written, given to `convert`: nothing may crash, no result be unreadable."""

import contextlib
import io
import random
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from enum import StrEnum
from functools import cache
from pathlib import Path

import numpy as np

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.links.link import Frame
from observer_rt.desk.cli.app import main
from observer_rt.files import formats
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.signals.recording import Recording
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, Row, conclude, run_cases, table

CASES = 5000
FRAMES, SAMPLES = 40, 60
START = 1_700_000_000_000_000_000  # ns since 1970
LONG = 30.0  # s, for one of these small files, on a machine that has other work


class Became(StrEnum):
    REFUSED = "refused"
    TOLD = "read, something told"
    SAME = "read as undamaged"
    CHANGED = "read otherwise, nothing told"
    FAULT = "fault"


BARS = (Bar("faults", "fault", "sum", most=0), *(Bar(each, each, "sum") for each in Became if each != Became.FAULT))


def kinds() -> list[str]:
    """Names of whole files: frames and signals in every format that is written."""
    signals = [f"signals{suffix}" for suffix in formats.SIGNALS_WRITTEN]
    return [f"frames{suffix}" for suffix in formats.LOGS_WRITTEN] + signals


def write_whole(path: Path) -> None:
    """An undamaged file of the kind of its name: frames of all sorts on one channel, or noise of three sensors."""
    chance = random.Random(1)
    if path.name.startswith("signals"):
        rail, lift, line = np.random.default_rng(1).normal(size=(3, SAMPLES))
        time_ = np.arange(SAMPLES) / 100e3
        formats.write_recording(path, Recording(time_, 100e6 + 1e5 * rail, 4e-7 * lift, 100e6 + 1e5 * line))
        return
    with formats.open_writer(path, START) as writer:
        for number in range(FRAMES):
            is_fd = chance.random() < 0.5
            is_extended = chance.random() < 0.5
            payload = chance.randbytes(chance.choice(FD_LENGTHS if is_fd else FD_LENGTHS[:9]))
            identifier = chance.randrange(0x2000_0000 if is_extended else 0x800)
            stamp = START + number * 1_234_567_000
            writer.write(LogFrame(Frame(identifier, payload, stamp, is_extended, is_fd), "1", False))


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Some of a file's bytes changed, missing, repeated, or its end cut off."""
    start = chance.randrange(len(data))
    end = min(start + chance.choice((1, 2, 8, 64, 500)), len(data))
    old = data[start:end]
    new, remainder = {
        "bit": (bytes([old[0] ^ 1 << chance.randrange(8)]) + old[1:], data[end:]),
        "noise": (chance.randbytes(len(old)), data[end:]),
        "zero": (bytes(len(old)), data[end:]),
        "gone": (b"", data[end:]),
        "twice": (old * 2, data[end:]),
        "cut": (b"", b""),
    }[chance.choice(("bit", "bit", "noise", "zero", "gone", "twice", "cut"))]
    return data[:start] + new + remainder


def convert_damaged(kind: str, seed: int, number: int) -> Row:
    """Damage a file and convert it as a user would; said: on the screen, or of the fault."""
    with tempfile.TemporaryDirectory(prefix="damage-") as name:
        path = Path(name) / kind
        write_whole(path)
        path.write_bytes(damaged(path.read_bytes(), random.Random(f"{seed} {number}")))
        begun = time.perf_counter()
        became, said = _converted(path)
        if time.perf_counter() - begun > LONG:
            became, said = Became.FAULT, f"took long; {said}"
        return {"kind": kind, "became": became, "said": said, **{each: became is each for each in Became}}


def _converted(path: Path) -> tuple[Became, str]:
    target = path.with_name("out.csv" if path.name.startswith("signals") else "out.log")
    code, out, err = _run("convert", path, target)
    if code not in (0, 1, 2) or "Traceback" in out + err:
        return Became.FAULT, f"exit code {code}: {out}{err}"
    if code != 0:
        is_named = (path.name in err or target.name in err) and not out
        return (Became.REFUSED if is_named else Became.FAULT), out + err
    if out.count("\n") != 1:
        return Became.FAULT, f"on stdout: {out}"
    try:
        content = _content(target)
    except Exception as error:  # whatever is wrong with what was written
        return Became.FAULT, f"writes what cannot be read: {error}"
    if err:
        return Became.TOLD, err
    if content == _whole_content(path.name, target.name):
        return Became.SAME, ""
    return Became.CHANGED, "read otherwise, nothing told"


def _run(*arguments: object) -> tuple[object, str, str]:
    sys.argv, code = ["observer-rt", *map(str, arguments)], 0
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0  # type: ignore[assignment]
        except BaseException:
            traceback.print_exc()
            code = -1
    return code, out.getvalue(), err.getvalue()


def _content(path: Path) -> Sequence[object]:
    if formats.is_log(path):
        return [entry.frame for entry in formats.open_log(path)]
    return [values.tolist() for values in formats.read_recording(path).arrays.values()]


@cache
def _whole_content(kind: str, target: str) -> Sequence[object]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / kind
        write_whole(path)
        _run("convert", path, path.with_name(target))
        return _content(path.with_name(target))


@cli.app.command(epilog="Example: tools/bench damage --cases 5000 --seed 1")
def damage(
    cases: cli.CasesOption = CASES,
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
) -> None:
    """What becomes of damaged files of every format, kind by kind in turn."""
    names, out = kinds(), out or Path("build/damage")
    chosen = [(names[number % len(names)], seed, number) for number in range(cases)]
    frame = run_cases("damage", convert_damaged, {" ".join(map(str, each)): each for each in chosen}, jobs, out)
    faults = frame[frame[Became.FAULT].eq(True)]
    said = [f"{row.label}: {row.said}" for row in faults.itertuples()]
    counts = table(frame, "kind", {str(each): (str(each), "sum") for each in Became})
    conclude(frame, BARS, {"damaged files": counts}, out, said)
