"""What is said of an evaluated recording: standstill checks, and one JSON document of everything."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import indent
from typing import Any, TextIO

import numpy as np

from observer_rt.evaluation.curves import injection_json
from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND
from observer_rt.model.effective import Coefficients
from observer_rt.observer.stream.lift_zero import LIMIT
from observer_rt.observer.stream.standstill import LiftFigures

SCHEMA = 1
PLAUSIBLE_OFFSET = 2 * MEGAPASCAL  # between line and rail pressure at standstill
_NO_INJECTIONS = '"injections": []'  # a string of the document cannot hold it: its quotes would be escaped


@dataclass(frozen=True)
class Check:
    """A standstill check."""

    id: str
    value: float
    unit: str
    passed: bool


def checks(evaluation: Evaluation, c: Coefficients) -> list[Check]:
    """Standstill checks: offset between line and rail pressure, noise levels, and what the lift sensor shows."""
    standstill = evaluation.standstill
    offset = standstill.offset * c.pressure_scale
    result = [
        Check("rail_line_offset", offset / MEGAPASCAL, "MPa", abs(offset) <= PLAUSIBLE_OFFSET),
    ]
    if standstill.noise is not None:
        noise = standstill.noise
        result += [
            Check("rail_pressure_noise", noise.rail_pressure / MEGAPASCAL, "MPa", True),
            Check("line_pressure_noise", noise.line_pressure / MEGAPASCAL, "MPa", True),
            Check("needle_lift_noise", noise.needle_lift / MICROMETRE, "um", True),
        ]
    return result + _lift_checks(standstill.lift)


def _lift_checks(lift: LiftFigures) -> list[Check]:
    result = [
        Check("needle_lift_zero", lift.zero / MICROMETRE, "um", abs(lift.zero) < LIMIT),
        Check(
            "needle_lift_crosstalk", lift.crosstalk * MEGAPASCAL / MICROMETRE, "um/MPa", lift.crosstalk == 0.0
        ),
    ]
    if not math.isnan(lift.at_stop):
        result.append(Check("needle_lift_at_stop", lift.at_stop / MICROMETRE, "um", lift.is_to_scale))
    return result


def write_document(evaluations: Sequence[Evaluation], model: str, c: Coefficients, out: TextIO) -> None:
    """Write one JSON document, injection by injection, however many there are.

    model: SHA-256 of the parameters; c: of the nominal model.
    """
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "model_sha256": model,
        "recordings": [_without_injections(evaluation, c) for evaluation in evaluations],
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


def _without_injections(evaluation: Evaluation, c: Coefficients) -> dict[str, Any]:
    """One recording of the document, an empty list for its injections."""
    valid = sum(result.report.valid for result in evaluation.injections)
    return {
        "file": str(evaluation.path),
        "samples": evaluation.samples,
        "sample_rate_hz": evaluation.sample_rate,
        "lost_samples": evaluation.counters.lost_samples,
        "spikes": evaluation.counters.spikes,
        "bridged_samples": evaluation.counters.bridged_samples,
        "checks": [vars(check) for check in checks(evaluation, c)],
        "injections": [],
        "summary": {
            "valid_share": valid / len(evaluation.injections) if len(evaluation.injections) else 0.0,
            "adoptions": evaluation.counters.adoptions,
            "rejected_adoptions": evaluation.counters.rejected_adoptions,
            **_energizing_json(evaluation),
        },
    }


def _energizing_json(evaluation: Evaluation) -> dict[str, Any]:
    """Of the recording as a whole."""
    if not evaluation.has_energizing:
        return {}
    delays = [
        result.report.commanded.opening_delay for result in evaluation.injections if result.report.commanded
    ]
    known = [delay / MICROSECOND for delay in delays if not math.isnan(delay)]
    return {
        "energizing": {
            "commands": evaluation.counters.commands,
            "missing_injections": evaluation.counters.missing_injections,
            "uncommanded_injections": evaluation.counters.uncommanded_injections,
            "mean_opening_delay_us": float(np.mean(known)) if known else None,
            "opening_delay_sigma_us": float(np.std(known)) if known else None,
        }
    }
