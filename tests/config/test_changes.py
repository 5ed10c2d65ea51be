"""What a bench file and the files it names say otherwise than before."""

from pathlib import Path

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, changes, content_of, load_bench


def test_keys_are_named_with_both_values(tmp_path: Path) -> None:
    injector, database, path = (tmp_path / name for name in ("injector.toml", "mine.dbc", "bench.toml"))
    injector.write_text(NOMINAL_INJECTOR.read_text())
    database.write_bytes(EXAMPLE_BENCH.with_name("observer_fd.dbc").read_bytes())
    text = EXAMPLE_BENCH.read_text().replace('"observer_fd.dbc"', '"mine.dbc"', 1)
    path.write_text(text.replace("# file = ", "file = ", 1))
    before = content_of(load_bench(path))
    assert changes(before, content_of(load_bench(path))) == []
    path.write_text(
        path.read_text().replace("bridge_ms = 0.5", "bridge_ms = 1").replace('"can0"', '"can1"', 1)
    )
    injector.write_text(injector.read_text().replace("holes = 8", "holes = 9"))
    assert changes(before, content_of(load_bench(path))) == [
        "link.channel can0 -> can1",
        "sampling.bridge_ms 0.5 -> 1.0",
        "model: nozzle.holes 8 -> 9",
    ]


def test_a_database_of_other_content_is_one(tmp_path: Path) -> None:
    database, path = tmp_path / "mine.dbc", tmp_path / "bench.toml"
    database.write_bytes(EXAMPLE_BENCH.with_name("observer_fd.dbc").read_bytes())
    path.write_text(EXAMPLE_BENCH.read_text().replace('"observer_fd.dbc"', '"mine.dbc"', 1))
    before = content_of(load_bench(path))
    database.write_bytes(database.read_bytes() + b"\n")
    assert changes(before, content_of(load_bench(path))) == [f"{database}: other content"]
