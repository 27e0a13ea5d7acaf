"""What a session's own findings refuse: those that are errors, whatever rule words them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import toolkit.calibration.fit.findings as findings
from tests.calibration.virtual_factory import Change, columns, failed, judged, rules, write_virtual
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.rules import rules_catalogue

CELLS = ("D51", "D52", "E5")


@pytest.fixture
def empty(tmp_path: Path) -> Registry:
    (tmp_path / "cal").mkdir()
    return Registry(tmp_path / "cal")


def of_cells(line: str) -> Change:
    """Return a change of SESSION.toml that states a line of every cell, in the place of its resolution."""

    def change(text: str) -> str:
        for name in CELLS:
            text = re.sub(rf"(\[cells\.{name}\]\n)((?!\[).*\n)*", rf"\1{line}\n", text)
        return text

    return change


def moved(by: float) -> Change:
    """Return a change of SESSION.toml that states the first cell's zeros before and after."""
    zeros = [("before", 0.0), ("after", by)]
    readings = "".join(
        f'[[zero.readings]]\nwhen = "{when}"\nvalues = {{ D51 = {value}, D52 = 0.0, E5 = 0.0 }}\n'
        for when, value in zeros
    )

    def change(text: str) -> str:
        lines = [line for line in text.splitlines() if not line.startswith("zero =")]
        return "\n".join([*lines, "[zero]", 'fit = "tared"', readings])

    return change


def test_a_bridge_output_that_foil_gauges_do_not_give_is_refused_unless_stated(
    empty: Registry, tmp_path: Path
) -> None:
    volts = columns(**dict.fromkeys(CELLS, 20.0))
    made, decision = judged(empty, write_virtual(tmp_path / "a", volts))
    assert rules(made, "error") == {"bridge-range"}
    assert failed(decision) == {"bridge-range"}
    assert not decision.done
    gauges = of_cells('bridge = "semiconductor"')
    _, decision = judged(empty, write_virtual(tmp_path / "b", volts, session=gauges))
    assert decision.done, decision.findings


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        (of_cells('resolution = { value = 5.0, unit = "mV/V" }'), {"coarse-uncertainty"}),
        (of_cells('u = { value = 0.5, unit = "mV/V" }'), {"coarse-uncertainty"}),
        (moved(3.0), {"zero-drift", "coarse-uncertainty"}),
        (moved(0.0005), set()),
    ],
    ids=["resolution", "u", "zero", "small zero"],
)
def test_a_record_whose_uncertainty_is_no_small_share_of_its_range_is_refused(
    empty: Registry, tmp_path: Path, change: Change, refused: set[str]
) -> None:
    made, decision = judged(empty, write_virtual(tmp_path / "s", session=change))
    # A sign that such a resolution hides is not the machine's either.
    assert failed(decision) - {"polarity"} == refused
    assert refused <= rules(made, "error")
    assert decision.done == (not refused)


def errors(folder: Path) -> Iterator[str]:
    """Yield the rules of findings that code may word as errors."""
    for path in sorted(folder.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding"):
                continue
            words = {word.arg: word.value for word in node.keywords}
            level, rule = words.get("level"), words["rule"]
            told = ast.unparse(level) if level is not None else ""
            if isinstance(rule, ast.Constant) and ("'error'" in told or told == "level"):
                yield str(rule.value)


def test_every_rule_that_may_be_an_error_declares_that_it_refuses_an_approval() -> None:
    declared = {rule for rule, entry in rules_catalogue().items() if "refuses" in entry}
    worded = set(errors(Path(findings.__file__).parent)) - {"stated-u"}  # a warning at most
    assert worded == declared - {"coarse-uncertainty"}
