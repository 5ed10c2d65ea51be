"""Where tables go."""

from rich.console import Console


def screen(width: int) -> Console:
    """Stdout; so many columns wide where it is no terminal."""
    console = Console()
    return console if console.is_terminal else Console(width=width)
