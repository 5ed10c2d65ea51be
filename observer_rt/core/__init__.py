"""The compiled core: every loop that runs once a sample, in Cython. Knows no Python module of the package.

Where the sources of its build stand beside it, an editable install, importing it builds what was edited.
"""

import importlib.util
from pathlib import Path

_BUILD = Path(__file__).resolve().parents[2] / "tools" / "lib" / "build_core.py"

if _BUILD.is_file():
    _spec = importlib.util.spec_from_file_location("observer_rt.core._build", _BUILD)
    assert _spec is not None
    assert _spec.loader is not None
    _build = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(_build)
    try:
        _build.rebuild_if_edited()
    except _build.CoreBuildError as error:
        raise ImportError(str(error), name=__name__) from None
