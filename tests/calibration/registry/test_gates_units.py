"""Units: a slip in both files fails against history, a meant change passes and is told."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.calibration.virtual_factory import PACKAGED, Change, columns, failed, judged, rules, write_virtual
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.response import differences
from toolkit.units import unit

LBF = 0.45359237 * 9.80665


@pytest.fixture
def used(tmp_path: Path) -> Registry:
    """The packaged registry, m15-virtual-r1 in force."""
    shutil.copytree(PACKAGED, tmp_path / "cal" / "m15-virtual")
    return Registry(tmp_path / "cal")


def header(name: str, old: str, new: str) -> Change:
    return lambda text: text.replace(f"{name} [{old}]", f"{name} [{new}]")


SLIPS = {
    "lbf written N": header("FY", "lbf", "N"),
    "lbf written kN": header("FY", "lbf", "kN"),
    "lbf written kgf": header("FY", "lbf", "kgf"),
    "lbf*ft written N*m": header("MZ", "lbf*ft", "N*m"),
    "lbf*ft written N*mm": header("MX", "lbf*ft", "N*mm"),
    "mV/V written V/V": lambda text: text.replace("mV/V", "V/V"),
    "mV/V written µV/V": lambda text: text.replace("mV/V", "µV/V"),
    "one cell's mV/V written V/V": header("D52", "mV/V", "V/V"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_unit_that_slipped_in_both_files_is_refused(used: Registry, tmp_path: Path, slip: str) -> None:
    made, decision = judged(used, write_virtual(tmp_path / "s", SLIPS[slip]))
    assert {"unit-changed", "span"} <= rules(made)
    assert "span" in failed(decision)
    assert used.status(made.record.id).state == "candidate"


def test_a_slip_of_mv_with_excitation_is_refused(used: Registry, tmp_path: Path) -> None:
    # The amplifier ran at 10 V and the session says 5 V: mV = 10 times mV/V, and half the ratio is left.
    def written(text: str) -> str:
        return columns(D51=10.0, D52=10.0, E5=10.0)(text).replace("mV/V", "mV")

    def at(volts: float) -> Change:
        return lambda text: text.replace("serial = ", f"excitation = {volts}\nserial = ")

    _, decision = judged(used, write_virtual(tmp_path / "five", written, session=at(5.0)))
    assert failed(decision) == {"span"}
    made, decision = judged(used, write_virtual(tmp_path / "ten", written, session=at(10.0)))
    assert decision.done, decision.findings
    assert rules(made) == {"unit-changed", "readings-again"}


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [("lbf", "N", ("FY",)), ("lbf*ft", "N*m", ("MZ", "MX")), ("mV/V", "V/V", ("D51", "D52", "E5"))],
)
def test_a_unit_that_was_changed_on_purpose_passes_and_is_told(
    used: Registry, tmp_path: Path, old: str, new: str, names: tuple[str, ...]
) -> None:
    factor = unit(old).factor / unit(new).factor
    meant = [columns(**dict.fromkeys(names, factor)), *(header(name, old, new) for name in names)]

    def write(text: str) -> str:
        for change in meant:
            text = change(text)
        return text

    made, decision = judged(used, write_virtual(tmp_path / "s", write))
    assert rules(made) == {"unit-changed", "readings-again"}
    assert {one.where for one in made.findings if one.rule == "unit-changed"} == set(names)
    assert decision.done, decision.findings
    (entry,) = [e for e in used.ledger("m15-virtual").of(made.record.id) if e.event == "approved"]
    for name in names:
        assert f"unit-changed: {name}: the unit changed: {new}, in m15-virtual-r1 {old}" in entry.evidence
    # Physically nothing changed: what is left is the rounding of the converted numbers.
    for term in differences(used.load("m15-virtual-r1"), used.load(made.record.id)):
        assert term.change is not None
        assert abs(term.change) <= 1e-9 * max(abs(term.one or 0.0), 1.0)
        assert (term.note is None) == (term.load not in names and not {term.term} & set(names))


def test_a_tolerance_in_the_slipped_unit_does_not_open_the_gate(used: Registry, tmp_path: Path) -> None:
    # 2 kN for 2 N: every change of FY is inside such a tolerance.
    wide = '\n[check.tolerance]\nFY = { value = 20, unit = "kN" }\n'

    def session(text: str) -> str:
        return text.replace('check = "check.csv"\n', "") + '[check]\nfile = "check.csv"\n' + wide

    _, decision = judged(used, write_virtual(tmp_path / "s", SLIPS["lbf written N"], session=session))
    assert {"span", "check-tolerance"} <= failed(decision)
    _, decision = judged(used, write_virtual(tmp_path / "t", columns(E5=-1.0), session=session))
    assert {"sign", "polarity", "check-tolerance"} <= failed(decision)


def test_without_a_history_the_size_of_things_tells(tmp_path: Path) -> None:
    for name, slip in SLIPS.items():
        registry = Registry(tmp_path / "cal" / name.replace("/", "_"))
        registry.folder.mkdir(parents=True)
        _, decision = judged(registry, write_virtual(tmp_path / name.replace("/", "_"), slip))
        # 1.356 and 2.2 of one moment alone lie inside what a drawing and a published lever differ by.
        if name == "lbf*ft written N*m":
            assert decision.done
        else:
            assert failed(decision) & {"lever", "range", "bridge-range"}, name


def test_a_load_and_an_indication_that_are_new_or_missing_are_told(used: Registry, tmp_path: Path) -> None:
    def renamed(text: str) -> str:
        return text.replace("MX [", "MQ [")

    made, decision = judged(
        used, write_virtual(tmp_path / "s", renamed, session=lambda text: text.replace("MX", "MQ"))
    )
    told = {one.where: one.message for one in made.findings if one.rule == "layout-changed"}
    assert set(told) == {"MQ", "MX"}
    assert "new" in told["MQ"]
    assert "missing" in told["MX"]
    # Nothing says in which direction MQ is positive.
    assert failed(decision) == {"polarity-reading"}


def test_the_names_of_a_unit_are_no_change(used: Registry, tmp_path: Path) -> None:
    made, decision = judged(used, write_virtual(tmp_path / "s", header("FY", "lbf", "lb")))
    assert "unit-changed" not in rules(made)
    assert decision.done
