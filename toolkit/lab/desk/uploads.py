"""Files that somebody hands in through a page: a Word template, or a case with its recordings.

They enter the home whole once they could be read as what they are, or not at all. The names that a browser
gives are names, never paths.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError, OutputError, ToolkitError
from toolkit.files import parse_toml, same_file
from toolkit.inputs import NAMED_FILE, SETTINGS_FILE, TEMPLATE_FILE, check_size
from toolkit.lab.desk.holdings import CASE
from toolkit.lab.desk.previews import WORD
from toolkit.lab.home import TEMPLATES
from toolkit.publication import caseless, publication

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Case

CASES = "cases"
_LONGEST = 4096  # of a path: what is longer leads nowhere
_BY_NAME = "files that are handed in with the case, by their names"
FILE_NAME = re.compile(r"[^\W_.][\w ().+-]{0,99}\Z")
"""A name of a file that is handed in: it begins with a letter or a digit and leads to no other folder."""


def claimed_folder(parent: Path, word: str) -> str:
    """Make a folder ``word-N`` whose number nobody else has or had, and return its name.

    Of one that is gone a note ``word-N.toml`` may lie there.

    Raises
    ------
    OutputError
        it cannot be made
    """
    pattern = re.compile(rf"{re.escape(word)}-([1-9][0-9]{{0,8}})(?:\.toml)?\Z")
    try:
        parent.mkdir(exist_ok=True)
        number = max(
            (int(match[1]) for path in parent.iterdir() if (match := pattern.match(path.name))), default=0
        )
        while True:
            number += 1
            with contextlib.suppress(FileExistsError):
                (parent / f"{word}-{number}").mkdir()
                return f"{word}-{number}"
    except OSError as error:
        raise OutputError(
            f"a folder for a {word} cannot be made", where=parent, got=error.strerror,
            expected="a folder with write permission and free space", next_step="give that permission",
            rule="not-writable",
        ) from error  # fmt: skip


def hand_in_template(home: Path, files: Sequence[tuple[str, bytes]], *, replace: bool) -> str:
    """Put a Word template, and its style file where there is one, into the home; return its name.

    Parameters
    ----------
    files : (name, content) of a .docx or .dotx, and of a .toml of the same name where it has a style
    replace : whether it may take the place of the template of that name

    Raises
    ------
    ConfigError
        ``usage``: the files are no template with its style, or the home has one of that name
    TemplateError
        it is no Word file, or not safe to open; nothing is written
    """
    from toolkit.report.style import read_style, style_file
    from toolkit.report.word.package import read_template

    contents = named_files(files, "one .docx or .dotx, and a .toml of the same name where it has a style")
    templates = [name for name in contents if name.lower().endswith(WORD)]
    style = [name for name in contents if name.lower().endswith(".toml")]
    stems = {Path(name).stem for name in contents}
    if len(templates) != 1 or len(stems) != 1 or len(contents) != 1 + len(style):
        raise not_those("one template", contents, "one .docx or .dotx, and a .toml of the same name")
    (template,) = templates
    check_size(contents[template], TEMPLATE_FILE, template)
    for name in style:
        check_size(contents[name], SETTINGS_FILE, name)
    folder = home / TEMPLATES
    occupied = next(iter(namesakes(folder, contents).items()), None)
    if occupied is not None and not (replace and occupied[0] == occupied[1]):
        name, namesake = occupied
        got = "another of that name" if name == namesake else f"{namesake}, which differs by case alone"
        raise ConfigError(
            "the home has a file of this name", where=f"{TEMPLATES}/{name}", got=got,
            expected="a new name, or consent to replace it",
            next_step="name the file anew, or agree to replace it; nothing was written", rule="usage",
        )  # fmt: skip

    def read(place: Path) -> None:
        read_template(place / template)
        read_style(style_file(place / template))

    _enter(folder, contents, read)
    return template


def hand_in_case(home: Path, files: Sequence[tuple[str, bytes]]) -> str:
    """Put a case with the files that it names into a folder of the home; return its place in the home.

    A case whose recordings lie in folders of its own is flat here: it names its files by name alone.

    Raises
    ------
    ConfigError
        ``usage``: no case.toml among the files, or it names a file that is not among them; what `read_case`
        raises. Nothing is kept
    """
    from toolkit.diagnosis.case.reader import read_case

    contents = named_files(files, f"{CASE} and every file that it names")
    settings = [name for name in contents if name.lower().endswith(".toml")]
    if CASE not in contents and len(settings) == 1:
        contents = {CASE if name in settings else name: data for name, data in contents.items()}
    if CASE not in contents:
        raise not_those("a case", contents, f"{CASE} and every file that it names")
    for name, data in contents.items():
        check_size(data, SETTINGS_FILE if name == CASE else NAMED_FILE, name)

    def read(place: Path) -> None:
        table = parse_toml(contents[CASE], where=place / CASE)
        if outside := leading_out(table, place, contents):
            raise not_those("a whole case", outside, _BY_NAME)
        check_inside(read_case(place / CASE), place, frozenset(contents))

    return enter_case(home, contents, read)


def enter_case(home: Path, contents: Mapping[str, bytes], read: Callable[[Path], None]) -> str:
    """Put files into a new folder of cases once ``read`` took them where they are staged; return its place.

    Raises
    ------
    OutputError
        it cannot be made; what ``read`` raises. Nothing is kept
    """
    folder = home / CASES
    name = claimed_folder(folder, "case")
    try:
        _enter(folder / name, contents, read)
    except BaseException:
        with contextlib.suppress(OSError):
            (folder / name).rmdir()
        raise
    return f"{CASES}/{name}"


def check_inside(case: Case, folder: Path, names: frozenset[str]) -> None:
    """Refuse a case that names a file which was not handed in with it."""
    simulation = case.simulation
    machine = Path(simulation.machine) if simulation.machine.endswith(".toml") else None
    files = [simulation.path, simulation.tire, machine, case.model]
    outside = [run.name for run in (*case.runs, *case.predict) if run.name not in names]
    outside += [
        file.name for file in files
        if file is not None and not (file.name in names and same_file(file, folder / file.name))
    ]  # fmt: skip
    if os.sep in simulation.calibration:
        outside.append(simulation.calibration)
    if outside:
        raise not_those("a whole case", outside, _BY_NAME)


def leading_out(table: Any, folder: Path, names: Collection[str]) -> list[str]:
    """Return the texts of a file that lead from a folder to what is there but is none of its named files.

    Whatever an entry means by its text: none of these is opened.
    """
    if isinstance(table, dict | list):
        entries = table.values() if isinstance(table, dict) else table
        return [text for entry in entries for text in leading_out(entry, folder, names)]
    is_text = isinstance(table, str) and table not in ("", *names) and "\0" not in table
    return [table] if is_text and len(table) < _LONGEST and os.path.lexists(folder / table) else []


def named_files(files: Sequence[tuple[str, bytes]], expected: str) -> dict[str, bytes]:
    """Return files by name, each of its own; a name leads to no other folder."""
    contents = dict(files)
    if len({caseless(name) for name in contents}) < len(files) or not all(
        FILE_NAME.match(name) for name in contents
    ):
        raise not_those("files with names of their own", [name for name, _ in files], expected)
    return contents


def namesakes(folder: Path, names: Collection[str]) -> dict[str, str]:
    """Return of each name that is taken in a folder the one that stands there: some disks tell no case."""
    taken = [path.name for path in folder.iterdir()] if folder.is_dir() else []
    return {
        name: min(alike, key=lambda other: other != name)
        for name in names
        if (alike := [other for other in taken if caseless(other) == caseless(name)])
    }


def _enter(folder: Path, files: Mapping[str, bytes], read: Callable[[Path], None]) -> None:
    """Put files into a folder once they could be read where they were staged."""
    with publication(folder) as stage:
        for name, data in files.items():
            (stage / name).write_bytes(data)
        with _places_of(folder, stage):
            read(stage)


@contextlib.contextmanager
def _places_of(folder: Path, stage: Path) -> Iterator[None]:
    """Tell errors by the place that the files were to have."""
    try:
        yield
    except ToolkitError as error:
        error.where = error.where and error.where.replace(str(stage), folder.name)
        raise


def not_those(noun: str, names: Sequence[str] | Mapping[str, bytes], expected: str) -> ConfigError:
    """Return the error of files that are none of what was asked for."""
    return ConfigError(
        f"the files are not {noun}", where="files", got=", ".join(names) or "no file", expected=expected,
        next_step="choose them again; nothing was written", rule="usage",
    )  # fmt: skip
