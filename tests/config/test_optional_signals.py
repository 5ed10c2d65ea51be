"""A new optional input is a role with its row, its section, and its example."""

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.config.signals import OPTIONAL_SIGNALS, OptionalRole, SignalsConfig


@pytest.mark.parametrize("role", OptionalRole)
def test_every_role_has_row_section_and_example(role: OptionalRole) -> None:
    row = OPTIONAL_SIGNALS[role]
    assert row.units is None or row.origins is None
    assert row.possible[0] <= row.possible[1]
    assert role.value in SignalsConfig.model_fields
    assert f"[signals.{role.value}]" in EXAMPLE_BENCH.read_text("utf-8")
