"""How golden events reach the learner one by one, and how its answers are read: arrays and texts by names."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.config.injector_sections import Meaning, SamplingConfig
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.engine.estimation.predictor import NoiseLevels, Window
from observer_rt.engine.learning.knowledge import Knowledge, Outcome, no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.learning.mass import volume_budget, volume_in
from observer_rt.engine.service.injector import bench_constants, healthy_injector
from observer_rt.engine.service.noise import configured_noise
from observer_rt.engine.stream.standstill import LiftFigures, Standstill
from observer_rt.engine.stream.state import Constants
from observer_rt.model.effective import Clock
from tests.observed_plants import bench_at

GOLDEN = Path(__file__).parent / "golden"
LARGE = 96  # numbers, above which an array is kept as what stands for it
ARRAYS = ("inputs", "output", "resting", "start", "opening", "knots", "masked", "clock", "commands")  # of a window
Named = dict[str, NDArray[Any] | str]


class Chain(NamedTuple):
    """Events in order; kind: of injector and line; model: its file beside the events; rate of samples [Hz]."""

    name: str
    kind: str
    model: str
    rate: float
    events: int
    means: bool
    has_lift: bool
    is_commanded: bool

    @property
    def constants(self) -> tuple[BenchInjector, Constants]:
        bench = bench_at(self.rate, GOLDEN / self.model).with_lift_sensor(not self.has_lift)
        meaning = Meaning.MEAN if self.means else Meaning.INSTANT
        injector = bench.with_sections(sampling=SamplingConfig(rate_hz=self.rate, meaning=meaning)).injector
        constants = bench_constants(injector)
        return injector, constants.by_commands() if self.is_commanded else constants


def learning_of(chain: Chain) -> Callable[[Named], Named]:
    """What learns from the next event of a chain."""
    injector, constants = chain.constants
    start = no_knowledge(configured_noise(injector), constants.coefficients.pressure_scale)
    learner = Learner(constants, start, healthy=healthy_injector(injector))

    def learn(event: Named) -> Named:
        in_force = np.array(event["in force"], np.float64)
        return outcome_of(learner.learn(*_read(event, constants.needle), in_force, constants))

    return learn


def recorder(events: list[Named], made: list[Constants]) -> Callable[[BenchInjector, Constants, Knowledge], Learner]:
    """Factory of learners that keep every event that reaches them, and the constants with it."""

    class Recorder(Learner):
        def learn(
            self, window: Window, standstill: Standstill, in_force: Any, constants: Constants | None = None
        ) -> Outcome:
            events.append(event_of(window, standstill, in_force))
            made.append(constants or self._constants)
            return super().learn(window, standstill, in_force, constants)

    return lambda injector, constants, start: Recorder(constants, start, healthy=healthy_injector(injector))


def event_of(window: Window, standstill: Standstill, in_force: NDArray[np.float64]) -> Named:
    """Arrays of an event: of all fields of a window but the needle, and those that are empty before learning."""
    event: dict[str, Any] = {name: getattr(window, name) for name in ARRAYS}
    event |= {"areas": np.stack((event["inputs"][:, 1], event["knots"][:, 1])), "in force": in_force}
    event |= {"rail": event.pop("inputs")[:, 0], "bends": event.pop("knots")[:, 0]}
    levels = [math.nan] * 3 if standstill.noise is None else list(vars(standstill.noise).values())
    event["standstill"] = [standstill.samples, standstill.offset, *levels, *vars(standstill.lift).values()]
    return {name: np.array(values) for name, values in event.items()}


def _read(event: Named, needle: NeedleLaw | None) -> tuple[Window, Standstill]:
    e: dict[str, Any] = {name: np.array(values) for name, values in event.items()}
    samples, offset, *others = e.pop("standstill").tolist()
    noise = None if math.isnan(others[0]) else NoiseLevels(*others[:3])
    area, bent = e.pop("areas")
    e |= {"inputs": np.column_stack((e.pop("rail"), area)), "knots": np.column_stack((e.pop("bends"), bent))}
    e |= {"opening": int(e["opening"]), "clock": Clock(*e["clock"].tolist()), "needle": needle}
    return Window(**{name: e[name] for name in (*ARRAYS, "needle")}), Standstill(
        int(samples), offset, noise, LiftFigures(*others[3:])
    )


def outcome_of(outcome: Outcome) -> Named:
    named, again = dict(vars(outcome)), outcome.resimulated
    knowledge = named.pop("knowledge")
    for who in ("forward", "objections"):
        named[who] = ", ".join(f"{each.reason.name} {getattr(each.phase, 'name', '')}" for each in named[who])
    named |= {"posterior": dict(outcome.posterior), "in force": knowledge.in_force, "state": knowledge.state}
    if again is not None:
        every = slice(0, again.run.rate.size)
        named["volume"] = [volume_in(again, every), *volume_budget(again, every)]
    return dict(flat("", named))


def flat(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any] | str]]:
    """Names and arrays or texts of what a value is made of; of a large array what stands for it."""
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from flat(f"{name}.{key}".lstrip("."), part)
        return
    if value is None or isinstance(value, str):
        yield name, str(value)
        return
    array = np.array(sorted(value) if isinstance(value, frozenset) else value, np.float64)
    if array.size <= LARGE:
        yield name, array
        return
    yield f"{name}#", np.frombuffer(blake2b(array.tobytes(), digest_size=8).digest(), np.uint64)
    yield f"{name} moments", np.array([array.sum(), np.square(array).sum(), np.abs(array).max()])
    if name.endswith(("covariance", "gains")) and not name.endswith(("resimulated.covariance", "error_covariance")):
        yield f"{name} shown", (array.diagonal() if array.shape[0] == array.shape[1] else array[-1]).copy()
