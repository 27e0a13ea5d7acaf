"""`toolkit init`: a laboratory's home folder."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.console import Json, Quiet, answer
from toolkit.cli.home import packaged_home

NAME = "init"


def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The home to make.")],
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Make a laboratory's home folder.

    An empty calibrations/ and the default report_templates/. What is there already is left as it is.

    Example: toolkit init lab
    """
    from toolkit.errors import OutputError

    templates = folder / "report_templates"
    made: list[str] = []
    try:
        (folder / "calibrations").mkdir(parents=True, exist_ok=True)
        templates.mkdir(exist_ok=True)
        for source in sorted((packaged_home() / "report_templates").iterdir()):
            target = templates / source.name
            if source.is_file() and not target.exists():
                shutil.copyfile(source, target)
                made.append(str(target.relative_to(folder)))
    except OSError as error:
        raise OutputError(
            "the home cannot be made",
            where=folder,
            got=error.strerror,
            expected="a folder that can be written to",
            next_step="choose another folder",
        ) from error
    text = (
        f"home: {folder}\n"
        f"  calibrations/       fill it with: toolkit calibrate SESSION.toml --home {folder}\n"
        f"  report_templates/   {', '.join(p.name for p in sorted(templates.glob('*.docx')))}"
    )
    answer({"home": folder.resolve(), "written": made}, text, as_json=json, quiet=quiet)
    return 0
