"""Terms in force: what the plant has and the predictor is given explains a recording, on every line."""

from dataclasses import dataclass

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.config.effects import term_domain
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.identification.likelihood.likelihood import JointLikelihood, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY, effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.terms.in_force import TermInForce
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.hidden import effect_of
from tests.model.conftest import with_line

FLOW = 60.0  # mm3/ms
TERMS = (
    ("line_flow", "4*line_flow/60"),
    ("line_pressure", "3*sqrt((line_pressure - chamber_pressure)/100)*needle_lift/max_lift"),
    ("nozzle_flow", "-0.1*(injection_number - 1)"),
    ("nozzle_flow", "-0.15*time_since_opening/1"),
    ("stiffness", "0.1*(line_pressure - 100)/100"),
    ("inertance", "0.1"),
    ("line_pressure_sensor", "2*((line_pressure - 100)/100)^2"),
    ("line_pressure_sensor", "ringing(line_pressure, 7.5, 0.2)"),
    ("chamber_pressure", "10*needle_lift/max_lift"),
    ("rail_pressure", "open"),
    ("rail_pressure", "2*nozzle_flow/60"),
    ("needle_lift", "-0.05*(needle_lift/max_lift)^2"),
    ("needle_lift", "0.001*closed"),
    ("needle_lift", "-0.06*(needle_lift/max_lift - lagged(needle_lift/max_lift, 0.1))"),
    ("seat_flow", "0.6*(needle_lift/max_lift - lagged(needle_lift/max_lift, 0.1))"),
)


@dataclass(frozen=True)
class Line:
    """An injector on a line, and what its model leaves of a recording that needs no term."""

    injector: InjectorParameters
    healthy: float


@pytest.fixture(scope="module")
def line(request: pytest.FixtureRequest) -> Line:
    injector = with_line(load_injector(), model=request.param)
    return Line(injector, _squares(_likelihood(injector), effective_model(injector)))


@pytest.mark.parametrize(
    ("line", "equation", "law"),
    [
        (model, *term)
        for model in ("lump", "wave")
        for term in TERMS
        if model == "lump" or "ringing" not in term[1]  # on cells it is refused: the observer would feed it
    ],
    indirect=["line"],
)
def test_a_term_of_the_plant_explains_its_recording(line: Line, equation: str, law: str) -> None:
    term = Term(TermEquation(equation), parse(law))
    likelihood = _likelihood(line.injector, SizedEffect(effect_of(term), ()))
    nominal = effective_model(line.injector)
    without, within = (_squares(likelihood, model) - line.healthy for model in (nominal, nominal.with_term(term)))
    assert without > 0.005
    assert abs(within) < 0.02 * without + 0.005


def test_masses_are_right_with_a_law_of_the_flow_that_bends() -> None:
    """A law that were half a sample late would be learned as a smaller friction, and masses be .4 % off."""
    law = TermInForce(equation=TermEquation.LINE_FLOW, law="0.09*max(line_flow - 28, 0)")
    injector = load_injector().model_copy(update={"terms": (law,)})
    schedule = make_schedule((60e6, 100e6, 140e6), 18, 0.05, (0.9e-3, 1.9e-3))
    made = simulate(injector, schedule, 100e3, (), SimulatedNoise(), seed=5)
    history = evaluate(load_bench().exact.with_parameters(injector), [made.recording])
    density = effective_model(injector).coefficients.density
    errors = []
    for report in history.evaluations[0].reports[-12:]:
        assert report.valid
        rate = made.truth.injection_rate[report.start_position : report.end_position + 1]
        errors.append(report.mass / (np.trapezoid(rate) * 1e-5 * density) - 1.0)
    assert abs(np.mean(errors)) < 0.0015


@pytest.mark.parametrize("line", ["lump", "wave"], indirect=True)
def test_a_law_of_the_flow_is_friction_along_the_whole_line(line: Line) -> None:
    own = term_domain(line.injector).friction * FLOW**2
    law = Term(TermEquation.LINE_FLOW, parse(f"{own:.6g}*line_flow/60*abs(line_flow/60)"))
    likelihood = _likelihood(line.injector, SizedEffect(VOCABULARY["line_friction"], (2.0,)))
    nominal = effective_model(line.injector)
    without, within = (_squares(likelihood, model) - line.healthy for model in (nominal, nominal.with_term(law)))
    assert within < 0.03 * without  # a pressure lost evenly is, on cells, nearly that


def _likelihood(injector: InjectorParameters, *effects: SizedEffect) -> JointLikelihood:
    made = simulate(injector, make_schedule((140e6,), 2, 60e-3, (1.2e-3,)), 100e3, effects, SimulatedNoise(), True, 1)
    return joint_likelihood(measurements([made.recording]), effective_model(injector))


def _squares(likelihood: JointLikelihood, model: EffectiveModel) -> float:
    residuals = likelihood.residuals(model)
    assert residuals is not None
    return float(np.mean(residuals.z**2))
