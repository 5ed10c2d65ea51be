"""`observer-rt evaluate` on a bench of several injectors: one after another, each with files of its own."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.command import EvaluateOptions, evaluate_files, is_folder, refuse_early
from observer_rt.evaluation.sources import without_truths
from observer_rt.foundation.errors import CombinedError, UserError
from observer_rt.recording.formats import is_log
from observer_rt.terminal.console import results, say


def evaluate_bench(bench: Bench, given: Sequence[Path], options: EvaluateOptions, console: Console) -> None:
    """Evaluate the recordings for all injectors of a bench, as `evaluate_files`.

    Files that the options name get the name of the injector where there are several: `worn.png` becomes
    `worn_left.png`, and a folder has one for each. One that cannot be evaluated, such as an injector whose messages a
    log lacks, leaves the others alone. Raises `UserError` for a recording that is one injector's, and at last
    `CombinedError` for those that were not evaluated.
    """
    if len(bench.injectors) == 1:
        evaluate_files(bench, given, options, console)
        return
    paths = without_truths(given, console)
    _refuse_plain(bench, paths)
    parts = [(each, _named(options, each.injector.name)) for each in bench.each]
    for each, own in parts:
        refuse_early(each, paths, own)
    failures: dict[str, UserError] = {}
    if options.json:
        print('{"injectors": {')
    for number, (each, own) in enumerate(parts):
        name = each.injector.name
        if options.json:
            print(f'{", " if number else ""}"{name}":')
        else:
            say(results(), f"{chr(10) if number else ''}injector {name}")
        try:
            evaluate_files(each, paths, own, console)
        except UserError as error:
            failures[name] = error
            if options.json:
                print(json.dumps({"error": str(error)}))
            else:
                say(results(), f"not evaluated: {error.problem}")
    if options.json:
        print("}}")
    if failures:
        raise CombinedError(failures)


def _refuse_plain(bench: Bench, paths: Sequence[Path]) -> None:
    """A recording has columns for one injector only, unless the bench file says which are whose."""
    for injector in bench.injectors:
        if injector.config.recording is None and (plain := [path for path in paths if not is_log(path)]):
            raise UserError(
                str(plain[0]),
                f"has the signals of one injector, {bench.path} has {len(bench.injectors)}",
                f"say whose it is, as --injector {injector.name}; or state [injectors.{injector.name}.recording]",
            )


def _named(options: EvaluateOptions, name: str) -> EvaluateOptions:
    """The options for one injector, with files of its own."""
    output = options.output
    if output is not None:
        output = output / name if is_folder(output) else _of(output, name)
    return replace(
        options,
        output=output,
        plot=_of(options.plot, name),
        state=_of(options.state, name),
        save_state=_of(options.save_state, name),
    )


def _of(path: Path | None, name: str) -> Path | None:
    return path and path.with_name(f"{path.stem}_{name}{path.suffix}")
