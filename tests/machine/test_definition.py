"""Machine definitions: the source document's figures, and what is refused."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from toolkit.errors import ConfigError, ToolkitError
from toolkit.machine import load_machine, machine_names
from toolkit.machine.definition import machine_file
from toolkit.units import from_si


def test_the_m15_as_the_source_document_prints_it() -> None:
    m15 = load_machine("m15")
    assert [c.header for c in m15.columns[:3]] == ["FZ load", "D52 (Filtered)", "D51 (Filtered)"]
    assert np.degrees(m15.protocol.slip_angles_rad).round(9).tolist() == [
        0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10,
    ]  # fmt: skip
    assert from_si(m15.protocol.loads_N, "lbf").round(9).tolist() == [250, 567, 833, 1101, 1372]
    assert m15.drum.speed_m_s == pytest.approx(2.128, abs=5e-4)
    # physics.md: one drum revolution takes 3.995 s.
    assert m15.drum.circumference_m / m15.drum.speed_m_s == pytest.approx(3.995, abs=5e-4)
    assert m15.layout.pitch_diameter_m == 0.2
    assert not m15.simulated


def test_the_virtual_machine_differs_in_its_indications_only() -> None:
    real, virtual = load_machine("m15"), load_machine("m15-virtual")
    assert {c.unit for c in virtual.indications} == {"mV/V"}
    assert {c.unit for c in real.indications} == {"lbf"}
    assert virtual.protocol == real.protocol
    assert virtual.simulated


def test_levers_of_the_drawing() -> None:
    # Equilateral triangle on a 200 mm pitch circle: apex 100 mm and base 50 mm from the centre.
    lever = dict(load_machine("m15").layout.overturning_lever_m)
    radius = load_machine("m15").layout.pitch_diameter_m / 2
    assert lever["E5"] == pytest.approx(-radius)
    assert lever["D51"] == pytest.approx(radius * math.sin(math.pi / 6))
    assert sum(lever.values()) == pytest.approx(0.0)


def _belt(folder: Path, *, revolutions_of: str = "tire") -> Path:
    """A flat belt with two cells of which no drawing is known, loads in kN."""
    text = machine_file("m15").read_text(encoding="utf-8")
    text = text.replace('circumference = { value = 8.5, unit = "m" }\n', "")
    text = text.replace('"convex"', '"flat belt"')
    text = re.sub(r"(?ms)^\[cells\].*?(?=^\[\[cell\]\])", "", text)
    text = text.replace('header = "FZ load"\nunit = "lbf"', 'header = "FZ load"\nunit = "kN"')
    text = text.replace('revolutions_of = "tire"', f'revolutions_of = "{revolutions_of}"')
    (folder / "belt.toml").write_text(text.replace('name = "m15"', 'name = "belt"'), encoding="utf-8")
    return folder / "belt.toml"


def test_a_flat_belt_has_no_circumference_and_needs_no_drawing_of_its_cells(tmp_path: Path) -> None:
    belt = load_machine(str(_belt(tmp_path)))
    assert belt.drum.circumference_m is None
    assert math.isinf(belt.drum.radius_m)  # a road without curvature
    assert (belt.layout.pitch_diameter_m, belt.layout.overturning_lever_m) == (None, ())
    assert belt.column("FZ").unit == "kN"


def test_turns_of_a_drum_need_its_circumference(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"drum\.circumference is not stated|drum\.circumference: is not stated"
    ):
        load_machine(str(_belt(tmp_path, revolutions_of="drum")))


def test_unknown_machine_lists_the_known() -> None:
    with pytest.raises(ConfigError) as caught:
        load_machine("m16")
    assert caught.value.expected == ", ".join(machine_names())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('unit = "deg"\nrole', 'unit = "degg"\nrole'),
        ("[drum]", "[drums]"),
        ('axes = "machine"', 'axes = "mine"'),
        ('circumference = { value = 8.5, unit = "m" }', "circumference = 8.5"),
        ('circumference = { value = 8.5, unit = "m" }', 'circumference = { value = 8.5, unit = "kg" }'),
        ('circumference = { value = 8.5, unit = "m" }', 'circumference = { value = "8.5", unit = "m" }'),
        (
            'circumference = { value = 8.5, unit = "m" }',
            f"circumference = {{ value = {10**400}, unit = 'm' }}",
        ),
        ("settle_revolutions = 2.5", ""),
        ("[type_b]\n", "[type_b]\nFX = { uu = 1 }\n"),
    ],
)
def test_a_wrong_definition_is_refused(tmp_path: Path, old: str, new: str) -> None:
    import toolkit.machine

    text = (Path(toolkit.machine.__file__).parent / "m15.toml").read_text()
    assert old in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ToolkitError):
        load_machine(str(path))


def test_a_statement_of_an_own_machine_goes_before_its_bases_and_drops_no_other(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'name = "own"\nextends = "m15"\n[type_b]\nFZ = { u = 15, unit = "N", source = "certificate" }\n'
    )
    own, base = load_machine(str(path)), load_machine("m15")
    assert (own.stated_uncertainty("FZ").u, own.stated_uncertainty("FZ").relative) == (15.0, 0.0)
    for symbol in ("SA", "SA_scale", "P", "zero"):
        assert own.stated_uncertainty(symbol) == base.stated_uncertainty(symbol)
