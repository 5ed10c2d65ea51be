"""Names chosen on the command line."""

from collections.abc import Collection

from observer_rt.foundation.errors import UserError


def chosen_names(text: str, option: str, known: Collection[str], default: Collection[str]) -> tuple[str, ...]:
    """Names by commas, else the default. Raises `UserError` for one that is not known."""
    names = tuple(name for name in text.split(",") if name) or tuple(default)
    for name in names:
        if name not in known:
            raise UserError(option, f"unknown name '{name}'", f"known: {', '.join(known)}")
    return names
