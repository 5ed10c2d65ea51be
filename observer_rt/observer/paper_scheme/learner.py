"""`training = "paper"`: the paper's training after every event, behind our adoption test."""

from dataclasses import replace

from observer_rt.estimation.gain import GainSchedule, gain_schedule
from observer_rt.estimation.predictor import Window
from observer_rt.estimation.scalars import Theta
from observer_rt.observer.learning.doubts.adequacy import Objection
from observer_rt.observer.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.observer.paper_scheme.network import FreeNetwork
from observer_rt.observer.paper_scheme.phi import FreePhi, free_phi
from observer_rt.observer.paper_scheme.systems import PaperSetting
from observer_rt.observer.paper_scheme.training import (
    first_weights,
    network_of,
    output_error,
    paper_setting,
    train,
)
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants, Reason


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
            self._knowledge.noise,
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
        """What x^ carries of it."""
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
        noise = standstill.noise or self._knowledge.noise
        self._knowledge = replace(self._knowledge, noise=noise, events=self._knowledge.events + 1)
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
