"""Protocol files: what they say, what the machine says in their place, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from toolkit.errors import ConfigError, ToolkitError
from toolkit.machine import load_machine, read_protocol

WHOLE = """
schema = 1
source = "three angles, there and back"
slip_angles = { value = [0, 2, -2, 0], unit = "deg" }
loads = { value = [2, 4], unit = "kN" }
rotations = ["forward"]
repeats = 2
speed = { value = 10, unit = "km/h" }
speed_tolerance = { value = 0.5, unit = "km/h" }
slip_angle_tolerance = { value = 0.2, unit = "deg" }
load_tolerance = 0.02
repeat_tolerance = 0.01
settle_revolutions = 1
average_revolutions = 2
revolutions_of = "drum"
acquisition = "continuous"
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "protocol.toml"
    path.write_text(text)
    return path


def test_a_protocol_file_in_si(tmp_path: Path) -> None:
    found = read_protocol(written(tmp_path, WHOLE))
    assert found.source == "three angles, there and back"
    assert found.slip_angles_rad == pytest.approx([0, math.radians(2), math.radians(-2), 0])
    assert found.loads_N == (2000.0, 4000.0)
    assert found.rotations == ("forward",)
    assert found.speed_m_s == pytest.approx(10 / 3.6)
    assert found.speed_tolerance_m_s == pytest.approx(0.5 / 3.6)
    assert (found.settle_revolutions, found.average_revolutions, found.revolutions_of) == (1.0, 2.0, "drum")
    # 0 deg stands twice in the sequence and everything is repeated twice.
    assert [found.times(step) for step in found.slip_angles_rad] == [4, 2, 2, 4]


def test_the_default_says_that_a_drum_is_not_a_flat_belt() -> None:
    default = load_machine("m15").protocol
    assert "SAE J1987 style" in default.source
    assert "not a flat belt" in default.source
    assert (default.speed_m_s, default.rotations, default.repeats) == (None, None, 1)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("repeats = 2", "repeat = 2", "repeats"),
        ("repeats = 2", "repeats = 0", "a whole number from 1"),
        ("repeats = 2", "repeats = 1.5", "a whole number from 1"),
        ('loads = { value = [2, 4], unit = "kN" }', "", "loads"),
        ('value = [2, 4], unit = "kN"', 'value = [2, 4], unit = "deg"', "force"),
        ("value = [2, 4]", "value = [2, 2]", "each once"),
        ("value = [2, 4]", "value = [-2, 4]", "above 0 N"),
        ("value = [2, 4]", "value = []", "value = [NUMBER"),
        ("value = [2, 4]", "value = [2, nan]", "finite"),
        ("value = [0, 2, -2, 0]", "value = [0, 95]", "90 deg"),
        ("load_tolerance = 0.02", 'load_tolerance = "2 %"', "positive"),
        ("load_tolerance = 0.02", "load_tolerance = true", "positive"),
        ("settle_revolutions = 1", "settle_revolutions = -1", "from 0"),
        ("settle_revolutions = 1", "", "settle_revolutions"),
        ('revolutions_of = "drum"', 'revolutions_of = "wheel"', "tire or drum"),
        ('acquisition = "continuous"', 'acquisition = "later"', "after_settling"),
        ('rotations = ["forward"]', 'rotations = ["backward"]', "forward or reverse"),
        ('rotations = ["forward"]', "rotations = []", "each once"),
        ('source = "three angles, there and back"', 'source = ""', "where the protocol comes from"),
        ("schema = 1", "schema = 2", "1"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in WHOLE
    with pytest.raises(ToolkitError) as caught:
        read_protocol(written(tmp_path, WHOLE.replace(old, new, 1)))
    assert said in f"{caught.value}"
    assert caught.value.next_step


def test_no_file_and_no_toml(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.toml", written(tmp_path, "slip_angles = [")):
        with pytest.raises(ToolkitError) as caught:
            read_protocol(path)
        assert caught.value.exit_code == 2


def test_a_statement_of_an_uncertainty_says_who_draws_it(tmp_path: Path) -> None:
    import toolkit.machine

    text = (Path(toolkit.machine.__file__).parent / "m15.toml").read_text()
    stated = {name: load_machine("m15").stated_uncertainty(name) for name in ("FZ", "SA", "P")}
    assert (stated["FZ"].common, stated["SA"].common) == ("machine", "test")
    assert stated["SA"].u == pytest.approx(math.radians(0.05))
    assert stated["P"].u == 3500.0
    line = next(one for one in text.splitlines() if one.startswith("P = "))
    for number, wrong in enumerate(
        (
            'P = { source = "s", common = "all" }',
            'P = { source = "s", relative = -1 }',
            'P = { source = "s", u = nan }',
            'P = { source = "s", effect = "0.5" }',
            'PP = { source = "s", u = 1 }',
            line + '\nXX = { source = "s" }',
        )
    ):
        path = tmp_path / f"own{number}.toml"
        path.write_text(text.replace(line, wrong))
        with pytest.raises(ConfigError):
            load_machine(str(path))
    # The zero of the slip angle has no relative part: its scale is a statement of its own.
    path = tmp_path / "scale.toml"
    path.write_text(text.replace("SA = { u = 0.05,", "SA = { relative = 0.01, u = 0.05,"))
    with pytest.raises(ConfigError):
        load_machine(str(path))
