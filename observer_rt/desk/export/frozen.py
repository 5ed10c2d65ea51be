"""The observer as it is exported: all its numbers, nothing of it learns.

An export knows no bus: of the bench file it has sampling, noise levels and what learning assumes. What that states of
its channels, and what the stream knows of its lift sensor, is the bench's and stays there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector import Meaning, Training
from observer_rt.config.signals import Role
from observer_rt.desk.evaluation.run import ObserverRun
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.stream.standstill import RestingLift
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLIMETRE
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.line.lump import LumpLine
from observer_rt.model.line.wave import WaveLine
from observer_rt.model.network import Network
from observer_rt.model.sensor import Sensor
from observer_rt.model.terms.term import Term
from observer_rt.model.terms.variable import Variable


@dataclass(frozen=True)
class Frozen:
    """An observer whose numbers stay: the model with effects and terms, what was learned, gains, dead band.

    sample_rate: [Hz]; line: a `Line` as it is carried, with what was learned; network: of phi, likewise; sensor: its
    lag and offset likewise; gains (n, states): by samples since the start; weight [1/p_0^2]: of innovations of x~;
    opens_above, shuts_below: [m], of a needle's lift; offset_moves: whether x~ follows the offset at rest.
    """

    name: str
    sample_rate: float
    model: EffectiveModel
    constants: Constants
    line: Any
    network: Network
    sensor: Sensor
    gains: NDArray[np.float64]
    weight: float
    opens_above: float
    shuts_below: float
    offset_moves: bool
    phi_version: int

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms in force."""
        return self.model.terms

    @property
    def known(self) -> Mapping[Variable, float]:
        """Variables of laws that stay as they are."""
        return {Variable.MAX_LIFT: self.model.injector.seat.max_lift / MILLIMETRE}


def without_its_bus(bench: Bench, sample_rate: float | None = None) -> Bench:
    """The bench of an export: one measuring device, its samples taken together; sample_rate [Hz], None: the bench's.

    Raises `UserError` for what an export cannot carry.
    """
    config, model = bench.injector.config, effective_model(bench.injector.parameters)
    place = bench.injector.place
    if config.learning.training is Training.PAPER:
        raise UserError(
            place("learning.training"),
            "'paper' carries another phi, which is not exported",
            "use training = 'prediction_error'",
        )
    if config.sampling.meaning is Meaning.MEAN:
        raise UserError(
            place("sampling.meaning"),
            "is 'mean', but an export takes values at an instant",
            "set meaning = 'instant' for samples as the controller takes them",
        )
    signals = config.signals
    if late := [role for role in Role if signals.of(role).filter_delay_us or signals.of(role).lag_us]:
        raise UserError(
            place(f"signals.{late[0]}"),
            "states a delay or a lag: that is of the bench's channel, and what undoes it is not exported",
            "leave --bench out and give --model and --state, for signals that are taken together and on time",
        )
    if model.inputs.lift_lag or model.inputs.rail_delay:
        raise UserError(
            str(bench.injector.parameters_path),
            "has an effect that delays the lift or the rail pressure; what undoes it is not exported",
            "take the effect out of the injector file, and undo the delay before the signal reaches the observer",
        )
    if type(model.coefficients.line) not in (LumpLine, WaveLine):
        raise UserError(
            f"{bench.injector.parameters_path}: line.model",
            f"'{bench.injector.parameters.line.model}' is no line that is exported",
            "use 'lump', 'wave' or 'wave_two_part'",
        )
    sampling = config.sampling.model_copy(update={} if sample_rate is None else {"rate_hz": sample_rate})
    plain = load_bench().with_parameters(bench.injector.parameters)
    plain = plain.with_sections(sampling=sampling, noise=config.noise, learning=config.learning)
    injector = replace(plain.injector, parameters_path=bench.injector.parameters_path)
    return replace(plain, injectors=(injector,))


def observer_run(bench: Bench, knowledge: Knowledge | None) -> ObserverRun:
    """The observer that is exported, about to begin: nothing is learned.

    knowledge: learned before, None: nothing. Raises `UserError` for a sample rate too low to integrate.
    """
    carried = None if knowledge is None else replace(knowledge, lift=RestingLift())
    temperature = bench.injector.parameters.fluid.reference_temperature
    return ObserverRun(bench, carried, learning=False, fuel_temperature=temperature)


def frozen_of(bench: Bench, run: ObserverRun) -> Frozen:
    """The numbers of an observer about to begin."""
    observer = run.core.compiled.observer
    memory, constants = observer.memory[0], observer.constants
    carried, line = memory["in_force"], constants.coefficients.line
    sensor = constants.sensor._replace(
        lag=float(carried["sensor"][0]), offset=float(carried["learned_offset"])
    )
    return Frozen(
        name=bench.injector.parameters_path.stem,
        sample_rate=bench.injector.config.sampling.rate_hz,
        model=effective_model(bench.injector.parameters),
        constants=constants,
        line=type(line)(*(float(value) for value in carried["line"][: len(line)])),
        network=Network(
            memory["prior"]["hidden"].copy(),
            carried["output"].copy(),
            carried["bias"].copy(),
            carried["nozzle"].copy(),
        ),
        sensor=sensor,
        gains=observer.gains.copy(),
        weight=float(memory["innovation_noise"]["weight"]),
        opens_above=float(memory["dead_band"]["lift_on"]),
        shuts_below=float(memory["dead_band"]["lift_off"]),
        offset_moves=bool(memory["judgement"]["offset_moves"]),
        phi_version=int(memory["judgement"]["phi_version"]),
    )
