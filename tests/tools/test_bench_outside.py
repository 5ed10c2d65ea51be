"""What the benchmark outside the vocabulary makes of answers: its definitions by hand-made cases, and a run."""

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.phases import Phase
from observer_rt.files.formats import read_recording
from observer_rt.identification.discovery.search.results import Proposal
from observer_rt.identification.discovery.search.search import representatives
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from tests.tools.discovery_stub import printed
from tools.benchmarks.discovery.asking import Asking
from tools.benchmarks.discovery.cases import write_all
from tools.benchmarks.discovery.outside.answers import (
    Misfit,
    OutsideAnswer,
    Proposed,
    ProposedTerm,
    misfit,
    taken,
    vocabulary_without,
)
from tools.benchmarks.discovery.outside.cases import Asked, OutsideCase, OutsidePlan, further_benches
from tools.benchmarks.discovery.outside.result import OutsideResult, figures
from tools.benchmarks.discovery.outside.run import run_outside, shown
from tools.benchmarks.discovery.outside.tables import case_lines, json_document
from tools.benchmarks.report import finite

LEAK = ProposedTerm("line_pressure", "sqrt(line_pressure - chamber_pressure)*closed", 2.0)
GOOD = Proposed((LEAK,), (), True, Misfit(0.1, 0.2), "after")
CASE = OutsideCase("0", Asked.OUTSIDE, "root_leakage", (2e-10,), True, None, 1)
ANSWER = OutsideAnswer(
    "0",
    "unknown",
    0.98,
    (),
    (),
    "line_pressure",
    (GOOD,),
    Misfit(1.0, 2.0),
    Misfit(0.0, 0.0),
    Misfit(1.0, 2.0),
    9.0,
    7.0,
    1.8,
)
RIGHT = OutsideResult(CASE, ANSWER)


def proposing(result: OutsideResult, *proposals: Proposed) -> OutsideResult:
    return replace(result, answer=replace(result.answer, proposals=proposals))


def asked(
    which: Asked, name: str, *proposals: Proposed, verdict: str, claims: tuple[str, ...]
) -> OutsideResult:
    return OutsideResult(
        replace(CASE, asked=which, name=name),
        replace(
            ANSWER,
            verdict=verdict,
            claims=claims,
            by_vocabulary=claims,
            proposals=proposals,
            named=Misfit(0.1, 0.1),
        ),
    )


SEAT = replace(GOOD, terms=(replace(LEAK, equation="needle_lift"),))
NAMED = asked(Asked.NAMED, "seat_area", verdict="named", claims=("seat_area",))
LEFT_OUT = asked(Asked.LEFT_OUT, "seat_area", SEAT, verdict="unknown", claims=())
HEALTHY = asked(Asked.HEALTHY, "healthy", verdict="none", claims=())


def test_a_phase_is_right_where_the_law_acts() -> None:
    elsewhere = proposing(RIGHT, replace(GOOD, phase="open"))
    everywhere = replace(RIGHT, case=replace(CASE, name="laminar_friction"))
    assert [one.right_phase for one in (RIGHT, elsewhere, everywhere, proposing(RIGHT))] == [
        True,
        False,
        None,
        None,
    ]


def test_a_proposal_is_right_where_the_true_law_is_or_cannot_be_told_from_it() -> None:
    assert RIGHT.right_equation
    assert RIGHT.exact_equation
    shut = proposing(RIGHT, SEAT)
    assert not shut.right_equation  # a measured rate tells a leak from a needle that is not shut
    assert replace(shut, case=replace(CASE, with_rate=False)).right_equation
    assert not shut.exact_equation
    both = proposing(RIGHT, replace(GOOD, terms=(LEAK, *SEAT.terms)))
    assert (both.right_equation, both.exact_equation) == (False, True)
    assert not proposing(RIGHT).right_equation
    assert proposing(RIGHT, GOOD, SEAT).right_equation  # the first leads
    beside = proposing(RIGHT, replace(GOOD, effects=("guide_leakage",)))
    assert beside.right_equation
    assert not proposing(RIGHT, replace(GOOD, effects=("seat_area",))).right_equation


def test_gaps_are_halved_or_not_and_only_where_they_matter() -> None:
    def with_gap(before: Misfit, after: Misfit) -> OutsideResult:
        answer = replace(ANSWER, before=before, proposals=(replace(GOOD, misfit=after),))
        return OutsideResult(CASE, answer)

    assert (RIGHT.pressure_halved, RIGHT.mass_halved, RIGHT.accepted_worse) == (True, True, False)
    assert with_gap(Misfit(1.0, 0.3), Misfit(0.51, 9.0)).mass_halved is None
    assert not with_gap(Misfit(1.0, 0.3), Misfit(0.51, 9.0)).pressure_halved
    assert with_gap(Misfit(1.0, 0.4), Misfit(0.5, 0.21)).mass_halved is False
    fitted = with_gap(Misfit(1.0, 1.4), Misfit(0.5, 1.19))  # to a line that is 1 mg off by itself
    assert fitted.mass_halved is False
    assert replace(fitted, answer=replace(fitted.answer, own=Misfit(0.2, 1.0))).mass_halved
    assert not with_gap(Misfit(1.0, 0.3), Misfit(0.5, 0.39)).accepted_worse
    assert not with_gap(Misfit(1.0, 1.0), Misfit(0.5, 1.15)).accepted_worse
    worse = with_gap(Misfit(1.0, 1.0), Misfit(0.5, 1.21))
    assert worse.accepted_worse
    refused = replace(worse.answer.proposals[0], may_enter=False)
    assert not proposing(worse, refused).accepted_worse
    assert with_gap(Misfit(1.0, 1.0), Misfit(math.inf, math.inf)).accepted_worse
    by_name = asked(Asked.OUTSIDE, "root_leakage", verdict="named", claims=("guide_leakage",))
    assert by_name.pressure_halved  # what is named is believed


def test_names_are_wrong_when_sure_of_what_is_not_there() -> None:
    assert not NAMED.wrong_and_sure
    assert NAMED.rightly_named
    assert not asked(Asked.NAMED, "seat_area", verdict="named", claims=("line_friction",)).rightly_named
    assert replace(NAMED, answer=replace(NAMED.answer, verdict="unknown", claims=())).rightly_named
    wrong = asked(Asked.OUTSIDE, "root_leakage", verdict="named", claims=("guide_leakage",))
    assert wrong.wrong_and_sure
    assert not replace(wrong, answer=replace(wrong.answer, confidence=0.89)).wrong_and_sure
    assert not asked(Asked.NAMED, "seat_area", verdict="named", claims=("lift_gain",)).wrong_and_sure
    assert asked(Asked.HEALTHY, "healthy", verdict="named", claims=("seat_area",)).wrong_and_sure
    assert not asked(Asked.NAMED, "seat_area", verdict="ambiguous", claims=("line_friction",)).wrong_and_sure


def test_what_has_lost_its_name_is_found_by_a_term_or_a_near_tie() -> None:
    assert LEFT_OUT.as_good
    assert not proposing(LEFT_OUT, GOOD).as_good
    assert not proposing(LEFT_OUT, replace(SEAT, misfit=Misfit(0.6, 0.1))).as_good
    assert asked(Asked.LEFT_OUT, "seat_area", verdict="named", claims=("lift_gain",)).as_good
    assert not asked(Asked.LEFT_OUT, "seat_area", verdict="named", claims=("guide_leakage",)).as_good
    assert not asked(Asked.LEFT_OUT, "seat_area", verdict="unknown", claims=()).as_good


def test_every_figure_has_a_bar_that_can_be_missed() -> None:
    outside_library = replace(RIGHT, case=replace(CASE, name="relief_leakage"))
    good = [RIGHT, outside_library, NAMED, LEFT_OUT, HEALTHY]
    assert all(figure.is_met for figure in figures(good, "A"))
    wrong = proposing(
        RIGHT, replace(GOOD, terms=(ProposedTerm("stiffness", "1", 1.0),), misfit=Misfit(2.0, 3.0))
    )
    bad = [
        wrong,
        replace(wrong, case=outside_library.case),
        proposing(NAMED, GOOD),
        proposing(HEALTHY, GOOD),
        proposing(LEFT_OUT),
        asked(Asked.OUTSIDE, "root_leakage", verdict="named", claims=("guide_leakage",)),
        replace(RIGHT, answer=replace(ANSWER, added_core_seconds=17.1)),
    ]
    found = figures([*good, *bad], "A")
    assert not any(figure.is_met for figure in found)
    assert figures([*good, *bad], "B")[-1].is_met
    assert found[0].value == pytest.approx(2 / 4)
    lines = case_lines([*good, *bad])
    assert len(lines) == len(bad) - 1
    assert lines[0].startswith(
        "0 with rate outside: root_leakage 2e-10: unknown (line_pressure) (0.98), proposed stiffness: 1 1; "
        "p_L 1.00 to 2.00 MPa, mass 2.00 to 3.00 mg; MASS WORSE"
    )


def test_json_has_every_figure_and_no_number_that_json_does_not_know() -> None:
    lost = proposing(RIGHT, replace(GOOD, misfit=Misfit(math.inf, math.inf)))
    document = json_document([RIGHT, lost, NAMED, HEALTHY], "A", ["x: failed"])
    told = json.loads(json.dumps(finite(document), allow_nan=False))["figures"]
    assert {figure.name for figure in figures([], "A")} <= set(told)
    assert (told["cases"], told["pressure_halved_in_library"], told["left_out_as_good"]) == (4, 0.5, None)
    assert "pressure_halved_in_library" in document["details"]["missed"]
    assert document["details"]["kinds"]["outside"]["root_leakage"]["right_equation"] == 1.0
    assert document["details"]["crashes"] == ["x: failed"]


def test_a_vocabulary_without_a_name_has_it_again_afterwards() -> None:
    names = tuple(VOCABULARY)
    with vocabulary_without(("seat_area", "line_volume")):
        assert set(names) - set(VOCABULARY) == {"seat_area", "line_volume"}
        assert "seat_area" not in {effect.id for effect in representatives()}
    assert tuple(VOCABULARY) == names


def test_a_proposal_is_taken_as_plain_values_and_its_model_meets_the_plant(tmp_path: Path) -> None:
    case = OutsideCase("0", Asked.NAMED, "orifice_area", (0.1,), False, None, 1)
    files = write_all(further_benches(case)[:1], True, tmp_path)
    further = measurements([read_recording(path) for path in files])
    nominal = effective_model(load_injector())

    class Offered:
        terms = (SimpleNamespace(equation="nozzle_flow", law="1", coefficient=0.1),)
        may_enter = True
        effects = ("line_friction",)
        phase = Phase.OPEN

        def model(self, nominal: object) -> object:
            return effective_model(load_injector(), (sized("orifice_area", v_H=0.1),))

    (proposed,) = taken([cast(Proposal, Offered())], nominal, further)
    assert proposed.terms == (ProposedTerm("nozzle_flow", "1", 0.1),)
    assert (proposed.effects, proposed.phase) == (("line_friction",), "open")
    assert proposed.misfit.pressure_mpa < 0.05
    assert proposed.misfit.mass_mg < 0.1
    before = misfit(nominal, further)
    assert before.pressure_mpa > 0.3
    assert before.mass_mg > 3.0


@pytest.mark.slow
def test_a_run_asks_once_and_tells_what_came_of_it(tmp_path: Path) -> None:
    asking = Asking(OutsidePlan("A", 0, (False,), 1, names=("healthy", "stop_loss")), 1, tmp_path)
    found = run_outside(asking)
    assert found.crashes == ()
    stop, healthy = sorted(found.results, key=lambda r: r.case.asked, reverse=True)
    assert (healthy.case.asked, healthy.answer.verdict) == (Asked.HEALTHY, "none")
    assert healthy.answer.before.pressure_mpa < 0.05
    assert stop.case.name == "stop_loss"
    assert stop.answer.before.mass_mg > 0.3
    assert 0.0 < stop.added_seconds < stop.answer.seconds
    assert stop.answer.added_core_seconds > 0.0
    assert not [path for path in asking.hidden.iterdir() if path.is_dir()]
    answers = (tmp_path / "answers.jsonl").read_text()
    assert run_outside(asking) == found
    assert (tmp_path / "answers.jsonl").read_text() == answers
    told = printed(shown(found, "A"))
    assert "stop_loss" in told
    assert "right_equation_in_library" in told
