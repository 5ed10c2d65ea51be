"""Commands share this: the declaration of their options for typer, and the console of their messages."""

from collections.abc import Callable
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from rich.console import Console

from observer_rt.config.bench import Bench, load_bench
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.options import Argument

messages = Console(stderr=True)


def with_options(work: Callable[..., None]) -> Callable[..., None]:
    """A command of typer whose options are the parameters of `work`, or the fields of its one argument `options`."""
    record = get_type_hints(work).get("options")
    parameters = [
        parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=_annotation(parameter.name, parameter.annotation))
        for parameter in signature(record or work).parameters.values()
    ]

    @wraps(work)
    def command(**values: Any) -> None:
        stated = {name: value for name, value in values.items() if value is not None}
        options = {name: tuple(value) if isinstance(value, list) else value for name, value in stated.items()}
        work(record(**options)) if record else work(**options)

    command.__dict__["__signature__"] = Signature(parameters)
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def _annotation(name: str, hint: Any) -> Any:
    """The declaration of an option for typer."""
    kind, said = get_args(hint)
    if get_origin(kind) is tuple:
        kind = list[get_args(kind)[0]] | None  # type: ignore[misc]
    parameter: Any
    if isinstance(said, Argument):
        parameter = typer.Argument(help=said.purpose, metavar=said.metavar, show_default=False)
    else:
        parameter = typer.Option(
            f"--{name.replace('_', '-')}",
            help=said.purpose,
            metavar=said.metavar or ("FILE" if "Path" in str(kind) else None),
            show_default="(default: " not in said.purpose,
            min=said.minimum,
            max=said.maximum,
        )
    return Annotated[kind, parameter]


def decoder_of(bench: Path | None, injector: str | None, model: Path | None = None) -> Bench | None:
    """The bench of `--bench`, with the injector of `--injector` only; None without one.

    Raises `UserError` for files that do not fit, and for an injector of no bench file.
    """
    if bench is not None:
        return load_bench(bench, model, off_bus=True).of(injector)
    if injector is not None:
        raise UserError(f"--injector {injector}", "names one of a bench file", "give that by --bench")
    return None
