"""What the figures of the house count, on small houses whose figures are known; and where they stand."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.house import __main__ as house
from tests.house import citations, structure, weight, words
from tests.house.__main__ import main, names_text
from tests.house.source import ROOT, Module, read_module, read_package

# A figure may fall below its limit and never rise above it; a step that lowers a figure lowers its limit.
LIMITS = {
    "percent of vague names": 2.5,
    "modules of cli without a command": 0,
    "effects named outside their file": 0,
    "imports up in report": 0,
    "imports up in diagnosis": 0,
    "pages cited that do not exist": 0,
    "functions that nobody calls": 0,
    "lines of functions written twice": 27,
}


@pytest.fixture(scope="module")
def figures() -> dict[str, Any]:
    """The figures. Apart: the graph of imports leaves threads, beside which every worker would begin anew."""
    words = [sys.executable, "-m", "tests.house", "--json"]
    done = subprocess.run(words, cwd=ROOT, check=True, capture_output=True)
    return json.loads(done.stdout)


def test_no_figure_rises_above_its_limit(figures: dict[str, Any]) -> None:
    today = {
        "percent of vague names": figures["names"]["percent"],
        "modules of cli without a command": len(figures["cli_without_command"]),
        "effects named outside their file": len(figures["effects_named_outside"]["mentions"]),
        **{f"imports up in {room}": len(arrows) for room, arrows in figures["arrows_up"].items()},
        "pages cited that do not exist": len(figures["pages_missing"]),
        "functions that nobody calls": len(figures["uncalled"]),
        "lines of functions written twice": figures["written_twice"]["lines"],
    }
    assert today.keys() == LIMITS.keys()
    assert {name: value for name, value in today.items() if value > LIMITS[name]} == {}


def test_layers_add_up(figures: dict[str, Any]) -> None:
    assert sum(layer["lines"] for layer in figures["layers"]) == figures["lines"]
    assert sum(layer["modules"] for layer in figures["layers"]) == figures["modules"]


def write(root: Path, files: dict[str, str]) -> list[Module]:
    """Write modules of a package by their paths without the ending."""
    for name, text in files.items():
        path = root / "toolkit" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return list(read_package(root))


NAMES = '''
import numpy as np
from a import b

def made(one, *rest, load=1, **said):
    """told is no binding."""
    found, (left, right) = 1, (2, 3)
    for each in one:
        pass
    with open("x") as held, open("y") as file:
        own: int = 1
    if (got := load):
        values = [what for what in one]
    try:
        pass
    except OSError as error:
        found.told = 2
    match load:
        case {"a": kept, **whole}:
            pass
        case [seen, *some]:
            pass
    return lambda thing: thing

class Told:
    known: int
    _given = 2
    def method(self, cls_, _):
        self.stuff = named_record(named=1)
'''


def test_every_kind_of_binding_counts(tmp_path: Path) -> None:
    (module,) = write(tmp_path, {"m": NAMES})
    vague = sorted(binding.name for binding in words.vague_bindings(module))
    words_told = "made one rest said found left each held own got what kept whole seen some thing"
    assert vague == sorted([*words_told.split(), "Told", "known", "_given"])
    # np, load, right, file, values, error, method, cls_
    assert words.share_of([module]) == words.Share(bound=len(vague) + 8, vague=len(vague))


def test_a_binding_stands_in_its_scope(tmp_path: Path) -> None:
    (module,) = write(tmp_path, {"m": NAMES})
    scopes = {binding.name: binding.scope for binding in words.vague_bindings(module)}
    assert (scopes["made"], scopes["found"], scopes["known"], scopes["what"]) == ("", "made", "Told", "made")


@pytest.mark.parametrize(
    ("name", "vague"),
    [("one", True), ("_ONE", True), ("one_", True), ("each_one", True), ("one_file", False),
     ("left_side", False), ("found", True), ("foundation", False), ("x", False)],
)  # fmt: skip
def test_a_name_is_vague_where_all_its_words_are(name: str, vague: bool) -> None:
    assert words.is_vague(name) is vague


def test_the_list_of_names_points_at_lines(tmp_path: Path) -> None:
    write(tmp_path, {"audit/grade": "def grade(one):\n    return one\n", "units": "one = 1\n"})
    assert (
        names_text(Path("toolkit/audit"), tmp_path) == "toolkit/audit/grade.py:1\tgrade\tone\tdef grade(one):"
    )
    assert names_text(Path("toolkit/units.py"), tmp_path) == "toolkit/units.py:1\t*\tone\tone = 1"


def test_modules_of_the_command_line_without_a_command(tmp_path: Path) -> None:
    files = {
        "cli/__init__": "", "cli/main": "", "cli/console": "", "cli/fit": "def command(): ...\n",
        "cli/machine": "app = 1\n@app.command()\ndef show(): ...\n", "cli/resolve": "def resolve(): ...\n",
        "cli/budget": "@answers(int)\ndef budget(): ...\n", "cli/groups": "",
        "lab/resolve": "",
    }  # fmt: skip
    modules = write(tmp_path, files)
    assert structure.without_command(modules) == ["toolkit.cli.resolve"]


EFFECTS = {
    "effects/creep": "EFFECT = 1\nNAME = 'creep'\n",
    "effects/wear": "EFFECT: int = 1\nLIKE = ('creep',)\n",
    "effects/signals": "x = 1\n",
    "effects/catalogue": 'NAMES = """creep\nwear""".split()\n',
}


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("if name == 'creep': pass\n", 1),
        ("x = 'creep.D51=0.01'\n", 1),
        ("x = 'creep wear'\n", 2),
        ("from toolkit.effects import creep\n", 1),
        ("from toolkit.effects.creep import EFFECT\n", 1),
        ("'''creep is physics'''\nx = 1  # creep\n", 0),
        ("x = 'the creep of a cell'\n", 0),
        ("def f(creep): return creep.wear\n", 0),
    ],
)
def test_an_effect_is_named_outside_its_file(tmp_path: Path, text: str, count: int) -> None:
    modules = write(tmp_path, {**EFFECTS, "simulation/chain": text})
    mentions = [row for row in citations.effects_named(modules) if row.place == "toolkit.simulation.chain"]
    assert len(mentions) == count


def test_effects_in_effects_and_words_of_other_layers(tmp_path: Path) -> None:
    files = {**EFFECTS, "calibration/session": "x = 'creep'\n",
             "report/page": "from toolkit.diagnosis.answer import Answer\nx = 'creep'\n"}  # fmt: skip
    places = [row.place for row in citations.effects_named(write(tmp_path, files))]
    # both names of the list, the name in the other effect's file, the name in what imports a diagnosis
    lists = ["toolkit.effects.catalogue"] * 2
    assert places == [*lists, "toolkit.effects.wear", "toolkit.report.page"]


def test_pages_that_are_cited_have_to_exist(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "physics.md").write_text("# Physics\n\n## The drum\nsee formats.md\n")
    (tmp_path / "docs" / "files").mkdir()
    (tmp_path / "docs" / "files" / "test.md").write_text(
        "[drum](../physics.md#the-drum) [belt](../physics.md#the-belt) [none](../none.md)\n"
        "```console\ndocs/example.md\n```\n"
    )
    text = '''"""See docs/physics.md, "The drum", physics.md#the-drum and docs/none.md."""
x = "told in physics.md, 'The belt'"  # and absent.md, docs/pictures/drum.png
y = "*.md"
'''
    write(tmp_path, {"m": text})
    cited = [row.word for row in citations.pages_missing(tmp_path)]
    assert sorted(cited) == sorted(
        [
            "formats.md",
            "docs/none.md",
            "physics.md, The belt",
            "absent.md",
            "docs/pictures/drum.png",
            "../physics.md#the-belt",
            "../none.md",
        ]
    )


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('__all__ = ["a", "b"]\nimport os\n', ["a", "b"]),
        (
            "from __future__ import annotations\nfrom x import y\n_z = 1\nw = 2\ndef f(): ...\n",
            ["f", "w", "y"],
        ),
    ],
)
def test_public_names(tmp_path: Path, text: str, names: list[str]) -> None:
    write(tmp_path, {"__init__": text})
    assert structure.public_names(tmp_path) == names


def test_arrows_run_up_the_layers_of_the_contract(tmp_path: Path) -> None:
    import grimp

    graph = grimp.ImportGraph()
    for name in ("", ".high", ".low", ".low.part", ".side"):
        graph.add_module(f"toolkit.diagnosis{name}")
    graph.add_import(importer="toolkit.diagnosis.low.part", imported="toolkit.diagnosis.high")
    graph.add_import(importer="toolkit.diagnosis.high", imported="toolkit.diagnosis.low")
    contract = """[tool.importlinter]
[[tool.importlinter.contracts]]
type = "layers"
containers = ["toolkit.diagnosis"]
layers = ["high | side", "low"]
"""
    (tmp_path / "pyproject.toml").write_text(contract)
    arrows = structure.arrows_up(graph, "diagnosis", tmp_path)
    assert arrows == [structure.Arrow("toolkit.diagnosis.low.part", "toolkit.diagnosis.high")]
    (tmp_path / "pyproject.toml").write_text("[tool.importlinter]\ncontracts = []\n")
    assert len(structure.arrows_up(graph, "diagnosis", tmp_path)) == 1  # the circle has to be cut once


def test_json_holds_what_the_text_counts(
    capsys: pytest.CaptureFixture[str], figures: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(house, "measure", lambda: figures)
    assert main(["--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(figures))
    assert main([]) == 0
    assert f"{figures['names']['vague']} of {figures['names']['bound']}" in capsys.readouterr().out


def test_a_module_knows_its_place() -> None:
    module = read_module(ROOT / "tests" / "house" / "__init__.py")
    assert (module.name, module.layer, module.is_sliver) == ("tests.house", "house", True)


CALLS = '''
def used(lines, width):
    """Return what is called by its name."""
    rows = [line.strip()[:width] for line in lines if line.strip()]
    count = len(rows) + sum(len(row) for row in rows)
    return "; ".join(sorted(rows)), count


def left_over(texts, most):
    """Return the same of other things, for nobody."""
    cells = [text.strip()[:most] for text in texts if text.strip()]
    total = len(cells) + sum(len(cell) for cell in cells)
    return ", ".join(sorted(cells)), total


class Plain:
    def asked(self):
        return used([], 1)

    def __call__(self):
        return self.asked()


class Derived(Plain):
    def called_by_the_base(self):
        return 1


@register
def registered():
    return 2
'''


def test_what_nobody_calls_and_what_is_written_twice_are_told(tmp_path: Path) -> None:
    modules = write(tmp_path, {"__init__": "", "calls": CALLS})
    assert weight.uncalled(modules, tmp_path) == ["toolkit.calls.left_over"]
    groups = weight.written_twice(modules)
    assert groups == [["toolkit.calls.used:5", "toolkit.calls.left_over:5"]]
    assert weight.repeated_lines(groups) == 5


def test_what_one_command_alone_leads_to_is_its_weight(tmp_path: Path) -> None:
    lazily = "def command():\n    from toolkit.planner import search\n    return search\n"
    files = {
        "__init__": "", "cli/__init__": "", "shared": "x = 1\n", "planner/__init__": "",
        "planner/search": 'from importlib import import_module\nfrom toolkit.shared import x\n'
        'import_module(f"{__name__}.{x}")\nimport_module(f"toolkit.kinds.{x}")\nimport_module(x)\n',
        "kinds/__init__": "", "kinds/one": "a = 1\nb = 2\n", "kinds/two": "c = 3\n",
        "cli/plan": lazily, "cli/options": "from toolkit.planner import search\n",
        "cli/fit": "from typing import TYPE_CHECKING\nfrom toolkit.cli import options\n"
        "from toolkit.shared import x\nif TYPE_CHECKING:\n    from toolkit.planner import search\n",
    }  # fmt: skip
    rows = weight.needed_by_one(write(tmp_path, files))
    assert rows == [
        weight.Weight("toolkit.cli.plan", lines=11, modules=4),
        weight.Weight("toolkit.cli.fit", lines=5, modules=1),
    ]
