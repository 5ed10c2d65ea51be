"""A disturbance of a real bench: what it does to a recording, how large, and which reasons would be true of it."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.plants.arrays import Array
from tests.plants.plant import LIFT, LINE, RAIL, SIGNALS, Bench, Measured, Step, seen_as


class Reasons:
    """Which reasons are true of what, by name."""

    ALWAYS = frozenset({"REVISED"})  # says what the observer did; cannot be untrue
    # "the line pressure has left what the model can do: check sensors, cables"
    SENSOR = frozenset({"CONTRADICTED"})
    OFFSET = SENSOR | {"PRESSURE_OFFSET"}
    OUTLIERS = SENSOR | {"SAMPLES_LOST"}
    FROZEN = OUTLIERS | {"INPUT_FROZEN"}
    CLIPPED = SENSOR | {"INPUT_CLIPPED"}
    DROPOUTS = FROZEN | CLIPPED
    LATE = SENSOR | {"TIME_BASE"}
    LATE_LINE = LATE | {"SENSOR_LAG"}
    LATE_LIFT = LATE | {"LIFT_SENSOR_LAG"}
    LIFT_ZERO = SENSOR | {"LIFT_ZERO", "NEEDLE_STUCK"}  # a zero far off seems an open needle
    CHANGE = frozenset({"SUDDEN_CHANGE"})
    # "wait for 3 ms of closed needle"; too few were judged yet, for a judgement takes as long as before
    CROWDED = frozenset({"STARTING", "NO_STANDSTILL", "TOO_FEW_EVENTS"})


ALL = SIGNALS
MPA, UM, US, KHZ = 1e6, 1e-6, 1e-6, 1e3
SCALES = {"MPa": MPA, "um": UM, "us": US, "ms": 1e-3, "kHz": KHZ, "%": 0.01}  # by the first word of a unit
LAG, DELAY = "lag_us", "filter_delay_us"  # keys of `[signals.<role>]`

Apply = Callable[[Bench, float, Generator], Bench]
"""The bench with a disturbance of a size."""
Wave = Callable[[Array, Array, float, Generator], Array]
"""What becomes of a signal (n,): of its times [s], values, a size, and chance."""
Stated = Mapping[str, Mapping[str, float]]
"""Keys of the bench file, by role, of `[signals.<role>]`."""


class Kind(StrEnum):
    """What a disturbance is of."""

    LINE = "line"
    RAIL = "rail"
    LIFT = "lift"
    TIMING = "timing"
    ALL = "all"
    BENCH = "bench"  # what really happens: needle, supply, rhythm


_KIND = {RAIL: Kind.RAIL, LIFT: Kind.LIFT, LINE: Kind.LINE}


@dataclass(frozen=True)
class Disturbance:
    """One disturbance at several sizes.

    table: the size in the table of the bars, None: it is not in it; true_reasons: names of reasons which, given for
    it, would be true; stated: what a bench file would say of it, for an observer that knows the keys; rhythm: it
    has a schedule of its own, and comes first.
    """

    name: str
    kind: Kind
    unit: str
    sizes: tuple[float, ...]
    apply: Apply
    true_reasons: frozenset[str] = frozenset()
    table: float | None = None
    stated: Callable[[float], Stated] | None = None
    rhythm: bool = False


def of_signal(
    name: str,
    role: str,
    unit: str,
    sizes: tuple[float, ...],
    wave: Wave,
    true_reasons: frozenset[str] = frozenset(),
    *,
    kind: Kind | None = None,
    after: bool = False,
    **more: Any,
) -> Disturbance:
    """A disturbance of one signal, ahead of the noise or after it; kind: another one than the signal's."""
    scale = SCALES[re.split("[, /]", unit)[0]]
    apply = (after_noise if after else before_noise)(wave, scale, role)
    return Disturbance(name, kind or _KIND[role], unit, sizes, apply, true_reasons, **more)


def before_noise(wave: Wave, scale: float, *roles: str) -> Apply:
    """A disturbance of single signals ahead of the noise, its size in units of `scale`."""
    return lambda bench, size, rng: with_step_before(bench, _step(wave, scale * size, rng, roles))


def after_noise(wave: Wave, scale: float, *roles: str) -> Apply:
    """The same of samples that have their noise."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        steps = (*bench.around.after_noise, _step(wave, scale * size, rng, roles))
        return replace(bench, around=replace(bench.around, after_noise=steps))

    return apply


def _step(wave: Wave, size: float, rng: Generator, roles: tuple[str, ...]) -> Step:
    seed = int(rng.integers(2**62))

    def step(measured: Measured) -> Measured:
        chance = np.random.default_rng(seed)  # the same every time the bench is recorded
        for role in roles:
            measured = seen_as(role, lambda time, values: wave(time, values, size, chance))(measured)
        return measured

    return step


def adding(role: str, of: Callable[[Bench, float, Generator], Callable[[Measured], Array]]) -> Apply:
    """What all signals together add to one, ahead of the noise."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        added = of(bench, size, rng)
        return with_step_before(bench, lambda m: changed(m, role, getattr(m, role) + added(m)))

    return apply


def with_step_before(bench: Bench, step: Step) -> Bench:
    """The bench with another step ahead of the noise."""
    around = bench.around
    return replace(bench, around=replace(around, before_noise=(*around.before_noise, step)))


def with_faults_set(bench: Bench, **values: float) -> Bench:
    """The bench with these faults at every event, beside its own."""
    events = tuple(replace(event, faults=event.faults._replace(**values)) for event in bench.events)
    return replace(bench, events=events)


def sign(rng: Generator) -> float:
    """Either, as often as the other."""
    return 1.0 if rng.random() < 0.5 else -1.0


def in_order(*parts: Apply) -> Apply:
    """One disturbance made of several."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        for part in parts:
            bench = part(bench, size, rng)
        return bench

    return apply


def changed(measured: Measured, role: str, values: Array) -> Measured:
    """The signals with another one in the place of a role."""
    return replace(measured, **{role: values})
