"""`tools/bench`: the figures the work is judged by. Each benchmark's module adds its commands."""

import sys

from rich.markup import escape

from observer_rt.foundation.errors import ObserverError
from tools.benchmarks import accuracy, batch, damage, injections, loop, networks, numbers  # noqa: F401
from tools.benchmarks.campaign import messages
from tools.benchmarks.command_line import app
from tools.benchmarks.discovery import command as discovery  # noqa: F401
from tools.benchmarks.faults import command as faults  # noqa: F401
from tools.benchmarks.speed import command as speed  # noqa: F401


@app.callback()
def bench() -> None:
    """Measures the observer; each command prints tables, and figures beside their bars."""


def main() -> None:
    """Entry point."""
    try:
        app()
    except ObserverError as error:
        messages.print(f"[red]error:[/red] {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
