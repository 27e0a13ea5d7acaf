"""An interlaboratory comparison as a document: assigned values, scores, consistency and precision.

The figures are data: means with their U, Mandel's h and k.
"""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from toolkit.comparison.laboratories import LaboratoryComparison, Measurand, Score
from toolkit.comparison.precision import OUTLIER, STRAGGLER, h_limit, k_limit
from toolkit.estimate import round_to_uncertainty, round_uncertainty
from toolkit.files import sha256_bytes
from toolkit.report.content import Curve, Plot, ReportContent
from toolkit.report.document import Document, Rows, finding_table
from toolkit.report.style import Style
from toolkit.units import printed
from toolkit.version import __version__

_SUBJECT = "Interlaboratory comparison"
_MOST_MEANS, _MOST_NAMED = 6, 3
_METHOD = (
    "Scores z', zeta and E_n by ISO 13528; repeatability and reproducibility by ISO 5725-2, for laboratories "
    "with different numbers of results too; Mandel's h and k with the limits of each laboratory's own number "
    "of results. A consensus is the robust mean of algorithm A. U: expanded uncertainty with the k that the "
    "laboratory states. No result is left out."
)
_READING = (
    "|z'| beyond 2 is a warning signal, from 3 on an action signal; |E_n| from 1 on says that a result and "
    "the assigned value differ by more than their uncertainties. h or k beyond its limit at 5 % marks a "
    "straggler, at 1 % an outlier."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedLaboratories:
    """A comparison of laboratories with the file that it was read from and the day of its document."""

    comparison: LaboratoryComparison
    source: str
    sha256: str
    issued: dt.date

    @property
    def title(self) -> str:
        """What was compared."""
        names = [measurand.name for measurand in self.comparison.measurands]
        listed = ", ".join(names) if len(names) <= _MOST_NAMED else f"{len(names)} measurands"
        return f"{_SUBJECT}: {listed}"

    @property
    def id(self) -> str:
        """Identification: the same results, reference and sigma_pt have the same on any day."""
        key = "\n".join(
            f"{m.name}|{m.assigned_by}|{m.assigned!r}|{m.sigma_pt!r}" for m in self.comparison.measurands
        )
        return f"ILC-{sha256_bytes(f'{self.sha256}|{key}'.encode())[:8].upper()}"

    @property
    def scored(self) -> Iterator[tuple[Measurand, Score]]:
        """Every score beside its measurand."""
        return ((m, score) for m in self.comparison.measurands for score in m.scores)

    @property
    def people(self) -> frozenset[str]:
        """The names of those who took part."""
        return frozenset(score.laboratory for _, score in self.scored)


LABORATORIES: Document[ComparedLaboratories] = Document(
    name="laboratories",
    family="laboratories",
    package=__package__,
    required=("tk:laboratories.source", "tk:laboratories.id"),
)


def build_laboratories_content(compared: ComparedLaboratories, style: Style) -> ReportContent:
    """Return everything that a template of an interlaboratory comparison can ask for."""
    return LABORATORIES.content(
        compared,
        style,
        title=compared.title,
        identity=compared.id,
        subject=_SUBJECT,
        issued=compared.issued,
        people=compared.people,
    )


def _summary(compared: ComparedLaboratories, _style: Style) -> str:
    scores = [score for _, score in compared.scored]
    signals = [score.signal for score in scores]
    departures = [d for score in scores for d in (score.h_departure, score.k_departure)]
    return (
        f"Laboratories: {len({score.laboratory for score in scores})}. "
        f"Action signals by z': {signals.count('action')}; "
        f"warning signals by z': {signals.count('warning')}; "
        f"|E_n| from 1 on: {sum(score.En_signal for score in scores)}; "
        f"outliers by h or k: {departures.count('outlier')}; "
        f"stragglers by h or k: {departures.count('straggler')}."
    )


DECLARED = (
    LABORATORIES.text("id", "identification, made from results and choices", lambda compared, _: compared.id),
    LABORATORIES.text("title", "title, with the measurands", lambda compared, _: compared.title),
    LABORATORIES.text("summary", "how many signals there are, in one sentence", _summary),
    LABORATORIES.text("method", "standards and procedures", lambda *_: _METHOD),
    LABORATORIES.text("reading", "from which limits on scores are signals", lambda *_: _READING),
    LABORATORIES.text(
        "source", "file of the results, with its SHA-256", lambda c, _: f"{c.source} ({c.sha256})"
    ),
    LABORATORIES.date("issued", "day of the document", lambda compared, _: compared.issued),
    LABORATORIES.text("software", "program and version that made it", lambda *_: f"toolkit {__version__}"),
    finding_table(
        LABORATORIES, "laboratory_findings", "measurand", lambda compared: compared.comparison.findings
    ),
)


def _ratio(style: Style, value: float | None) -> str:
    return "-" if value is None else style.decimal(f"{value:.2f}")


def _mean(style: Style, measurand: Measurand, score: Score) -> str:
    """Return a laboratory's mean to the last place of its U, else to that of the assigned value's."""
    U = score.U or 2 * measurand.u_assigned
    return style.decimal(round_to_uncertainty(score.mean, U) if U else f"{score.mean:.5g}")


def _uncertain(style: Style, value: float | None) -> str:
    return "-" if value is None else style.decimal(round_uncertainty(value))


@LABORATORIES.table(
    "laboratory_assigned",
    "the assigned value of every measurand, and the standard deviation that scores are reckoned by",
    """
    measurand|measurand
    unit|unit of the row
    assigned|assigned value
    u|its standard uncertainty
    by|reference laboratory, or the consensus
    sigma|standard deviation for proficiency assessment, sigma_pt
    sigma_by|where that is from
    """,
)
def assigned(compared: ComparedLaboratories, style: Style) -> Rows:
    """Return the assigned values."""
    for m in compared.comparison.measurands:
        value = round_to_uncertainty(m.assigned, 2 * m.u_assigned) if m.u_assigned else f"{m.assigned:.6g}"
        texts = (style.decimal(value), _uncertain(style, m.u_assigned))
        yield m.name, printed(m.unit), *texts, m.assigned_by, _uncertain(style, m.sigma_pt), m.sigma_by


@LABORATORIES.table(
    "laboratory_scores",
    "the scores of every laboratory in every measurand",
    """
    measurand|measurand
    laboratory|laboratory
    n|number of results
    mean|mean of its results
    U|expanded uncertainty that it states
    z|score z'
    zeta|score zeta
    En|score E_n
    signal|action, warning, E_n, or nothing
    """,
)
def scores(compared: ComparedLaboratories, style: Style) -> Rows:
    """Return the scores."""
    for m, score in compared.scored:
        signals = [f"{score.signal} signal" if score.signal else "", "E_n" if score.En_signal else ""]
        ratios = (_ratio(style, value) for value in (score.z_prime, score.zeta, score.En))
        mean, U = _mean(style, m, score), _uncertain(style, score.U)
        yield m.name, score.laboratory, str(score.n), mean, U, *ratios, ", ".join(filter(None, signals))


@LABORATORIES.table(
    "laboratory_consistency",
    "Mandel's h and k of every laboratory in every measurand",
    """
    measurand|measurand
    laboratory|laboratory
    n|number of results
    h|Mandel's h: how far its mean lies from that of all
    h_departure|straggler or outlier by h, or nothing
    k|Mandel's k: its scatter over the repeatability
    k_departure|straggler or outlier by k, or nothing
    """,
)
def consistency(compared: ComparedLaboratories, style: Style) -> Rows:
    """Return h and k where they can be told of a measurand."""
    for m, score in compared.scored:
        if score.h is not None or score.k is not None:
            yield (
                m.name, score.laboratory, str(score.n), _ratio(style, score.h), score.h_departure or "",
                _ratio(style, score.k), score.k_departure or "",
            )  # fmt: skip


@LABORATORIES.table(
    "laboratory_precision",
    "repeatability and reproducibility of every measurand",
    """
    measurand|measurand
    unit|unit of the row
    laboratories|number of laboratories
    n|number of results
    mean|mean of all results
    s_r|repeatability standard deviation
    r|repeatability limit
    s_L|standard deviation between laboratories
    s_R|reproducibility standard deviation
    R|reproducibility limit
    """,
)
def precision(compared: ComparedLaboratories, style: Style) -> Rows:
    """Return the precision where more than one laboratory reports."""
    for m in compared.comparison.measurands:
        if (p := m.precision) is not None:
            spreads = (None if p.s_r is None else p.s_r.value, p.r, p.s_L, p.s_R, p.R)
            mean = style.decimal(round_to_uncertainty(p.mean, p.s_R) if p.s_R else f"{p.mean:.5g}")
            texts = (_uncertain(style, value) for value in spreads)
            yield m.name, printed(m.unit), str(p.laboratories), str(p.n), mean, *texts


@LABORATORIES.table(
    "laboratory_outliers",
    "Cochran's and Grubbs' tests of every measurand",
    """
    measurand|measurand
    test|Cochran's of the scatter, or Grubbs' of the means
    laboratory|the laboratory that scatters most, or whose mean lies farthest off
    p|chance of such a departure among alike laboratories
    """,
)
def outliers(compared: ComparedLaboratories, style: Style) -> Rows:
    """Return the tests that the results allow."""
    for m in compared.comparison.measurands:
        if (p := m.precision) is not None:
            tests = (
                ("Cochran: scatter", p.cochran_laboratory, p.cochran_p),
                ("Grubbs: mean", p.grubbs_laboratory, p.grubbs_p),
            )
            for test, laboratory, chance in tests:
                if chance is not None:
                    yield m.name, test, laboratory, style.decimal(f"{chance:.2g}")


@LABORATORIES.figures(
    {
        f"laboratories_{number}": f"measurand {number}: means with U against the assigned value"
        for number in range(1, _MOST_MEANS + 1)
    }
    | {
        "laboratories_h": "Mandel's h of every laboratory, with its limits",
        "laboratories_k": "Mandel's k of every laboratory, with its limits",
    },
    charts=False,
)
def figures(compared: ComparedLaboratories, _style: Style) -> Iterator[Plot]:
    """Return the figures of the first measurands, and of h and k."""
    declared = {f"laboratories_{number}" for number in range(1, _MOST_MEANS + 1)}
    for name, plot in laboratory_plots(compared.comparison).items():
        if name in declared or name in ("laboratories_h", "laboratories_k"):
            yield plot


_BARS = 0.8  # of the room of a laboratory, for the bars of all measurands together


def laboratory_plots(comparison: LaboratoryComparison) -> dict[str, Plot]:
    """Return the figure of every measurand, and those of h and k where they can be told, by name."""
    measurands = comparison.measurands
    plots = [_means(measurand, number) for number, measurand in enumerate(measurands, start=1)]
    h = _bars(comparison, "h", lambda score: score.h, _h_lines(comparison))
    k = _bars(comparison, "k", lambda score: score.k, _k_lines(comparison))
    return {plot.name: plot for plot in (*plots, h, k) if plot is not None}


def _means(measurand: Measurand, number: int) -> Plot:
    scores = sorted(measurand.scores, key=lambda score: score.mean)
    places = tuple(float(place) for place in range(len(scores)))
    ends = (-0.5, len(scores) - 0.5)
    band = 2 * (measurand.sigma_pt or 0.0)
    lines = [
        ("assigned value", 0.0, 1),
        *([("±2 sigma_pt", off, 2) for off in (-band, band)] if band else []),
    ]
    listed = ", ".join(f"{score.laboratory} {score.mean:.5g}" for score in scores)
    return Plot(
        name=f"laboratories_{number}",
        x_label="laboratory",
        y_label=f"{measurand.name} [{measurand.unit}]",
        curves=(
            Curve(
                label="mean with U", x=places, y=tuple(score.mean for score in scores),
                error=tuple(score.U or 0.0 for score in scores), style="points",
            ),
            *(
                Curve(label=label, x=ends, y=(measurand.assigned + off,) * 2, group=group, style="line")
                for label, off, group in lines
            ),
        ),
        caption=f"{measurand.name}: laboratories against the assigned value",
        zero_y=False,
        alt=f"{measurand.name}, assigned {measurand.assigned:.5g} {measurand.unit}: {listed}",
        names=tuple(score.laboratory for score in scores),
    )  # fmt: skip


def _bars(
    comparison: LaboratoryComparison,
    name: str,
    statistic: Callable[[Score], float | None],
    limits: tuple[tuple[str, float], ...],
) -> Plot | None:
    """Return bars of a statistic, grouped by laboratory in the order of the file; None without any."""
    scored = [m for m in comparison.measurands if any(statistic(score) is not None for score in m.scores)]
    if not scored:
        return None
    laboratories = list(dict.fromkeys(score.laboratory for m in scored for score in m.scores))
    width = _BARS / len(scored)
    curves, parts = [], []
    for number, measurand in enumerate(scored):
        offset = (number - (len(scored) - 1) / 2) * width
        values = {score.laboratory: statistic(score) for score in measurand.scores}
        bars = {place: values.get(laboratory) for place, laboratory in enumerate(laboratories)}
        heights = {place: value for place, value in bars.items() if value is not None}
        curves.append(
            Curve(
                label=measurand.name, x=tuple(place + offset for place in heights), y=tuple(heights.values()),
                group=number, style="bars", width=0.9 * width,
            )
        )  # fmt: skip
        listed = ", ".join(f"{laboratories[place]} {value:.2f}" for place, value in heights.items())
        parts.append(f"{measurand.name}: {listed}")
    ends = (-0.5, len(laboratories) - 0.5)
    lines = [
        Curve(label=label, x=ends, y=(limit, limit), group=len(scored) + label.startswith("1 "), style="line",
              open=label.startswith("5 "))
        for label, limit in limits
    ]  # fmt: skip
    return Plot(
        name=f"laboratories_{name}",
        x_label="laboratory",
        y_label=f"Mandel's {name}",
        curves=(*curves, *lines),
        caption=f"Mandel's {name} of the laboratories, with its limits at 5 % and 1 %",
        alt=f"Mandel's {name} by laboratory: {'; '.join(parts)}",
        names=tuple(laboratories),
    )


def _h_lines(comparison: LaboratoryComparison) -> tuple[tuple[str, float], ...]:
    """Return the limits of the number of laboratories that most measurands have."""
    numbers = Counter(len(m.scores) for m in comparison.measurands if any(s.h is not None for s in m.scores))
    if not numbers:
        return ()
    ((p, _),) = numbers.most_common(1)
    lines = ((f"{100 * level:.0f} %", h_limit(p, level)) for level in (STRAGGLER, OUTLIER))
    return tuple((label, sign * limit) for label, limit in lines for sign in (1, -1))


def _k_lines(comparison: LaboratoryComparison) -> tuple[tuple[str, float], ...]:
    """Return the limits of the number of results that most laboratories have."""
    sizes = Counter(
        (score.n - 1, sum(rival.n - 1 for rival in m.scores))
        for m in comparison.measurands
        for score in m.scores
        if score.k is not None
    )
    if not sizes:
        return ()
    (((dof, total), _),) = sizes.most_common(1)
    return tuple((f"{100 * level:.0f} %", k_limit(dof, total, level)) for level in (STRAGGLER, OUTLIER))
