"""Recipes of docs/CONTRIBUTING.md, followed: a value of an injection, a message, a line model, a scalar, a reason."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from observer_rt.config.bench_file import BusesConfig
from observer_rt.config.injector_sections import InjectorConfig
from observer_rt.daemon.journal import COLUMNS
from observer_rt.daemon.keeper import KeptFiles
from observer_rt.engine.reports.injection_report import INDICATORS
from observer_rt.engine.stream.state import Reason

ROOT = Path(__file__).parents[1]
VALUE = """
import json

from observer_rt.engine.reports import injection_report as reports

ROW = reports.Field("volume_mm3", float, lambda report, _: report.volume / 1e-9, "volume\\nmm3", ".1f")
reports.FIELDS = (*reports.FIELDS, ROW)

from observer_rt.config.bench import load_injector
from observer_rt.daemon.journal import COLUMNS
from observer_rt.desk.evaluation.curves import SHOWN
from observer_rt.desk.fleet.job import SCHEMA
from observer_rt.model.effects import effective_model
from tests.daemon.samples import some_report

c = effective_model(load_injector()).coefficients
record = reports.injection_record(some_report(volume=50e-9), c, has_energizing=False)
shown, value = SHOWN["volume_mm3"], record["volume_mm3"]
texts = [COLUMNS["volume_mm3"].__name__, str(SCHEMA.field("volume_mm3").type), shown.heading, shown.text(value)]
print(json.dumps([*texts, value]))
"""
LINE = """
import json
from pathlib import Path

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.model.effective import LINES
from observer_rt.model.effects import effective_model
from observer_rt.model.line import LumpLine, stiffened
from observer_rt.model.parameters import LINE_MODELS

class RigidLine(LumpLine):
    __slots__ = ()

    @classmethod
    def of(cls, *arguments):
        return stiffened(super().of(*arguments), 1.0)

LINE_MODELS.append("rigid")
LINES["rigid"] = RigidLine
path = Path({path!r})
path.write_text(NOMINAL_INJECTOR.read_text().replace("# model = \\"lump\\"", "model = \\"rigid\\""))
rigid, lump = (effective_model(load_injector(each)).coefficients.line for each in (path, NOMINAL_INJECTOR))
print(json.dumps({{"type": type(rigid).__name__, "stiffness": rigid.a1 / lump.a1, "mode": rigid.mode / lump.mode}}))
"""
SCALARS = "engine/estimation/parameters.py"
SCALAR_EDITS = (
    (SCALARS, "\n\n_MM3_PER_MS = ", "    INERTANCE = 25 + HIDDEN\n\n\n_MM3_PER_MS = "),
    (
        SCALARS,
        "\n))\n# fmt: on",
        """
    Scalar("inertance", Parameter.INERTANCE, prior=0.3, drift=1e-3, longest_step=0.2, bounds=(-0.6, 1.0),
           gated_from=-0.6, shown=ShownIndicator("line_inertance", label="line inertance i"),
           change=lambda line, i: line._replace(a3=line.a3 * (1.0 + i))),
))
# fmt: on""",
    ),
)
SCALAR = """
import json

from observer_rt.engine.estimation.parameters import SCALARS, Parameter
from observer_rt.engine.reports.indicators import indicators_of
from observer_rt.engine.learning.knowledge import no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.observer import make_observer
from observer_rt.engine.stream.standstill import Standstill
from tests.engine.learning.strokes import CONSTANTS, SCALE, stroke_of
from tests.engine.sample_stream import NOISE, judge

c = CONSTANTS.coefficients
found = []
for inertance in (-0.15, 0.0, 0.15):
    knowledge = no_knowledge(NOISE, SCALE)
    learner = Learner(CONSTANTS, knowledge)
    observer = make_observer(CONSTANTS, knowledge, learner)
    other = c._replace(line=c.line._replace(a3=c.line.a3 * (1.0 + inertance)))
    for seed in range(3):
        event = stroke_of(other, samples=900, seed=seed)
        outcome = learner.learn(event, Standstill(0, 0.0, None), observer.theta.copy())
        judge(observer, outcome.forward, outcome)
    shown = indicators_of(outcome.estimate, outcome.covariance, [0.9, 1.0, 0.8], [0.95, 0.9])["line_inertance"]
    line = observer.memory[0]["in_force"]["line"]
    found.append({
        "learned": observer.theta[Parameter.INERTANCE],
        "carried": line[c.line._fields.index("a3")] / c.line.a3 - 1.0,
        "shown": shown.value,
        "sigma": shown.sigma,
    })
print(json.dumps({"name": SCALARS.names[-1], "found": found}))
"""
SIGNALS = "bus/mapping/output_signals.py"
MASS_MESSAGE = """BO_ 515 InjectionMass: 8 Observer
 SG_ CRC : 0|16@1+ (1,0) [0|65535] "" BenchComputer
 SG_ Counter : 16|8@1+ (1,0) [0|255] "" BenchComputer

"""
MESSAGE_EDITS = (
    (
        SIGNALS,
        "\n# fmt: on",
        """

class MassValues(NamedTuple):
    valid: Annotated[bool, OutputSignal("report.valid", 1, 24)]
    mass: Annotated[float, OutputSignal("report.mass", 16, 32, None, None, MASS, says="Mass alone.")]
# fmt: on""",
    ),
    (SIGNALS, "\n}\n", '\n    "injection_mass": Result(MassValues, 515, per_injection=True),\n}\n'),
    (
        "config/injector_sections.py",
        "    injector_id: ",
        """    injection_mass: str | Literal[False] = "InjectionMass"
    injection_mass_id: Identifier | None = None
    injector_id: """,
    ),
    ("data/observer_fd.dbc", "BO_ 514 ObserverStatus", f"{MASS_MESSAGE}BO_ 514 ObserverStatus"),
    ("data/observer_classic.dbc", "BO_ 514 ObserverStatus", f"{MASS_MESSAGE}BO_ 514 ObserverStatus"),
)
MESSAGE = """
import json

from cantools.database import load_file

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import PACKAGE_DATA, load_bench
from observer_rt.config.bench_file import RESULT_IDS
from observer_rt.engine.service.messages import FrameWriter
from tests.daemon.samples import some_report
from tools.lib.word_tables import database_with_words

for path in PACKAGE_DATA.glob("*.dbc"):
    path.write_text(database_with_words(path.read_text()))
bus = map_bus(load_bench())
*_, frame = FrameWriter(bus.results_of(per_injection=True)).write({"report": some_report(mass=42e-6, valid=True)})
values = [load_file(path).decode_message(frame.frame_id, frame.payload) for path in PACKAGE_DATA.glob("*.dbc")]
print(json.dumps({
    "values": [[each["Mass"], each["Valid"]] for each in values],
    "sent": [layout.name for layout in bus.sent],
    "identifiers": RESULT_IDS,
}))
"""
FREE = max(Reason) + 1
REASON_EDITS = (
    ("engine/stream/state.py", "\n\ndef sample_dtype", f"    FUEL_HOT = {FREE}\n\n\ndef sample_dtype"),
    (
        "engine/words.py",
        "}\n\nCOUNTERS",
        '    Reason.FUEL_HOT: Words("the fuel is too hot", "cool it"),\n}\n\nCOUNTERS',
    ),
    ("engine/stream/validity.py", "\n\ndef state_of_service", "    is_hot: bool = False\n\n\ndef state_of_service"),
    (
        "engine/stream/validity.py",
        "    if condition.is_stale:",
        "    if condition.is_hot:\n        return State.DEGRADED, Reason.FUEL_HOT\n    if condition.is_stale:",
    ),
)
REASON = f"""
import json

from observer_rt.engine.stream.validity import ServiceCondition, state_of_service
from observer_rt.engine.words import named
from tools.lib.word_tables import DATABASES, PAGE, database_with_words, page_with_words

_, reason = state_of_service(None, ServiceCondition(is_hot=True))
print(json.dumps({{
    "named": named(reason),
    "page": "| `FUEL_HOT` | the fuel is too hot | cool it |" in page_with_words(PAGE.read_text()),
    "databases": [database_with_words(each.read_text()).count('{FREE} "FUEL_HOT') for each in DATABASES],
}}))
"""


def _followed(code: str, package: Path = ROOT) -> Any:
    """JSON that a program of its own prints, so that what it registers goes with it; package: folder it is in."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=package,
        env={**os.environ, "PYTHONPATH": f"{package}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def _with_edits(folder: Path, edits: Sequence[tuple[str, str, str]]) -> Path:
    """A folder with a copy of the package, in whose files a text became another."""
    copy = folder / "observer_rt"
    shutil.copytree(ROOT / "observer_rt", copy)  # with what Python has compiled of it, which takes longest
    for name, before, after in edits:
        text = (copy / name).read_text(encoding="utf-8")
        assert text.count(before) == 1
        (copy / name).write_text(text.replace(before, after), encoding="utf-8")
    return folder


def test_a_row_of_fields_reaches_journal_tables_and_json() -> None:
    *texts, value = _followed(VALUE)
    assert texts == ["float", "double", "volume\nmm3", "50.0"]
    assert value == pytest.approx(50.0, abs=1e-9)


def test_a_registered_line_is_a_model_of_injector_files(tmp_path: Path) -> None:
    output = _followed(LINE.format(path=str(tmp_path / "rigid.toml")))
    assert output["type"] == "RigidLine"
    assert abs(output["stiffness"] - 2.0) < 1e-12
    assert abs(output["mode"] - 2.0**0.5) < 1e-12


def test_a_row_of_scalars_is_learned_and_shown(tmp_path: Path) -> None:
    followed = _followed(SCALAR, _with_edits(tmp_path, SCALAR_EDITS))
    assert followed["name"] == "inertance"
    heavy, healthy, light = followed["found"]
    for learned, inertance in ((heavy, -0.15), (light, 0.15)):
        assert learned["learned"] == learned["shown"] == pytest.approx(inertance, abs=0.02)
        assert learned["carried"] == pytest.approx(learned["learned"], rel=1e-9)
        assert 0.0 < learned["sigma"] < 0.02
    assert healthy["learned"] == healthy["carried"] == 0.0  # it does not pay


def test_a_row_of_results_is_a_message_of_both_databases_on_the_bus(tmp_path: Path) -> None:
    output = _followed(MESSAGE, _with_edits(tmp_path, MESSAGE_EDITS))
    assert output["values"] == [[pytest.approx(42.0), 1]] * 2
    assert {"InjectionMass", "injection_mass_id"} <= {*output["sent"], *output["identifiers"]}


def test_a_reason_with_its_words_and_rule_reaches_page_and_databases(tmp_path: Path) -> None:
    output = _followed(REASON, _with_edits(tmp_path, REASON_EDITS))
    assert output == {"named": "FUEL_HOT: the fuel is too hot", "page": True, "databases": [2, 2]}


def _keys(model: type[BaseModel]) -> Iterator[str]:
    for key, field in model.model_fields.items():
        yield key
        inner: list[Any] = [field.annotation]
        while inner:
            kind = inner.pop()
            inner += get_args(kind)
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from _keys(kind)


def test_pages_name_every_key_of_the_bench_file_and_every_file_that_is_kept() -> None:
    pages = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}
    del pages["CHANGELOG.md"]
    code = re.findall(r"(?s:```.*?```)|`[^`\n]+`|(?m:^ {4}.*$)", "\n".join(pages.values()))
    assert not {*_keys(BusesConfig), *_keys(InjectorConfig)} - set(re.findall(r"\w+", "\n".join(code)))
    assert [name for name in KeptFiles._fields if f"--{name} " not in pages["journal.md"]] == []


def test_the_page_lists_the_columns_of_the_journal() -> None:
    listed = set(re.findall(r"`(\w+)`", (ROOT / "docs" / "journal.md").read_text(encoding="utf-8")))
    indicators = {column for each in INDICATORS for column in each.columns}
    assert COLUMNS.keys() - indicators <= listed
