"""Reference runs beside an export: inputs, and what the observer and the model here make of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import Bench
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.laws import normalised_area
from observer_rt.core.model.model import rest_state
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.evaluate import Evaluation
from observer_rt.desk.evaluation.run import ObserverRun
from observer_rt.desk.export.frozen import Frozen
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.estimation.predictor import NO_SLOPES, Setting, Window
from observer_rt.engine.estimation.scalars import nothing_learned
from observer_rt.engine.stream.state import LINE
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import sized

Signal = NDArray[np.float64]
PRESSURES = (60e6, 120e6)  # Pa, of the events in turn
ENERGIZED = (0.4e-3, 1.2e-3)  # s, beyond the delay of the opening
EVENTS = 4
PERIOD = 25e-3  # s
BEFORE = 20e-3  # s of standstill before the first event
WORN = 0.1  # v_H that the model does not know, so that there is something to correct
SEED = 1


@dataclass(frozen=True)
class ReferenceRun:
    """Columns by name, in SI; rows of outputs from the first sample on that has one."""

    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]


def reference_recording(bench: Bench) -> Recording:
    """Four injections as sensors of a slightly worn injector show them, with noise of rail and line pressure."""
    injector, rate = bench.injector.parameters, bench.injector.config.sampling.rate_hz
    schedule = make_schedule(
        PRESSURES, EVENTS, PERIOD, [injector.needle.opening_delay + time for time in ENERGIZED]
    )
    worn = (sized("orifice_area", v_H=WORN),)
    quiet = replace(SimulatedNoise(), needle_lift=0.0)
    recording = simulate(injector, schedule, rate, worn, quiet, seed=SEED).recording
    first = int(np.flatnonzero(recording.needle_lift > 0.0)[0]) - round(BEFORE * rate)
    end = min(first + RING, recording.samples)
    return Recording(
        time=recording.time[first:end] - recording.time[first],
        rail_pressure=recording.rail_pressure[first:end],
        needle_lift=recording.needle_lift[first:end],
        line_pressure=recording.line_pressure[first:end],
    )


def observer_reference(recording: Recording, run: ObserverRun) -> ReferenceRun:
    """A recording, no longer than the observer remembers, through the observer itself, which is about to begin.

    The inputs are those that its model saw: the lift without its zero, no line pressure where that was an outlier.
    """
    source = HeldSignals(recording)
    evaluation = Evaluation(source)
    evaluation.observe(run)
    run.finish()
    rows = run.core.rows(0, run.core.processed)
    constants = run.core.compiled.observer.constants
    c, inputs = constants.coefficients, constants.inputs
    line = np.where(rows["bridged"] >> LINE & 1, np.nan, rows["line_pressure"])
    taken = {
        "time_s": recording.time,
        "rail_pressure_Pa": (_in_pascal(rows["rail_pressure"], c) - inputs.rail_shift) / inputs.rail_factor,
        "needle_lift_m": rows["lift"].copy(),
        "line_pressure_Pa": _in_pascal(line, c),
    }
    rows = rows[: len(rows) - constants.timing.lookahead]
    valid = np.isfinite(rows["injection_rate"])
    columns = {
        "time_s": recording.time[: len(rows)],
        "is_valid": valid.astype(np.float64),
        "is_open": (rows["lift_area"] > 0.0).astype(np.float64),
        "injection_rate_m3_per_s": np.where(valid, rows["injection_rate"], 0.0),
        "innovation_Pa": rows["innovation"] * c.pressure_scale,
    }
    for name, x in (("observed", rows["x_hat"]), ("followed", rows["x_tilde"])):
        columns[f"{name}_line_pressure_Pa"] = _in_pascal(x[:, 0], c)
        columns[f"{name}_line_flow_m3_per_s"] = x[:, 1] * c.flow_scale
        columns[f"{name}_sac_pressure_Pa"] = _in_pascal(x[:, 2], c)
    return ReferenceRun(taken, columns)


def injector_reference(recording: Recording, frozen: Frozen) -> ReferenceRun:
    """The model alone from rest on, along the rail pressure and the lift of a recording."""
    it, sensor = frozen.constants, frozen.sensor
    c = it.coefficients._replace(line=frozen.line)
    rail = (recording.rail_pressure - c.chamber_pressure) / c.pressure_scale
    area = np.array([normalised_area(lift, c.seat) for lift in recording.needle_lift])
    inputs = np.column_stack([np.append(rail[0], rail), np.append(0.0, area)])  # at rest before the first
    x = np.zeros(c.states)
    rest_state(x, rail[0], c)
    zeros = np.zeros(len(inputs))
    window = Window(inputs, zeros, np.zeros(len(inputs), np.bool_), np.append(x, rail[0]), 0)
    setting = Setting(
        it.interval, it.substeps, c, np.zeros(c.states), sensor.fraction, sensor.lag, program=it.program
    )
    learned = nothing_learned(c)._replace(network=frozen.network)
    shown, rate = np.empty((2, len(inputs)))
    follow(window, setting, learned, 0, shown, rate, None, NO_SLOPES)
    late = max(sensor.late, 0)
    recorded = np.append(np.full(late, rail[0]), -shown[1:])[: recording.samples] + sensor.offset
    columns = {
        "time_s": recording.time,
        "injection_rate_m3_per_s": rate[1:],
        "recorded_line_pressure_Pa": _in_pascal(recorded, c),
    }
    taken = {
        "time_s": recording.time,
        "rail_pressure_Pa": recording.rail_pressure,
        "needle_lift_m": recording.needle_lift,
    }
    return ReferenceRun(taken, columns)


def _in_pascal(normalised: Signal, c: Coefficients) -> Signal:
    return normalised * c.pressure_scale + c.chamber_pressure
