"""What `discover` answers on a case's recordings: one call of the command, as a user makes it."""

import json
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import beta

from tools.benchmarks.campaign import How, Row

TIME_LIMIT = 600  # s
KEPT_MESSAGE = 400  # characters of a failed command's
NONE, NAMED, AMBIGUOUS, UNKNOWN = "none", "named", "ambiguous", "unknown"
CONFIDENT = 0.9
BIN_EDGES = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)


class Grade(StrEnum):
    RIGHT = "right"
    AMBIGUOUS = "ambiguous"  # rightly left open: what is hidden is among names that cannot be told from it
    WRONG = "wrong"
    NOT_LOOKED_FOR = "not looked for"  # too small to be asked for: whatever was answered

    def count_among(self, grades: pd.Series) -> int:
        """How many of the grades are it."""
        return int((grades == self).sum())


def calibration(confidences: pd.Series) -> pd.DataFrame:
    """What confidences, positive where right, let expect, and how often they are right, with 95 % limits, by bins."""
    stated = confidences.abs().astype(float)
    within = pd.cut(stated, BIN_EDGES, include_lowest=True)
    columns = pd.DataFrame({"expected": stated, "seen": (confidences > 0.0).astype(float), "of": 1})
    bins = columns.groupby(within, observed=True).agg({"expected": "mean", "seen": "mean", "of": "sum"})
    right, wrong = bins["seen"] * bins["of"], (1.0 - bins["seen"]) * bins["of"]
    # by Jeffreys' prior
    limits = {name: beta.ppf(q, right + 0.5, wrong + 0.5) for name, q in (("low", 0.025), ("high", 0.975))}
    return bins.assign(off=(bins["expected"] - bins["seen"]).abs(), **limits)


def calibration_error(confidences: pd.Series) -> float:
    """Mean distance between expected and seen in `calibration`."""
    bins = calibration(confidences)
    return float(np.average(bins["off"], weights=bins["of"]))


GRADES: dict[str, tuple[str, How]] = {str(grade): ("grade", grade.count_among) for grade in Grade}
"""Columns of tables."""


@dataclass(frozen=True)
class Answer:
    """What findings.json says; listed: all ids an ambiguous answer leaves open.

    amended_model: the text of the file, or of the model given where nothing is amended; core_seconds: of processor
    time, all its processes; equations: of the terms proposed first.
    """

    verdict: str
    claims: tuple[Row, ...]
    smallest: tuple[Row, ...]
    amended_model: str
    core_seconds: float
    equations: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        return [claim["id"] for claim in self.claims]

    @property
    def listed(self) -> list[str]:
        others = [other for claim in self.claims for other in claim["indistinguishable_from"]]
        return list(dict.fromkeys([*self.names, *others]))

    def confidences(self, is_right: Callable[[str], bool]) -> list[float]:
        """Confidences of the claims, negative where the name is wrong."""
        return [float(claim["confidence"]) * (1 if is_right(claim["id"]) else -1) for claim in self.claims]

    def facts(self) -> Row:
        named = self.names[0] if len(self.names) == 1 else "several"
        claimed = ", ".join(f"{claim['id']} ({claim['confidence']:.2f})" for claim in self.claims)
        return {
            "verdict": self.verdict,
            "claimed": claimed,
            "answer": named if self.verdict == NAMED else self.verdict,
            "core_seconds": self.core_seconds,
        }


def ask(recordings: Sequence[Path], folder: Path, model: Path, choose: bool) -> Answer:
    """Call `discover` with a model on recordings, its output in `folder`. Raises RuntimeError when it fails.

    choose: of several effects that are tied the first is chosen, by a second call whose time is not counted.
    """
    command = [sys.executable, "-m", "observer_rt", "discover", "--model", str(model), "--out", str(folder)]
    command += map(str, recordings)
    before = _core_seconds()
    findings = _findings(command, folder)
    used = _core_seconds() - before
    if choose and findings["verdict"] == AMBIGUOUS:
        leading = "+".join(effect["id"] for effect in findings["effects"])
        findings = _findings([*command, "--force", "--choose", leading], folder)
    name = findings.get("amended_model")
    amended = (folder / name).read_text() if name else model.read_text()
    effects, smallest = tuple(findings["effects"]), tuple(findings.get("smallest_visible", ()))
    proposals = (findings.get("unknown") or {}).get("proposals", [])
    equations = tuple(term["equation"] for proposal in proposals[:1] for term in proposal["terms"])
    return Answer(findings["verdict"], effects, smallest, amended, used, equations)


def _findings(command: Sequence[str], folder: Path) -> dict[str, Any]:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
    if done.returncode != 0:
        raise RuntimeError(f"discover: exit {done.returncode}: {done.stderr[-KEPT_MESSAGE:]}")
    findings: dict[str, Any] = json.loads((folder / "findings.json").read_text())
    return findings


def _core_seconds() -> float:
    """Processor time of all processes this one started and that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
