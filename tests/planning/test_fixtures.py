"""Fixtures become loads in the record's units, inside the limits, and nothing else does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from toolkit.declared import read
from toolkit.declared.text import read_text
from toolkit.errors import ConfigError
from toolkit.machine.hub import LoadingFixtures
from toolkit.planning.fixtures import FeasibleLoads, loads_of_fixtures
from toolkit.planning.knowledge import Knowledge
from toolkit.units import to_si

TEXT = """schema = 1
instrument = "m15-virtual"
[limit]
FY = { value = 4448.2216152605, unit = "N" }
[[fixture]]
name = "lateral pull"
per_newton = { FY = 1.0 }
weights = { value = [500, 1000, 1500], unit = "lbf" }
minutes = 3
[[fixture]]
name = "couple"
per_newton = { MZ = 0.5, FY = 0.1 }
weights = { value = [100], unit = "N" }
both = false
"""


def made(folder: Path, knowledge: Knowledge, text: str = TEXT) -> FeasibleLoads:
    path = folder / "fixtures.toml"
    path.write_text(text)
    return loads_of_fixtures(read(LoadingFixtures, path), knowledge.record, path)


def test_weights_become_loads_in_the_records_units(tmp_path: Path, knowledge: Knowledge) -> None:
    feasible = made(tmp_path, knowledge)
    FY = feasible.loads[:, 0]
    # The record is in lbf and lbf·ft: 500 and 1000 lbf both ways, 1500 lbf is beyond 1000 lbf (4448.2 N).
    assert np.sort(FY)[:2] == pytest.approx([-1000, -500])
    assert np.sort(FY)[-2:] == pytest.approx([500, 1000])
    assert feasible.refused == 2
    couple = feasible.mount.index("couple")
    assert feasible.loads[couple, 1] == pytest.approx(100 * 0.5 / (4.4482216152605 * 0.3048))
    assert feasible.loads[couple, 0] == pytest.approx(10 / 4.4482216152605)
    assert feasible.mount[0] == ""
    assert not feasible.loads[0].any()


def test_the_top_of_a_mount_is_not_reached_from_above(tmp_path: Path, knowledge: Knowledge) -> None:
    feasible = made(tmp_path, knowledge)
    below = feasible.unloadable()
    assert sorted(np.abs(feasible.loads[below, 0]).round().tolist()) == [0, 500, 500]


def test_loads_of_a_session_are_those_it_put_on(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    names = list(knowledge.names)
    rows = np.concatenate([knowledge.loads.matrix(names), knowledge.check.matrix(names)])  # type: ignore[union-attr]
    largest = np.abs(rows).max(axis=0)
    for load in feasible.loads[1:]:
        assert (np.abs(rows - load) / largest).max(axis=1).min() == 0
    distance = np.abs(rows[:, None] / largest - feasible.loads / largest).max(axis=2).min(axis=1)
    assert distance.max() < 0.021  # every load that was put on is there, within what counts as one load
    assert feasible.minutes is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("per_newton = { FY = 1.0 }", "per_newton = { FX = 1.0 }", "FX"),
        ("per_newton = { FY = 1.0 }", "per_newton = { FY = 0.0 }", "makes no load"),
        ('weights = { value = [100], unit = "N" }', 'weights = { value = [], unit = "N" }', "weights"),
        ('weights = { value = [100], unit = "N" }', 'weights = { value = [-1], unit = "N" }', "weights"),
        ('name = "couple"', 'name = "lateral pull"', "lateral pull"),
        ("value = 4448.2216152605", "value = 0.001", "limits leave no weight"),
    ],
)
def test_fixtures_that_cannot_serve_are_refused(
    tmp_path: Path, knowledge: Knowledge, old: str, new: str, said: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        made(tmp_path, knowledge, TEXT.replace(old, new))
    assert said in str(refused.value)


def test_an_empty_list_of_fixtures_is_refused(tmp_path: Path, knowledge: Knowledge) -> None:
    with pytest.raises(ConfigError) as refused:
        made(tmp_path, knowledge, 'schema = 1\ninstrument = "m15-virtual"\nfixture = []\n')
    assert "fixture" in str(refused.value)


def test_a_load_far_beyond_what_was_put_on_is_left_out(tmp_path: Path, knowledge: Knowledge) -> None:
    text = TEXT.replace('[limit]\nFY = { value = 4448.2216152605, unit = "N" }\n', "")
    largest = knowledge.record.load("FY").largest
    assert 1500 < 1.1 * largest < 20_000
    feasible = made(tmp_path, knowledge, text.replace("1500]", "1500, 20000]"))
    assert np.abs(feasible.loads[:, 0]).max() == pytest.approx(1500)
    assert feasible.refused == 2
    stated = read(LoadingFixtures, tmp_path / "fixtures.toml")
    rated = loads_of_fixtures(stated, knowledge.record, "rig", {"FY": to_si(1000.0, "lbf")})
    assert np.abs(rated.loads[:, 0]).max() == pytest.approx(1000)


def test_a_load_of_zero_has_no_sign(tmp_path: Path, knowledge: Knowledge) -> None:
    loads = made(tmp_path, knowledge).loads
    assert not np.signbit(loads[loads == 0]).any()


def test_of_thousands_of_fixtures_a_search_weighs_those_that_differ(knowledge: Knowledge) -> None:
    """Every force comes twice, slowly first: the largest of both senses stay, and the quick ones."""
    stated = "".join(
        f'''[[fixture]]
name = "{name} {force}"
per_newton = {{ FY = 1.0 }}
weights = {{ value = [{force}], unit = "N" }}
minutes = {minutes}
'''
        for force in range(1000, 3000)
        for name, minutes in (("slow", 9), ("quick", 2))
    )
    stated = 'instrument = "m15-virtual"\n' + stated
    read_in = read_text(LoadingFixtures, stated.encode(), where="fixtures.toml")
    every = loads_of_fixtures(read_in, knowledge.record, "fixtures.toml")
    few = every.few()
    assert 500 < len(few.mount) <= 600
    assert few.mounts_left_out == len({*every.mount}) - len({*few.mount})
    assert {*few.loads[:, 0]} >= {every.loads[:, 0].min(), every.loads[:, 0].max(), 0.0}
    assert not [mount for mount in few.mount if mount.startswith("slow")]
    steps = np.diff(np.sort(few.loads[few.loads[:, 0] > 0, 0]))
    assert steps.max() < 2.5 * np.median(steps)
    assert few.few() is few
