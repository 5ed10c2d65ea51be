"""Builds report.html: the answer in the words of the terminal, then what it rests on, in figures and tables."""

import math
import re

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from observer_rt import __version__
from observer_rt.files.learned_picture import learned_figure
from observer_rt.foundation import units
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.report import figures, tables, text
from observer_rt.identification.discovery.search import proposal
from observer_rt.identification.discovery.search.laws import guess_words
from observer_rt.model.effects import VOCABULARY

_PAGES = Environment(  # in which a name that a template is not given is an error
    loader=PackageLoader(__package__),
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    undefined=StrictUndefined,
)
for _module in (units, proposal, text, tables, figures):
    _PAGES.globals |= vars(_module)
_PAGES.globals |= {"version": __version__, "VOCABULARY": VOCABULARY, "isfinite": math.isfinite}
_PAGES.globals |= {"learned_figure": learned_figure, "guess_words": guess_words}
_PAGES.filters["with_code"] = lambda text: Markup(re.sub("`(.+?)`", r"<code>\1</code>", str(escape(text))))
_PAGES.filters["sentence"] = lambda text: text[:1].upper() + text[1:]


def report(findings: Findings) -> str:
    """The page."""
    return _PAGES.get_template("report.html.j2").render(findings=findings)
