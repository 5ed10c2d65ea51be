"""Laws as formulas."""

import xml.etree.ElementTree as ET

import pytest

from observer_rt.identification.discovery.search.curves import AXES
from observer_rt.identification.discovery.search.term_library import RecordingSpan, library
from observer_rt.identification.discovery.words.formula import Formula, formula, law_text
from observer_rt.model.term_effect import term_of
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation


def _of(equation: str, law: str, c: float) -> Formula:
    return formula(Term(TermEquation(equation), parse(law), c, (0.99 * c, 1.01 * c)), 0.3e-3)


@pytest.mark.parametrize(
    ("equation", "law", "c", "latex"),
    [
        (
            "line_flow",
            "c*max(line_flow/60 - 0.4217, 0)",
            8.34,
            r"\Delta p_{\mathrm{lost}} = 0.139\,\mathrm{MPa/(mm^3/ms)} \cdot "
            r"\max\left(Q_{L} - 25.3\,\mathrm{mm^3/ms}, 0\right)",
        ),
        (
            "seat_flow",
            "c*exp(-((needle_lift/max_lift - 0.466)/0.138)^2)",
            -0.334,
            r"\frac{\Delta Q_{S}}{Q_{S}} = -0.334 \cdot \exp\left(- \left(\frac{x - 0.14\,\mathrm{mm}}"
            r"{0.0414\,\mathrm{mm}}\right)^{2}\right)",
        ),
        (
            "nozzle_flow",
            "c*((1 + tanh((time_since_opening/1 - 0.6)/0.01))/2)",
            -0.15,
            r"\frac{\Delta Q_{H}}{Q_{H}} = -0.150 \cdot \frac{1 + \tanh\left(\frac{t_{\mathrm{open}} - 0.6\,"
            r"\mathrm{ms}}{0.01\,\mathrm{ms}}\right)}{2}",
        ),
        (
            "line_pressure",
            "c*closed",
            1.5,
            r"Q_{\mathrm{out}} = 1.50\,\mathrm{mm^3/ms} \cdot 1_{\mathrm{shut}}",
        ),
    ],
)
def test_latex_has_physical_numbers(equation: str, law: str, c: float, latex: str) -> None:
    assert _of(equation, law, c).latex == latex


def test_every_law_that_is_tried_is_a_formula() -> None:
    """Braces match, and the elements made of it."""
    effects = [*library(RecordingSpan(1.0, 5.0)), *(AXES[0].hats(TermEquation.LINE_FLOW))]
    for effect in effects:
        term = term_of(effect, 0.1)
        assert term is not None
        drawn = formula(term)
        assert drawn.latex.count("{") == drawn.latex.count("}")
        assert drawn.latex.count(r"\left") == drawn.latex.count(r"\right")
        assert ET.fromstring(drawn.mathml).tag.endswith("math")


def test_a_law_as_a_file_has_it_states_its_interval() -> None:
    term = Term(TermEquation.LINE_PRESSURE, parse("c*closed"), 1.5, (1.4, 1.6))
    assert law_text(term) == "line_pressure = c * closed, c = 1.50 mm³/ms (95 %: 1.40 to 1.60)"
