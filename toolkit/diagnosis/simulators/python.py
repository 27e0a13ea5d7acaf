"""Kind ``python``: any simulator as a function of its inputs and parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.along_recordings import AlongRecordings
from toolkit.diagnosis.simulators.array_table import ArrayTable, Trials
from toolkit.diagnosis.simulators.channels import true_inputs
from toolkit.diagnosis.simulators.memory import Memory
from toolkit.diagnosis.simulators.tire import base_drive, late, through_tire, tire_signs
from toolkit.diagnosis.simulators.user_code import load_functions, raised, silenced
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.signals import Drive, Setting, TireForces
from toolkit.errors import FitError
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.case_code import CaseCode
    from toolkit.worker.serve import Handlers

    Question = tuple[Run, Mapping[str, float], Mapping[str, Array]]
    Answer = Callable[[Run, Mapping[str, float], Mapping[str, Array]], Arrays]
    Answers = Callable[[Sequence[Question]], list[Arrays | None]]

_KEPT, _HELD = 2_000, 200_000_000  # simulations of a run that are remembered, and their bytes
LARGEST = 1e100  # of an output in its unit: the squares of larger ones are no numbers any more
# Drive's field -> the channel that a simulator takes it from.
_FIELDS = (("SA", ("SA", "SA_CMD")), ("FZ", ("FZ", "FZ_CMD")), ("IA", ("IA",)), ("V", ("V",)))


class UserFunction:
    """The function of a case's file: what it returns is checked where it runs."""

    def __init__(self, case: Case) -> None:
        self.case = case
        (self._function,) = load_functions(case.file(), case.simulation.function)
        self._arrays = Trials()

    def call(self, run: Run, p: Mapping[str, float], changed: Mapping[str, Array]) -> Arrays:
        """Return the outputs of a run with some of its inputs changed; FitError where they are none."""
        import pandas as pd

        of_arrays, due = None, self._arrays.same and self._arrays.due(run)
        if self._arrays.same:
            try:
                of_arrays = self._outputs(ArrayTable(self._inputs(run, changed)), run, p)
            except FitError:  # arrays do not do, or no inputs do: a DataFrame tells which
                due = True
            if of_arrays is not None and not due:
                return of_arrays
        of_table = self._outputs(pd.DataFrame(self._inputs(run, changed)), run, p)
        if due:
            self._arrays.judge(of_arrays, of_table)
        return of_table

    def _inputs(self, run: Run, changed: Mapping[str, Array]) -> Arrays:
        return {
            channel.name: np.array(changed.get(channel.name, run.columns[channel.name]))
            for channel in self.case.channels
            if channel.role != "output" and channel.name in run.columns
        }

    def _outputs(self, inputs: Any, run: Run, p: Mapping[str, float]) -> Arrays:
        """Return the function's outputs, checked."""
        import pandas as pd

        try:
            with silenced():
                answer = self._function(inputs, dict(p))
        except (Exception, SystemExit) as error:
            raise _failed(
                self.case, run, raised(error, inputs=[str(name) for name in inputs.columns], p=p)
            ) from error
        if not isinstance(answer, pd.DataFrame):
            raise _failed(self.case, run, f"a {type(answer).__name__}, not a pandas.DataFrame")
        if len(answer) != run.rows:
            raise _failed(self.case, run, f"{len(answer)} rows for {run.rows} rows of inputs")
        result = {}
        for output in self.case.outputs:
            if output.name not in answer.columns:
                raise _failed(
                    self.case, run, f"no column {output.name!r}; it has {', '.join(map(str, answer.columns))}"
                )
            values = _numbers(answer, output.name)
            if values is None or values.ndim != 1:
                got = "no numbers" if values is None else "several columns of one name"
                raise _failed(self.case, run, f"{got} in column {output.name!r}")
            if not np.isfinite(values).all():
                raise _failed(
                    self.case, run, f"no number in column {output.name!r}, row {_first_bad(values)}"
                )
            if np.abs(values).max(initial=0.0) > LARGEST:
                raise _failed(self.case, run, f"values beyond {LARGEST:.0e} in column {output.name!r}")
            result[output.name] = values
        return result


class PythonModel(AlongRecordings):
    """A simulator in Python: ``simulate(inputs, p)`` returns one row for each row of inputs.

    ``answer`` is its function with checked outputs, in this process or in a worker. Each question of a worker
    is a way there and back: ``answers`` are those of many at once, None of what gives no usable output.
    """

    def __init__(self, case: Case, answer: Answer, answers: Answers | None = None) -> None:
        super().__init__(case)
        self._called, self._answers = answer, answers
        self._names = {channel.name for channel in case.channels}
        self.inputs = frozenset(channel.name for channel in case.drivers if channel.role == "input")
        self._kept: Memory[Arrays] = Memory(_KEPT, _HELD)
        self._last: dict[Run, Mapping[str, Array]] = {}  # what was changed of a run's inputs, last time
        self.capability = replace(
            self.capability_with(unsure={}, findings=(), repeats=self._repeats),
            together=None if answers is None else self._together,
        )

    def own_outputs(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], around: Setting
    ) -> Arrays:
        """Return what the simulator says of its inputs without the effects that they were recorded with."""
        return self.call(run, p, true_inputs(run, active, self.inputs, around))

    def lateral(self, run: Run) -> Array:
        """Return the nominal simulator's FY."""
        return self.call(run, {parameter.name: parameter.value for parameter in self.parameters}, {})["FY"]

    def tire_inputs(self) -> tuple[bool, bool]:
        """Tell which of camber and pressure the simulator takes."""
        return "IA" in self.drivers, bool({"P", "P_INFL"} & self.drivers)

    def call(self, run: Run, p: Mapping[str, float], changed: Mapping[str, Array]) -> Arrays:
        """Return the simulator's own outputs with some of its inputs changed, checked.

        The same inputs and parameters give the same outputs: a slow simulator is not asked twice.
        """
        key = _key(run, p, changed)
        if key not in self._kept:
            self._kept[key] = self._called(run, p, changed)
        if changed:
            self._last[run] = changed
        return self._kept[key]

    def _together(
        self,
        runs: Sequence[Run],
        points: Sequence[tuple[Mapping[str, float], Sequence[AppliedEffect]]],
    ) -> None:
        """Ask at once what `simulate` will ask: with inputs as recorded, and as effects changed them last."""
        assert self._answers is not None  # noqa: S101  or this is not asked
        asked: dict[object, Question] = {}
        for p, active in points:
            if any(applied.channel in self.inputs for applied in active):
                continue
            drives = any(applied.effect.drive is not None for applied in active)
            for run in runs:
                for changed in ({}, self._last[run]) if drives and run in self._last else ({},):
                    asked[_key(run, p, changed)] = run, p, changed
        missing = [key for key in asked if key not in self._kept][:_KEPT]
        if len(missing) > 1:
            answers = self._answers([asked[key] for key in missing])
            for key, made in zip(missing, answers, strict=True):
                if made is not None:
                    self._kept[key] = made

    def _repeats(self, run: Run, p: Mapping[str, float]) -> None:
        """Refuse a simulator that answers one question in two ways: its noise would pass for physics."""
        first, second = self.call(run, p, {}), self._called(run, p, {})
        for name, values in first.items():
            if not np.allclose(values, second[name], rtol=1e-9, atol=1e-12 * float(np.abs(values).max())):
                raise _failed(
                    self.case, run, f"other values of {name!r} on a second call with the same inputs"
                )

    def tire_outputs(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], around: Setting
    ) -> Arrays:
        """Return what the simulator says of a tire that road and carriage drive otherwise."""
        case = self.case
        start = base_drive(case, run, load_N=self.load_N, outputs=False)
        to_case, to_machine = tire_signs("SAE", case.axes, run), tire_signs(case.axes, "machine", run)
        units = {name: unit(case.unit(name)).factor for name in ("FY", "MZ") if name in self._names}

        def raw(SA: Array, drive: Drive) -> Arrays:
            changed = {}
            for field, names in _FIELDS:
                value = SA * to_case["SA"] if field == "SA" else getattr(drive, field)
                for name in names:
                    if name in self._names:
                        changed[name] = value / unit(case.unit(name)).factor
            for name in ("P_INFL", "P"):
                if name in self._names:
                    changed[name] = run.columns[name] + drive.pressure_error / unit(case.unit(name)).factor
            return self.call(run, p, changed)

        def steady(SA: Array, drive: Drive) -> TireForces:
            forces = raw(SA, drive)
            zero = np.zeros(run.rows)
            return TireForces(
                FY=forces["FY"] * units["FY"] * to_machine["FY"] if "FY" in forces else zero,
                MZ=forces["MZ"] * units["MZ"] * to_machine["MZ"] if "MZ" in forces else zero,
            )

        forces = through_tire(start, steady, active, run, around)
        back = tire_signs("machine", case.axes, run)
        outputs = dict(self.call(run, p, {}))
        for name in ("FY", "MZ"):
            if name in outputs:
                outputs[name] = getattr(forces, name) * back[name] / units[name]
        if "FZ" in outputs:
            loaded = late(start, active, run, around, lambda drive: steady(drive.SA, drive))
            outputs["FZ"] = outputs["FZ"] if loaded is None else raw(loaded.SA, loaded)["FZ"]
        return outputs


def build(case: Case, _: Path | None, code: CaseCode | None) -> PythonModel:
    """Return the simulation of a case of this kind; ConfigError where its file has no such function."""
    if code is None:
        return PythonModel(case, UserFunction(case).call)
    code.begin(handlers)
    return PythonModel(
        case,
        apart(case, code, lambda run, name: _failed(case, run, f"no number in column {name!r}")),
        _many_apart(case, code),
    )


def apart(case: Case, code: CaseCode, failed: Callable[[Run, str], FitError]) -> Answer:
    """Return the answers of a simulator in a worker; ``failed`` is the error of an output without numbers."""

    def answer(run: Run, p: Mapping[str, float], changed: Mapping[str, Array]) -> Arrays:
        shapes = {output.name: (run.rows,) for output in case.outputs}
        outputs = code.arrays("call", run, p, shapes, dict(changed))
        for name, values in outputs.items():
            if not (np.abs(values) <= LARGEST).all():  # the code may have answered past the check there
                raise failed(run, name)
        return outputs

    return answer


def _many_apart(case: Case, code: CaseCode) -> Answers:
    """Return the answers to many questions of a simulator in a worker."""
    names = [output.name for output in case.outputs]

    def answers(questions: Sequence[Question]) -> list[Arrays | None]:
        rows = [run.rows for run, _, _ in questions]
        shapes: dict[str, tuple[int, ...]] = {name: (sum(rows),) for name in names}
        sent = [(code.number(run), dict(p), dict(changed)) for run, p, changed in questions]
        try:
            made = code.arrays("calls", questions[0][0], {}, shapes, sent)
        except FitError:  # whatever it is, the same question alone raises it by name
            return [None] * len(questions)
        parts = np.split(np.stack([made[name] for name in names]), np.cumsum(rows)[:-1], axis=1)
        usable = [(np.abs(part) <= LARGEST).all() for part in parts]
        return [
            dict(zip(names, part, strict=True)) if good else None
            for part, good in zip(parts, usable, strict=True)
        ]

    return answers


def handlers(case: Case) -> Handlers:
    """Return what a worker answers of a simulator's function."""
    from toolkit.worker.serve import Numbers

    function, runs = UserFunction(case), (*case.runs, *case.predict)

    def call(run: int, p: Mapping[str, float], changed: Mapping[str, Array]) -> Arrays:
        return Numbers(function.call(runs[run], p, changed))

    def calls(_: int, __: Mapping[str, float], questions: Sequence[tuple[int, Any, Any]]) -> Arrays:
        parts = []
        for run, p, changed in questions:
            try:
                parts.append(call(run, p, changed))
            except FitError:
                nothing = np.full(runs[run].rows, np.nan)
                parts.append({output.name: nothing for output in case.outputs})
        return Numbers(
            {output.name: np.concatenate([part[output.name] for part in parts]) for output in case.outputs}
        )

    return {"call": call, "calls": calls}


def _key(run: Run, p: Mapping[str, float], changed: Mapping[str, Array]) -> object:
    inputs = tuple((name, blake2b(values.tobytes()).digest()) for name, values in changed.items())
    return run, tuple(p.values()), inputs


def _failed(case: Case, run: Run, got: str) -> FitError:
    return FitError(
        "the simulation gives no usable output", where=f"{case.simulation.path}, {run.name}", got=got,
        expected="a pandas.DataFrame with every output, a finite number in each row, in the inputs' order",
        next_step="run the simulator on that file by itself and mend it", rule="simulator",
    )  # fmt: skip


def _numbers(made: Any, name: str) -> Array | None:
    """Return a column's numbers, None where it has texts or complex numbers."""
    column = made[name]
    kind = getattr(getattr(column, "dtype", None), "kind", "O")
    if kind not in "iufb" and not all(isinstance(entry, Real) for entry in np.ravel(column)):
        return None
    try:
        return np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError):
        return None


def _first_bad(values: Array) -> int:
    return int(np.flatnonzero(~np.isfinite(values))[0]) + 1
