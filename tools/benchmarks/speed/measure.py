"""All measurements of `tools/bench speed`, or those asked for."""

import os
import tempfile
from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from rich.console import Console

from tools.benchmarks.speed.evaluated import EvaluateTimes, measure_evaluate
from tools.benchmarks.speed.injectors import InjectorsRow, measure_injectors
from tools.benchmarks.speed.roundtrip import RoundTrips, measure_roundtrips
from tools.benchmarks.speed.sample import SampleTimes, measure_sample
from tools.benchmarks.speed.scaling import Row, measure_scaling
from tools.benchmarks.speed.startup import Startup, measure_startup
from tools.benchmarks.speed.sustained import Sustained, measure_sustained
from tools.benchmarks.speed.traffic import make_traffic
from tools.benchmarks.speed.training import TrainingTimes, measure_training


class Part(StrEnum):
    """What `--only` chooses from, in the order it is measured."""

    SUSTAINED = "sustained"
    ROUNDTRIP = "roundtrip"
    SAMPLE = "sample"
    EVALUATE = "evaluate"
    TRAINING = "training"
    STARTUP = "startup"
    SCALING = "scaling"
    INJECTORS = "injectors"


@dataclass(frozen=True)
class SpeedPlan:
    """What is measured. seconds: of the sustained rate; roundtrip_seconds: to each party.

    injectors_seconds: to each number of injectors; cold: start so, too.
    """

    parts: Collection[Part]
    seconds: float
    roundtrip_seconds: float
    injectors_seconds: float
    cold: bool


@dataclass(frozen=True)
class Speed:
    """What was measured; None: was not. load: of the machine in the last minute, before and after."""

    load: tuple[float, float]
    sustained: Sustained | None = None
    roundtrips: RoundTrips | None = None
    sample: SampleTimes | None = None
    evaluate: EvaluateTimes | None = None
    training: TrainingTimes | None = None
    startup: Startup | None = None
    scaling: tuple[Row, ...] = ()
    injectors: tuple[InjectorsRow, ...] = ()


def measure_speed(plan: SpeedPlan, messages: Console) -> Speed:
    """Measure part after part. Raises UserError, RunError."""
    before = os.getloadavg()[0]

    def wanted(part: Part) -> bool:
        if part in plan.parts:
            messages.print(f"{part} ...", highlight=False)
        return part in plan.parts

    with tempfile.TemporaryDirectory(prefix="speed-") as name:
        folder = Path(name)
        traffic = make_traffic(folder)
        sustained = measure_sustained(folder, traffic, plan.seconds) if wanted(Part.SUSTAINED) else None
        roundtrips = measure_roundtrips(folder, plan.roundtrip_seconds) if wanted(Part.ROUNDTRIP) else None
        sample = measure_sample(folder) if wanted(Part.SAMPLE) else None
        evaluate = measure_evaluate(folder) if wanted(Part.EVALUATE) else None
        training = measure_training(traffic) if wanted(Part.TRAINING) else None
        startup = measure_startup(folder, cold=plan.cold) if wanted(Part.STARTUP) else None
        scaling = tuple(measure_scaling()) if wanted(Part.SCALING) else ()
        injectors = (
            measure_injectors(folder, traffic, plan.injectors_seconds) if wanted(Part.INJECTORS) else ()
        )
    load = before, os.getloadavg()[0]
    return Speed(load, sustained, roundtrips, sample, evaluate, training, startup, scaling, injectors)
