"""Another process can compile what learning calls: it learns from the bench's own injections without a failure."""

from pathlib import Path

from observer_rt.config.bench import load_bench
from observer_rt.service.warm_up import learning_compiled_beside


def test_it_comes_to_its_end(bench: Path) -> None:
    with learning_compiled_beside(load_bench(bench).injector) as wait:
        assert wait() == 0
