"""Make a report and hand it over: written beside, verified, then renamed into the output folder."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import OutputError, RenderError
from toolkit.recording.marks import refuse_original
from toolkit.report.content import ReportContent
from toolkit.report.drawer import Drawer
from toolkit.report.fill import Filled, fill, needed_figures
from toolkit.report.package import Template
from toolkit.report.pdf import Office
from toolkit.report.verify import Check, verify_docx, verify_pdf

Step = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivered:
    """A delivered report."""

    docx: Path
    pdf: Path
    companions: tuple[Path, ...] = ()
    pages: int
    checks: tuple[Check, ...]
    filled: Filled
    template_sha256: str

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should look at although the report was delivered."""
        said = [f"{one.rule}: {one.message}" for one in self.filled.lint]
        said += [f"{one.name}: {one.message}" for one in self.checks if not one.ok]
        said += [f"missing-value: {tag} prints a visible mark" for tag in self.filled.missing]
        said += [
            f"mark-added: the template has no place for the mark {name!r}" for name in self.filled.marks_added
        ]
        return tuple(said)


def deliver(
    template: Template,
    content: ReportContent,
    out: Path,
    *,
    office: Office | None = None,
    drawer: Drawer | None = None,
    name: str = "report",
    allow_missing: bool = False,
    keep: bool = False,
    companions: Mapping[str, bytes] | None = None,
    step: Step = lambda _text: None,
) -> Delivered:
    """Fill, convert, verify and deliver ``<name>.docx`` and ``<name>.pdf``.

    Parameters
    ----------
    template, content : the safe template and the report's content
    out : output folder; made where it does not exist
    office, drawer : LibreOffice and the figures' workers prepared by the caller; default: LibreOffice of
        its own, figures drawn here
    companions : files that are handed over with the two, suffix to content (``.xml``)
    keep : on failure leave what was made in ``rejected/`` of the folder

    Raises
    ------
    TemplateError, RenderError, OutputError
        nothing is left in the output folder then
    """
    from toolkit.report.figures import draw

    beside = companions or {}
    for suffix in (".docx", ".pdf", *beside):
        refuse_original(out / f"{name}{suffix}", suffix=suffix)
    office = office or Office()
    with office, _staging(out) as stage:
        step("figures")
        plots = {figure: content.plots[figure] for figure in needed_figures(template, content)}
        pictures = drawer.pictures(plots) if drawer else {one: draw(plot) for one, plot in plots.items()}
        step("document")
        filled = fill(template, content, pictures, allow_missing=allow_missing, fonts=True)
        docx = stage / f"{name}.docx"
        docx.write_bytes(filled.docx)
        try:
            checks = list(verify_docx(filled))
            step("PDF")
            pdf = office.convert([docx], stage)[0]
            step("verification")
            found, pages = verify_pdf(pdf, filled)
            checks += found
            _demand(checks)
        except RenderError as error:
            if keep:
                _reject(stage, out, name, str(error))
            raise
        for suffix, data in beside.items():
            (stage / f"{name}{suffix}").write_bytes(data)
        targets = _hand_over([docx, pdf, *(stage / f"{name}{suffix}" for suffix in beside)], out)
    return Delivered(
        docx=targets[0],
        pdf=targets[1],
        companions=tuple(targets[2:]),
        pages=pages,
        checks=tuple(checks),
        filled=filled,
        template_sha256=template.sha256,
    )


def _demand(checks: list[Check]) -> None:
    failed = [one for one in checks if not one.ok and not one.warning]
    if failed:
        raise RenderError(
            "the report was not verified and is not delivered",
            where="PDF",
            got="; ".join(f"{one.name}: {one.message}" for one in failed),
            expected="every value, figure and font of the report in its PDF",
            rule="not-verified",
            next_step="look at the rejected files with --keep and correct the template at that place",
        )


@contextlib.contextmanager
def _staging(out: Path) -> Iterator[Path]:
    """Yield a folder beside ``out`` that goes away; one that did not exist before leaves no trace."""
    parent = out.parent if not out.exists() else out
    try:
        if out.exists() and not out.is_dir():
            raise NotADirectoryError(20, "a file stands where the folder should be")
        made = [one for one in (parent, *parent.parents) if not one.exists()]
        parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".report-", dir=parent))
    except OSError as error:
        raise OutputError(
            "the output folder cannot be written",
            where=out,
            got=error.strerror or str(error),
            expected="a folder with write permission and free space",
            next_step="choose another folder with --out",
        ) from error
    try:
        yield stage
    except BaseException:
        shutil.rmtree(stage, ignore_errors=True)
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise
    shutil.rmtree(stage, ignore_errors=True)


def _hand_over(files: list[Path], out: Path) -> list[Path]:
    from toolkit.files import sync_folder

    try:
        out.mkdir(parents=True, exist_ok=True)
        targets = [out / one.name for one in files]
        for source, target in zip(files, targets, strict=True):
            source.replace(target)
        sync_folder(out)
    except OSError as error:
        raise OutputError(
            "the report cannot be written",
            where=out,
            got=error.strerror or str(error),
            expected="a folder with write permission and free space",
            next_step="choose another folder with --out",
        ) from error
    return targets


def _reject(stage: Path, out: Path, name: str, reason: str) -> None:
    rejected = out / "rejected"
    rejected.mkdir(parents=True, exist_ok=True)
    for suffix in (".docx", ".pdf"):
        made = stage / f"{name}{suffix}"
        if made.is_file():
            made.replace(rejected / made.name)
    (rejected / "reason.txt").write_text(reason + "\n")
