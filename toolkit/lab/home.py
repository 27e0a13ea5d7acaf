"""A laboratory's home, the nearest folder upward with ``calibrations/``: its registry, its templates."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError
from toolkit.files import real_path
from toolkit.publication import check_place, publication

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.report.word.package import Template
    from toolkit.trust.keys import Signer
    from toolkit.trust.signing import Travel

TEMPLATES = "report_templates"
PLAN = "plan.json"
_PACKAGE = real_path(Path(__file__)).parents[1]


def packaged_home() -> Path:
    """Return the home that comes with the package: its copy in a wheel, the checkout otherwise."""
    inside = _PACKAGE / "_home"
    return inside if inside.is_dir() else _PACKAGE.parent


def documentation() -> Path:
    """Return the first page of the documentation: a wheel's own, in a checkout the one of ``make docs``.

    Raises
    ------
    ConfigError
        a checkout in which nobody made it
    """
    folders = (_PACKAGE / "_site", _PACKAGE.parent / "build" / "docs")
    pages = [folder / "docs" / "README.html" for folder in folders]
    if page := next((page for page in pages if page.is_file()), None):
        return page
    raise ConfigError(
        "the documentation was not built",
        where=pages[-1],
        got="no file",
        expected="the site, which a wheel carries and a checkout makes",
        next_step="run 'make docs' in the checkout",
        rule="no-docs",
    )


def find_home(home: Path | None = None) -> Path:
    """Return the laboratory's home: ``--home``, ``TOOLKIT_HOME``, or the nearest folder upward.

    Raises
    ------
    ConfigError
        there is none; the message names ``toolkit init``
    """
    stated = home or (Path(os.environ["TOOLKIT_HOME"]) if os.environ.get("TOOLKIT_HOME") else None)
    if stated is not None:
        if not (stated / "calibrations").is_dir():
            raise _no_home(stated)
        return real_path(stated)
    cwd = real_path(Path.cwd())
    for folder in (cwd, *cwd.parents):
        if (folder / "calibrations").is_dir():
            return folder
    raise _no_home(cwd)


def calibrations_folder(calibrations: Path | None = None, home: Path | None = None) -> Path:
    """Return the registry folder: ``--calibrations DIR``, else that of the home."""
    if calibrations is None:
        return find_home(home) / "calibrations"
    if not calibrations.is_dir():
        raise ConfigError(
            "the registry folder does not exist",
            where=calibrations,
            got="no folder",
            expected="a folder with one sub-folder an instrument",
            next_step="check --calibrations, or make a home with 'toolkit init DIR'",
            rule="no-registry",
        )
    return real_path(calibrations)


def registry_to_write(calibrations: Path | None = None, home: Path | None = None) -> Path:
    """Return the registry folder of a command that enters a record: one that was named may yet be made."""
    if calibrations is not None and not os.path.lexists(calibrations):
        check_place(calibrations)
        return calibrations.absolute()
    return calibrations_folder(calibrations, home)


def open_registry(
    calibrations: Path | None = None,
    home: Path | None = None,
    *,
    lock_file: bool = False,
    signers: Sequence[Signer] = (),
    travel: Travel | None = None,
) -> Registry:
    """Return the registry of `calibrations_folder`; ``lock_file``: where the file system has no locks."""
    from toolkit.calibration.registry.registry import Registry
    from toolkit.trust.signing import HERE

    return Registry(
        calibrations_folder(calibrations, home), lock_file=lock_file, signers=signers, travel=travel or HERE
    )


def registry_if_any(calibrations: Path | None = None, home: Path | None = None) -> Registry | None:
    """Return the registry, None where there is no home and none was named.

    A file can be looked into, and a plan run, anywhere; but a registry that is named is never passed over.
    """
    try:
        return open_registry(calibrations, home)
    except ConfigError:
        if calibrations is not None or home is not None:
            raise
        return None


def document_template(
    template: Path | None, out: Path | None, *, default: str | None = None, home: Path | None = None
) -> Template | None:
    """Return the template of a document in ``out``, judged before anything is read; None without one.

    ``default`` is the home's template where none is named; None: there is then no document.

    Raises
    ------
    ConfigError
        ``template-without-out``; TemplateError: the file is no template
    """
    from toolkit.report.word.package import read_template

    if out is None and template is not None:
        raise ConfigError(
            "a template needs a folder for what it makes", where="--template", got=template,
            expected="--out DIR beside it", next_step="add --out DIR", rule="template-without-out",
        )  # fmt: skip
    if out is None or (template is None and default is None):
        return None
    return read_template(template or home_template(str(default), home))


def home_template(name: str, home: Path | None = None) -> Path:
    """Return a template of the home's ``report_templates/``; the packaged one where the home has none.

    Raises
    ------
    ConfigError
        ``home`` was given and is none
    """
    packaged = packaged_home() / TEMPLATES / name
    try:
        own_template = find_home(home) / TEMPLATES / name
    except ConfigError:
        if home is not None:
            raise
        return packaged
    return own_template if own_template.is_file() else packaged


def make_home(folder: Path) -> tuple[str, ...]:
    """Make a home: an empty ``calibrations/`` and the default templates; return what was written.

    What is there already is left as it is.

    Raises
    ------
    OutputError
        the folder cannot be written to
    """
    written: list[str] = []
    with publication(folder) as stage:
        for name in ("calibrations", TEMPLATES):
            if not (folder / name).is_dir():
                (stage / name).mkdir()
        for source in sorted((packaged_home() / TEMPLATES).iterdir()):
            name = f"{TEMPLATES}/{source.name}"
            if source.is_file() and not (folder / name).exists():
                (stage / TEMPLATES).mkdir(exist_ok=True)
                shutil.copyfile(source, stage / name)
                written.append(name)
    return tuple(written)


def _no_home(where: Path) -> ConfigError:
    return ConfigError(
        "no laboratory home was found",
        where=where,
        got="no folder calibrations/ here or above",
        expected="a folder that holds calibrations/",
        next_step="run inside the laboratory's home, name it with --home or TOOLKIT_HOME, "
        "or make one with 'toolkit init DIR'",
        rule="no-home",
    )
