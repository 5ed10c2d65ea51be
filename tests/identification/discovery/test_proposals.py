"""A departure that no vocabulary has is proposed as a law, put into the amended model, and leaves noise."""

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.healthy_events import observer_remainder
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery import amend, discover
from observer_rt.identification.discovery.amend import write_amended
from observer_rt.identification.discovery.discover import DiscoveryTask, answer
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.proposals import with_parts
from observer_rt.identification.discovery.search.results import Discovery, Verdict
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.conftest import WORN_POINTS, Worn
from tests.identification.discovery.hidden import NOMINAL, effect_of, recordings

PLUGGED = Term(TermEquation.NOZZLE_FLOW, parse("-0.2*(injection_number > 1)"))  # a hole, after the first injection


@pytest.fixture(scope="module")
def plugged() -> DiscoveryTask:
    made = recordings((SizedEffect(effect_of(PLUGGED), ()),), points=WORN_POINTS)
    names = {f"{n}.csv": f"{n:064x}" for n in range(len(made))}
    return DiscoveryTask(NOMINAL, measurements(made), (), names)


def answered(task: DiscoveryTask) -> Findings:
    return replace(answer(task, lambda _: None), folder="found")


@pytest.fixture(scope="module")
def accepted(plugged: DiscoveryTask) -> Findings:
    return answered(replace(plugged, accepted=1))


def test_what_no_effect_explains_is_proposed_as_a_law(accepted: Findings) -> None:
    proposal = accepted.proposals[0]
    (term,) = proposal.terms
    low, high = term.interval or (0.0, 0.0)
    assert accepted.verdict is Verdict.UNKNOWN
    assert term.equation is TermEquation.NOZZLE_FLOW
    assert {variable.word for variable in term.law.variables} == {"injection_number"}
    assert low < -0.2 < high
    assert high - low < 0.01
    assert proposal.may_enter
    assert proposal.held_out[1] < 0.5 * proposal.held_out[0]


def test_an_accepted_proposal_explains_recordings(accepted: Findings, plugged: DiscoveryTask, tmp_path: Path) -> None:
    path = tmp_path / "amended.toml"
    write_amended(path, InjectorFile.read(NOMINAL_INJECTOR), accepted.in_force, None, accepted.terms)
    amended = load_injector(path)
    again = name_effects(effective_model(amended), plugged.measured, workers=2)
    assert effective_model(amended).terms[0].coefficient == pytest.approx(-0.2, abs=0.01)
    assert accepted.amended_model == "amended.toml"
    assert again.verdict is Verdict.NONE


def test_a_proposal_is_in_document_screen_and_page(accepted: Findings) -> None:
    (stated,) = accepted.as_json()["unknown"]["proposals"]
    (term,) = stated["terms"]
    page = report(accepted)
    assert (term["equation"], term["depends_on"]) == ("nozzle_flow", ["injection_number"])
    assert term["hardly_told_from"] == ["chamber_pressure"]
    assert stated["gap_held_out"]["after_MPa"] < stated["gap_held_out"]["before_MPa"]
    assert stated["seen"] == {"injection_number": [1.0, 2.0]}
    for text in (as_text(accepted), page):
        assert re.search(r"the nozzle lost (19\.\d|20|20\.\d) % of its flow from the injection after number 1", text)
        assert "injection_number starts anew" in text
    assert "injection_number starts anew" in accepted.terms[0].evidence
    for words in ("With proposal 1", "nozzle_flow = c", "--model found/amended.toml"):
        assert words in page


def test_the_gap_shrinks_with_the_law(accepted: Findings) -> None:
    """The plug comes after the first of two injections of each recording, 20 % less of a nozzle."""
    pressure = accepted.gaps.by_name["line_pressure"]
    assert pressure.after < 0.5 * pressure.before
    assert all(overlay.after is not None for overlay in accepted.overlays)
    assert max(item.after.excess for item in accepted.where) < 5.0
    assert [injection.number for injection in accepted.injections] == [1, 2] * len(WORN_POINTS)
    for injection in accepted.injections:
        assert (injection.before > 2.0 * injection.after) == (injection.number == 2)
    for change in accepted.masses:  # a mean of two injections, which seat and line share
        low, high = change.ci95_pct
        assert low < change.change_pct < high < low + 0.5
        assert -12.0 < change.change_pct < -6.0


@pytest.fixture(scope="module")
def less(accepted: Findings, plugged: DiscoveryTask) -> Discovery:
    """The same, had the law left something."""
    discovery = Discovery(**{field.name: getattr(accepted, field.name) for field in fields(Discovery)})
    left = replace(discovery.proposals[0], adequate=False, held_out=(2e6, 0.5e6))
    parts = with_parts([left], plugged.measured, effective_model(NOMINAL))
    assert discovery.unexplained is not None
    return replace(discovery, accepted=0, unexplained=replace(discovery.unexplained, proposals=parts))


def test_what_leaves_something_is_accepted_in_part(
    less: Discovery, plugged: DiscoveryTask, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What it leaves widens the intervals then."""
    monkeypatch.setattr(discover, "name_effects", lambda *_: less)
    remainder = answered(replace(plugged, accepted=1, observed=observer_remainder))
    path = tmp_path / "amended.toml"
    write_amended(
        path, InjectorFile.read(NOMINAL_INJECTOR), remainder.in_force, None, remainder.terms, remainder.remainder
    )
    stated, part = load_injector(path), remainder.proposals[0].part
    assert part is not None
    assert stated.remainder is not None
    assert stated.remainder == remainder.remainder
    assert stated.remainder.mass_share == pytest.approx(part.mass_half / 1.96, rel=0.01)
    assert "in part: closes" in stated.terms[0].evidence
    assert remainder.as_json()["in_part"] is True
    for text in (as_text(remainder), report(remainder)):
        assert "ccepted in part: it closes" in text
    widths = [_mass_halves(plugged, model) for model in (stated, stated.model_copy(update={"remainder": None}))]
    assert widths[0] == pytest.approx(np.hypot(widths[1], part.mass_half), rel=0.1)


def _mass_halves(task: DiscoveryTask, parameters: InjectorParameters) -> float:
    """Half width, as a share, of the 95 % interval that the observer gives the last mass of the first recording."""
    history = evaluate(load_bench().exact.with_parameters(parameters), [task.measured[0].recording])
    last = history.evaluations[0].reports[-1]
    return last.mass_bound / last.mass


def test_a_proposal_that_is_not_there_is_not_accepted(accepted: Findings, worn: Worn) -> None:
    assert worn.findings.proposals == ()
    for findings, number, because in ((accepted, 2, "there are 1"), (worn.findings, 1, "'named'")):
        with pytest.raises(UserError, match=f"no such proposal.*{because}"):
            amend.accepted(NOMINAL, findings, number, {})
