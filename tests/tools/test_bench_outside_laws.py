"""The product's terms on independent plants: the law a plant follows, in force, closes the model's gap to it."""

import math
from collections.abc import Callable

import pytest

from observer_rt.config.bench import load_injector
from observer_rt.model.effects import effective_model
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.plants.parameters import Injector
from tools.benchmarks.discovery.cases import HiddenCase, Query, outside_benches
from tools.benchmarks.discovery.laws import KINDS, WAVE_OF_SENSOR, WEAK_BELOW
from tools.benchmarks.discovery.rigs import FURTHER
from tools.benchmarks.discovery.scoring import measured, misfit
from tools.benchmarks.discovery.vocabulary import TAP_DAMPING

PART = Injector()
INERTANCE = 1e-12 * PART.density * PART.line_length / PART.line_area  # MPa s per mm3/ms
LOSS = 1e-18 * PART.line_loss * PART.density / (2.0 * PART.line_area**2)  # MPa per (mm3/ms)^2
ABOVE = "(line_pressure - 100)/100"
LIFT = "needle_lift/max_lift"
SINE = f"{2.0 * math.pi * 1.5:.9g}[kHz]"
LEFT, LEFT_MPA, LEFT_MG = 0.15, 0.01, 0.02  # of a gap, and what steps and noise-free codes leave anyway

Law = Callable[..., str | tuple[tuple[str, str], ...]]
LAWS: dict[str, Law] = {
    "laminar_friction": lambda rate: f"{INERTANCE * rate:.9g}*line_flow",
    "friction_by_pressure": lambda share: f"{LOSS * share:.9g}*line_flow*abs(line_flow)*{ABOVE}",
    "slow_friction": lambda rate, memory: (
        f"{INERTANCE * rate:.9g}*(line_flow - lagged(line_flow, {memory * 1e3:.9g}))"
    ),
    "slow_damper": lambda loss, memory: f"{1e-12 * loss:.9g}*lagged(line_flow, {memory * 1e3:.9g})",
    "stiction": lambda loss: f"{loss * 1e-6:.9g}*tanh(line_flow/10)",
    "inertance_by_flow": lambda share: f"{share:.9g}*abs(line_flow)/60",
    "rail_hum": lambda size, hertz: f"{size * 1e-6:.9g}*sin({2.0 * math.pi * hertz:.9g}[Hz]*time)",
    "bent_rail_sensor": lambda bow: f"{-bow / 1.6e9:.9g}*(rail_pressure - 60)*(rail_pressure - 140)",
    "needle_displacement": lambda area: f"{area * 1e6:.9g}*lift_rate",
    "root_leakage": lambda c: f"{c * 1e9:.9g}*sqrt(line_pressure - chamber_pressure)*closed",
    "open_leakage": lambda c: f"{c * 1e12:.9g}*(line_pressure - chamber_pressure)*open",
    "yielding_fuel": lambda c, memory: f"{c * 1e12:.9g}*(line_pressure - lagged(line_pressure, {memory * 1e3:.9g}))",
    "relief_leakage": lambda c: f"{c * 1e12:.9g}*max(line_pressure - 100, 0)",
    "stiffness_bend": lambda share: f"{share:.9g}*({ABOVE})^2",
    "waxing_fuel": lambda share: f"{share:.9g}*tanh((line_pressure - 100)/15)",
    "warming_fuel": lambda softer, wider: (
        ("stiffness", f"{-softer:.9g}*time"), ("seat_flow", f"{wider:.9g}*time"),
    ),
    "seat_by_speed": lambda share: f"{share:.9g}*lift_rate",
    "stop_loss": lambda share: f"{-share / 0.25:.9g}*max({LIFT} - 0.75, 0)",
    "middle_loss": lambda share: f"{-share:.9g}*exp(-((({LIFT} - 0.5)/0.15)^2))",
    "lagged_lift": lambda share, memory: f"{share:.9g}*(needle_lift - lagged(needle_lift, {memory * 1e3:.9g}))",
    "needle_behind": lambda share, memory: f"{-share:.9g}*(needle_lift - lagged(needle_lift, {memory * 1e3:.9g}))",
    "needle_not_shut": lambda least: f"{least * 1e3:.9g}*closed",
    "bent_lift": lambda share: f"{share:.9g}*needle_lift^2/max_lift",
    "coking_nozzle": lambda share: f"{-share:.9g}*(injection_number - 1)",
    "plugged_hole": lambda share: f"{-share:.9g}*(injection_number > 1)",
    "closing_hole": lambda share: f"{-share:.9g}*(time_since_opening > 0.6)",
    "viscous_nozzle": lambda share: f"{-share:.9g}*sqrt(100/(max(sac_pressure - chamber_pressure, 0) + 4))",
    "opening_loss": lambda share, time: f"{-share:.9g}*exp(-time_since_opening/{time * 1e3:.9g})",
    "chamber_by_number": lambda step: f"{step * 1e-6:.9g}*(injection_number - 1)*open",
    "chamber_by_flow": lambda slope: f"{slope * 1e-12:.9g}*nozzle_flow",
    "chamber_ringing": lambda size: f"{size * 1e-6:.9g}*sin({SINE}*time_since_opening)*exp(-time_since_opening/0.6)",
    "bent_line_sensor": lambda bow: f"{bow / 1.6e9:.9g}*(line_pressure - 60)*(line_pressure - 140)",
    "weak_sensor": lambda share: f"{-share:.9g}*max({WEAK_BELOW * 1e-6:.9g} - line_pressure, 0)",
    "wavy_sensor": lambda size: f"{size * 1e-6:.9g}*sin({2.0 * math.pi * 1e6 / WAVE_OF_SENSOR:.9g}*line_pressure)",
    "tap_resonance": lambda hertz: f"ringing(line_pressure, {hertz * 1e-3:.9g}, {TAP_DAMPING:.9g})",
    "drifting_sensor": lambda rate: f"{rate * 1e-6:.9g}*time",
    "creeping_sensor": lambda share: f"{share:.9g}*(line_pressure - lagged(line_pressure, 1))",
}  # fmt: skip
NO_LAW = {"seat_hysteresis"}


def test_every_kind_a_law_can_state_has_one() -> None:
    assert set(LAWS) == set(KINDS) - NO_LAW


@pytest.mark.parametrize("name", LAWS)
def test_the_true_law_closes_the_gap(name: str) -> None:
    kind = KINDS[name]
    values = tuple(p.most_negative or p.highest for p in kind.parameters)
    case = HiddenCase("0", Query.OUTSIDE, ((name, values),), False, None, 5)
    further = measured(outside_benches(case, FURTHER, 0.0)[1::2])
    nominal = amended = effective_model(load_injector())
    stated = LAWS[name](*values)
    for equation, law in ((kind.equation, stated),) if isinstance(stated, str) else stated:
        amended = amended.with_term(Term(TermEquation(equation), parse(law)))
    before, after = misfit(nominal, further), misfit(amended, further)
    assert before.pressure_mpa > 0.05
    assert after.pressure_mpa < LEFT * before.pressure_mpa + LEFT_MPA
    assert after.mass_mg < LEFT * before.mass_mg + LEFT_MG
