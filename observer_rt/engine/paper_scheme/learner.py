"""`training = "paper"`: the paper's training after every event, its network carried by x^, our adoption test."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.laws import root
from observer_rt.core.paper.scheme import FreePhi as CarriedFreePhi
from observer_rt.core.paper.scheme import fault_of
from observer_rt.core.stream.stepper import CarriedPhi
from observer_rt.engine.estimation.gain import GainSchedule, gain_schedule
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.engine.paper_scheme.network import FreeNetwork
from observer_rt.engine.paper_scheme.systems import PaperSetting
from observer_rt.engine.paper_scheme.training import (
    first_weights,
    network_of,
    output_error,
    paper_setting,
    train,
)
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.model.effective import Coefficients


class FreePhi(NamedTuple):
    """The arrays of a `FreeNetwork`; unit (1,) [1/s]."""

    hidden: NDArray[np.float64]
    output: NDArray[np.float64]
    bias: NDArray[np.float64]
    unit: NDArray[np.float64]

    def nozzle_wear(self, x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients) -> float:
        """v_H of (27) from phi_1 at state x (3,) and inputs u (2,)."""
        network = FreeNetwork(self.hidden, self.output, self.bias, float(self.unit[0]))
        phi_1, _, _ = fault_of(x, u, network)
        flow = c.line.a2_nozzle * root(float(x[2]), c.nozzle.transition)
        return -phi_1 / flow if flow > 0.0 else 0.0

    def carried(self, posted: "FreePhi") -> CarriedPhi:
        """See `Phi.carried`."""
        return CarriedFreePhi(self, posted)


def free_phi(network: FreeNetwork) -> FreePhi:
    """Copies what an observer carries of a network into arrays of its own."""
    return FreePhi(
        network.hidden.copy(), network.output.copy(), network.bias.copy(), np.array([network.unit])
    )


class PaperLearner:
    """Trains the free three-row phi event after event; x~ runs without phi, as in (5).

    The scheme cannot tell how good its result is, so nothing it publishes counts as valid.
    """

    def __init__(self, constants: Constants, knowledge: Knowledge, gain: float) -> None:
        """gain: identification gain l [1/s]."""
        self._constants = constants
        self._knowledge = knowledge
        self._gain = gain
        self._setting = self._setting_of(constants)
        self._weights = first_weights()
        self._previous: Window | None = None

    def _setting_of(self, constants: Constants) -> PaperSetting:
        return paper_setting(constants.coefficients, constants.interval, constants.substeps, self._gain)

    @property
    def schedule(self) -> GainSchedule:
        """Gains of the live x~, which x^ follows while the needle is shut."""
        sensor = self._constants.sensor
        return gain_schedule(
            self._constants.coefficients,
            self._knowledge.state.noise,
            1.0 / self._constants.interval,
            sensor.lag,
            sensor.fraction,
            self._constants.rail_every,
        )

    @property
    def network(self) -> FreeNetwork:
        """The network in force."""
        return network_of(self._weights.in_force, self._setting)

    @property
    def phi(self) -> FreePhi:
        """Correction that x^ carries of it."""
        return free_phi(self.network)

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Train on one event; adopt what lowers the re-simulated output error over this and the previous event.

        in_force (PARAMETERS,) stays 0: the weights of the free rows are kept here. constants: during the event;
        None: as they were.
        """
        if constants is not None:
            self._constants = constants
            self._setting = self._setting_of(constants)
        state = self._knowledge.state
        state = replace(state, noise=standstill.noise or state.noise, events=state.events + 1)
        self._knowledge = replace(self._knowledge, state=state)
        window = window._replace(output=window.output - self._constants.sensor.offset)
        training = train(window, self._setting, self._weights)
        windows = [window] if self._previous is None else [self._previous, window]
        errors = [
            sum(output_error(w, self._setting, weights) for w in windows)
            for weights in (training.weights, self._weights.in_force)
        ]
        adopted = errors[0] < errors[1]
        self._weights = replace(self._weights, trained=training.weights)
        if adopted:
            self._weights = replace(self._weights, in_force=training.weights)
        self._previous = window
        return Outcome(
            adoption=Adoption.ADOPTED if adopted else Adoption.REJECTED,
            knowledge=self._knowledge,
            schedule=self.schedule,
            objections=(Objection(Reason.UNTESTED),),
            estimate=in_force,
            covariance=None,
            phi=self.phi,
        )
