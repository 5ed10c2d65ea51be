"""Fits of candidates: the effects alone, then with a second one; stored on disk, to go on where it ended."""

import hashlib
import json
import threading
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.outputs import replacing
from observer_rt.foundation.source import source_digest
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, Sizing, minimum_from
from observer_rt.identification.discovery.search.results import Candidate
from observer_rt.identification.likelihood.appearance import (
    Signature,
    reference,
    signatures,
    smallest_visible,
)
from observer_rt.identification.likelihood.bounded_fit import MAX_ITERATIONS, Residuals, linearise, sigmas_of
from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.model.baseline import Appearance
from observer_rt.model.effect import Effect, SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import InjectorParameters

WORTH_FITTING = 10.0  # predicted gain from which on a second effect is fitted
MOST_SECONDS = 6  # second effects fitted to one leader
ROUGH_ITERATIONS = 3  # of the first fit of every effect
ROUGH_SHARE = 0.5  # of what the best single explains: those that leave more of it unexplained stay rough
ALWAYS_REFINED = 4  # leaders

NEAR = 40.0  # of -2 log L beyond which a candidate takes nothing from the confidence in another

ROUGH = "rough"

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
FORMAT = 1


Fit = tuple[NDArray[np.float64], float]
"""theta (p,) and -2 log L."""
FitMemory = MutableMapping[tuple[str, ...], Fit]
"""Fitted candidates by the ids of their effects, and ROUGH after them for a rough one: an interrupted run goes on
where it was."""


class Fitter:
    """Fits hypotheses to the likelihood on several threads (the compiled prediction runs without the lock)."""

    def __init__(
        self,
        likelihood: JointLikelihood,
        nominal: EffectiveModel,
        workers: int = 1,
        memory: FitMemory | None = None,
        fitted: Callable[[Candidate], None] | None = None,
        appears: Mapping[str, Appearance] = MappingProxyType({}),
    ) -> None:
        """fitted: called with every fit as soon as it is there; appears: what the healthy injector
        appears to have."""
        self.likelihood = likelihood
        self.nominal = nominal
        self._workers = workers
        self._memory: FitMemory = {} if memory is None else memory
        self._fitted = fitted
        self._appears = appears
        self._signatures: dict[str, Signature] = {}
        self._sigmas: dict[tuple[tuple[str, ...], tuple[float, ...]], NDArray[np.float64]] = {}

    def nothing(self) -> Candidate:
        """The nominal model."""
        residuals = self.likelihood.residuals(self.nominal)
        assert residuals is not None  # the search began with it
        return Candidate(Hypothesis(), (), residuals.statistic)

    def measure(self, effects: Sequence[Effect]) -> None:
        """Measures how a small size of every effect moves the residuals of the nominal model."""
        judged = self.likelihood.judge(self.nominal)
        assert judged is not None  # the search began with it
        found = self.each(lambda effect: signatures(self.likelihood, self.nominal, judged, [effect]), effects)
        self._signatures = {one.effect.id: one for each in found for one in each}

    @property
    def signatures(self) -> Sequence[Signature]:
        """Signatures of the effects measured."""
        return tuple(self._signatures.values())

    def reference(self, effect: Effect) -> tuple[float, float]:
        """The size an effect appears to have on the healthy injector, as these recordings see it."""
        signature = self._signatures.get(effect.id)
        return (0.0, 0.0) if signature is None else reference(self._appears, signature)

    def smallest_visible(self, signature: Signature) -> float:
        """Size [SI] from which on an effect is distinguished from noise and from the healthy injector."""
        return smallest_visible(self._appears, signature)

    def sigmas(self, candidate: Candidate) -> NDArray[np.float64]:
        """Standard deviations of a candidate's sizes by noise, from the information there; inf where it has none."""
        key = (candidate.ids, candidate.sizes)
        if key not in self._sigmas:
            sizing = Sizing(self.likelihood, self.nominal, candidate.hypothesis)
            residuals = sizing.residuals(candidate.theta)
            if residuals is None or not candidate.hypothesis.effects:
                return np.full(len(candidate.sizes), np.inf)
            ranges = candidate.hypothesis.ranges()
            information = linearise(sizing, candidate.theta, residuals, ranges).information
            self._sigmas[key] = sigmas_of(information) * np.sqrt(max(1.0, float(np.mean(residuals.z**2))))
        return self._sigmas[key]

    def _fit_all(self, tasks: Sequence["_Task"], max_iterations: int) -> list[Candidate]:
        """Fit hypotheses, each from its starts; those without a solution are left out."""
        found = self.each(lambda task: self._fit(task, max_iterations), tasks)
        return [one for one in found if one is not None]

    def each(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        """Results of `work` in the order of the items; an interruption does not wait for those not begun."""
        with ThreadPoolExecutor(self._workers) as pool:
            try:
                return list(pool.map(work, items))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def _fit(self, task: "_Task", max_iterations: int) -> Candidate | None:
        hypothesis = task.hypothesis
        key = hypothesis.ids if max_iterations == MAX_ITERATIONS else (*hypothesis.ids, ROUGH)
        known = self._memory.get(key)
        if known is not None:
            return Candidate(hypothesis, tuple(known[0].tolist()), known[1])
        sizing = Sizing(self.likelihood, self.nominal, task.hypothesis)
        found = minimum_from(sizing, task.starts, max_iterations, second_if_stuck=task.probed)
        if found is None:
            return None
        candidate = Candidate(hypothesis, tuple(found.theta.tolist()), found.statistic)
        self._memory[key] = found.theta, found.statistic
        if self._fitted is not None:
            self._fitted(candidate)
        return candidate

    def singles(self, effects: Sequence[Effect], nominal: Candidate) -> list[Candidate]:
        """Every effect alone; those that explain far less than the best are fitted roughly."""
        hypotheses = [Hypothesis((effect,)) for effect in effects]
        return self._refined([_Task(h, h.starts()) for h in hypotheses], nominal)

    def pairs(self, leaders: Sequence[Candidate], effects: Sequence[Effect]) -> list[Candidate]:
        """Each leader with the second effects that promise something, fitted together as the singles are."""
        tasks = [task for leader in leaders for task in self._seconds(leader, effects)]
        return self._refined(tasks, min(leaders, key=attrgetter("statistic")))

    def _refined(self, tasks: Sequence["_Task"], before: Candidate) -> list[Candidate]:
        """Each hypothesis once, best first where it matters: those within reach of the best are fitted to the end.

        before: the best candidate that is smaller.
        """
        rough = best_of_each(self._fit_all(tasks, ROUGH_ITERATIONS), attrgetter("statistic"))
        if not rough:
            return []
        limit = rough[0].statistic + max(NEAR, ROUGH_SHARE * (before.statistic - rough[0].statistic))
        leaders = sum(number < ALWAYS_REFINED or one.statistic <= limit for number, one in enumerate(rough))
        refined = self._fit_all(
            [_Task(one.hypothesis, [one.theta]) for one in rough[:leaders]], MAX_ITERATIONS
        )
        return refined + rough[leaders:]

    def _seconds(self, leader: Candidate, effects: Sequence[Effect]) -> list["_Task"]:
        """The leader with each second effect that promises something, and where to begin."""
        base = self.likelihood.residuals(leader.model(self.nominal))
        if base is None:
            return []
        sizing = Sizing(self.likelihood, self.nominal, leader.hypothesis)
        spanned = linearise(sizing, leader.theta, base, leader.hypothesis.ranges()).slopes
        others = [effect for effect in effects if effect not in leader.hypothesis.effects]
        promises = self.each(lambda effect: self._promise(leader, base, spanned, effect), others)
        ranked = sorted(zip(promises, others, strict=True), key=lambda item: -item[0].gain)
        worthwhile = [item for item in ranked if item[0].gain > WORTH_FITTING][:MOST_SECONDS]
        return [
            _Task(leader.hypothesis.with_effect(effect), promise.starts, probed=True)
            for promise, effect in worthwhile
        ]

    def _promise(
        self, leader: Candidate, base: Residuals, spanned: NDArray[np.float64], effect: Effect
    ) -> "_Promise":
        """Estimates the gain of a second effect were the residuals linear in it, the leader's sizes free."""
        both = leader.hypothesis.with_effect(effect)
        sizing = Sizing(self.likelihood, self.nominal, both)
        best = _Promise(0.0, ())
        for values in _probes(effect):
            start = np.concatenate([leader.theta, values])
            there = sizing.residuals(start)
            if there is None:
                continue
            gain = base.statistic - there.statistic
            if effect.parameters:
                gain = max(gain, _predicted_gain(base, there, spanned))
            if gain > best.gain:
                off = np.array([p.off for p in effect.parameters])
                best = _Promise(gain, (start, np.concatenate([leader.theta, off + 0.1 * (values - off)])))
        return best


def best_of_each(candidates: Sequence[Candidate], by: Callable[[Candidate], float]) -> list[Candidate]:
    """The best first, each combination of effects once, in whichever order."""
    best: dict[frozenset[str], Candidate] = {}
    for candidate in sorted(candidates, key=by):
        best.setdefault(frozenset(candidate.ids), candidate)
    return list(best.values())


@dataclass(frozen=True, eq=False)
class _Task:
    """A hypothesis to be fitted, and where to begin: at guesses, or at what probing found."""

    hypothesis: Hypothesis
    starts: Sequence[NDArray[np.float64]]
    probed: bool = False


@dataclass(frozen=True, eq=False)
class _Promise:
    gain: float
    starts: tuple[NDArray[np.float64], ...]


def _probes(effect: Effect) -> list[NDArray[np.float64]]:
    """Sizes at which a second effect is tried: small ones of either sign, and the starts that are not off."""
    if not effect.parameters:
        return [np.zeros(0)]
    first, others = effect.parameters[0], effect.parameters[1:]
    sizes = [first.off + sign * 3.0 * first.dead_zone for sign in (1.0, -1.0)]
    sizes += [start for start in first.starts if start != first.off]
    allowed = [size for size in sizes if first.lowest <= size <= first.highest]
    return [np.array(values) for values in product(allowed, *(p.starts for p in others))]


def _predicted_gain(base: Residuals, there: Residuals, spanned: NDArray[np.float64]) -> float:
    """Least-squares gain along the secant to `there`, what the leader's own parameters span taken out."""
    direction = there.z - base.z
    if spanned.shape[1]:
        basis, _ = np.linalg.qr(spanned)
        direction = direction - basis @ (basis.T @ direction)
    length = float(direction @ direction)
    return float(direction @ base.z) ** 2 / length if length > 0.0 else 0.0


def problem_key(
    parameters: InjectorParameters, recording_hashes: Sequence[str], stated: Sequence[SizedEffect] = ()
) -> str:
    """Hashes the problem that fits belong to: model, recordings (SHA-256 of each) and this program.

    stated: what is known of the recordings' channels.
    """
    why = {"__all__": {"origin", "evidence", "date"}}
    model = parameters.model_dump(mode="json", exclude={"format": True, "effects": why, "terms": why})
    channels = [(each.effect.id, *each.values) for each in stated]
    content = json.dumps([source_digest(), model, list(recording_hashes), channels], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


class FitStore(dict[tuple[str, ...], Fit]):
    """JSON lines: what the fits belong to, then a fit a line. A `FitMemory`, used by several threads."""

    def __init__(self, path: Path, key: str) -> None:
        """Take over the fits of this key; a file of another key, or none, is begun anew.

        Raises OSError when the file cannot be read or written.
        """
        self._lock = threading.Lock()
        super().__init__(_read(path, key))
        self.taken_over = len(self)
        """Fits there were already."""
        header = json.dumps({"format": FORMAT, "key": key}) + "\n"
        with replacing(path) as part:
            part.write_text(header + "".join(_line(ids, *fit) for ids, fit in self.items()), "ascii")
        self._file = path.open("a", encoding="ascii")

    def __enter__(self) -> "FitStore":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __setitem__(self, ids: tuple[str, ...], fit: Fit) -> None:
        """Keep a fit, at once on disk."""
        with self._lock:
            super().__setitem__(ids, fit)
            self._file.write(_line(ids, *fit))
            self._file.flush()


def _line(ids: tuple[str, ...], theta: NDArray[np.float64], statistic: float) -> str:
    return json.dumps({"ids": ids, "theta": theta.tolist(), "statistic": statistic}) + "\n"


def _read(path: Path, key: str) -> dict[tuple[str, ...], tuple[NDArray[np.float64], float]]:
    """Fits of a file with this key; a line cut off while it was written ends it."""
    if not path.exists():
        return {}
    fits = {}
    header, *lines = path.read_text(encoding="ascii", errors="replace").splitlines() or [""]
    try:
        if json.loads(header) != {"format": FORMAT, "key": key}:
            return {}
        for line in lines:
            content = json.loads(line)
            fits[tuple(content["ids"])] = np.array(content["theta"], float), float(content["statistic"])
    except (ValueError, KeyError, TypeError):
        pass
    return fits
