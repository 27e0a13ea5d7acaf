"""Between tire files, TYDEX files, tables and reduced tests; what a target cannot hold is named.

An FMU is made of a fit over all loads, or of a tire file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError, FitError, OutputError, refuse_unknown
from toolkit.files import same_file
from toolkit.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Callable

    from toolkit.arrays import Array
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.channels import Axes
    from toolkit.lab.tire_tests.fit_models import Fitted
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.tires.fmu.equations import TireEquations

    Columns = dict[str, tuple[str, Array]]

_KINDS = {
    ".tir": "tir",
    ".fmu": "fmu",
    ".csv": "csv",
    ".tdx": "tydex",
    ".tydex": "tydex",
    ".tyd": "tydex",
    ".xlsx": "test",
}
_PAIRS = {
    ("tir", "tir"),
    ("tir", "fmu"),
    ("tydex", "csv"),
    ("csv", "tydex"),
    ("test", "csv"),
    ("test", "tydex"),
}
_WAYS = ".tir to .tir or .fmu; .tdx to .csv; .csv to .tdx; a reduced test .xlsx to .csv or .tdx"


@dataclass(frozen=True, slots=True, kw_only=True)
class Converted:
    """A file that was converted: both formats, what the target could not hold, the record of a test."""

    kinds: tuple[str, str]
    findings: tuple[Finding, ...]
    use: CalibrationUse | None = None


def convert(
    source: Path, target: Path, *, axes: str, resolve: Callable[[Path], Resolved], fmi: str = "2"
) -> Converted:
    """Write a file in another format.

    Parameters
    ----------
    axes : of a .csv, read or written
    resolve : reads a reduced test (`lab.tire_tests.resolve`)
    fmi : version of FMI of an .fmu, 2 or 3

    Raises
    ------
    ToolkitError
        there is no such conversion; the source cannot be read; a table of a draft is asked for
    """
    from toolkit.channels import AXES
    from toolkit.publication import write_result

    refuse_unknown("axis system", axes, AXES, where="--axes", rule="unknown-axes")
    kinds = _kinds(source, target)
    use: CalibrationUse | None = None
    text: str | bytes
    if kinds == ("tir", "tir"):
        text, findings = _tir(source)
    elif kinds == ("tir", "fmu"):
        text, findings = file_fmu(source, target, fmi=fmi)
    else:
        resolved = resolve(source) if kinds[0] == "test" else None
        use = None if resolved is None else resolved.result.reduced.calibration
        _refuse_draft(source, target, kinds, use)
        marks: tuple[str, ...]
        if resolved is not None:
            columns, read_in, lost = _of_test(source, resolved)
            marks = (use.mark,) if use is not None and use.mark else ()
        else:
            columns, read_in, lost, marks = _read(source, kinds[0], axes)
        text, target_findings = _written(columns, read_in, kinds[1], axes, source, marks)
        findings = (*lost, *target_findings)
    write_result(target, text)
    return Converted(kinds=kinds, findings=findings, use=use)


def _kinds(source: Path, target: Path) -> tuple[str, str]:
    kinds = (_KINDS.get(source.suffix.lower(), ""), _KINDS.get(target.suffix.lower(), ""))
    if kinds not in _PAIRS:
        raise OutputError(
            "there is no such conversion", where=f"{source.name} to {target.name}",
            got=f"{source.suffix or 'no ending'} to {target.suffix or 'no ending'}", expected=_WAYS,
            next_step="choose a name with one of these endings", rule="output-name",
        )  # fmt: skip
    if same_file(source, target):
        raise OutputError(
            "the output would replace the input", where="OUT", got=target, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
    return kinds


def _refuse_draft(source: Path, target: Path, kinds: tuple[str, str], use: CalibrationUse | None) -> None:
    """Refuse a table of a draft: of a reduced test, or of a file that carries the mark of one."""
    from toolkit.calibration.records.use import DRAFT_MARK
    from toolkit.inputs import TYDEX_FILE, read_input

    draft = use is not None and use.draft
    if kinds[0] == "tydex":
        draft = source.is_file() and DRAFT_MARK.encode() in read_input(source, TYDEX_FILE)
    if draft and kinds[1] == "csv":
        raise OutputError(
            "a table has no place for the mark of a draft", where=target, got=f"{source.name}, a draft",
            expected="a format that carries the mark, such as .tdx",
            next_step="convert to .tdx, or use a record that is in force", rule="draft-unmarked",
        )  # fmt: skip


def _tir(source: Path) -> tuple[str, tuple[Finding, ...]]:
    from toolkit.tires.tir import read_tir
    from toolkit.tires.tir_checks import pressure_findings
    from toolkit.tires.tir_write import file_text, in_si

    file = read_tir(source)
    _ = file.version  # a kind that cannot be evaluated is not passed on
    converted, findings = in_si(file)
    return file_text(converted), (*findings, *pressure_findings(file))


def _read(source: Path, kind: str, axes: str) -> tuple[Columns, Axes, tuple[Finding, ...], tuple[str, ...]]:
    # Columns in their own units, the axes that they are in, what stays out, and the marks of records.
    from toolkit.units import from_si, unit

    if kind == "tydex":
        from toolkit.tires.tydex import read_tydex

        file = read_tydex(source)
        columns = {
            channel.symbol: (channel.unit, channel.values)
            for channel in file.channels
            if channel.symbol is not None
        }
        out = [channel.name for channel in file.channels if channel.symbol is None] + [
            name for name in file.other if name != "RELEASE"
        ]
        note = Finding(
            rule="not-converted", where=str(source), message=f"a table has no place for {', '.join(out)}"
        )
        return columns, "ISO-W", (*file.findings, *([note] if out else [])), _marks(source)
    from toolkit.tires.table import read_table

    table = read_table(source, axes=axes, required=("FZ",), measured=False)
    units = [unit(cell.partition("[")[2].partition("]")[0]).text for cell in table.header]
    columns = {
        symbol: (name, from_si(values, name))
        for name, (symbol, values) in zip(units, table.columns, strict=True)
    }
    return columns, table.axes, table.mark_findings, table.marks


def _marks(tydex: Path) -> tuple[str, ...]:
    """Return the marks of records among the comments of a TYDEX file."""
    from toolkit.calibration.records.use import SINCE, UNVERIFIED
    from toolkit.inputs import TYDEX_FILE, read_input

    lines = read_input(tydex, TYDEX_FILE).decode("utf-8", errors="replace").splitlines()
    return tuple(dict.fromkeys(line.strip() for line in lines if line.startswith((UNVERIFIED, SINCE))))


def _of_test(source: Path, resolved: Resolved) -> tuple[Columns, Axes, tuple[Finding, ...]]:
    import numpy as np

    all_conditions = resolved.result.reduced.conditions
    use = resolved.result.reduced.calibration
    conditions = [condition for condition in all_conditions if condition.used]
    reverse = sum(condition.rotation == "reverse" for condition in conditions)
    columns = {
        "SA": ("deg", np.degrees([condition.SA for condition in conditions])),
        "FZ": ("N", np.array([condition.FZ for condition in conditions])),
        "FY": ("N", np.array([condition.FY for condition in conditions])),
        "MZ": ("N*m", np.array([condition.MZ for condition in conditions])),
    }
    text = "the uncertainties and the provenance of the reduced test"
    if reverse:
        text += f", and which {reverse} of {len(conditions)} rows ran in reverse"
    if len(all_conditions) > len(conditions):
        text += f", and {len(all_conditions) - len(conditions)} blocks that the reduction does not use"
    note = Finding(
        rule="not-converted", where=str(source), message=f"the target has no place for {text}", level="note"
    )
    record_findings = [
        finding for finding in resolved.findings if finding.where == use.id
    ]  # how its record stands
    return columns, "SAE", (*record_findings, note)


def _written(
    columns: Columns, read_in: Axes, kind: str, axes: str, source: Path, marks: Sequence[str]
) -> tuple[str, tuple[Finding, ...]]:
    import csv
    import io

    from toolkit.channels import signs
    from toolkit.tires.table import MARKS
    from toolkit.tires.tydex import NAMES, tydex_text

    turn = signs(read_in, "ISO-W" if kind == "tydex" else axes)  # type: ignore[arg-type]
    turned = {symbol: (name, turn.get(symbol, 1) * values) for symbol, (name, values) in columns.items()}
    if kind == "csv":
        # Every row says how its record stands: a row that is copied elsewhere says so too.
        mark = [" - ".join(marks)] if marks else []
        table = io.StringIO()
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(
            [f"{symbol} [{name}]" for symbol, (name, _) in turned.items()] + [MARKS for _ in mark]
        )
        for row in zip(*(values for _, values in turned.values()), strict=True):
            writer.writerow([repr(float(value) + 0.0) for value in row] + mark)  # -0 is 0
        return table.getvalue(), ()
    out = [symbol for symbol in turned if symbol not in NAMES]
    text, findings = tydex_text(
        {symbol: column for symbol, column in turned.items() if symbol in NAMES}, comments=marks
    )
    if out:
        message = f"TYDEX has no channel for {', '.join(out)}"
        findings = (*findings, Finding(rule="not-converted", where=str(source), message=message))
    return text, findings


def check_fmu(fmu: Path, source: Path, names: Sequence[str], fmi: str) -> str:
    """Return which of the models becomes the FMU; refuse what cannot, before anything is fitted.

    Raises
    ------
    ConfigError
        none of the models is over all loads, or more than one; ``fmi`` is no version; the file would replace
        the table
    """
    from toolkit.tires.fmu.description import VERSIONS
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find

    fitting = [name for name in names if isinstance(find(name), GlobalModel)]
    if len(fitting) != 1:
        raise ConfigError(
            "an FMU holds one model over all loads", where="--fmu", got=", ".join(names),
            expected="one model over all loads, such as mf61 or brush; single loads have no FMU",
            next_step=f"give --model {fitting[0] if fitting else 'mf61'}, and no second of them",
            rule="fmu-needs-global",
        )  # fmt: skip
    if fmi not in VERSIONS:
        raise ConfigError(
            f"unknown version of FMI {fmi!r}", where="--fmi", got=fmi, expected=" or ".join(VERSIONS),
            next_step="name one of those expected", rule="fmi-version",
        )  # fmt: skip
    if same_file(fmu, source):
        raise ConfigError(
            "the FMU would replace the table", where="--fmu", got=fmu, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
    return fitting[0]


def write_fit_fmu(
    path: Path, fitted: Fitted, model_name: str, *, source: Path, side: str, fmi: str
) -> tuple[Finding, ...]:
    """Write the FMU of one of the fits; return what should be known about it.

    A Magic Formula is taken as the tire file that ``--tir`` would write, so that both hold the same tire.

    Raises
    ------
    FitError
        the data have one load: its change would be invented
    ConfigError
        the model's equations have no C
    """
    from toolkit.publication import write_result
    from toolkit.tires.fmu.archive import fmu_of
    from toolkit.tires.fmu.equations import equations_of_file, equations_of_fit
    from toolkit.tires.global_data import what_varies
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find
    from toolkit.tires.tir import parse_tir
    from toolkit.tires.tir_write import FITTYP, tir_text, tire_fit

    fit = next(fit for fit in fitted.globals if fit.model == model_name)
    data, use = fitted.data.take(fit.selection.rows), fitted.use
    if "two_loads" not in what_varies(data):
        raise FitError(
            "an FMU needs two loads or more", where=source, got=f"one load, {data.loads[0]:.0f} N",
            expected="two loads or more, five for a load sensitivity to trust",
            next_step="measure more loads; without --fmu the model is fitted at this load", rule="one-load",
        )  # fmt: skip
    model = find(model_name)
    assert isinstance(model, GlobalModel)  # noqa: S101  `check_fmu` saw to it
    equations: TireEquations
    if model_name in FITTYP:
        text = tir_text(tire_fit(model, fit, data, side=side))
        equations = equations_of_file(parse_tir(text, where=str(path)))
    else:
        equations = equations_of_fit(model, fit, data)
    notes = [f"Fitted to {source.name}, {len(data)} rows, {len(data.loads)} loads"]
    if use is not None:
        notes += [f"calibration {use.id} {use.sha256}", *([use.mark] if use.mark else [])]
    fmu = fmu_of(equations, name=path.stem, fmi=fmi, notes="; ".join(notes))
    write_result(path, fmu.content)
    return fmu_findings(path, fmu.binary)


def file_fmu(source: Path, target: Path, *, fmi: str) -> tuple[bytes, tuple[Finding, ...]]:
    """Return the FMU of a tire file, and what should be known about it.

    Raises
    ------
    ToolkitError
        the file cannot be read or evaluated; ``fmi`` is no version
    """
    from toolkit.calibration.records.use import DRAFT_MARK
    from toolkit.tires.fmu.archive import fmu_of
    from toolkit.tires.fmu.equations import equations_of_file
    from toolkit.tires.tir import read_tir
    from toolkit.tires.tir_checks import file_findings

    file = read_tir(source)
    mark = file.comment(DRAFT_MARK)
    findings = file_findings(file)
    fmu = fmu_of(
        equations_of_file(file), name=target.stem, fmi=fmi,
        notes="; ".join([f"Of {source.name}", *([mark] if mark else [])]),
    )  # fmt: skip
    return fmu.content, (*findings, *fmu_findings(target, fmu.binary))


def fmu_findings(path: Path, binary: str | None) -> tuple[Finding, ...]:
    """Return a note where an FMU holds sources alone."""
    if binary is not None:
        return ()
    text = (
        "no C compiler for this system was found (cc, gcc, clang on Linux): the FMU holds its sources alone, "
        "for tools that compile them"
    )
    return (Finding(rule="fmu-sources", where=str(path), message=text, level="note"),)
