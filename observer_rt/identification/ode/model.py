"""A system of ordinary differential equations, recordings of it, and its solution with laws added."""

import math
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError

Values = Any
"""Numbers by name, as attributes: `x.level`."""
SECANT = (
    0.05  # of a state's scatter, over which a slope is taken: a kink or jump counts as often as it is met
)


@dataclass(frozen=True, eq=False)
class OdeRecording:
    """A recording of a system.

    time: (n,) even [s, or whatever the model counts in]; outputs: measured signals (n,) by the names of the model's
    outputs; inputs: signals (n,) by name, each held from a sample to the next; start: states at the first sample that
    are other than the model's, a number or the name of a parameter.
    """

    time: NDArray[np.float64]
    outputs: Mapping[str, NDArray[np.float64]]
    inputs: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    start: Mapping[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class OdeModel:
    """A system x' = f(x, u, p) with outputs y = output(x, u, p).

    f: derivatives in the order of the states; its arguments have states, inputs and parameters as attributes, numbers
    all of them. states: values at the first sample, each a number or the name of a parameter; parameters: where their
    fit begins, each keeps its sign, one of 0 is free to have either; output: a mapping of names to values, by default
    the states; steps: of RK4 from a sample to the next.
    """

    f: Callable[[Values, Values, Values], Sequence[float]]
    states: Mapping[str, float | str]
    parameters: Mapping[str, float]
    output: Callable[[Values, Values, Values], Mapping[str, float]] | None = None
    steps: int = 1


@dataclass(frozen=True)
class LawInForce:
    """A law added to the derivative of a state (by number), times a coefficient."""

    state: int
    law: Callable[..., float]
    coefficient: float
    numbers: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Solution:
    """States (n, s) and outputs (n, m) of a model at the samples of a recording."""

    states: NDArray[np.float64]
    outputs: NDArray[np.float64]


class System:
    """A model on one recording."""

    def __init__(self, model: OdeModel, recording: OdeRecording) -> None:
        """Raises `UserError` for signals that do not fit each other, and a time that is not even."""
        self._model, self._recording = model, recording
        self._state: Any = namedtuple("State", list(model.states))  # type: ignore[misc]
        self._parameter: Any = namedtuple("Parameter", list(model.parameters))  # type: ignore[misc]
        given: Any = namedtuple("Input", list(recording.inputs))  # type: ignore[misc]
        _refuse_misfits(model, recording)
        columns = [np.asarray(values, float).tolist() for values in recording.inputs.values()]
        count = len(recording.time)
        self.inputs = [given(*row) for row in zip(*columns, strict=True)] if columns else [given()] * count
        """Inputs of every sample, by name."""
        self.measured = np.column_stack([np.asarray(y, float) for y in recording.outputs.values()])
        """Outputs (n, m) as measured."""
        self.interval = float(recording.time[1] - recording.time[0])
        """Sample interval."""

    def solve(
        self,
        parameters: Mapping[str, float],
        laws: Sequence[LawInForce] = (),
        gain: NDArray[np.float64] | None = None,
    ) -> Solution | None:
        """The solution with laws added; None where it is not finite.

        gain: (s, m) by which the states follow the measured outputs, None: they run free.
        """
        p = self._parameter(**parameters)
        try:
            with np.errstate(all="ignore"):
                found = list(self._samples(p, laws, gain))
            states, outputs = (np.array(each, float) for each in zip(*found, strict=True))
        except (ArithmeticError, ValueError, TypeError):  # of a root or logarithm of what is negative
            return None
        return Solution(states, outputs) if np.isfinite(outputs).all() else None

    def start(self, parameters: Mapping[str, float]) -> list[float]:
        """States at the first sample."""
        stated = {**self._model.states, **self._recording.start}
        every = (stated[name] for name in self._model.states)
        return [float(parameters[one]) if isinstance(one, str) else float(one) for one in every]

    def rates(
        self, parameters: Mapping[str, float], states: NDArray[np.float64], laws: Sequence[LawInForce] = ()
    ) -> NDArray[np.float64]:
        """Derivatives (n, s) at states (n, s)."""
        p = self._parameter(**parameters)
        every = zip(states.tolist(), self.inputs, strict=True)
        return np.array([self._rate(self._state(*x), u, p, laws) for x, u in every], float)

    def along(
        self, states: NDArray[np.float64], law: Callable[..., float], numbers: Sequence[float]
    ) -> NDArray[np.float64]:
        """A law (n,) at states (n, s)."""
        every = zip(states.tolist(), self.inputs, strict=True)
        return np.array([law(self._state(*x), u, *numbers) for x, u in every], float)

    def slopes(
        self,
        parameters: Mapping[str, float],
        states: NDArray[np.float64],
        laws: Sequence[LawInForce],
        at: Sequence[int],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean derivatives of the next states (s, s) and of the outputs (m, s) by the states, over some samples."""
        p, scale = (
            self._parameter(**parameters),
            SECANT * (np.std(states, axis=0) + 0.1 * np.abs(states).mean(axis=0) + 1e-9),
        )

        def moved(k: int) -> NDArray[np.float64]:
            every = [states[k], *(states[k] + scale * row for row in np.eye(scale.size))]
            named, u = [self._state(*x.tolist()) for x in every], self.inputs[k]
            values = np.array([[*self._next(x, u, p, laws), *self._shown(x, u, p)] for x in named])
            return np.asarray((values[1:] - values[0]).T / scale)

        mean = np.mean([moved(k) for k in at], axis=0)
        return mean[: scale.size], mean[scale.size :]

    def _samples(
        self, p: Values, laws: Sequence[LawInForce], gain: NDArray[np.float64] | None
    ) -> Iterator[tuple[Sequence[float], list[float]]]:
        x = self._state(*self.start(p._asdict()))
        rows, measured = None if gain is None else gain.tolist(), self.measured.tolist()
        for u, y in zip(self.inputs, measured, strict=True):
            shown = self._shown(x, u, p)
            yield x, shown
            if rows is not None:
                off = [a - b for a, b in zip(y, shown, strict=True)]
                corrected = (
                    v + sum(k * e for k, e in zip(row, off, strict=True))
                    for v, row in zip(x, rows, strict=True)
                )
                x = self._state(*corrected)
            x = self._next(x, u, p, laws)

    def _shown(self, x: Values, u: Values, p: Values) -> list[float]:
        output = self._model.output
        shown = x._asdict() if output is None else output(x, u, p)
        return [float(shown[name]) for name in self._recording.outputs]

    def _next(self, x: Values, u: Values, p: Values, laws: Sequence[LawInForce]) -> Values:
        """States at the next sample."""
        for _ in range(self._model.steps):
            x = self._stepped(x, u, p, laws, self.interval / self._model.steps)
        return x

    def _rate(self, x: Values, u: Values, p: Values, laws: Sequence[LawInForce]) -> list[float]:
        rate = list(self._model.f(x, u, p))
        for one in laws:
            rate[one.state] += one.coefficient * one.law(x, u, *one.numbers)
        return rate

    def _stepped(self, x: Values, u: Values, p: Values, laws: Sequence[LawInForce], step: float) -> Values:
        """A step of RK4."""
        make, half = self._state._make, 0.5 * step
        first = self._rate(x, u, p, laws)
        second = self._rate(make([v + half * s for v, s in zip(x, first, strict=True)]), u, p, laws)
        third = self._rate(make([v + half * s for v, s in zip(x, second, strict=True)]), u, p, laws)
        fourth = self._rate(make([v + step * s for v, s in zip(x, third, strict=True)]), u, p, laws)
        sixth = step / 6.0
        every = zip(x, first, second, third, fourth, strict=True)
        stepped = make([v + sixth * (a + 2.0 * (b + c) + d) for v, a, b, c, d in every])
        if not all(map(math.isfinite, stepped)):
            raise ArithmeticError
        return stepped


def _refuse_misfits(model: OdeModel, recording: OdeRecording) -> None:
    time = np.asarray(recording.time, float)
    for name, values in {**recording.outputs, **recording.inputs}.items():
        if len(values) != time.size:
            raise UserError(f"'{name}'", f"has {len(values)} samples, time {time.size}", "give as many")
    if not recording.outputs:
        raise UserError("outputs", "are none", "give what was measured, by name")
    if time.size < 2 or not np.allclose(np.diff(time), time[1] - time[0], rtol=1e-3):
        raise UserError("time", "is not even", "interpolate the signals to an even time")
    starts = {**model.states, **recording.start}
    for name, start in starts.items():
        if isinstance(start, str) and start not in model.parameters:
            raise UserError(f"start of '{name}'", f"is no parameter '{start}'", "add it to the parameters")
    if model.output is None and not set(recording.outputs) <= set(model.states):
        raise UserError("outputs", "are not among the states", "name the states measured, or give `output`")
