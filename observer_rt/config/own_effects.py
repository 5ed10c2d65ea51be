"""Effects of the user's own, from Python files and installed packages: checked, and the same in every process."""

import hashlib
import math
import re
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_file_location
from itertools import product
from pathlib import Path
from types import ModuleType
from typing import Any, Self

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import UserError, hint
from observer_rt.model.effect import Effect, EffectParameter, Place, Relation, differs_in_bounds_only
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import BUILT_IN, add_to_vocabulary, added_digests, effective_model
from observer_rt.model.parameters import InjectorParameters

GROUP = "observer_rt.effects"
_EXAMPLE = "docs/effects.md has a complete example"
_ID = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class _Defined:
    """A file with the effects it defines; place: how a message names it."""

    place: str
    effects: tuple[Effect, ...]
    digest: str


def use_effects(paths: Sequence[Path]) -> None:
    """Have the effects of these files and of installed packages, and no others, beside the vocabulary's own.

    One of the vocabulary's own may be there within other bounds.

    Raises `UserError` naming file, what is wrong with it and how to mend it.
    """
    sources = [_from_file(path) for path in paths] + [_installed(one) for one in entry_points(group=GROUP)]
    defined = [(source.place, effect) for source in sources for effect in source.effects]
    known = dict(BUILT_IN)
    for place, effect in defined:
        before = known.get(effect.id)
        is_built_in = before is BUILT_IN.get(effect.id)
        if before is not None and not (is_built_in and differs_in_bounds_only(effect, before)):
            problem = f"'{effect.id}' is an effect already"
            raise UserError(place, problem, "give it another id, and every file once")
        known[effect.id] = effect
    for place, effect in defined:
        _check(f"{place}: {effect.id}", effect, known)
    add_to_vocabulary([effect for _, effect in defined], [source.digest for source in sources])


def _from_file(path: Path) -> _Defined:
    place = f"--effects {path}"
    spec = spec_from_file_location(f"{__name__}.{path.stem}", path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise UserError(place, "is no Python file", f"give a file whose name ends in .py; {_EXAMPLE}")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        line = _line_in(path, error)
        raise UserError(f"{place}{line}", f"does not run: {error!r}", "mend the file") from None
    return _source(place, module, path)


def _installed(point: EntryPoint) -> _Defined:
    place = f"installed effects '{point.name}' ({point.value})"
    try:
        found = point.load()
    except (Exception, SystemExit) as error:
        raise UserError(place, f"cannot be loaded: {error!r}", "mend or remove the package") from None
    return _source(place, found, Path(sys.modules[point.module].__file__ or ""))


def _source(place: str, found: Any, path: Path) -> _Defined:
    """The effects that a module defines, or the one that was found instead of a module."""
    values = vars(found).values() if isinstance(found, ModuleType) else [found]
    built_in = BUILT_IN.values()
    effects = [value for value in values if isinstance(value, Effect) and value not in built_in]
    if not effects:
        raise UserError(place, "defines no effect", f"write EFFECT = Effect(...); {_EXAMPLE}")
    return _Defined(place, tuple(effects), hashlib.sha256(path.read_bytes()).hexdigest())


def _line_in(path: Path, error: BaseException) -> str:
    """The line of the file an error came from, as in `:12`; nothing when it is none of its lines."""
    if isinstance(error, SyntaxError):
        return f":{error.lineno}"
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
    return f":{lines[-1]}" if lines else ""


def _check(place: str, effect: Effect, known: Mapping[str, Effect]) -> None:
    """Refuse an effect for the first of its faults."""
    try:
        fault = next(_faults(effect, known), None)
    except Exception as error:  # fields of quite another type
        raise UserError(place, f"cannot be used: {error!r}", _EXAMPLE) from None
    if fault is not None:
        raise UserError(place, *fault)


def _faults(effect: Effect, known: Mapping[str, Effect]) -> Iterator[tuple[str, str]]:
    """Faults of an effect, each with its remedy."""
    if not _ID.fullmatch(effect.id):
        yield "is no id", "use small letters, digits and underscores"
    if not (effect.sentence and effect.signature):
        yield "has no sentence or no signature", "reports print them: say what it is, and how it shows"
    if effect.place not in tuple(Place):
        yield f"'{effect.place}' is no place", f"places: {', '.join(f'Place.{one.name}' for one in Place)}"
    for name, values, kind in (
        ("parameters", effect.parameters, EffectParameter),
        ("relations", effect.relations, Relation),
    ):
        if not isinstance(values, tuple) or not all(isinstance(value, kind) for value in values):
            yield f"'{name}' is no tuple of {kind.__name__}", f"write {name}=(...,), with the comma"
    if len({p.name for p in effect.parameters}) < len(effect.parameters):
        yield "has two parameters of one name", "rename one"
    for number, one in enumerate(effect.parameters):
        yield from _faults_of(one, is_size=number == 0)
    for other in (other for relation in effect.relations for other in relation.others):
        if other not in known or other == effect.id:
            yield f"is related to '{other}', which is no other effect{hint(other, known)}", "correct the id"
    yield from _faults_of_law(effect)


def _faults_of(one: EffectParameter, is_size: bool) -> Iterator[tuple[str, str]]:
    """Faults of a parameter, each with its remedy; the first parameter is the effect's size, others shape it."""
    if not (one.name.isidentifier() and one.unit):
        yield f"parameter '{one.name}' has no name or no unit", 'give both; the unit of a share is "-"'
    if not (one.si > 0.0 and math.isfinite(one.si)):
        yield f"parameter {one.name}: one {one.unit} is {one.si} in SI", "give how much it is in SI, above 0"
    if not (one.lowest < one.highest and math.isfinite(one.highest - one.lowest)):
        yield f"parameter {one.name} has no range", "give finite bounds, the lowest first"
    inside = [one.lowest <= value <= one.highest for value in (one.off, *one.starts)]
    if not (one.starts and all(inside)):
        yield (
            f"parameter {one.name}: 'off' or a start is out of bounds",
            "put them within, with one start at least",
        )
    if not (0.0 < one.dead_zone < math.inf or (one.dead_zone == 0.0 and not is_size)):
        yield f"parameter {one.name} has no dead zone", "give the size below which the effect does not matter"


def _faults_of_law(effect: Effect) -> Iterator[tuple[str, str]]:
    """Faults of `apply`, tried on the nominal injector and on what it has made of it."""
    nominal = effective_model(load_injector())
    made = []
    for values in product(*((p.lowest, p.highest) for p in effect.parameters)):
        sizes = ", ".join(
            f"{p.name} = {v / p.si:g} {p.unit}" for p, v in zip(effect.parameters, values, strict=True)
        )
        at = f"apply at {sizes}" if sizes else "apply"
        try:
            made.append(effect.apply(nominal, values))
            problem = _unsound(made[-1])
        except Exception as error:
            problem = f"fails: {error!r}"
        if problem:
            yield f"{at}: {problem}", "mend the law, or set narrower bounds"
    off = tuple(p.off for p in effect.parameters)
    if off and any(effect.apply(model, off) != model for model in (nominal, *made)):
        yield "apply changes a model at the 'off' values", "return the model as it is there"
    if all(model == nominal for model in made):
        yield "apply changes nothing, even at the bounds", "return the changed model"


def _unsound(model: Any) -> str:
    """Reason why a model is none the program can run; empty when it is."""
    if not isinstance(model, EffectiveModel):
        return f"gives {type(model).__name__}, not an EffectiveModel"
    InjectorParameters.model_validate(model.injector.model_dump())
    terms = (model.coefficients, model.departures, model.inputs, model.sensor)
    return "" if all(map(math.isfinite, _numbers(terms))) else "gives numbers that are not finite"


def _numbers(values: tuple[Any, ...]) -> Iterator[float]:
    for value in values:
        if isinstance(value, tuple):
            yield from _numbers(value)
        else:
            yield value


@dataclass(frozen=True)
class OwnEffects:
    """Files with effects of the user's own; digests: of their content, and of installed effects."""

    paths: tuple[Path, ...] = ()
    digests: tuple[str, ...] = ()

    @classmethod
    def in_use(cls, paths: Sequence[Path]) -> Self:
        """Effects of this process, read from these files."""
        return cls(tuple(path.absolute() for path in paths), added_digests())

    def use(self) -> None:
        """Have them in the vocabulary, and no others. Raises `UserError` where a worker has other ones."""
        if added_digests() == self.digests:
            return
        use_effects(self.paths)
        if added_digests() != self.digests:
            raise UserError(
                "worker",
                "has other effects of your own, or other installed ones, than this command",
                "have the same files and packages wherever a worker runs",
            )
