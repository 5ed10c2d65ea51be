"""What `discover` answers on a case's recordings: one call of the command, as a user makes it."""

import json
import resource
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from observer_rt.config.bench import NOMINAL_INJECTOR
from tools.benchmarks.discovery.result import AMBIGUOUS

TIME_LIMIT = 600  # s
KEPT_MESSAGE = 400  # characters of a failed command's


@dataclass(frozen=True)
class ClaimedParameter:
    """A parameter of a claimed effect with its 95 % interval, in its printed unit."""

    name: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Claim:
    """An effect of findings.json."""

    id: str
    confidence: float
    parameters: tuple[ClaimedParameter, ...]


@dataclass(frozen=True)
class Smallest:
    """The smallest size of an effect's parameter that could have been seen, in its printed unit."""

    id: str
    parameter: str
    value: float
    unit: str


@dataclass(frozen=True)
class Answer:
    """What findings.json says; `listed`: all ids an ambiguous answer leaves open.

    amended_model: the text of the file, or of the model given where nothing is amended; seconds: of wall time;
    core_seconds: of processor time, all its processes.
    """

    label: str
    verdict: str
    claims: tuple[Claim, ...]
    listed: tuple[str, ...]
    amended_model: str
    seconds: float
    core_seconds: float
    smallest: tuple[Smallest, ...] = ()


def ask(
    program: Sequence[str],
    label: str,
    recordings: Sequence[Path],
    folder: Path,
    model: Path = NOMINAL_INJECTOR,
    choose: bool = True,
) -> Answer:
    """Call `program discover` with a model on recordings, its output in `folder`.

    choose: of several effects that are tied the first is chosen, by a second call whose time is not counted.
    Raises RuntimeError when it fails.
    """
    command = [*program, "discover", "--model", str(model), "--out", str(folder)]
    command += map(str, recordings)
    before, begin = _core_seconds(), time.perf_counter()
    findings = _findings(command, folder)
    seconds, used = time.perf_counter() - begin, _core_seconds() - before
    if choose and findings["verdict"] == AMBIGUOUS:
        leading = "+".join(effect["id"] for effect in findings["effects"])
        findings = _findings([*command, "--force", "--choose", leading], folder)
    name = findings.get("amended_model")
    amended = (folder / name).read_text() if name else model.read_text()
    return read_answer(label, findings, amended, seconds, used)


def _findings(command: Sequence[str], folder: Path) -> dict[str, Any]:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
    if done.returncode != 0:
        raise RuntimeError(f"discover: exit {done.returncode}: {done.stderr[-KEPT_MESSAGE:]}")
    found: dict[str, Any] = json.loads((folder / "findings.json").read_text())
    return found


def read_answer(
    label: str, findings: dict[str, Any], amended_model: str, seconds: float, core_seconds: float
) -> Answer:
    """The answer in a findings.json. Raises KeyError where it does not keep its contract."""
    claims = tuple(
        Claim(effect["id"], float(effect["confidence"]), tuple(map(_parameter, effect["parameters"].items())))
        for effect in findings["effects"]
    )
    others = [other for effect in findings["effects"] for other in effect["indistinguishable_from"]]
    listed = tuple(dict.fromkeys([claim.id for claim in claims] + others))
    smallest = tuple(
        Smallest(entry["id"], entry["parameter"], float(entry["value"]), entry["unit"])
        for entry in findings.get("smallest_visible", [])
    )
    return Answer(label, findings["verdict"], claims, listed, amended_model, seconds, core_seconds, smallest)


def _parameter(item: tuple[str, dict[str, Any]]) -> ClaimedParameter:
    name, printed = item
    low, high = printed["ci95"]
    return ClaimedParameter(name, float(printed["value"]), float(low), float(high), printed["unit"])


def _core_seconds() -> float:
    """Processor time of all processes this one started and that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
