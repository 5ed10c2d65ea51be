"""What the peers are given: the nominal model, and a recording with its seat area, rests and events."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.arrays import Array
from tools.benchmarks.peer_equations import Model, Stream
from tools.benchmarks.plant import Measured
from tools.benchmarks.plant_parameters import Injector

PRESSURE_SCALE, FLOW_SCALE, AREA_SCALE = 1e8, 6e-5, 7e-7  # Pa, m3/s, m2
TRANSITION = 0.5e6  # Pa
OPEN_LIFT, LOOK_BACK = 2.5e-6, 3  # m, samples
SETTLED = 3e-3  # s of shut needle after which the sac is at chamber pressure
EVENT_GAP = 10e-3  # s
STEP = 2.0e-6  # s of RK4


@dataclass(frozen=True, eq=False)
class PeerInputs:
    """A recording for the peers; `events` (m, 2): first open sample, and first sample 10 ms after the last."""

    model: Model
    stream: Stream
    events: NDArray[np.int64]
    open: NDArray[np.bool_]


def lump_model(part: Injector, sac_follows: bool = False) -> Model:
    """Coefficients of an injector with a lumped line; its sac may follow without delay."""
    jet = math.sqrt(2.0 * PRESSURE_SCALE / part.density)
    line = part.bulk_modulus_line / part.line_volume
    sac = part.bulk_modulus_sac / part.sac_volume
    nozzle = part.nozzle_area * jet
    return Model(
        a1=line * FLOW_SCALE / PRESSURE_SCALE,
        a2=line * nozzle / PRESSURE_SCALE,
        a3=part.line_area * PRESSURE_SCALE / (part.density * part.line_length * FLOW_SCALE),
        a4=part.line_loss * FLOW_SCALE / (2.0 * part.line_area * part.line_length),
        a5=sac * part.seat_coefficient * AREA_SCALE * jet / PRESSURE_SCALE,
        a6=sac * nozzle / PRESSURE_SCALE,
        leak=line,
        transition=TRANSITION / PRESSURE_SCALE,
        nozzle_flow=nozzle,
        sac_follows=sac_follows,
    )


def peer_inputs(measured: Measured, model: Model | None = None) -> PeerInputs:
    """The recording as every peer takes it; the model is the nominal injector's unless another is given."""
    part = Injector()
    interval = float(measured.time[1] - measured.time[0])
    opened = _open(measured.needle_lift)
    lift = np.where(opened, np.maximum(measured.needle_lift, 0.0), 0.0)
    sine, taper = math.sin(part.seat_half_angle), math.sin(2.0 * part.seat_half_angle)
    area = math.pi * lift * sine * (part.seat_diameter - 0.5 * lift * taper)
    sample = np.arange(opened.size)
    last_open = np.maximum.accumulate(np.where(opened, sample, -opened.size))
    shut_for = sample - last_open
    stream = Stream(
        np.stack(
            ((measured.rail_pressure - part.chamber_pressure) / PRESSURE_SCALE, area / AREA_SCALE), axis=1
        ),
        (measured.line_pressure - part.chamber_pressure) / PRESSURE_SCALE,
        shut_for > SETTLED / interval,
        interval,
        max(5, math.ceil(interval / STEP)),
    )
    return PeerInputs(model or lump_model(part), stream, _events(opened, round(EVENT_GAP / interval)), opened)


def _open(lift: Array) -> NDArray[np.bool_]:
    """Dead band: open where two samples in a row are above it, and a few positive samples round that."""
    above = lift > OPEN_LIFT
    pair = above[1:] & above[:-1]
    core = np.concatenate((pair, [False])) | np.concatenate(([False], pair))
    opened = core.copy()
    for shift in range(1, LOOK_BACK + 1):
        opened[:-shift] |= core[shift:] & (lift[:-shift] > 0.0)
        opened[shift:] |= core[:-shift] & (lift[shift:] > 0.0)
    return opened


def _events(opened: NDArray[np.bool_], gap: int) -> NDArray[np.int64]:
    samples = np.flatnonzero(opened)
    starts = samples[np.concatenate(([True], np.diff(samples) > gap))]
    ends = samples[np.concatenate((np.diff(samples) > gap, [True]))]
    return np.stack((starts, np.minimum(ends + gap, opened.size - 1)), axis=1)
