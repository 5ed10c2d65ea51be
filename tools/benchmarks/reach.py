"""`python -m tools.benchmarks.reach`: lines of the package that no test reaches, tests that reach none alone.

To be asked before code or tests go; build/coverage has both lists. Each line is noted under the test that reached it,
also in processes that the test started. It takes three times as long; the compiled core is not seen.
"""

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import coverage
import pytest

PACKAGE = Path("observer_rt").absolute()
FOLDER = Path("build/coverage").absolute()
CONFIGURATION = f"""[run]
include = {PACKAGE}/*
data_file = {FOLDER}/lines
parallel = true
patch = _exit
sigterm = true
context = ${{PYTEST_CURRENT_TEST-}}
"""  # of a process that a test started: the test that was running


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Note lines under this test."""
    if running := coverage.Coverage.current():
        running.switch_context(item.nodeid)
    return (yield)


def main() -> None:
    """Run the tests, put together what their processes noted, and write the lists."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    settings = FOLDER / "settings"
    settings.write_text(CONFIGURATION)
    command = [sys.executable, "-m", "pytest", "-p", "tools.benchmarks.reach", *sys.argv[1:]]
    subprocess.run(command, env={**os.environ, "COVERAGE_PROCESS_START": str(settings)}, check=False)
    (lines := coverage.Coverage(config_file=str(settings))).combine([str(FOLDER)])
    reached, unreached, total, missed = dict[str, set[tuple[Path, int]]](), list[str](), 0, 0
    for path in sorted(PACKAGE.rglob("*.py")):
        _, statements, _, missing, ranges = lines.analysis2(str(path))
        total, missed = total + len(statements), missed + len(missing)
        unreached += [f"{path.relative_to(PACKAGE)}: {ranges}"] * bool(missing)
        for number, contexts in lines.get_data().contexts_by_lineno(str(path)).items():
            for test in {each.removesuffix(" (call)").removesuffix(" (setup)") for each in contexts}:
                reached.setdefault(test, set()).add((path, number))
    tests = Counter(line for found in reached.values() for line in found)
    contained = [test for test in sorted(reached) if test and all(tests[line] > 1 for line in reached[test])]
    (FOLDER / "unreached.txt").write_text("\n".join(unreached) + "\n")
    (FOLDER / "contained.txt").write_text("\n".join(contained) + "\n")
    print(f"{total - missed} of {total} lines reached; of {len(reached)} tests {len(contained)} reach none alone")


if __name__ == "__main__":
    main()
