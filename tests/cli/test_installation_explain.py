"""Every rule that the code can print is explained, and explained rules exist."""

from __future__ import annotations

import ast
import json

import pytest

from tests.house.source import Module, read_package
from toolkit.audit.model import CLEAN, GRADES, NOT_IDENTIFIED
from toolkit.cli.main import run
from toolkit.effects.catalogue import effects
from toolkit.lab.rules import rules_catalogue
from toolkit.report.word.check import RULES

REFUSERS = {"_refuse", "refuse_cell", "problem"}


def rules_in(module: Module) -> set[str]:
    """Return the constants given as ``rule=...``, or as the first argument of a function that refuses."""
    found = set()
    for node in module.nodes:
        if not isinstance(node, ast.Call):
            continue
        named = [k.value for k in node.keywords if k.arg == "rule"]
        if getattr(node.func, "id", None) in REFUSERS and module.path.parts[-2] in ("recording", "tires"):
            named += node.args[:1]
        found |= {n.value for n in named if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    return found


def test_every_rule_of_a_module_is_explained() -> None:
    explained = rules_catalogue().keys()
    modules = read_package()
    unexplained = {module.name: lacking for module in modules if (lacking := rules_in(module) - explained)}
    assert len(modules) > 500
    assert unexplained == {}


def test_the_template_lint_and_the_grades_are_explained() -> None:
    assert RULES.keys() <= rules_catalogue().keys()
    assert {f"identified-{g}" for g in GRADES if g not in (*CLEAN, *NOT_IDENTIFIED)} <= (
        rules_catalogue().keys()
    )


def test_explain_one(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        run(["explain", "no-tare"])
    assert caught.value.code == 0
    assert "zero of the cells" in capsys.readouterr().out


def test_explain_an_unknown_rule_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        run(["explain", "no-tar"])
    assert caught.value.code == 2
    assert "no-tare" in capsys.readouterr().err


def test_explain_an_effect_that_a_diagnosis_names(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        run(["explain", "coulomb_friction"])
    assert caught.value.code == 0
    told = capsys.readouterr().out
    assert "Dry friction is missing" in told
    assert "coulomb [unit of force]: size of the friction" in told


def test_explain_lists_every_effect_and_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run(["explain", "--json"])
    listed = json.loads(capsys.readouterr().out)
    assert {one["effect"] for one in listed["effects"]} == set(effects())
    with pytest.raises(SystemExit) as caught:
        run(["explain", "relaxatoin"])
    assert caught.value.code == 2
    assert "relaxation" in capsys.readouterr().err
