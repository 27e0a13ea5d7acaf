"""The tag catalogue: every ``tk:`` tag that a template may use, generated lists included.

A tag is ``tk:<path>`` with an optional ``|<format>``; the kinds are ``text number date figure table if
row``. Values have a default format each; a number takes one Python format spec after the bar, a figure
``width=120mm``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from toolkit.characteristics.catalogue import figures, summary
from toolkit.errors import TemplateError
from toolkit.report.columns import TABLES
from toolkit.report.diagnosis.entries import REPORT_FIGURES, REPORT_TABLES, REPORT_VALUES
from toolkit.report.entries import Spec, Tables, catalogue_of, conditions_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """A tag as it stands in a template: path without ``tk:`` and the format after the bar."""

    path: str
    spec: str | None = None

    @property
    def family(self) -> str:
        """``figure``, ``table``, ``if``, ``row`` or ``value``."""
        head = self.path.partition(".")[0]
        return head if head in ("figure", "table", "if", "row") else "value"

    @property
    def name(self) -> str:
        """The path after the family, or the whole path of a value."""
        return self.path if self.family == "value" else self.path.partition(".")[2]

    def __str__(self) -> str:
        """Return the tag as a template writes it."""
        return f"tk:{self.path}" + (f"|{self.spec}" if self.spec is not None else "")


def parse_tag(text: str) -> Tag | None:
    """Read ``tk:path|format``; None where the text is no tag of the toolkit.

    >>> parse_tag("tk:calibration.FY.D51|.5g")
    Tag(path='calibration.FY.D51', spec='.5g')
    >>> parse_tag("Company") is None
    True
    """
    text = text.strip()
    if not text.startswith("tk:"):
        return None
    path, bar, spec = text[3:].partition("|")
    return Tag(path=_canonical(path.strip()), spec=spec.strip(" \t") if bar else None)


def _canonical(path: str) -> str:
    # practice and thesis write Fy and Mz; the channels are FY and MZ.
    return re.sub(r"^calibration\.([FM])([xyz])\.", lambda m: f"calibration.{m[1]}{m[2].upper()}.", path)


def _texts() -> list[Spec]:
    pairs = """
    test.name|name of the test
    test.operator|operator
    test.requestor|requestor (customer)
    test.special|what is special about the test
    test.surface|surface of the drum
    test.machine|test machine
    test.pressure|test pressure in psi and bar
    test.loads|the loads of the test, means of the blocks
    test.slip_angles|the slip-angle steps of the test
    test.directions|directions of rotation
    test.axes|axis system of all results
    test.averaging|what was averaged and discarded
    test.tare|which tare was subtracted
    tire.size|tire size
    tire.company|maker
    tire.DOT|DOT number
    tire.series|series
    tire.construction|construction
    tire.rim|rim
    calibration.id|id of the calibration record that computed the forces
    calibration.hash|SHA-256 of the calibration record
    calibration.instrument|instrument of the calibration record
    calibration.status|verified, unverified, or not approved and why
    report.id|id of the report, made from its inputs
    report.title|title of the report
    software.name|program
    software.version|version of the program
    laboratory.name|laboratory (from the style file)
    laboratory.address|its address (from the style file)
    laboratory.contact|how to reach it (from the style file)
    laboratory.accreditation|its accreditation (from the style file)
    report.customer|customer: of [report] in test.toml, else the requestor
    report.customer_contact|the customer's address or contact
    report.location|where the test was made: of [report], else the laboratory's place
    report.method|method: of [report], else of the style file, else what the test's protocol names
    report.deviations|deviations from the method: of [report], else a count of the findings
    report.sampling|sampling plan
    report.conformity|statement of conformity
    report.external|results that come from another laboratory
    report.authorised_by|who authorises the report: of [report], else of the style file
    report.authorised_function|function of that person
    report.amends|id of the report that this one replaces
    report.amendment|why it is replaced
    item.description|the item tested: of [report], else size, maker, series and DOT number of the tire
    item.condition|condition of the item as received
    simulated|simulated data or measured data
    unit.force|unit of forces in the report
    unit.moment|unit of moments
    unit.force_per_angle|unit of the cornering stiffness
    unit.moment_per_angle|unit of the aligning stiffness
    """
    return [
        Spec(path=p.strip(), kind="text", description=d)
        for p, d in (line.split("|") for line in pairs.strip().splitlines())
    ]


_VALUES = (
    *_texts(),
    Spec(path="test.date", kind="date", description="date of the test"),
    Spec(path="report.date", kind="date", description="date of issue"),
    Spec(path="item.received", kind="date", description="date on which the item was received"),
    Spec(path="test.pressure.psi", kind="number", unit="psi", spec=".1f", description="test pressure"),
    Spec(path="test.pressure.bar", kind="number", unit="bar", spec=".2f", description="test pressure"),
    Spec(path="test.pressure.kPa", kind="number", unit="kPa", spec=".0f", description="test pressure"),
    Spec(path="test.speed", kind="number", unit="km/h", spec=".2f", description="speed of the drum surface"),
    Spec(path="test.rated_load", kind="number", unit="N", spec=".0f", description="rated load of the tire"),
    Spec(path="test.files", kind="number", unit="1", spec="d", description="number of recordings"),
    Spec(path="test.conditions", kind="number", unit="1", spec="d", description="number of conditions used"),
    Spec(path="test.findings", kind="number", unit="1", spec="d", description="number of findings"),
    *REPORT_VALUES,
)

_SUMMARY = (
    ("load", "N", ".0f", "load of the summary: nearest to the rated load, else the middle one"),
    *((str(one.summary), one.printed_unit, f".{one.digits}f", one.summary_text) for one in summary()),
)


FIGURES = {
    "fy_vs_slip": "lateral force against slip angle, all loads",
    "mz_vs_slip": "aligning moment against slip angle, all loads",
    "fy_vs_load": "lateral force against load at constant slip angles",
    "mz_vs_load": "aligning moment against load at constant slip angles",
    "gough": "Gough plot: lateral force against aligning moment",
    **{figure.name: figure.text for figure in figures()},
    "models_fy": "error of each tire model in lateral force, fitted and with each load left out",
    "models_mz": "error of each tire model in aligning moment, fitted and with each load left out",
    **REPORT_FIGURES,
}
EVERY_TABLE: Tables = {**TABLES, **REPORT_TABLES}

CONDITIONS = {
    "simulated": "the data are simulated",
    "measured": "the data are measured",
    "unverified": "the calibration record is a legacy import",
    "draft": "the calibration record was not approved and in force on the test's date",
    "impossible": "values of the test are such as no tire has",
    "verified": "the calibration record reproduces from its stored data",
    "pull": "both directions of rotation gave a pull characteristic",
    "no_pull": "there is no pull characteristic, for instance for want of a reversed run",
    "reverse": "the test has reversed runs",
    "stiffness": "a cornering or aligning stiffness exists",
    "no_findings": "the test has no findings",
}


_LOADS = ("FY", "MZ", "MX", "FX", "FZ")
TERM = re.compile(rf"calibration\.(?:{'|'.join(_LOADS)})\.[A-Za-z0-9_^*()]+")


def catalogue() -> tuple[Spec, ...]:
    """Return every tag in the order of the manual; coefficients of the M-15's cells stand for all."""
    coefficients = [
        Spec(
            path=f"calibration.{load}.{term}",
            kind="number",
            spec=".6g",
            description=f"coefficient of {term} in {load}, in the record's units",
        )
        for load in ("FY", "MZ")
        for term in ("D51", "D52", "E5", "intercept")
    ]
    summary = [
        Spec(path=f"summary.{name}", kind="number", unit=unit, spec=spec, description=text)
        for name, unit, spec, text in _SUMMARY
    ] + [
        Spec(
            path=f"summary.{name}.with_U",
            kind="text",
            description=f"{text}, with its expanded uncertainty; n/a where there is none",
        )
        for name, _, _, text in _SUMMARY[1:]
    ]
    return catalogue_of([*_VALUES, *summary, *coefficients], FIGURES, EVERY_TABLE, condition_names())


def condition_names() -> dict[str, str]:
    """Return every name that ``tk:if.<name>`` may have: conditions, figures, tables and values."""
    names = conditions_of(CONDITIONS, FIGURES, EVERY_TABLE, _VALUES)
    return names | {f"summary.{name}": f"there is a value: {text}" for name, _, _, text in _SUMMARY}


# A width or precision of three digits would be a denial of service, not a format.
_NUMBER_SPEC = re.compile(r"(?:[^{}]?[<>=^])?[+\- ]?z?#?0?\d{0,2}[,_]?(?:\.\d{1,2})?[eEfFgGn%d]?")
_WIDTH = re.compile(r"width=(\d{1,4}(?:\.\d{1,3})?)(mm|cm|in|pt)")
_EMU = {"mm": 36000, "cm": 360000, "in": 914400, "pt": 12700}


def format_problem(kind: str, spec: str | None) -> str | None:
    """Tell what is wrong with the format of a tag of some kind; None where it is right."""
    if spec is None:
        return None
    if kind == "number":
        return None if spec and _NUMBER_SPEC.fullmatch(spec) else "not a Python format spec of a number"
    if kind == "figure":
        return None if _WIDTH.fullmatch(spec) else "a figure takes width=NUMBERmm (or cm, in, pt)"
    return f"a {kind} takes no format"


def width_emu(spec: str | None) -> int | None:
    """Return the width that a figure's tag asks for, in EMU (914 400 an inch)."""
    found = _WIDTH.fullmatch(spec) if spec else None
    return round(float(found[1]) * _EMU[found[2]]) if found else None


def format_number(value: float, spec: str, *, decimal_comma: bool = False) -> str:
    """Return a finite number in a format; minus zero is zero.

    >>> format_number(-0.001, ".2f"), format_number(1234.5, ",.1f", decimal_comma=True)
    ('0.00', '1.234,5')
    """
    try:
        if spec.endswith("d"):
            if value != round(value):
                raise ValueError("a whole-number format for a number that is not whole")  # noqa: TRY301
            text = format(round(value), spec)
        else:
            text = format(float(value), spec)
            if "-" in text and not re.search(r"[1-9]", text):
                text = format(0.0, spec)
    except ValueError as error:
        raise TemplateError(
            "a number cannot be printed in the format of its tag",
            got=f"|{spec}: {error}",
            expected="one Python format spec such as .2f or .5g",
            next_step="correct the tag in the template",
            rule="bad-format",
        ) from error
    return text.translate(str.maketrans(".,", ",.")) if decimal_comma else text
