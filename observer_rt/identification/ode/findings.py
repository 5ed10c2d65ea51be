"""Finds laws that a system of differential equations is missing, and says how sure that is."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.engine.estimation.signal_noise import white_noise
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.term_search import TIE
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.ode.fitting import (
    SHARES,
    FittedOde,
    OdeFit,
    OdeStretch,
    SizedLaw,
    is_noise,
    ways_to_fit,
)
from observer_rt.identification.ode.laws import CandidateLaw
from observer_rt.identification.ode.model import OdeModel, OdeRecording, System
from observer_rt.identification.ode.signatures import promising

FITTED_SHARE = 2.0 / 3.0  # of every recording, where none is held out
MOST_LAWS = 3
LEADERS = 4  # laws fitted, by signature
LEAST_GAIN = 25.0  # of -2 log L, of a law
PAYS = 0.95  # of the error held out, below which a further law must bring it
OWN_ERROR = (
    0.05  # of its square that laws explain, that a further law must explain: the rest is the model's own
)


@dataclass(frozen=True)
class OdeEstimate:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.4g} ({self.low:.4g} to {self.high:.4g})"


@dataclass(frozen=True)
class FoundLaw:
    """A law found. equation: the state whose derivative it is added to; gain: of -2 log L, that its removal costs."""

    equation: str
    law: str
    coefficient: OdeEstimate
    gain: float

    def __str__(self) -> str:
        return (
            f"{self.equation}' += c * {self.law}, c = {self.coefficient}; -2 log L falls by {self.gain:.0f}"
        )


@dataclass(frozen=True)
class OdeFindings:
    """Result of `find_terms`; its print says all of it.

    laws: that are missing, none where nothing is worth one; parameters: of the model, fitted together with them;
    rivals: laws of other equations that explain as much; sigma: noise of the outputs; noise_is_given: else it was
    measured; explained: whether nothing but white noise is left; held_out: error of the free run where nothing was
    fitted, rms over the noise, before and after.
    """

    laws: tuple[FoundLaw, ...]
    parameters: dict[str, OdeEstimate]
    rivals: tuple[str, ...]
    sigma: dict[str, float]
    noise_is_given: bool
    explained: bool
    held_out: tuple[float, float]

    def __repr__(self) -> str:
        before, after = self.held_out
        lines = [f"missing: {law}" for law in self.laws] or ["nothing is missing that these laws say"]
        lines += [f"  or else: {words}" for words in self.rivals]
        lines.append(
            f"held out: error {before:.3g} times the noise before, {after:.3g} after"
            if self.laws
            else f"held out: error {before:.3g} times the noise"
        )
        lines.append(f"parameters: {', '.join(f'{name} = {one}' for name, one in self.parameters.items())}")
        whence = "as given" if self.noise_is_given else "measured"
        lines.append(f"noise, {whence}: {', '.join(f'{name} {one:.3g}' for name, one in self.sigma.items())}")
        if not self.explained:
            lines.append(
                "not all is explained: what is left is more than white noise, so that a law may stand in for another"
            )
        return "\n".join(lines)


def find_terms(
    model: OdeModel,
    recordings: Sequence[OdeRecording],
    candidates: Sequence[CandidateLaw],
    sigma: Mapping[str, float] | None = None,
    held_out: Sequence[OdeRecording] = (),
) -> OdeFindings:
    """Find laws that the model is missing; its parameters are fitted together with them.

    candidates: such as `common_laws` makes; sigma: standard deviation of the white noise of every output, by default
    measured by its fourth differences; held_out: recordings that laws are judged by and not fitted to, by default the
    last third of each recording.

    Raises `UserError` for signals that do not fit each other, a noise that cannot be measured, and a model without a
    finite solution at the start values of its parameters.
    """
    noise = dict(sigma) if sigma else _measured_noise(recordings)
    fit, judge = _stretches(model, recordings, held_out, noise, candidates)
    first = fit.started()
    if first is None or first.residuals(first.at_start, ()) is None:
        raise UserError("the model", "has no finite solution", "give other start values of its parameters")
    ways = ways_to_fit(first, first.at_start, ())
    fit, best = min(ways, key=lambda way: _error(judge, way[1]))
    before = after = _error(judge, best)
    rivals: tuple[str, ...] = ()
    for _ in range(MOST_LAWS):
        grown = [one for way in ways for one in _grown(*way, candidates)]
        errors = [_error(judge, found) for _, found in grown]
        least = min(errors, default=math.inf)
        if not least < PAYS * after or after**2 - least**2 < OWN_ERROR * (before**2 - after**2):
            break
        after = least
        fit, best = grown[errors.index(least)]
        rivals = _rivals(fit, best, grown)
        ways = ways_to_fit(fit.disturbed(SHARES[0], best.q, best.laws) or fit, best.q, best.laws)
    free = fit.undisturbed().residuals(best.q, best.laws)
    return OdeFindings(
        laws=tuple(_law(fit, best, number) for number in range(len(best.laws))),
        parameters=_parameters(fit, best),
        rivals=rivals,
        sigma=noise,
        noise_is_given=bool(sigma),
        explained=free is not None and is_noise(free),
        held_out=(before, after),
    )


def _grown(
    fit: OdeFit, here: FittedOde, candidates: Sequence[CandidateLaw]
) -> list[tuple[OdeFit, FittedOde]]:
    """Fits with one law more, everything fitted together: of those that promise most."""
    grown = []
    for law in promising(fit, here, candidates, LEADERS):
        there = fit.residuals(here.q, (*here.laws, law))
        grown.append(
            fit.fitted(here.q, (*here.laws, law if there is not None else replace(law, coefficient=0.0)))
        )
    return [(fit, one) for one in grown if one.statistic < here.statistic - LEAST_GAIN]


def _rivals(fit: OdeFit, best: FittedOde, grown: Sequence[tuple[OdeFit, FittedOde]]) -> tuple[str, ...]:
    """Laws of other equations that explain as much as the last one."""
    law, spread = best.laws[-1].candidate, max(1.0, float(np.mean(best.z**2)))
    return tuple(
        f"{one.laws[-1].candidate.equation}' += {one.laws[-1].coefficient:.4g} * {_words(one.laws[-1])}"
        for other, one in grown
        if other is fit
        and one.laws[-1].candidate.equation != law.equation
        and one.statistic < best.statistic + TIE * spread
    )


def _in_turn(work: Callable[[int], object], items: Sequence[int]) -> Iterable[object]:
    return map(work, items)


def _measured_noise(recordings: Sequence[OdeRecording]) -> dict[str, float]:
    levels: dict[str, list[float]] = {}
    for recording in recordings:
        for name, values in recording.outputs.items():
            y = np.asarray(values, float)
            levels.setdefault(name, []).append(white_noise(y, np.ones(y.size, np.bool_)))
    noise = {
        name: float(np.nanmean(each)) if np.isfinite(each).any() else math.nan
        for name, each in levels.items()
    }
    for name, level in noise.items():
        if not level > 0.0:
            raise UserError(f"noise of '{name}'", "cannot be measured in so few samples", "give it as sigma")
    return noise


def _stretches(
    model: OdeModel,
    recordings: Sequence[OdeRecording],
    held_out: Sequence[OdeRecording],
    noise: Mapping[str, float],
    candidates: Sequence[CandidateLaw],
) -> tuple[OdeFit, OdeFit]:
    """What is fitted, and what is held out."""

    def stretch(recording: OdeRecording, first: float, last: float) -> OdeStretch:
        count = len(recording.time)
        sigma = np.array([noise[name] for name in recording.outputs])
        return OdeStretch(System(model, recording), slice(round(first * count), round(last * count)), sigma)

    share = 1.0 if held_out else FITTED_SHARE
    fitted = [stretch(one, 0.0, share) for one in recordings]
    judged = [stretch(one, 0.0, 1.0) for one in held_out] or [stretch(one, share, 1.0) for one in recordings]
    return OdeFit(model, fitted, [one.equation for one in candidates]), OdeFit(model, judged)


def _error(judge: OdeFit, found: FittedOde) -> float:
    """Rms of the normalised residuals held out; inf without a solution."""
    z = judge.residuals(found.q, found.laws)
    return math.inf if z is None else math.sqrt(float(np.mean(z**2)))


def _parameters(fit: OdeFit, found: FittedOde) -> dict[str, OdeEstimate]:
    half = NORMAL_975 * found.sigmas()[: found.q.size] * np.abs(fit.slopes_of_parameters(found.q))
    values = fit.parameters(found.q)
    return {
        name: OdeEstimate(value, value - each, value + each)
        for (name, value), each in zip(values.items(), half.tolist(), strict=True)
    }


def _law(fit: OdeFit, found: FittedOde, number: int) -> FoundLaw:
    law = found.laws[number]
    rest = [one for i, one in enumerate(found.laws) if i != number]
    half = NORMAL_975 * float(found.sigmas()[found.q.size + number])
    coefficient = OdeEstimate(law.coefficient, law.coefficient - half, law.coefficient + half)
    gain = fit.fitted(found.q, rest).statistic - found.statistic
    return FoundLaw(law.candidate.equation, _words(law), coefficient, gain)


def _words(law: SizedLaw) -> str:
    return law.candidate.words.format(*(f"{number:.4g}" for number in law.numbers))
