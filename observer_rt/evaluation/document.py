"""Evaluated recordings as one JSON document, however many injections there are."""

import json
from collections.abc import Sequence
from textwrap import indent
from typing import Any, TextIO

from observer_rt.evaluation.results import SCHEMA, Evaluated, injection_json, recording_json_without
from observer_rt.model.coefficients import Coefficients

_NO_INJECTIONS = '"injections": []'  # a string of the document cannot hold it: its quotes would be escaped


def write_document(evaluations: Sequence[Evaluated], model: str, c: Coefficients, out: TextIO) -> None:
    """Write it, injection by injection. model: SHA-256 of the parameters; c: of the nominal model."""
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "model_sha256": model,
        "recordings": [recording_json_without(evaluation, c) for evaluation in evaluations],
    }
    before, *after = json.dumps(document, indent=2).split(_NO_INJECTIONS)
    out.write(before)
    for evaluation, text in zip(evaluations, after, strict=True):
        out.write('"injections": [')
        for number, result in enumerate(evaluation.injections):
            record = json.dumps(injection_json(result, evaluation.has_energizing, c), indent=2)
            out.write((",\n" if number else "\n") + indent(record, 8 * " "))
        out.write("\n      ]" if len(evaluation.injections) else "]")
        out.write(text)
    out.write("\n")
