"""Recipes of docs/CONTRIBUTING.md, followed: a value of an injection, a line model.

Effects and formats from outside: `tests/config/test_own_effects.py`, `tests/desk/cli/test_formats.py`.
"""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from observer_rt.daemon.persistence.journal import COLUMNS
from observer_rt.engine.reports.injection_report import INDICATORS

ROOT = Path(__file__).parents[1]
VALUE = """
import json

from observer_rt.engine.reports import injection_report as reports

ROW = reports.Field("volume_mm3", float, lambda report, _: report.volume / 1e-9, "volume\\nmm3", ".1f")
reports.FIELDS = (*reports.FIELDS, ROW)

from observer_rt.config.bench import load_injector
from observer_rt.daemon.persistence.journal import COLUMNS
from observer_rt.desk.evaluation.curves import SHOWN
from observer_rt.desk.fleet.job import SCHEMA
from observer_rt.model.effects import effective_model
from tests.daemon.samples import some_report

c = effective_model(load_injector()).coefficients
record = reports.injection_record(some_report(volume=50e-9), c, has_energizing=False)
print(json.dumps({
    "journal": COLUMNS["volume_mm3"].__name__,
    "parquet": str(SCHEMA.field("volume_mm3").type),
    "heading": SHOWN["volume_mm3"].heading,
    "text": SHOWN["volume_mm3"].text(record["volume_mm3"]),
    "json": record["volume_mm3"],
}))
"""
LINE = """
import json
from pathlib import Path

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.model.effects import effective_model
from observer_rt.model.line.interface import register
from observer_rt.model.line.lump import LumpLine

class RigidLine(LumpLine):
    __slots__ = ()

    @classmethod
    def of(cls, *arguments):
        return super().of(*arguments).with_stiffness(1.0)

register("rigid", RigidLine)
path = Path({path!r})
path.write_text(NOMINAL_INJECTOR.read_text().replace("# model = \\"lump\\"", "model = \\"rigid\\""))
rigid, lump = (effective_model(load_injector(each)).coefficients.line for each in (path, NOMINAL_INJECTOR))
print(json.dumps({{"type": type(rigid).__name__, "stiffness": rigid.a1 / lump.a1, "mode": rigid.mode / lump.mode}}))
"""


def _followed(code: str) -> Any:
    """JSON that a program of its own prints, so that what it registers goes with it."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_row_of_fields_reaches_journal_tables_and_json() -> None:
    found = _followed(VALUE)
    assert found == {
        "journal": "float",
        "parquet": "double",
        "heading": "volume\nmm3",
        "text": "50.0",
        "json": found["json"],
    }
    assert abs(found["json"] - 50.0) < 1e-9


def test_a_registered_line_is_a_model_of_injector_files(tmp_path: Path) -> None:
    found = _followed(LINE.format(path=str(tmp_path / "rigid.toml")))
    assert found["type"] == "RigidLine"
    assert abs(found["stiffness"] - 2.0) < 1e-12
    assert abs(found["mode"] - 2.0**0.5) < 1e-12


def test_the_page_lists_the_columns_of_the_journal() -> None:
    listed = set(re.findall(r"`(\w+)`", (ROOT / "docs" / "journal.md").read_text(encoding="utf-8")))
    indicators = {column for each in INDICATORS for column in each.columns}
    assert COLUMNS.keys() - indicators <= listed
