"""What no vocabulary has: proposed as a law, put into the amended model, and what is left then."""

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.healthy_events import observer_remainder
from observer_rt.identification.discovery import discover
from observer_rt.identification.discovery.amend import write_amended
from observer_rt.identification.discovery.discover import DiscoveryTask, answer
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.candidates import NoMemory
from observer_rt.identification.discovery.search.results import Discovery, Verdict
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.conftest import WORN_POINTS
from tests.identification.discovery.hidden import NOMINAL, recordings
from tests.identification.discovery.terms import effect_of

PLUGGED = Term(
    TermEquation.NOZZLE_FLOW, parse("-0.2*(injection_number > 1)")
)  # a hole, after the first injection


def question_of(*effects: SizedEffect) -> DiscoveryTask:
    made = recordings(effects, points=WORN_POINTS)
    return DiscoveryTask(NOMINAL, measurements(made), (), {f"{n}.csv": f"{n:064x}" for n in range(len(made))})


def answered(task: DiscoveryTask) -> Findings:
    return answer(task, NoMemory(), lambda _: None, "amended.toml")


@pytest.fixture(scope="module")
def plugged() -> DiscoveryTask:
    return question_of(SizedEffect(effect_of(PLUGGED), ()))


@pytest.fixture(scope="module")
def accepted(plugged: DiscoveryTask) -> Findings:
    return answered(replace(plugged, accepted=1))


def test_what_no_effect_explains_is_proposed_as_a_law(accepted: Findings) -> None:
    found = accepted
    proposal = found.proposals[0]
    (term,) = proposal.terms
    low, high = term.interval or (0.0, 0.0)

    assert found.verdict is Verdict.UNKNOWN
    assert term.equation is TermEquation.NOZZLE_FLOW
    assert {variable.word for variable in term.law.variables} == {"injection_number"}
    assert low < -0.2 < high
    assert high - low < 0.01
    assert proposal.may_enter
    assert proposal.held_out[1] < 0.5 * proposal.held_out[0]


def test_a_law_is_drawn_beside_what_the_recordings_say(accepted: Findings) -> None:
    (curve,) = accepted.proposals[0].curves

    assert curve.words == "injection"
    np.testing.assert_array_equal(curve.at, (1.0, 2.0))
    np.testing.assert_allclose(curve.points, (0.0, -0.2), atol=0.01)
    assert np.all(curve.half < 0.02)
    assert "free curve" not in as_text(accepted)
    assert "may be any curve there" in report(accepted)


def test_an_accepted_proposal_explains_the_recordings(
    accepted: Findings, plugged: DiscoveryTask, tmp_path: Path
) -> None:
    path = tmp_path / "amended.toml"
    file = InjectorFile.read(NOMINAL_INJECTOR)
    write_amended(path, file, accepted.in_force, None, accepted.terms)

    amended = load_injector(path)
    again = answered(replace(plugged, parameters=amended))

    assert effective_model(amended).terms[0].coefficient == pytest.approx(-0.2, abs=0.01)
    assert accepted.amended_model == "amended.toml"
    assert again.verdict is Verdict.NONE


def test_a_proposal_is_in_every_answer(accepted: Findings) -> None:
    (stated,) = accepted.as_json()["unknown"]["proposals"]

    assert stated["terms"][0]["equation"] == "nozzle_flow"
    assert stated["terms"][0]["depends_on"] == ["injection_number"]
    assert stated["terms"][0]["hardly_told_from"] == ["chamber_pressure"]
    assert "hardly tells it from a law of chamber_pressure" in as_text(accepted)
    assert stated["gap_held_out"]["after_MPa"] < stated["gap_held_out"]["before_MPa"]
    assert stated["terms"][0]["latex"].endswith(r"\cdot \left(n > 1\right)")
    for text in (as_text(accepted), report(accepted)):
        words = r"as if the nozzle lost (19\.\d|20|20\.\d) % of its flow from the injection after number 1 on"
        assert re.search(words, text)


def test_the_page_shows_the_gap_shrink_with_the_law(accepted: Findings) -> None:
    page = report(accepted)

    assert accepted.gaps.line_pressure.after < 0.5 * accepted.gaps.line_pressure.before
    assert all(overlay.amended_pressure is not None for overlay in accepted.overlays)
    assert max(item.after.excess for item in accepted.where) < 5.0
    assert page.count("With proposal 1") >= 2  # the map, and the first lines
    for words in (
        "As if: share added to the flow through the nozzle (nozzle_flow)",
        "confidence that something unknown is missing",
        "observer-rt evaluate --model found/amended.toml RECORDING",
        "What lost",
    ):
        assert words in page
    assert "balance of the line" not in page
    assert "Nearest, not enough" not in page
    assert len(accepted.as_json()["unknown"]["proposals"][0]["lost"]) > 0


def test_residuals_show_in_which_injection_a_fault_begins(accepted: Findings) -> None:
    """The plug comes after the first of two injections of each recording."""
    found = accepted.injections
    assert [one.number for one in found] == [1, 2] * len(WORN_POINTS)
    for one in found:
        assert (one.before > 2.0 * one.after) == (one.number == 2)


def test_masses_are_told_by_operating_point_with_their_interval(accepted: Findings) -> None:
    for one in accepted.masses:
        low, high = one.ci95_pct
        assert low < one.change_pct < high
        assert high - low < 0.5
        assert (
            -12.0 < one.change_pct < -6.0
        )  # of two injections, one 20 % of a nozzle less, which seat and line share


def test_what_is_counted_from_the_start_is_told_with_the_law(accepted: Findings) -> None:
    words = "injection_number starts anew with every recording and every start of the daemon"
    assert words in as_text(accepted).splitlines()[0]
    assert words in report(accepted)
    assert accepted.terms[0].evidence.endswith(words)


@pytest.fixture(scope="module")
def less(accepted: Findings) -> Discovery:
    """The same, had the law left something."""
    found = Discovery(**{field.name: getattr(accepted, field.name) for field in fields(Discovery)})
    return replace(found, accepted=0, proposals=(replace(found.proposals[0], adequate=False),))


def test_what_leaves_something_is_accepted_in_part_only(
    less: Discovery, plugged: DiscoveryTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(discover, "name_effects", lambda *_: less)
    found = answered(replace(plugged, accepted=1))

    assert "add --in-part" in found.not_accepted
    assert found.amended_model is None
    assert "--accept-term 1 --in-part, and --force" in as_text(found)
    assert found.as_json()["in_part"] is False


def test_what_a_law_accepted_in_part_leaves_widens_intervals(
    less: Discovery, plugged: DiscoveryTask, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    left = replace(less.proposals[0], held_out=(2e6, 0.5e6))
    monkeypatch.setattr(discover, "name_effects", lambda *_: replace(less, proposals=(left,)))
    found = answered(replace(plugged, accepted=1, in_part=observer_remainder))
    path = tmp_path / "amended.toml"
    write_amended(
        path, InjectorFile.read(NOMINAL_INJECTOR), found.in_force, None, found.terms, found.remainder
    )
    stated = load_injector(path)

    part = found.proposals[0].part
    assert part is not None
    assert stated.remainder == found.remainder
    assert stated.remainder is not None
    assert stated.remainder.mass_share == pytest.approx(part.mass_half / 1.96, rel=0.01)
    assert "in part: closes" in stated.terms[0].evidence
    assert found.as_json()["in_part"] is True
    for text in (as_text(found), report(found)):
        assert "ccepted in part: it closes" in text
    widths = [
        _mass_halves(plugged, model) for model in (stated, stated.model_copy(update={"remainder": None}))
    ]
    assert widths[0] == pytest.approx(np.hypot(widths[1], part.mass_half), rel=0.1)


def _mass_halves(task: DiscoveryTask, parameters: InjectorParameters) -> float:
    """Half width, as a share, of the 95 % interval that the observer gives the last mass of the first recording."""
    history = evaluate(load_bench().with_parameters(parameters), [task.measured[0].recording])
    last = history.evaluations[0].reports[-1]
    assert last.mass_ci95 is not None
    low, high = last.mass_ci95
    return (high - low) / 2.0 / last.mass


@pytest.mark.parametrize(("number", "because"), [(2, "there are 1"), (7, "there are 1")])
def test_a_proposal_that_is_not_there_is_not_accepted(
    plugged: DiscoveryTask, number: int, because: str
) -> None:
    found = answered(replace(plugged, accepted=number))

    assert because in found.not_accepted
    assert found.amended_model is None
    assert found.terms == ()


@pytest.mark.parametrize("effects", [(), (sized("orifice_area", v_H=0.1),)])
def test_nothing_is_proposed_where_the_vocabulary_explains(effects: tuple[SizedEffect, ...]) -> None:
    found = answered(replace(question_of(*effects), accepted=1))

    assert found.proposals == ()
    assert "no such proposal" in found.not_accepted
    assert (found.amended_model is None) == (not effects)
