"""docs/schemas: the JSON Schemas of the documents for programs. `python -m tests.test_schemas` writes them."""

import json
from pathlib import Path

import pytest

from observer_rt.desk.injection_map.map_document import MapDocument
from observer_rt.identification.discovery import findings
from observer_rt.identification.fit.document import FitDocument

FOLDER = Path(__file__).parents[1] / "docs" / "schemas"
VERSION = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
FINDINGS = {"description": "Findings of `observer-rt discover`."}  # of which a part is in the document
SCHEMAS = {
    "findings": VERSION | findings.adapter().json_schema(mode="serialization") | FINDINGS,
    "fit": VERSION | FitDocument.model_json_schema(),
    "map": VERSION | MapDocument.model_json_schema(),
}


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_that_of_its_model(name: str) -> None:
    assert json.loads((FOLDER / f"{name}.json").read_text("utf-8")) == SCHEMAS[name]


if __name__ == "__main__":
    for name, schema in SCHEMAS.items():
        (FOLDER / f"{name}.json").write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
