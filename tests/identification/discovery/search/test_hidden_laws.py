"""Laws hidden in plants that share no code with the model, searched without the vocabulary."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from observer_rt.desk.evaluation.healthy_events import learn_laws
from observer_rt.engine.estimation.parameters import NOZZLE, SEAT
from observer_rt.engine.reports.learned_laws import LearnedLaw, furthest
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MILLISECOND, Floats
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.discovery.search.search import Search, representatives
from observer_rt.identification.discovery.search.verdict import healthy_baseline, name_effects
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import effective_model
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.hidden import NOMINAL, recordings
from tests.observed_plants import recording_of
from tests.plants.laws import COKING_TIME, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import LINE, Bench, Event, Needle, Shot, Surroundings, record, seen_as

pytestmark = pytest.mark.slow
Change = Callable[[Bench], Bench]
POINTS = tuple(product((60e6, 100e6, 140e6), (0.6e-3, 1.9e-3)))  # Pa, s
INJECTIONS = 2
NUMBER = r"\d+\.?\d*"


def recorded(change: Change, injections: int = INJECTIONS) -> list[Recording]:
    made = []
    for number, (pressure, duration) in enumerate(POINTS):
        shots = np.random.default_rng(number).uniform(0.0, 1e-5, injections)  # s, anywhere between samples
        events = tuple(Event(pressure, (Shot(shot, duration),), Faults()) for shot in shots)
        bench = Bench(Injector(), Needle(), events, seed=number)
        made.append(recording_of(record(change(bench))))
    return made


def found_in(change: Change, injections: int = INJECTIONS) -> tuple[Term, ...]:
    nominal = effective_model(NOMINAL)
    fits = Fitter(joint_likelihood(measurements(recorded(change, injections)), nominal), nominal, workers=2)
    outcome = Search(fits, ()).run()
    return (outcome.left or outcome.nearest)[0].terms


def plugged(bench: Bench) -> Bench:
    """Half of the nozzle is gone from the middle on, and the sensors are ten times better than usual."""
    half = Faults(orifice_area=-0.5)
    events = (*bench.events[:2], *(replace(event, faults=half) for event in bench.events[2:]))
    return replace(bench, events=events, noise=0.1)


def test_a_law_is_found_that_is_large_against_the_noise() -> None:
    (term,) = found_in(plugged, 4)
    assert term.equation is TermEquation.NOZZLE_FLOW
    assert str(term.law) == "c * (injection_number > 2)"
    assert term.coefficient == pytest.approx(-0.5, abs=0.01)


def with_sensor(change: Callable[[Floats], Floats]) -> Change:
    step = seen_as(LINE, lambda _, pressure: change(pressure))
    return lambda bench: replace(bench, around=Surroundings(before_noise=(step,)))


def with_laws(**laws: float) -> Change:
    return lambda bench: replace(bench, laws=Laws(**laws))


def with_faults(**faults: float) -> Change:
    worn = Faults(**faults)
    return lambda bench: replace(bench, events=tuple(replace(event, faults=worn) for event in bench.events))


@pytest.mark.parametrize(
    ("change", "equations", "law", "coefficient"),
    [
        (
            with_sensor(lambda p: p + 0.07 * np.maximum(90e6 - p, 0.0)),
            {TermEquation.LINE_PRESSURE_SENSOR},
            "c * max(1.8 - line_pressure / 50, 0)",
            3.5,
        ),
        (
            with_laws(damper=4e10, flow_memory=0.6e-3),
            {TermEquation.LINE_FLOW, TermEquation.RAIL_PRESSURE},
            "c * lagged(line_flow / 60, 0.6)",
            2.4,
        ),
        (
            with_laws(yielding=1e-13, pressure_memory=0.4e-3),
            {TermEquation.LINE_PRESSURE},
            "c * ((line_pressure - 100) / 50 - lagged((line_pressure - 100) / 50, 0.4))",
            5.0,
        ),
        (  # of a needle that is open for longer than is seen: the other sign does nothing while it is shut
            with_laws(lift_behind=0.14, lift_memory=0.2e-3),
            {TermEquation.NEEDLE_LIFT},
            "c * (needle_lift / max_lift - lagged(needle_lift / max_lift, 0.2))",
            0.044,
        ),
    ],
)
def test_a_law_is_found_with_its_numbers(
    change: Change, equations: set[TermEquation], law: str, coefficient: float
) -> None:
    (term,) = found_in(change)
    assert term.equation in equations
    shape, numbers = spelled(str(term.law))
    true_shape, true_numbers = spelled(law)
    assert shape == true_shape
    assert numbers == pytest.approx(true_numbers, rel=0.15)
    assert abs(term.coefficient) == pytest.approx(abs(coefficient), rel=0.1)


def spelled(law: str) -> tuple[str, list[float]]:
    return re.sub(NUMBER, "_", law), [float(one) for one in re.findall(NUMBER, law)]


@pytest.mark.parametrize(("rows", "shares"), [((0, 1), {"nozzle_product": 0.1}), ((0, 2), {"seat_product": 0.15})])
def test_a_law_of_two_variables_is_a_product(rows: tuple[int, int], shares: dict[str, float]) -> None:
    """Of tanh, both; at the rail pressures that were recorded the nozzle's is within a hundredth of the truth."""
    first, second = rows
    (term,) = found_in(with_laws(**shares, first_factor=float(first), second_factor=float(second)))
    expected = TermEquation.NOZZLE_FLOW if "nozzle_product" in shares else TermEquation.SEAT_FLOW
    assert term.equation is expected
    words = ("rail_pressure", "time_since_opening", "needle_lift", "sac_pressure")
    assert all(words[row] in str(term.law) for row in rows)
    if expected is TermEquation.NOZZLE_FLOW:
        rail, since = (values.ravel() for values in np.meshgrid((60.0, 100.0, 140.0), np.linspace(0.1, 1.8, 18)))
        true = 0.1 * np.tanh((rail - 100.0) / 30.0) * np.tanh((since - 0.8) / 0.4)
        seen = term.law.at({"rail_pressure": rail, "time_since_opening": since}, term.coefficient)
        assert np.abs(seen - true).max() < 0.01


def test_what_no_form_explains_is_one_table() -> None:
    (term,) = found_in(with_sensor(lambda p: p + 0.8e6 * np.sin(2.0 * np.pi * p / 60e6)))
    assert term.equation is TermEquation.LINE_PRESSURE_SENSOR
    at = np.linspace(65.0, 145.0, 17)
    result = term.law.at({"line_pressure": at}, term.coefficient)
    off = result - 0.8 * np.sin(2.0 * np.pi * at / 60.0)
    assert np.std(off) < 0.15


def test_several_names_do_not_stand_for_one_law() -> None:
    """A seat that lets more through while the needle closes: a lagged sensor and a seat by its lift come near."""
    made = measurements(recorded(with_laws(seat_hysteresis=0.47), 4))
    discovery = name_effects(effective_model(NOMINAL), made)
    assert discovery.named.ids == ()
    assert {term.equation for term in discovery.ranking[0].terms} == {TermEquation.SEAT_FLOW}


def test_a_name_does_not_stand_for_a_step_beside_a_fitted_model() -> None:
    """Fuel that stiffens at 100 MPa is nearly one whose stiffness rises with its pressure."""
    nominal = effective_model(NOMINAL)
    baseline, _ = healthy_baseline(nominal, measurements(recorded(with_laws())))
    assert baseline.appears  # so that something may be the model's own error
    discovery = name_effects(nominal, measurements(recorded(with_laws(wax=0.034))), baseline=baseline)
    assert discovery.verdict is Verdict.UNKNOWN
    (term,) = discovery.ranking[0].terms
    assert term.equation is TermEquation.STIFFNESS
    assert term.coefficient == pytest.approx(0.034, rel=0.05)


def test_what_laws_explain_better_is_not_named_though_they_are_too_small() -> None:
    """A leak that the vocabulary lacks is nearly friction of the line, and moves no mass by .01 mg."""
    nominal = effective_model(NOMINAL)
    leaking = measurements(recorded(with_faults(guide_leakage=7.5e-15), 4))
    fitter = Fitter(joint_likelihood(leaking, nominal), nominal)
    names = [one for one in representatives(has_lift=True) if one.id != "guide_leakage"]
    fitter.measure(names)
    outcome = Search(fitter, names).run()
    assert outcome.adequate
    assert outcome.winner.ids == ()
    assert outcome.probability(outcome.winner) > 0.9


def test_a_third_effect_is_sought_beside_the_nearest_two() -> None:
    hidden = {"orifice_area": 0.25, "seat_area": -0.25, "line_friction": 2.5}
    discovery = name_effects(effective_model(NOMINAL), measurements(recorded(with_faults(**hidden))))
    left = [set(ids) for ids in (discovery.named.ids, *discovery.rivals)]
    assert set(hidden) in left
    assert all(ids <= set(hidden) | {"lift_gain"} for ids in left)  # which is hard to tell from the seat's area
    right = next(one for one in discovery.ranking if set(one.ids) == set(hidden))
    for effect, size in zip(right.ids, right.sizes, strict=True):
        assert size == pytest.approx(hidden[effect], rel=0.03)
    assert all(effect.gain > discovery.detection.threshold for effect in discovery.effects)


def test_the_law_that_the_network_learned_is_near_the_truth_and_tried_first() -> None:
    made, tried = recorded(with_laws(coking=0.3)), list[Candidate]()
    guess = furthest(learn_laws(NOMINAL, made))
    assert guess is not None
    assert (guess.flow, *guess.variables) == (NOZZLE, "time_since_opening_ms")
    true = 0.3 * np.expm1(-guess.inputs[0] * MILLISECOND / COKING_TIME)
    assert np.abs(guess.change - true).max() < 0.1 * np.ptp(true)

    def stop_at(candidate: Candidate) -> None:
        tried.append(candidate)
        raise InterruptedError

    nominal = effective_model(NOMINAL)
    fits = Fitter(joint_likelihood(measurements(made[::2]), nominal), nominal, on_fit=stop_at)
    with pytest.raises(InterruptedError):
        Search(fits, (), guess=guess).run()
    (term,) = tried[0].terms
    assert term.equation is TermEquation.NOZZLE_FLOW
    assert "time_since_opening" in str(term.law)


def test_a_curve_that_may_be_level_is_no_guess() -> None:
    inputs, half = np.linspace(10.0, 100.0, 5), np.full(5, 0.01)
    level, slight, rising = (
        LearnedLaw(SEAT, ("seat_area_mm2",), (inputs,), np.linspace(-rise, rise, 5), half, half > 0.0, 0.9)
        for rise in (0.0, 0.009, 0.03)
    )
    assert furthest((level, slight)) is None
    assert furthest((level, rising)) is rising


def test_what_the_observer_refuses_teaches_nothing() -> None:
    (usual,) = recordings(points=((60e6, 1.9e-3),))
    rail, lift, line = (values[::20] for values in usual.signals.values())
    slow = Recording(usual.time[::20], rail, lift, line)
    assert learn_laws(NOMINAL, [slow]) == ()
