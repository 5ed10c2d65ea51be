"""The learned state on disk: one file, replaced as a whole, restored only where it belongs and can be true."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from pydantic import BaseModel

from observer_rt.core.stream.stream import FURTHEST_ZERO, MOST_CROSSTALK
from observer_rt.daemon.array_texts import ArrayTexts
from observer_rt.engine.estimation.parameters import SCALARS, sensor_lag
from observer_rt.engine.estimation.predictor import LARGEST_NOISE
from observer_rt.engine.learning.adequacy import LARGEST_LAG, is_worn_beyond_limits
from observer_rt.engine.learning.knowledge import Knowledge, LearningState, no_state
from observer_rt.engine.stream.standstill import RestingLift
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.files import replacing
from observer_rt.foundation.outputs import LEARNED_STATE, refuse_other_kind
from observer_rt.foundation.records import Count, NotAsExpectedError, from_plain, kept_names, to_plain
from observer_rt.foundation.units import Floats
from observer_rt.foundation.version import __version__
from observer_rt.model.parameters import InjectorParameters

VERSION = 13
BEGUN_ANEW = "nothing, if another injector was mounted: learning begins anew; else put the right file back"
ASIDE = ".set-aside-"  # in the name of what is set aside, before its number
LARGEST_FILE = 1 << 22  # bytes, far more than any state takes: a hypothesis is 20 kB, of earlier versions .3 MB
_WHOLE = ("account", "noise", "events", "interval")
"""Names in the state without which nothing is restored; of the others, one that does not fit is left out."""

_NO_MODEL: Any = {
    **dict.fromkeys(("effects", "terms", "format", "accuracy"), True),
    "fluid": {"fuel"},  # its values are in the other keys
    "remainder": {"origin", "date"},
}
_FROM_THE_FIRST = {  # keys that enter a hash at their default, too, as before there was a rule; none joins them
    *("line_outflow", "fluid.thermal_expansion", "fluid.bulk_modulus_slope", "line.inlet_loss_factor"),
    *("line.model", "line.cells", "line.damping", "line.end_volume", "line.wall_viscosity", "line.impedance_ratio"),
    *("line.impedance_step", "scaling", "scaling.pressure", "scaling.flow", "scaling.area", "remainder.observer"),
    *("baseline", "baseline.format", "baseline.ci95", "baseline.recordings", "baseline.healthy", "baseline.observer"),
    *("baseline.line_pressure_sensor_gain", "baseline.origin", "baseline.date"),
}
_json = partial(json.dumps, allow_nan=False, default=np.ndarray.tolist)
"""Text of numbers, lists, mappings and arrays."""


class _UnusableError(Exception):
    """Reason not to restore a file's content."""


@dataclass(frozen=True, eq=False)
class _Content:
    """Learned state as it lies in the file. columns: names of the parameters in order; arrays: `ArrayTexts`."""

    package_version: str
    model_sha256: str
    columns: tuple[str, ...]
    phi_version: Count
    in_force: Floats
    state: Mapping[str, Any]
    lift: RestingLift
    arrays: tuple[str, ...]


class RestoredKnowledge(NamedTuple):
    """Knowledge of a file, None if it has none to use, and a message that says so."""

    knowledge: Knowledge | None
    message: str


class StateDoesNotFitError(UserError):
    """A file with a learned state that does not belong to the model, was damaged or cannot be true."""


def model_hash(parameters: InjectorParameters) -> str:
    """SHA-256 (hexadecimal) of the parameters, however the file they were read from is written.

    A key at its default does not enter: a file is the model that it was before there was such a key. Of the effects
    and terms in force it covers what they do, not why somebody believes in them.
    """
    content = _stated(parameters, parameters.model_dump(mode="json", exclude=_NO_MODEL))
    if parameters.fluid.reference_temperature is None:  # then there is no law of the temperature either
        for key in ("thermal_expansion", "bulk_modulus_slope"):
            del content["fluid"][key]
    if parameters.effects:
        content["effects"] = [
            [effect.id, {name: [size.value, size.unit] for name, size in effect.parameters.items()}]
            for effect in parameters.effects
        ]
    if parameters.terms:
        content["terms"] = [
            (term.equation, str(term.law), term.coefficient) for term in (stated.term for stated in parameters.terms)
        ]
    return _digest(content)


def _stated(section: BaseModel, dumped: Mapping[str, Any], name: str = "") -> dict[str, Any]:
    """Keys of an injector file, or section, that enter the hash; dumped: their values as JSON."""
    entering = {}
    for key, plain in dumped.items():
        value, path = getattr(section, key), f"{name}{key}"
        if path in _FROM_THE_FIRST or value != type(section).model_fields[key].get_default():
            is_section = isinstance(value, BaseModel) and not name
            entering[key] = _stated(value, plain, f"{key}.") if is_section else plain
    return entering


def save_knowledge(path: Path, knowledge: Knowledge, model: InjectorParameters) -> None:
    """Replace the file by knowledge for a model, in one step. Raises `RunError`; the old file is then unchanged."""
    if problem := _problem_of(knowledge, model.scaling.pressure):
        raise RunError(f"{path}: what was learned is not saved, for {problem}")
    arrays = ArrayTexts()
    try:
        content = to_plain(
            _Content(
                __version__,
                model_hash(model),
                SCALARS.names,
                knowledge.phi_version,
                knowledge.in_force,
                dict(_finite_parts(to_plain(knowledge.state), arrays)),
                knowledge.lift,
                tuple(arrays.texts),
            )
        )
        document = {"version": VERSION, "sha256": _digest(content), "content": content}
        with replacing(path) as part:
            part.write_text(_json(document) + "\n", encoding="ascii")
    except ValueError:
        raise RunError(f"{path}: what was learned is not saved, for some of it is not finite") from None
    except OSError as error:
        raise RunError(f"{path}: the learned state cannot be written: {error.strerror or error}") from error


def load_knowledge(path: Path, model: InjectorParameters, set_aside: bool = True) -> RestoredKnowledge:
    """Restore what `save_knowledge` wrote for the same model.

    A file of another model, damaged or impossible is renamed to `NAME.set-aside-N`, or refused without `set_aside`.
    Raises `StateDoesNotFitError` if refused, `UserError` if it cannot be read or set aside.
    """
    path = Path(os.path.realpath(path))
    try:
        if path.exists() and not path.is_file():
            raise UserError(str(path), "is no file", "name a file for the learned state")
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        if not path.parent.is_dir():
            raise UserError(str(path), "is in no existing folder", "create the folder first") from None
        return RestoredKnowledge(None, f"no learned state at {path}, starting from the prior")
    except OSError as error:
        raise UserError(str(path), f"cannot be read: {error.strerror}", "check path and rights") from None
    try:
        knowledge = _knowledge_in(data, model)
        if problem := _problem_of(knowledge, model.scaling.pressure) or _doubt_of(knowledge):
            raise _UnusableError(problem)
    except _UnusableError as reason:
        if not set_aside:
            raise StateDoesNotFitError(
                str(path), f"is no learned state for this model: {reason}", "name another file, or none"
            ) from None
        refuse_other_kind("learned state", path, LEARNED_STATE)  # only what was one is ever set aside
        warning = f"warning: learned state not restored, for {reason}; kept as {_set_aside(path)}"
        return RestoredKnowledge(None, f"{warning}\n  remedy: {BEGUN_ANEW}")
    learned = f"correction {knowledge.phi_version}, learned from {knowledge.state.events} events"
    return RestoredKnowledge(knowledge, f"learned state restored from {path}: {learned}")


def _finite_parts(state: Mapping[str, Any], arrays: ArrayTexts) -> Iterator[tuple[str, Any]]:
    """Parts of the state without their arrays. Raises ValueError where a needed one is not finite."""
    for name, value in state.items():
        try:
            part = arrays.take_out(value)
            _json(part)
        except ValueError:
            if name in _WHOLE:
                raise
        else:
            yield name, part


def _digest(content: object) -> str:
    return hashlib.sha256(_json(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _set_aside(path: Path) -> Path:
    number = 1
    while (target := path.with_name(f"{path.name}{ASIDE}{number}")).exists():
        number += 1
    try:
        path.rename(target)
    except OSError as error:
        problem = f"cannot be used, nor set aside: {error.strerror}"
        raise UserError(str(path), problem, "move it away, or name another file for the learned state") from None
    return target


def _knowledge_in(data: bytes, model: InjectorParameters) -> Knowledge:
    try:
        document = json.loads(data.decode("ascii"))
        version = document["version"]
        if version != VERSION:
            content = document.get("content")
            by = content.get("package_version") if isinstance(content, dict) else None
            by = f" (observer_rt {by} wrote it, this is {__version__})" if isinstance(by, str) else ""
            raise _UnusableError(f"its format is version {version!r}, not {VERSION}{by}")
        if document["sha256"] != _digest(document["content"]):
            raise _UnusableError("it was changed or damaged: its content does not match its checksum")
        start = no_state(LARGEST_NOISE, model.scaling.pressure)  # before any event
        content = from_plain(_Content, document["content"], SimpleNamespace(in_force=start.learned.theta))
        if (other := content.model_sha256) != (this := model_hash(model)):
            raise _UnusableError(
                f"it was learned for another injector model, SHA-256 {other[:8]}... instead of {this[:8]}..."
            )
        values = ArrayTexts(content.arrays).put_in(content.state)
        hints = get_type_hints(LearningState, include_extras=True)
        fields = {name: from_plain(hints[name], values[name], getattr(start, name), name) for name in _WHOLE}
        for name in values.keys() & set(kept_names(LearningState)) - set(_WHOLE):
            with suppress(NotAsExpectedError):
                fields[name] = from_plain(hints[name], values[name], getattr(start, name), name)
        state = replace(start, **fields)
        if content.columns != SCALARS.names:
            raise _UnusableError("it is of a version that learned other parameters")
        if not state.learned.active <= set(SCALARS.gate.columns):
            raise _UnusableError("it leaves out a parameter that cannot be left out")
        return Knowledge(state, content.in_force, content.phi_version, content.lift)
    except (ValueError, OverflowError, RecursionError, LookupError, TypeError, AttributeError) as error:
        raise _UnusableError(f"its content is not as expected ({error})") from None


def restored_knowledge(
    path: Path | None, model: InjectorParameters, tell: Callable[[str], None], set_aside: bool = True
) -> Knowledge | None:
    """A state file's knowledge for this model, reported; None without a file, or where it learned from no event."""
    if path is None:
        return None
    outcome = load_knowledge(path, model, set_aside)
    tell(outcome.message)
    return outcome.knowledge if outcome.knowledge and outcome.knowledge.state.events else None


def learned_beside(injector_file: Path) -> Path:
    """File of what was learned for an amended injector file before it was taken over."""
    return injector_file.with_suffix(".learned.json")


def knowledge_beside(injector_file: Path, model: InjectorParameters, tell: Callable[[str], None]) -> Knowledge | None:
    """Reads what `learned_beside` has for this model, and reports what became of it; None without, or if refused."""
    path = learned_beside(injector_file)
    if not path.exists():
        return None
    try:
        return restored_knowledge(path, model, tell, set_aside=False)
    except UserError as error:
        tell(f"warning: {error.location} {error.problem}; learning begins anew")
        return None


def _problem_of(knowledge: Knowledge, pressure_scale: float) -> str | None:
    """Fault that makes knowledge impossible or implausible, in words, or None; pressure_scale: p_0 [Pa]."""
    state, belief = knowledge.state, knowledge.state.learned.belief
    lowest, highest = SCALARS.bounds(pressure_scale)
    if np.any(knowledge.in_force < lowest) or np.any(knowledge.in_force > highest):
        return "the parameters in force lie beyond what an injector can do"
    # the mean is free of the bounds' signs: it may say that a leak is slightly negative
    if np.any(np.abs(belief.mean) > np.maximum(-lowest, highest)):
        return "the mean lies beyond what an injector can do"
    covariances = {"the covariance": belief.covariance, "the error's covariance": belief.error_covariance}
    for name, covariance in covariances.items():
        if not np.array_equal(covariance, covariance.T) or not _is_positive_definite(covariance):
            return f"{name} is not symmetric and positive definite"
    if odd := state.noise.implausible:
        return f"the noise of the {odd[0].replace('_', ' ')} is {getattr(state.noise, odd[0]):g} (SI units)"
    lift = knowledge.lift
    is_drift = abs(lift.zero) <= FURTHEST_ZERO and 0.0 <= lift.wander <= FURTHEST_ZERO
    if not (is_drift and abs(lift.crosstalk) <= MOST_CROSSTALK):
        return f"the lift of a shut needle shows more than a sensor's drift: {lift}"
    return None


def _doubt_of(knowledge: Knowledge) -> str | None:
    """Reason why every event would be refused with restored knowledge, in words, or None.

    A later run may have other signals. An offset is no reason: one that follows the rail pressure is a gain.
    """
    for theta in (knowledge.state.learned.belief.mean, knowledge.in_force):
        lag = sensor_lag(theta)
        if lag > LARGEST_LAG:
            return f"its lag of the line-pressure sensor, {lag * 1e3:.2g} ms, is more than {LARGEST_LAG * 1e3:g} ms"
        if is_worn_beyond_limits(theta):
            return "its nozzle or seat is at the limit of what an injector can do"
    return None


def _is_positive_definite(matrix: Floats) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
