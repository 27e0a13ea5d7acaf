"""The tutorials are walked as a new user walks them: from an empty folder, one after the other."""

from __future__ import annotations

import contextlib
import doctest
import io
import json
import os
import re
import runpy
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.house.source import ROOT
from tests.recipes import blocks_of, commands_of, file_named
from toolkit.cli.main import run

TUTORIALS = ROOT / "docs" / "tutorials"
INDEX = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
PAGES = [TUTORIALS / name for name in re.findall(r"\]\(tutorials/(\w+\.md)\)", INDEX)]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
SAME = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@contextlib.contextmanager
def terminal() -> Iterator[io.StringIO]:
    """What a terminal shows: output and errors in one stream."""
    screen = io.StringIO()
    with contextlib.redirect_stdout(screen), contextlib.redirect_stderr(screen):
        yield screen


def typed(command: str) -> tuple[str, int]:
    """Return what a command prints, and its exit code; ``cd`` stays in effect for the next one."""
    program, *words = shlex.split(command)
    with terminal() as screen:
        if program == "cd":
            os.chdir(words[0])
        elif program == "python":
            runpy.run_path(words[0], run_name="__main__")
        else:
            assert program == "toolkit", command
            with pytest.raises(SystemExit) as ended:
                run(words)
            return screen.getvalue(), int(ended.value.code or 0)
    return screen.getvalue(), 0


def test_every_tutorial_stands_in_the_index() -> None:
    assert sorted(PAGES) == sorted(TUTORIALS.glob("*.md"))
    assert len(PAGES) == 9


EFFORT = {
    row[1]: tuple(map(int, row.groups()[1:]))
    for row in re.finditer(
        r"\]\(tutorials/(\w+)\.md\)[^\n]*\| (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", INDEX, re.M
    )
}
"""By page, as the index tells: commands, entries and options, files written by hand, processor time [s]."""
_SECONDS = 3  # times as many as told: a machine is slower, or busy


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_the_index_tells_what_a_tutorial_takes(page: Path) -> None:
    blocks = blocks_of(page.read_text(encoding="utf-8"))
    consoles = [block for block in blocks if block.language == "console"]
    words = [shlex.split(command) for block in consoles for command, _ in commands_of(block)]
    commands = [command for command in words if command[0] == "toolkit"]
    options = [word for command in commands for word in command if word.startswith("--")]
    files = [block for block in blocks if file_named(block) is not None]
    assert EFFORT[page.stem][:3] == (len(commands), len(options), len(files))


WALKED = ("first_report", "calibration_session", "three_axis_rig", "own_machine", "own_template")
"""Of every run: the first page of a new user, and the short ones."""
ALL = pytest.mark.campaign(
    "the longer pages as well, which say of audits and diagnoses what other tests hold"
)


@pytest.mark.parametrize(
    "pages",
    [
        pytest.param([page for page in PAGES if page.stem in WALKED], id="walked"),
        pytest.param(PAGES, id="all", marks=ALL),
    ],
)
def test_tutorials_do_what_they_promise(
    pages: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    assert len(pages) >= len(WALKED)
    for page in pages:
        text, begun = page.read_text(encoding="utf-8"), processor_s()
        # A page begins in an empty folder, or where the page is that it continues.
        continued = re.search(r"continues in `lab/` of\s+\[[^]]+\]\((\w+)\.md\)", text)
        folder = tmp_path / (continued[1] if continued else page.stem)
        folder.mkdir(exist_ok=continued is not None)
        monkeypatch.chdir(folder)
        for block in blocks_of(text):
            if (name := file_named(block)) is not None:
                assert not Path(name).exists(), f"{page.name}: {name} is no new file"
                Path(name).write_text(block.text, encoding="utf-8")
            elif block.language == "console":
                for command, expected in commands_of(block):
                    printed, code = typed(command)
                    assert code in {0, 1}, f"{page.name}: $ {command}\n{printed}"
                    assert same(expected, printed), f"{page.name}: $ {command}\n{printed}"
        taken = processor_s() - begun
        assert taken < _SECONDS * EFFORT[page.stem][3], f"{page.name}: {taken:.1f} s of processor time"


def processor_s() -> float:
    """Return the processor time of this process and of those that have ended in it [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def same(expected: str, printed: str) -> bool:
    """Tell whether a command printed what its page shows; a narrow space between thousands is a space."""
    return doctest.OutputChecker().check_output(
        expected, printed.replace("\N{NARROW NO-BREAK SPACE}", " "), SAME
    )


LONGEST = pytest.mark.campaign("the longest of the notebooks: the others are run cell by cell in every run")


@pytest.mark.parametrize(
    "notebook",
    [pytest.param(path, id=path.stem, marks=[LONGEST] * (path.stem == "diagnosis")) for path in NOTEBOOKS],
)
def test_a_notebook_runs_from_its_first_cell_to_its_last(
    notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    names: dict[str, object] = {}
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), f"{notebook.name}[{number}]", "exec"), names)  # noqa: S102


def test_there_are_three_notebooks() -> None:
    page = (TUTORIALS / "notebook.md").read_text(encoding="utf-8")
    assert {path.name for path in NOTEBOOKS} == set(re.findall(r"notebooks/(\w+\.ipynb)>", page))
    assert len(NOTEBOOKS) == 3
