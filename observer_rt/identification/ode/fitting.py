"""Fits of a model with laws to recordings: base parameters, coefficients and numbers within laws, jointly.

What is fitted are innovations of a steady Kalman filter: a model that lacks something is taken to be disturbed, in
the equations that may lack a law, by a share of their own rates. The more is found, the smaller is the share that
suits the recordings best; at none of it the model runs free.
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.ode.laws import CandidateLaw
from observer_rt.identification.ode.model import LawInForce, OdeModel, System

SHARES = (1.0, 0.3, 0.1, 0.03, 0.01, 0.0)  # of an equation's rate that may be its disturbance
POINTS = 25  # samples at which a model is linearised
BEYOND = 0.5  # of the range of the numbers tried, that a fit may go beyond it
MOST_SOLUTIONS = 10  # of a fit, but for slopes
FAR = 1e6  # standard deviations, that stand for no solution
BLOCK = 25  # samples whose sum tells coloured residuals from white ones


@dataclass(frozen=True)
class SizedLaw:
    """A candidate with its coefficient and the numbers within it."""

    candidate: CandidateLaw
    coefficient: float
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class OdeStretch:
    """Samples of a recording, and the standard deviations (m,) of its outputs."""

    system: System
    part: slice
    sigma: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Filter:
    """Gain (s, m) of a stretch, None of a model that runs free, and standard deviations (m,) of its innovations."""

    gain: NDArray[np.float64] | None
    sigma: NDArray[np.float64]


class OdeFit:
    """Fits of a model to stretches of recordings."""

    def __init__(
        self, model: OdeModel, stretches: Sequence[OdeStretch], disturbed: Sequence[str] = ()
    ) -> None:
        """disturbed: equations that may lack something."""
        self.model, self.stretches = model, stretches
        self.share = 0.0
        """Of the rates of these equations, that is taken for their disturbance."""
        self._filters = [Filter(None, one.sigma) for one in stretches]
        self._names = list(model.states)
        self._disturbed = np.array([name in disturbed for name in model.states])
        self._start = np.array(list(model.parameters.values()), float)
        self.at_start = np.zeros(self._start.size)
        """Where a fit begins: base parameters q (p,), logarithms of their ratio to the start; from 0 as they are."""

    def parameters(self, q: NDArray[np.float64]) -> dict[str, float]:
        """Base parameters by name."""
        values = np.where(self._start == 0.0, q, self._start * np.exp(np.clip(q, -50.0, 50.0)))
        return dict(zip(self.model.parameters, values.tolist(), strict=True))

    def slopes_of_parameters(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the parameters (p,) by q."""
        return np.where(self._start == 0.0, 1.0, np.array(list(self.parameters(q).values())))

    def residuals(self, q: NDArray[np.float64], laws: Sequence[SizedLaw]) -> NDArray[np.float64] | None:
        """Normalised innovations (n,), stretch after stretch; None without a solution."""
        parameters, added, parts = self.parameters(q), self._added(laws), []
        for one, corrected in zip(self.stretches, self._filters, strict=True):
            solution = one.system.solve(parameters, added, corrected.gain)
            if solution is None:
                return None
            innovations = (one.system.measured - solution.outputs) / corrected.sigma
            parts.append(innovations[one.part].T.ravel())
        return np.concatenate(parts)

    def statistic(self, z: NDArray[np.float64]) -> float:
        """-2 log L of normalised innovations (n,), constants left out."""
        logs = (
            float(np.sum(np.log(corrected.sigma))) * len(range(*one.part.indices(len(one.system.inputs))))
            for one, corrected in zip(self.stretches, self._filters, strict=True)
        )
        return float(z @ z) + 2.0 * sum(logs)

    def states(
        self, q: NDArray[np.float64], laws: Sequence[SizedLaw] = ()
    ) -> list[NDArray[np.float64]] | None:
        """States (n, s) of every recording, along measured outputs as far as these correct them."""
        parameters, added = self.parameters(q), self._added(laws)
        found = [
            one.system.solve(parameters, added, corrected.gain)
            for one, corrected in zip(self.stretches, self._filters, strict=True)
        ]
        return None if None in found else [one.states for one in found if one is not None]

    def disturbed(self, share: float, q: NDArray[np.float64], laws: Sequence[SizedLaw]) -> "OdeFit | None":
        """The same with another share of disturbance, gains by linearisation about here; None where there is none."""
        states = self.states(q, laws)
        return None if states is None else self._filtered(share, q, laws, states)

    def started(self) -> "OdeFit | None":
        """The same with all of the rates taken for disturbance, gains by linearisation about the first states."""
        parameters = self.parameters(self.at_start)
        states = [
            np.tile(one.system.start(parameters), (len(one.system.inputs), 1)) for one in self.stretches
        ]
        return self._filtered(SHARES[0], self.at_start, (), states)

    def _filtered(
        self,
        share: float,
        q: NDArray[np.float64],
        laws: Sequence[SizedLaw],
        states: Sequence[NDArray[np.float64]],
    ) -> "OdeFit | None":
        other = copy(self)
        other.share = share
        try:
            other._filters = [
                self._filter(one, share, q, laws, x) for one, x in zip(self.stretches, states, strict=True)
            ]
        except (np.linalg.LinAlgError, ArithmeticError, ValueError):
            return None
        return other

    def undisturbed(self) -> "OdeFit":
        """The same model running free, with the noise of its outputs."""
        other = copy(self)
        other.share, other._filters = 0.0, [Filter(None, one.sigma) for one in self.stretches]
        return other

    def louder(self, variance: float) -> "OdeFit":
        """The same with the noise of this variance, if that is more than 1."""
        other = copy(self)
        more = math.sqrt(max(1.0, variance))
        other._filters = [Filter(one.gain, one.sigma * more) for one in self._filters]
        return other

    def _filter(
        self,
        one: OdeStretch,
        share: float,
        q: NDArray[np.float64],
        laws: Sequence[SizedLaw],
        states: NDArray[np.float64],
    ) -> Filter:
        from scipy.linalg import solve_discrete_are  # no other import takes as long

        if share == 0.0:
            return Filter(None, one.sigma)
        parameters, added, system = self.parameters(q), self._added(laws), one.system
        rates = np.sqrt(np.mean(system.rates(parameters, states, added) ** 2, axis=0))
        at = np.linspace(0, len(states) - 1, POINTS).astype(int).tolist()
        after, shown = system.slopes(parameters, states, added, at)
        disturbance = np.where(self._disturbed, (share * rates * system.interval) ** 2, 0.0)
        floor = 1e-12 * float(np.max(disturbance, initial=0.0))
        noise = np.diag(one.sigma**2)
        variance = solve_discrete_are(after.T, shown.T, np.diag(disturbance + floor), noise)
        innovation = shown @ variance @ shown.T + noise
        gain = np.linalg.solve(innovation, shown @ variance).T
        return Filter(gain, np.sqrt(np.diag(innovation)))

    def _added(self, laws: Sequence[SizedLaw]) -> list[LawInForce]:
        return [
            LawInForce(
                self._names.index(one.candidate.equation), one.candidate.law, one.coefficient, one.numbers
            )
            for one in laws
        ]

    def fitted(self, q: NDArray[np.float64], laws: Sequence[SizedLaw]) -> "FittedOde":
        """Everything fitted together, from here."""
        from scipy.optimize import least_squares

        here = self.residuals(q, laws)
        count = 0 if here is None else here.size
        free = np.full(q.size, np.inf)
        lowest = np.concatenate(
            [-free, [one.candidate.lowest for one in laws], *(_reach(one)[0] for one in laws)]
        )
        highest = np.concatenate(
            [free, [one.candidate.highest for one in laws], *(_reach(one)[1] for one in laws)]
        )

        def errors(theta: NDArray[np.float64]) -> NDArray[np.float64]:
            found = self.residuals(*self.unpacked(theta, laws))
            return np.full(count, FAR) if found is None else np.clip(found, -FAR, FAR)

        inside = np.clip(packed(q, laws), lowest, highest)
        found = least_squares(
            errors, inside, bounds=(lowest, highest), x_scale="jac", max_nfev=MOST_SOLUTIONS
        )
        q, laws = self.unpacked(found.x, laws)
        z = np.asarray(found.fun)
        return FittedOde(q, tuple(laws), z, np.asarray(found.jac), self.statistic(z))

    def unpacked(
        self, theta: NDArray[np.float64], laws: Sequence[SizedLaw]
    ) -> tuple[NDArray[np.float64], list[SizedLaw]]:
        """Base parameters and laws of a vector; see `packed`."""
        count, place = self.at_start.size, self.at_start.size + len(laws)
        sized = []
        for one, coefficient in zip(laws, theta[count:place].tolist(), strict=True):
            end = place + len(one.numbers)
            sized.append(SizedLaw(one.candidate, coefficient, tuple(theta[place:end].tolist())))
            place = end
        return theta[:count], sized


def packed(q: NDArray[np.float64], laws: Sequence[SizedLaw]) -> NDArray[np.float64]:
    """Base parameters, coefficients and numbers within laws as one vector."""
    return np.concatenate([q, [one.coefficient for one in laws], *(one.numbers for one in laws)])


def ways_to_fit(
    fit: OdeFit, q: NDArray[np.float64], laws: Sequence[SizedLaw]
) -> "list[tuple[OdeFit, FittedOde]]":
    """Fits by the share of disturbance that makes the recordings most probable, and of the model that runs free.

    Each smaller share is fitted from the one before: the states follow the recordings less and less. What the free
    run leaves counts as its noise: its errors are taken for what is beyond the model.
    """
    best: tuple[OdeFit, FittedOde] | None = None
    for share in SHARES:
        other = fit.disturbed(share, q, laws)
        if other is None:
            continue
        found = other.fitted(q, laws)
        fit, q, laws = other, found.q, found.laws
        if best is None or found.statistic < best[1].statistic:
            best = other, found
    free = fit.louder(float(np.mean(found.z**2))) if best is not None and fit.share == 0.0 else None
    found_free = [] if free is None else [(free, free.fitted(q, laws))]
    return [*([] if best is None else [best]), *found_free]


def _reach(one: SizedLaw) -> tuple[list[float], list[float]]:
    """Bounds of the numbers within a law."""
    if not one.numbers:
        return [], []
    low, high = min(one.candidate.numbers), max(one.candidate.numbers)
    more = BEYOND * (high - low) or BEYOND * abs(high)
    return [low - more], [high + more]


@dataclass(frozen=True, eq=False)
class FittedOde:
    """A fit. q: base parameters (p,) as `OdeFit` has them; z: normalised innovations (n,); jacobian: (n, k) of q,
    coefficients, numbers; statistic: -2 log L."""

    q: NDArray[np.float64]
    laws: tuple[SizedLaw, ...]
    z: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    statistic: float

    def sigmas(self) -> NDArray[np.float64]:
        """Standard deviations (k,), larger where innovations are larger than expected, or not white."""
        covariance = np.linalg.pinv(self.jacobian.T @ self.jacobian, rcond=1e-12, hermitian=True)
        spread = max(1.0, float(np.mean(self.z**2)), blocks(self.z))
        return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0) * spread))


def blocks(z: NDArray[np.float64]) -> float:
    """Mean square of the scaled sums of residuals over blocks: their variance where they are white."""
    count = z.size // BLOCK
    if count == 0:
        return float(np.mean(z**2))
    return float(np.mean(z[: count * BLOCK].reshape(count, BLOCK).sum(axis=1) ** 2)) / BLOCK


def is_noise(z: NDArray[np.float64]) -> bool:
    """Whether residuals (n,) are as large as noise, and white."""
    few, many = max(1, z.size // BLOCK), z.size
    return bool(np.mean(z**2) < 1.2 + 4.0 * math.sqrt(2.0 / many)) and blocks(z) < 1.3 + 4.0 * math.sqrt(
        2.0 / few
    )
