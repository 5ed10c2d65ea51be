"""Recordings of a healthy or worn injector, as sensors and bus show it, with the truth behind them."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from observer_rt.config.effects import effect_named, parameter_named, value_in_bounds
from observer_rt.desk.simulation.plant import Progress, Truth, run_plant
from observer_rt.desk.simulation.schedule import Schedule, strokes
from observer_rt.files.signals.recording import TRUTH_SUFFIX, Recording, shown_slowly
from observer_rt.files.signals.table_writers import TRUTH, CsvWriter
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import replacing
from observer_rt.foundation.units import Floats
from observer_rt.model.effect import EffectParameter, SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.parameters import InjectorParameters

HIGHEST_CODE = 0xFFFD  # above it the bus says "error" and "not available"
MIN_SAMPLE_RATE = 1e3  # Hz, below which an injection falls between two samples
MAX_SAMPLE_RATE = 1e6  # Hz
OPTION = "--effect"
SAMPLE_RATE_OPTION = "--sample-rate"


class Quantisation(NamedTuple):
    """16-bit codes of the bus: value = (code + lowest) * multiple / divisor, exact in SI units."""

    lowest: int
    multiple: float
    divisor: float

    def apply(self, values: Floats) -> Floats:
        """Nearest values the bus can carry, clipped to its range; shape (n,)."""
        steps = np.rint(values * (self.divisor / self.multiple))
        return np.clip(steps, self.lowest, self.lowest + HIGHEST_CODE) * self.multiple / self.divisor


PRESSURE = Quantisation(lowest=-2000, multiple=5000.0, divisor=1.0)
"""0.005 MPa steps from -10 MPa."""
LIFT = Quantisation(lowest=-5000, multiple=1.0, divisor=1e8)
"""0.01 um steps from -50 um."""


@dataclass(frozen=True)
class SimulatedNoise:
    """Standard deviations [SI] of white noise per sample, whatever the sample rate."""

    rail_pressure: float = 0.1e6
    needle_lift: float = 0.4e-6
    line_pressure: float = 0.15e6
    injection_rate: float = 0.5e-6
    injection_rate_gain: float = 0.005
    """Standard deviation of the measured rate's gain, once a recording [-]."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """A recording as sensors and bus would give it, and the noise-free truth at the same times."""

    recording: Recording
    truth: Truth


def simulate(
    parameters: InjectorParameters,
    schedule: Schedule,
    sample_rate: float,
    effects: Sequence[SizedEffect] = (),
    noise: SimulatedNoise | None = None,
    measured_rate: bool = False,
    seed: int = 0,
    progress: Progress | None = None,
    bounce: float = 0.0,
) -> Simulation:
    """Simulate a schedule at `sample_rate` [Hz], with the effects in force in `parameters` and `effects` besides.

    noise None: neither noise nor quantisation; measured_rate: has the rate [m3/s], too; progress: takes the share
    done; bounce: lift [m] after landing. The same arguments give the same bits; every signal has its own random
    stream. Raises `UserError` for a sample rate out of range and strokes that overlap.
    """
    model = effective_model(parameters, effects)
    if not MIN_SAMPLE_RATE <= sample_rate <= MAX_SAMPLE_RATE:
        problem = f"{sample_rate:g} Hz is out of range"
        raise UserError(SAMPLE_RATE_OPTION, problem, f"give {MIN_SAMPLE_RATE:g} to {MAX_SAMPLE_RATE:g} Hz")
    time = np.arange(round(schedule.duration * sample_rate) + 1) / sample_rate
    truth = run_plant(model, strokes(schedule, model.injector), time, schedule.rail_pressure(time), progress, bounce)
    return Simulation(_measure(truth, model, noise, measured_rate, seed), truth)


def truth_path(recording: Path) -> Path:
    """Path of the truth of a recording: `FILE.truth.csv`."""
    return recording.with_name(recording.name + TRUTH_SUFFIX)


def printed_truth(truth: Truth) -> dict[str, Floats]:
    """Columns of the truth by their headings, in the units that these name."""
    return {column.header: getattr(truth, column.channel) / column.factor for column in TRUTH}


def write_truth(path: Path, truth: Truth) -> None:
    """Write the truth as CSV, units in the header. Raises `UserError` or `RunError` for the file."""
    with file_errors(path), replacing(path) as part, CsvWriter(part, TRUTH) as writer:
        writer.write([*printed_truth(truth).values()])


def _measure(
    truth: Truth, model: EffectiveModel, noise: SimulatedNoise | None, measured_rate: bool, seed: int
) -> Recording:
    terms = model.inputs
    shown = np.interp(truth.time - terms.rail_delay, truth.time, truth.rail_pressure)
    rail_pressure = (shown - terms.rail_shift) / terms.rail_factor
    line_pressure = truth.recorded_line_pressure + model.sensor.offset
    open_lift = np.maximum((truth.needle_lift - terms.lift_shift) / terms.lift_factor, 0.0)
    needle_lift = np.where(truth.needle_lift > 0.0, open_lift, 0.0)
    if terms.lift_lag > 0.0:
        needle_lift = shown_slowly(needle_lift, float(truth.time[1] - truth.time[0]), terms.lift_lag)
    injection_rate = truth.injection_rate
    if noise is not None:
        rail, lift, line, rate, gain = (
            np.random.Generator(np.random.PCG64(stream)) for stream in np.random.SeedSequence(seed).spawn(5)
        )
        n = truth.time.size
        injection_rate = injection_rate * (1.0 + gain.normal(0.0, noise.injection_rate_gain))
        injection_rate += rate.normal(0.0, noise.injection_rate, n)
        rail_pressure = PRESSURE.apply(rail_pressure + rail.normal(0.0, noise.rail_pressure, n))
        needle_lift = LIFT.apply(needle_lift + lift.normal(0.0, noise.needle_lift, n))
        line_pressure = PRESSURE.apply(line_pressure + line.normal(0.0, noise.line_pressure, n))
    return Recording(truth.time, rail_pressure, needle_lift, line_pressure, injection_rate if measured_rate else None)


def parse_effects(texts: Sequence[str]) -> tuple[SizedEffect, ...]:
    """Effects from `id[:parameter]=value` in printed units, such as `channel_skew:d=10` or `=10us`; switches are ids.

    An effect with several parameters is given once for each. Raises `UserError` for an unknown id or parameter
    (naming the nearest), another unit, a value out of bounds, and a parameter given twice.
    """
    sizes: dict[str, dict[str, float]] = {}
    for text in texts:
        key, separator, printed = text.partition("=")
        name, colon, parameter_name = (part.strip() for part in key.partition(":"))
        effect = effect_named(OPTION, name)
        if not effect.parameters:
            if colon or separator or name in sizes:
                raise UserError(OPTION, f"'{text}' is a switch", f"write it as {name}, once")
            sizes[name] = {}
            continue
        if not separator:
            raise UserError(OPTION, f"'{text}' has no '=value'", "write it as orifice_area:v_H=0.3")
        parameter = parameter_named(OPTION, effect, parameter_name) if colon else effect.parameters[0]
        values = sizes.setdefault(name, {})
        if parameter.name in values:
            raise UserError(OPTION, f"'{name}:{parameter.name}' is given twice", "give each parameter once")
        values[parameter.name] = value_in_bounds(OPTION, effect, parameter, _number(printed, parameter))
    return tuple(sized(name, **values) for name, values in sizes.items())


def sizes_of(effect: SizedEffect) -> str:
    """An effect with its sizes and their units, such as `channel_skew d = 10 us`."""
    sizes = [
        f"{p.name} = {value / p.si:g}" + ("" if p.unit == "-" else f" {p.unit}")
        for p, value in zip(effect.effect.parameters, effect.values, strict=True)
    ]
    return f"{effect.effect.id} {', '.join(sizes)}".rstrip()


def _number(text: str, parameter: EffectParameter) -> float:
    """A text with or without the unit; nan for no number."""
    number = re.match(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text.strip())
    if number is None:
        return math.nan
    unit = text.strip()[number.end() :].strip()
    if unit not in ("", parameter.unit):
        problem = f"'{text}': the unit of {parameter.name} is not '{unit}'"
        raise UserError(OPTION, problem, f"give the number in {parameter.unit}, or by itself")
    return float(number[0])
