"""The build of the compiled core: stubs that state what there is, an edit that is built upon import."""

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import Cython
import numpy as np
import pytest

REPOSITORY = Path(__file__).parents[2]
LAW = """
\"\"\"A trial.\"\"\"
from observer_rt.core.law cimport doubled

def twice(double value):
    \"\"\"Two times it.\"\"\"
    return doubled(value)
"""
HEADER = "cdef inline double doubled(double value) noexcept nogil:\n    return {factor}.0 * value\n"


def run(command: list[str], **options: object) -> str:
    ran = subprocess.run(command, capture_output=True, text=True, **options)  # type: ignore[call-overload]
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return str(ran.stdout)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package laid out as this one, with a core of one law and one module, built; each test edits it further."""
    folder = tmp_path_factory.mktemp("package")
    core = folder / "observer_rt" / "core"
    core.mkdir(parents=True)
    (folder / "tools" / "lib").mkdir(parents=True)
    for name in ("build_core.py", "core_stubs.py"):
        shutil.copy(REPOSITORY / "tools" / "lib" / name, folder / "tools" / "lib")
    for name in ("__init__.py", "meson.build", "meson.options"):
        shutil.copy(REPOSITORY / "observer_rt" / "core" / name, core)
    (core.parent / "__init__.py").touch()
    (core / "trial.pyx").write_text(LAW)
    (core / "law.pxd").write_text(HEADER.format(factor=2))
    assert twice(folder, 3.0) == 6.0
    return folder


def edited(package: Path) -> float:
    """The law's next factor, in a header that trial.pyx includes."""
    header = package / "observer_rt" / "core" / "law.pxd"
    factor = int(re.findall(r"return (\d+)", header.read_text())[0]) + 1
    header.write_text(HEADER.format(factor=factor))
    return float(factor)


def twice(package: Path, value: float) -> float:
    """Asked of a process that imports the package's core."""
    program = f"from observer_rt.core.trial import twice; print(twice({value}))"
    return float(run([sys.executable, "-c", program], cwd=package, env=environment()))


def environment() -> dict[str, str]:
    """Without the package, sanitizers and the kind of core of the tests."""
    others = ("PYTHONPATH", "LD_PRELOAD", "OBSERVER_RT_CHECKED_CORE")
    return {name: value for name, value in os.environ.items() if name not in others}


@pytest.mark.parametrize(
    "source", sorted((REPOSITORY / "observer_rt" / "core").rglob("*.pyx")), ids=lambda path: path.stem
)
def test_a_stub_states_all_that_python_sees(source: Path) -> None:
    module = importlib.import_module(".".join(source.relative_to(REPOSITORY).with_suffix("").parts))
    names = {
        name
        for name, value in vars(module).items()
        if getattr(value, "__module__", None) == module.__name__ or isinstance(value, int | float | tuple | np.dtype)
    }
    stated = re.findall(r"^(?:def |class |)(\w+)[:(]", source.with_suffix(".pyi").read_text(), re.MULTILINE)
    assert set(stated) == {name for name in names if not name.startswith("_")}


@pytest.mark.slow
def test_importing_builds_what_was_edited_and_nothing_else(package: Path) -> None:
    built = (package / "observer_rt" / "core" / "trial.abi3.so").stat().st_mtime_ns
    before = twice(package, 4.0)
    assert (package / "observer_rt" / "core" / "trial.abi3.so").stat().st_mtime_ns == built
    assert edited(package) == twice(package, 1.0) != before / 4.0


@pytest.mark.slow
def test_an_edit_after_pip_built_apart_builds_nothing_else(package: Path, tmp_path: Path) -> None:
    """The compiler of Cython that pip had is gone by then, with its headers."""
    core, passing, cython = package / "observer_rt" / "core", tmp_path / "passing", Path(Cython.__file__).parent
    (core / "root.pyx").write_text("from libc.math cimport sqrt\n\ndef root(double x):\n    return sqrt(x)\n")
    shutil.copytree(cython, passing / "Cython")
    shutil.copy(cython.with_name("cython.py"), passing)
    build = [sys.executable, str(package / "tools" / "lib" / "build_core.py")]
    run(build, env=environment() | {"PYTHONPATH": str(passing)})
    shutil.rmtree(passing)
    built = (core / "root.abi3.so").stat().st_mtime_ns
    assert edited(package) == twice(package, 1.0)
    assert (core / "root.abi3.so").stat().st_mtime_ns == built


@pytest.mark.slow
def test_where_nothing_builds_an_edit_the_command_that_does_is_named(package: Path) -> None:
    """As after an update of a checkout that was installed without what developers need."""
    edited(package)
    program = (
        "import shutil; shutil.which = lambda *_, **__: None\n"
        "try:\n    import observer_rt.core\n"
        "except ImportError as error:\n    print(error.name, error)"
    )
    ran = run([sys.executable, "-c", program], cwd=package, env=environment() | {"CC": "cc"})
    assert ran.startswith("observer_rt.core the compiled core is older than its sources")
    assert f"pip install -e '{package}'" in ran


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["cdef int f(int[::1] x):\n    return x[-1]\n", "def f(:\n"])
def test_what_does_not_compile_without_warning_is_said_with_its_line(package: Path, wrong: str) -> None:
    module = package / "observer_rt" / "core" / "trial.pyx"
    module.write_text(wrong)
    command = [sys.executable, "tools/lib/build_core.py"]
    ran = subprocess.run(command, cwd=package, env=environment(), capture_output=True, text=True)
    module.write_text(LAW)
    assert ran.returncode == 1
    said = ran.stdout + ran.stderr
    assert "trial.pyx:" in said
    assert "Traceback" not in said
