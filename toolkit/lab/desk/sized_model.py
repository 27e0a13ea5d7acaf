"""The model of an answer that a home keeps: sized by hand beside its recordings, and kept as a model file.

A page shows the answer itself (`SeenDiagnosis`): verdict, figures, predictions. The figures are those of the
answer's own page: drawings in SVG, shown as pictures, in which no script runs.
"""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.diagnosis.answer.reader import ANSWER, read_answer
from toolkit.errors import ConfigError, UnreadableError
from toolkit.estimate import plus_minus
from toolkit.files import number_of, same_file
from toolkit.inputs import RESULT_FILE, TABLE_FILE, read_input, read_regular
from toolkit.lab.desk.chart import Chart, Series, sampling
from toolkit.lab.desk.holdings import CASE, Holdings
from toolkit.lab.desk.uploads import claimed_folder
from toolkit.publication import publication
from toolkit.report.diagnosis.page import explains_a_part, headline

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.by_hand import Beside, Sized, Trial
    from toolkit.simulation.model_file import ModelFile

MODELS = "models"
TRIAL_S = 10.0
"""Seconds that a case's own code may take for one answer: somebody waits for it with a hand on the size."""
_MOST_RUNS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class SizableModel:
    """The model file of an answer, and the case whose recordings it was fitted to."""

    model: ModelFile
    case: Path

    @property
    def effects(self) -> list[dict[str, Any]]:
        """Each effect with its parameters: value, as its field shows it, unit, standard error, and a step."""
        return [
            {
                "label": fitted.label, "statement": fitted.applied.effect.statement,
                "equation": fitted.applied.effect.equation,
                "parameters": [
                    {
                        "name": name, "value": fitted.applied.values[name],
                        "shown": _shown(fitted.applied.values[name], fitted.standard_errors.get(name)),
                        "unit": fitted.applied.units[name],
                        "standard_error": fitted.standard_errors.get(name),
                        "step": _step(fitted.applied.values[name], fitted.standard_errors.get(name)),
                    }
                    for name in fitted.applied.effect.names
                ],
            }
            for fitted in self.model.effects
        ]  # fmt: skip


def sizable_model(folder: Path, holdings: Holdings) -> SizableModel | None:
    """Return the model of an answer in ``folder``; None where the answer names nothing to size.

    Raises
    ------
    ConfigError
        the model file cannot be read; ``no-file``: its case is none of the home
    """
    from toolkit.diagnosis.answer.model_text import MODEL
    from toolkit.simulation.model_file import read_model

    path = folder / MODEL
    if not path.is_file():
        return None
    model = read_model(path)
    for place in holdings.places["case"].values():
        case = holdings.home / place / CASE
        if model.case is not None and same_file(case, model.case):
            return SizableModel(model=model, case=case)
    raise ConfigError(
        "the case of this answer is not in the home", where=path, got=model.case or "no case",
        expected=f"a folder of the home with the {CASE} that was diagnosed",
        next_step="bring the case into the home and diagnose it there", rule="no-file",
    )  # fmt: skip


def sized_from(model: ModelFile, stated: Mapping[str, str]) -> tuple[Sized, ...]:
    """Return the effects of a model as a form states them: ``on-I``, and ``size-I-NAME`` of effect I.

    A size that stands as its field showed it is the fitted one, to its last digit.

    Raises
    ------
    ConfigError
        ``wrong-value``: a size is no number
    """
    from toolkit.diagnosis.by_hand import Sized, as_fitted

    return tuple(
        Sized(
            on=stated.get(f"on-{at}") == "yes",
            values={
                name: _number(
                    stated, f"size-{at}-{name}", value, _shown(value, fitted.standard_errors.get(name))
                )
                for name, value in own.values.items()
            },
        )
        for at, (own, fitted) in enumerate(zip(as_fitted(model), model.effects, strict=True))
    )


def trial_answer(sizable: SizableModel, sized: Sequence[Sized], home: Path) -> dict[str, Any]:
    """Return what the sized model says: ``rmse`` by output with its unit, ``charts`` (title, view, chart).

    The case's own code runs isolated, for `TRIAL_S` at most.

    Raises
    ------
    ToolkitError
        as `toolkit.diagnosis.by_hand.tried`
    """
    from toolkit.diagnosis.by_hand import tried
    from toolkit.lab.studies.diagnosis import machine_registry, worker_limits

    trial = tried(
        sizable.model, sizable.case, sized, machine_registry(sizable.model.kind, None, home),
        budget_s=TRIAL_S, limits=worker_limits(isolated=True),
    )  # fmt: skip
    return shown_trial(trial)


def shown_trial(trial: Trial) -> dict[str, Any]:
    """Return a trial as a page shows it: ``rmse`` by output with its unit, ``charts``: title, view, chart."""
    units = {row.output: row.unit for row in trial.beside}
    return {
        "rmse": [
            {"channel": name, "value": None if math.isnan(value) else value, "unit": units[name]}
            for name, value in trial.rmse.items()
        ],
        "charts": [
            (f"{row.run}: {row.output}", view, chart)
            for row in trial.beside[:_MOST_RUNS]
            for view, chart in _charts(row, has_time=trial.has_time)
        ],
    }


def keep_model(home: Path, model: ModelFile, sized: Sequence[Sized]) -> str:
    """Write the sized model as a model file of the home; return its place.

    Raises
    ------
    OutputError
        it cannot be written
    """
    from toolkit.diagnosis.answer.model_text import MODEL
    from toolkit.diagnosis.by_hand import kept_model

    folder = home / MODELS / claimed_folder(home / MODELS, "model")
    text = kept_model(model, sized, folder)
    with publication(folder) as stage:
        (stage / MODEL).write_text(text, encoding="utf-8")
    return f"{MODELS}/{folder.name}/{MODEL}"


def _charts(row: Beside, *, has_time: bool) -> Iterator[tuple[str, Chart]]:
    """Yield the output of a run, ``beside`` what was recorded, and what is ``left`` of it."""
    import numpy as np

    def series(label: str, values: Array, *, line: bool) -> Series:
        at = np.flatnonzero(np.isfinite(values))
        at = at[:: sampling(len(at))]
        x = row.x[at] if has_time else at + 1.0
        return {"label": label, "x": x.tolist(), "y": values[at].tolist(), "line": line}

    recorded = series("file", row.recorded, line=False)
    simulated = series("augmented", row.simulated, line=True)
    left = series("augmented", row.simulated - row.recorded, line=True)
    x_label, y_label = "t [s]" if has_time else "row", f"{row.output} [{row.unit}]"
    yield "beside", {"x_label": x_label, "y_label": y_label, "series": [recorded, simulated]}
    yield "left", {"x_label": x_label, "y_label": y_label, "series": [left]}


def _step(value: float, error: float | None) -> float:
    """Return a decimal step for a size: near its standard error, else a tenth of the size."""
    size = error or abs(value) / 10
    return 10.0 ** math.floor(math.log10(size)) if size > 0 and math.isfinite(size) else 0.1


def _shown(value: float, error: float | None) -> str:
    """Return a size to the last place that its 95 % interval supports, as a field holds it."""
    return plus_minus(value, 2 * error if error else math.nan, spec=".6g").split(" ± ")[0]


def _number(stated: Mapping[str, str], key: str, fitted: float, shown: str) -> float:
    text = stated.get(key)
    if text is None or text == shown:
        return fitted
    number = number_of(text.replace(",", "."))
    if number is None:
        raise ConfigError(
            "a size is no number", where=key.partition("-")[2], got=text or "nothing", expected="a number",
            next_step="type a number, such as 0.002", rule="wrong-value",
        )  # fmt: skip
    return number


PAGE, PREDICTIONS = "diagnosis.html", "predictions"
_FIGURE = re.compile(r'<img alt="([^"]*)" src="(data:image/svg\+xml;base64,[A-Za-z0-9+/=]+)">')
_CURVES = ("nominal", "refitted", "augmented")
_FIRST = f"_{_CURVES[0]}"
_MOST_CHARTS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenDiagnosis:
    """An answer as its file has it; ``headline`` is the first line of its own page.

    ``partly`` tells that its effects are the smaller part of what is off.
    ``figures`` are (text, address of the picture), ``charts`` (file and channel, chart).
    """

    answer: dict[str, Any]
    headline: str
    partly: bool
    figures: tuple[tuple[str, str], ...]
    charts: tuple[tuple[str, Chart], ...]


def read_diagnosis(folder: Path) -> SeenDiagnosis:
    """Read the answer of a diagnosis.

    Raises
    ------
    UnreadableError
        it is none; what stands beside it may lack
    """
    try:
        diagnosis, file = read_answer(folder)
        answer = json.loads(read_input(file, RESULT_FILE))
    except ConfigError as error:
        raise _none(folder, str(error.got)) from error
    charts = tuple(zip(range(_MOST_CHARTS), _answer_charts(folder / PREDICTIONS), strict=False))
    return SeenDiagnosis(
        answer=answer,
        headline=headline(diagnosis, with_cause=True),
        partly=explains_a_part(diagnosis),
        figures=tuple(_figures(folder / PAGE)),
        charts=tuple(chart for _, chart in charts),
    )


def _figures(path: Path) -> Iterator[tuple[str, str]]:
    try:
        text = read_regular(path, RESULT_FILE).decode()
    except (OSError, ValueError):
        return
    yield from ((html.unescape(alt), source) for alt, source in _FIGURE.findall(text))


def _answer_charts(folder: Path) -> Iterator[tuple[str, Chart]]:
    """Yield the predictions of each channel over the time of its file, else over its rows."""
    for path in sorted(folder.glob("*.csv")):
        try:
            rows = list(csv.reader(io.StringIO(read_regular(path, TABLE_FILE).decode())))
            columns = dict(zip(rows[0], zip(*rows[1:], strict=True), strict=True))
            step = sampling(len(rows) - 1)
            numbers = {name: [float(text) for text in column[::step]] for name, column in columns.items()}
        except (OSError, ValueError, IndexError):
            continue
        channels = [name.removesuffix(_FIRST) for name in numbers if name.endswith(_FIRST)]
        # The first column is the time, where the case has one: each channel brings its own columns.
        first = next(iter(numbers), "")
        timed = bool(first) and not any(first == f"{name}_{curve}" for name in channels for curve in _CURVES)
        x_label, x = (first, numbers[first]) if timed else ("row", list(range(1, len(rows), step)))
        for channel in channels:
            series: list[Series] = [
                {"label": curve, "x": x, "y": numbers[f"{channel}_{curve}"], "line": True}
                for curve in _CURVES
                if f"{channel}_{curve}" in numbers and all(map(math.isfinite, numbers[f"{channel}_{curve}"]))
            ]
            if series:
                yield f"{path.name}: {channel}", {"x_label": x_label, "y_label": channel, "series": series}


def _none(folder: Path, actual: str) -> UnreadableError:
    return UnreadableError(
        "the answer of the diagnosis cannot be read", where=folder / ANSWER, got=actual,
        expected="diagnosis.json as 'toolkit diagnose' writes it", next_step="run the diagnosis again",
        rule="no-file",
    )  # fmt: skip
