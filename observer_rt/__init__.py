"""Real-time neural-network observer of a common-rail injector's injection rate over CAN.

The library, in a notebook or a script (`import observer_rt as ort`):

- `read`: a recording from a file, a DataFrame or arrays
- `Injector`: a model; `fit`, `evaluate` and `discover` take recordings, `fit_map` a table of masses
- `Observer`: fed sample by sample, in physical units
- `simulate`: a recording of a healthy or worn injector
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from observer_rt.foundation.version import __version__ as __version__

if TYPE_CHECKING:
    from observer_rt.desk.library.fit import FitResult, MapResult
    from observer_rt.desk.library.injector import DiscoveryResult as Discovery
    from observer_rt.desk.library.injector import Injector
    from observer_rt.desk.library.notes import ObserverWarning
    from observer_rt.desk.library.observer import SampleObserver as Observer
    from observer_rt.desk.library.recordings import read, to_frame
    from observer_rt.desk.library.results import EvaluationResult
    from observer_rt.desk.library.simulation import simulate
    from observer_rt.foundation.errors import UserError

__all__ = [
    "Discovery",
    "EvaluationResult",
    "FitResult",
    "Injector",
    "MapResult",
    "Observer",
    "ObserverWarning",
    "UserError",
    "read",
    "simulate",
    "to_frame",
]
_PLACES = {
    "Discovery": "desk.library.injector.DiscoveryResult",
    "EvaluationResult": "desk.library.results.EvaluationResult",
    "FitResult": "desk.library.fit.FitResult",
    "Injector": "desk.library.injector.Injector",
    "MapResult": "desk.library.fit.MapResult",
    "Observer": "desk.library.observer.SampleObserver",
    "ObserverWarning": "desk.library.notes.ObserverWarning",
    "UserError": "foundation.errors.UserError",
    "read": "desk.library.recordings.read",
    "simulate": "desk.library.simulation.simulate",
    "to_frame": "desk.library.recordings.to_frame",
}


def __getattr__(name: str) -> Any:
    """A name of the library, its module imported when it is first asked for: the daemon needs none of them."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _PLACES[name].rpartition(".")
    return getattr(import_module(f"{__name__}.{module}"), attribute)


def __dir__() -> list[str]:
    return sorted([*globals(), *_PLACES])
