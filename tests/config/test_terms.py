"""`[[terms]]` of an injector file: read, part of the model, refused with key and remedy, written again."""

from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.effects import term_domain
from observer_rt.config.injector_file import InjectorFile, section_of, tables_in_force
from observer_rt.daemon.state_file import model_hash
from observer_rt.model.effects import effective_model
from observer_rt.model.terms.bounds import refuse_unbounded
from observer_rt.model.terms.in_force import TermInForce, coefficient_unit
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import VARIABLES
from tests.config.test_bench import require_refusal
from tests.config.test_effects import injector_file

PLUGGED = """
[[terms]]
equation = "nozzle_flow"
law = "-0.21 * (injection_number - 1)"
"""
LEAK = """
[[terms]]  # seen on bench 3
equation = "line_pressure"
law = "c * sqrt(line_pressure - chamber_pressure) * closed"
coefficient = { value = 0.4, unit = "mm3/ms/MPa^0.5", low = 0.3, high = 0.5 }
origin = "discover"
date = 2026-01-31
"""


def test_terms_are_part_of_the_model(tmp_path: Path) -> None:
    injector = load_injector(injector_file(tmp_path, PLUGGED + LEAK))
    plugged, leak = effective_model(injector).terms
    assert plugged == Term(TermEquation.NOZZLE_FLOW, parse("-0.21 * (injection_number - 1)"))
    assert (leak.coefficient, leak.interval) == (0.4, (0.3, 0.5))
    assert injector.terms[1].date == "2026-01-31"
    assert effective_model(load_injector()).terms == ()


def test_a_coefficient_in_another_unit_of_its_kind(tmp_path: Path) -> None:
    stated = LEAK.replace("closed", "closed / 2[MPa]").replace("mm3/ms/MPa^0.5", "mm3*bar^0.5/ms")
    (leak,) = effective_model(load_injector(injector_file(tmp_path, stated))).terms
    assert leak.coefficient == pytest.approx(0.4 * 0.1**0.5)
    assert leak.interval == pytest.approx((0.3 * 0.1**0.5, 0.5 * 0.1**0.5))


@pytest.mark.parametrize(
    ("old", "new", "key", "said"),
    [
        ('"line_pressure"', '"line_presure"', "equation", "'line_pressure'"),
        ("sqrt(", "squrt(", "law", "unknown name 'squrt' did you mean 'sqrt'?"),
        ("sqrt(", "exp(", "law", "what exp() takes is in -"),
        ("closed", "closed * -1", "law", "feeds back"),
        ("c *", "0.1 *", "coefficient", "the law has no c"),
        ('"mm3/ms/MPa^0.5"', '"mm3/ms"', "coefficient.unit", "give it in 'mm3/ms/MPa^0.5'"),
        ('"mm3/ms/MPa^0.5"', '"litres"', "coefficient.unit", "unknown unit"),
        (", high = 0.5", "", "coefficient", "give both, or neither"),
        ("high = 0.5", "high = 0.35", "coefficient", "between"),
        ("value = 0.4", "value = nan", "coefficient.value", "should be a finite number"),
        ("low =", "lo =", "coefficient.lo", "did you mean 'low'?"),
        ("origin =", "origins =", "origins", "did you mean 'origin'?"),
        ("law =", "laws =", "laws", "did you mean 'law'?"),
        (
            'coefficient = { value = 0.4, unit = "mm3/ms/MPa^0.5", low = 0.3, high = 0.5 }',
            "",
            "coefficient",
            'add coefficient = { value = 1.0, unit = "mm3/ms/MPa^0.5" }',
        ),
    ],
)
def test_mistakes_name_the_key(tmp_path: Path, old: str, new: str, key: str, said: str) -> None:
    assert LEAK.count(old) == 1
    require_refusal(load_injector, injector_file(tmp_path, PLUGGED + LEAK.replace(old, new)), f"terms.1.{key}", said)


def test_terms_are_written_as_they_are_read(tmp_path: Path) -> None:
    terms = effective_model(load_injector(injector_file(tmp_path, PLUGGED + LEAK))).terms
    written = tmp_path / "amended.toml"
    with InjectorFile.read(NOMINAL_INJECTOR).changed(written) as document:
        document["terms"] = tables_in_force([TermInForce.of(term, origin="discover") for term in terms])
    assert effective_model(load_injector(written)).terms == terms
    text = written.read_text()
    assert text.startswith(NOMINAL_INJECTOR.read_text())  # comments and all
    assert 'law = "c * sqrt(line_pressure - chamber_pressure) * closed"' in text
    assert text.count('origin = "discover"') == NOMINAL_INJECTOR.read_text().count('origin = "discover"') + 2


def test_a_section_of_numbers_and_pairs_is_one_line() -> None:
    text = section_of({"a": {"b": [1, 2], "c": 3}, "d": {"e": [1, 2, 3]}, "f": {"g": {"h": 1}}}).as_string()
    assert " ".join(text.split()) == "a = {b = [1, 2], c = 3} [d] e = [1, 2, 3] [f] g = {h = 1}"


def test_comments_of_terms_stay(tmp_path: Path) -> None:
    path, other = injector_file(tmp_path, LEAK), tmp_path / "other.toml"
    with InjectorFile.read(path).changed(other):
        pass
    assert other.read_text() == path.read_text()


def test_model_hash_covers_what_terms_do(tmp_path: Path) -> None:
    leaking = model_hash(load_injector(injector_file(tmp_path, LEAK)))
    assert leaking != model_hash(load_injector())
    for old, new, is_same in (
        ("value = 0.4", "value = 0.41", False),
        ("* closed", "* open", False),
        ('"discover"', '"a dream"', True),
        ("low = 0.3", "low = 0.2", True),
        ("c * sqrt(", "c*sqrt( ", True),
    ):
        other = model_hash(load_injector(injector_file(tmp_path, LEAK.replace(old, new))))
        assert (other == leaking) is is_same


def test_the_page_states_what_is_so(tmp_path: Path) -> None:
    """Its examples load, its tables hold every equation with its bounds, and every variable."""
    page = (Path(__file__).parents[2] / "docs" / "terms.md").read_text()
    assert len(load_injector(injector_file(tmp_path, page.split("```")[1].removeprefix("toml"))).terms) == 2
    for equation in TermEquation:
        low, high = equation.bounds
        assert f"| `{equation}` | {equation.words} | {equation.unit} | {low:g} to {high:g} |" in page
    assert all(f"`{name}`" in page for name in VARIABLES)
    rows = [
        line.split("`")
        for line in page.split("## Examples")[1].split("\n## ")[0].splitlines()
        if line.startswith("| ")
    ]
    examples = [(row[1], row[3]) for row in rows if len(row) > 3]
    assert len(examples) == 7
    for name, law in examples:
        term = Term(TermEquation(name), parse(law), 0.01)
        coefficient_unit(term.equation, term.law)
        refuse_unbounded(term, term_domain(load_injector()))
