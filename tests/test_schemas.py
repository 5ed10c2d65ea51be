"""docs/schemas: the JSON Schemas of the documents for programs. `python -m tests.test_schemas` writes them."""

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from observer_rt.identification.discovery.report.document import FindingsDocument
from observer_rt.identification.fit.document import FitDocument

FOLDER = Path(__file__).parents[1] / "docs" / "schemas"
DOCUMENTS: dict[str, type[BaseModel]] = {
    "findings": FindingsDocument,
    "fit": FitDocument,
}


def schema_of(name: str) -> dict[str, Any]:
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **DOCUMENTS[name].model_json_schema()}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_schema_is_that_of_its_model(name: str) -> None:
    assert json.loads((FOLDER / f"{name}.json").read_text("utf-8")) == schema_of(name)


if __name__ == "__main__":
    for name in DOCUMENTS:
        (FOLDER / f"{name}.json").write_text(json.dumps(schema_of(name), indent=2) + "\n", encoding="utf-8")
