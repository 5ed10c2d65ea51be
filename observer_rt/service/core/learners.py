"""Which training an injector's observer uses, and what that asks of bench and injector."""

from collections.abc import Callable

from observer_rt.config.bench import BenchInjector
from observer_rt.config.injector import Training
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import LineOutflow
from observer_rt.observer.learning.healthy import Healthy, healthy_of
from observer_rt.observer.learning.knowledge import EventLearner, Knowledge
from observer_rt.observer.learning.learner import Learner
from observer_rt.observer.paper_scheme.gain import check_gain
from observer_rt.observer.paper_scheme.learner import PaperLearner
from observer_rt.observer.stream.state import Constants

LearnerFactory = Callable[[BenchInjector, Constants, Knowledge], EventLearner]
"""What `Core` makes its learner by: `make_learner`, or another where learners are compared."""


def make_learner(fitted: BenchInjector, constants: Constants, knowledge: Knowledge) -> EventLearner:
    """The learner of an injector. Raises `UserError` when its training does not fit its sample rate or injector."""
    learning = fitted.config.learning
    if learning.training is Training.PREDICTION_ERROR or learning.identification_gain is None:
        return Learner(constants, knowledge, healthy=healthy_injector(fitted))
    line_outflow = effective_model(fitted.parameters).injector.line_outflow
    if line_outflow is not LineOutflow.NOZZLE:
        raise UserError(
            fitted.place("learning.training"),
            f"'paper' rests on a line drained by the nozzle flow (25), but {fitted.parameters_path} says "
            f"line_outflow = '{line_outflow}'",
            "use training = 'prediction_error'",
        )
    check_gain(
        fitted.place("learning.identification_gain"),
        learning.identification_gain,
        constants.coefficients,
        1.0 / constants.interval,
    )
    return PaperLearner(constants, knowledge, learning.identification_gain)


def healthy_injector(fitted: BenchInjector) -> Healthy:
    """What an injector's model, if fitted, leaves unexplained of the healthy one."""
    config = fitted.config
    return healthy_of(
        fitted.parameters.baseline, config.sampling.rate_hz, config.learning.on_inadequate_model
    )


def refuse_state(fitted: BenchInjector, option: str) -> None:
    """Raise `UserError` naming an option that keeps what was learned where the training keeps nothing."""
    if fitted.config.learning.training is Training.PAPER:
        raise UserError(
            option,
            "training = 'paper' starts anew every time and keeps nothing",
            f"leave {option} out, or use training = 'prediction_error'",
        )
