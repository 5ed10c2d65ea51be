"""The package's model of an injector file, open loop on a recording's inputs."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.learned import nothing_learned
from observer_rt.estimation.predictor import NO_SLOPES, Setting, Window, follow
from observer_rt.evidence.measurement import measurements
from observer_rt.evidence.windows import TrueInputs
from observer_rt.model.effects import effective_model
from observer_rt.model.line.interface import rest_line
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import substeps_needed
from observer_rt.recording.signals.recording import Recording

SUBSTEPS = 10  # at 100 kHz, or what is needed: of the nominal injector a fifth, at the largest orifice


def open_loop(
    injector: InjectorParameters, recording: Recording
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Line pressure as the model's sensor records it [Pa] (n,), and injected mass flow [kg/s] (n,)."""
    model = effective_model(injector)
    c, sensor = model.coefficients, model.sensor
    (measurement,) = measurements([recording])
    inputs = TrueInputs(measurement, model.inputs, c)
    u = np.stack((inputs.rail, inputs.area), axis=1)
    start = np.zeros(c.states + 1)
    start[-1] = inputs.rail[0]
    rest_line(start[:-1], start[-1], c.line)
    window = Window(
        inputs=u,
        output=np.zeros(recording.samples),
        resting=np.zeros(recording.samples, np.bool_),
        start=start,
        opening=recording.samples,
    )
    errors, rate = np.empty((2, recording.samples))
    substeps = max(SUBSTEPS, substeps_needed(model.injector, recording.sample_rate, model.departures))
    setting = Setting(measurement.interval, substeps, c, np.zeros(c.states), lag=sensor.lag)
    follow(window, setting, nothing_learned(c), 0, errors, rate, None, NO_SLOPES)
    indicated = -errors * c.pressure_scale + c.chamber_pressure + sensor.offset
    indicated[0] = indicated[1]
    late = sensor.delay / measurement.interval
    sample = np.arange(recording.samples)
    return np.interp(sample - late, sample, indicated), rate * c.density
