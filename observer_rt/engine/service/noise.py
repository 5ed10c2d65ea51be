"""Noise of an injector's signals: stated, slow at rest, in words. scipy.signal takes long: it is imported late."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.core.stream.stream import OFFSET_FOLLOWS
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.stream.state import Doubt, Observer
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, Floats, Ints, Structs

SIGNALS = {  # short name, unit, its size
    Role.RAIL_PRESSURE: ("rail", "MPa", MEGAPASCAL),
    Role.LINE_PRESSURE: ("line", "MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("lift", "um", MICROMETRE),
}
LEAST_SHARE = 0.08  # of the white variance, below which slow noise is not reported
ONE_TONE = 0.6  # share of the slow noise at one frequency, from which on it is hum
SLOWEST, SLOW = 5.0, 800.0  # Hz, between which a tone is sought over all stretches together
BLOCKS_A_PERIOD = 4  # blocks in a period of the fastest of these tones
MOST_BLOCKS = 8_000  # in which a tone is sought
DECAYING = 2.0  # ratio of the squares early at rest to those late, beyond which they are an echo
FEWEST = 512  # samples, below which nothing is reported


@dataclass(frozen=True)
class SlowNoise:
    """Noise beside white noise: hum, a slow tone, or a colour."""

    frequency: float | None  # of the tone [Hz]; None: a colour
    strength: float  # amplitude of a tone, else standard deviation, in the unit of the signal

    def as_text(self, unit: str, size: float) -> str:
        """Describes the noise in words, its strength in a unit of this size."""
        strength = f"{self.strength / size:.2g} {unit}"
        if self.frequency is None:
            return f"colour {strength}"
        return f"hum {float(f'{self.frequency:.2g}'):.0f} Hz {strength}"


def configured_noise(injector: BenchInjector) -> NoiseLevels:
    """Noise levels of the bench file, SI."""
    noise = injector.config.noise
    return NoiseLevels(
        rail_pressure=noise.rail_pressure_MPa * MEGAPASCAL,
        line_pressure=noise.line_pressure_MPa * MEGAPASCAL,
        needle_lift=noise.needle_lift_um * MICROMETRE,
    )


def slow_noise_of(observer: Observer, rows: Structs, white: NoiseLevels) -> Mapping[Role, SlowNoise]:
    """Slow noise of line pressure [Pa] and needle lift [m] in processed samples `rows` (n,).

    For the line, innovations are used: slow changes of the rail pressure, which the line follows, are no noise.
    """
    c, rate = observer.constants.coefficients, 1.0 / observer.constants.interval
    resting = rows[rows["resting"] & ~rows["interpolated"] & (rows["doubt"] == Doubt.NONE)]
    index = resting["index"].astype(np.int64)
    sigma = float(observer.memory[0]["innovation_noise"]["sigma"]) * c.pressure_scale
    line = slow_noise(resting["innovation"] * c.pressure_scale, index, rate, sigma)
    lift = slow_noise(resting["needle_lift"], index, rate, white.needle_lift)
    levels = {}
    if line is not None:
        passed = 1.0 if line.frequency is None else _passed(observer, line.frequency)
        levels[Role.LINE_PRESSURE] = replace(line, strength=line.strength / passed)
    if lift is not None:
        levels[Role.NEEDLE_LIFT] = lift
    return levels


def _passed(observer: Observer, frequency: float) -> float:
    """Gain from a disturbance of the line sensor to the innovations at a frequency [Hz]: x~ follows the rest."""
    line, _ = observer.constants.coefficients.line.transition(observer.constants.interval)
    gain = observer.gains[-1][[0, 1, *range(3, 1 + len(line))]]
    moved = line * cmath.exp(-2j * math.pi * frequency * observer.constants.interval)
    followed = moved @ np.linalg.solve(np.eye(len(line)) - moved, gain.astype(np.complex128))
    passed = 1.0 / (1.0 + followed[0])
    if observer.memory[0]["judgement"]["offset_moves"]:
        turns = 2j * math.pi * frequency * OFFSET_FOLLOWS
        passed *= turns / (1.0 + turns)
    return float(abs(passed))


def noise_text(white: NoiseLevels, slow: Mapping[Role, SlowNoise]) -> str:
    """Sentence with the noise levels of all signals, and their slow parts."""
    noises = []
    for role, (name, unit, size) in SIGNALS.items():
        text = f"{name} {getattr(white, role.value) / size:.2g} {unit}"
        noises.append(f"{text} and {slow[role].as_text(unit, size)}" if role in slow else text)
    return ", ".join(noises)


def slow_noise(values: Floats, index: Ints, sample_rate: float, white: float) -> SlowNoise | None:
    """Slow noise at rest of samples (n,) with sigma `white` of the rest; None: white, or too few."""
    if values.size < FEWEST:
        return None
    values = values - values.mean()
    beyond = float(np.mean(values**2)) - white**2
    if beyond < LEAST_SHARE * white**2:
        return None
    stretches = np.split(np.arange(values.size), np.flatnonzero(np.diff(index) != 1) + 1)
    if _decays(values, stretches):
        return None
    frequency, power = _slow_tone(values, index, stretches, sample_rate)
    if power > ONE_TONE * beyond:
        return SlowNoise(frequency, math.sqrt(2.0 * power))
    return SlowNoise(None, math.sqrt(beyond))


def _decays(values: Floats, stretches: list[Ints]) -> bool:
    """True if values are smaller in the stretches' second halves: an echo of the motion before."""
    first = sum(float(np.sum(values[s[: s.size // 2]] ** 2)) for s in stretches)
    second = sum(float(np.sum(values[s[-(s.size // 2) :]] ** 2)) for s in stretches if s.size > 1)
    return first > DECAYING * second


def _slow_tone(values: Floats, index: Ints, stretches: list[Ints], sample_rate: float) -> tuple[float, float]:
    """Frequency [Hz] and mean square of the strongest slow tone, over all stretches at once; 0 without a block."""
    from scipy.signal import lombscargle

    length = max(1, round(sample_rate / (BLOCKS_A_PERIOD * SLOW)))
    blocks = [s[: s.size // length * length].reshape(-1, length) for s in stretches if s.size >= length]
    if not blocks:
        return 0.0, 0.0
    joined = np.concatenate(blocks)[-MOST_BLOCKS:]
    means, time = values[joined].mean(axis=1), index[joined].mean(axis=1) / sample_rate
    resolution = 0.25 / max(float(time[-1] - time[0]), 1e-3)
    frequencies = np.arange(SLOWEST, SLOW, max(resolution, (SLOW - SLOWEST) / MOST_BLOCKS))
    power = lombscargle(time, means, 2.0 * math.pi * frequencies)
    best = int(np.argmax(power))
    return float(frequencies[best]), 2.0 * float(power[best]) / means.size
