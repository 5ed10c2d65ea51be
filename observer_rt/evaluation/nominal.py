"""The model as it is given, with nothing learned, beside the observer."""

import numpy as np

from observer_rt.config.bench import BenchInjector
from observer_rt.evaluation.compiled import FOLLOWED, nominal_rates
from observer_rt.evaluation.trace import Signal
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.observer import make_observer, with_constants
from observer_rt.observer.stream.state import Observer
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.learners import make_learner


class NominalModel:
    """Follows an observer's samples: open loop from the state in which that found the line before an injection."""

    def __init__(self, fitted: BenchInjector) -> None:
        constants = bench_constants(fitted)
        start = no_knowledge(configured_noise(fitted), constants.coefficients.pressure_scale)
        self._nominal = make_observer(constants, start, make_learner(fitted, constants, start))
        self._state = np.zeros(1, FOLLOWED)
        self._x = np.full(constants.coefficients.states, np.nan)

    def rates(self, observer: Observer, first: int, end: int) -> Signal:
        """Rates [m3/s] at positions [first, end), processed and remembered; nan where the observer has none.

        Call it without gaps.
        """
        rates = np.empty(end - first)
        if self._nominal.constants is not observer.constants:  # of fuel as warm as it is
            self._nominal = with_constants(self._nominal, observer.constants)
        nominal_rates(observer, self._nominal.stepper, self._state, self._x, first, rates)
        return rates
