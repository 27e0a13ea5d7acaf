"""The columns of every report table, each with its unit and default format."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from toolkit.characteristics.budget import COLUMNS as BUDGET
from toolkit.characteristics.catalogue import columns, tables

# Quantities whose unit an organisation chooses, and the unit where it does not.
UNITS = {"force": "N", "moment": "N*m", "force/angle": "N/deg", "moment/angle": "N*m/deg"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a report table; ``unit`` is the SI-side default, shown in the heading.

    ``of_the_run`` says that its cells differ from run to run: the hash of the content leaves them out.
    ``U`` names the column of the uncertainty to whose last place its cells are printed; an uncertainty's own
    column names itself.
    """

    name: str
    kind: Literal["text", "number"]
    description: str
    unit: str | None = None
    spec: str = "g"
    quantity: str | None = None
    of_the_run: bool = False
    U: str | None = None


def _text(name: str, description: str) -> Column:
    return Column(name=name, kind="text", description=description)


def _number(
    name: str,
    description: str,
    spec: str,
    *,
    unit: str | None = None,
    quantity: str | None = None,
    U: str | None = None,
) -> Column:
    return Column(
        name=name,
        kind="number",
        description=description,
        spec=spec,
        quantity=quantity,
        unit=UNITS[quantity] if quantity else unit,
        U=U,
    )


def _with_u(name: str, description: str, spec: str, unit: str) -> list[Column]:
    return [
        replace(_number(one, text, spec, unit=unit, U=f"U_{name}"), quantity=_QUANTITIES.get(unit))
        for one, text in ((name, description), (f"U_{name}", f"expanded uncertainty (95 %) of {name}"))
    ]


_QUANTITIES = {unit: quantity for quantity, unit in UNITS.items()}


def _wide_tables() -> dict[str, tuple[str, tuple[Column, ...]]]:
    """Return the tables of the catalogue of characteristics that have a column for each."""
    load, rotation = (
        _number("load", "load", ".0f", quantity="force"),
        _text("rotation", "direction of rotation"),
    )
    heads = {
        "load": (load,),
        "direction": (load, rotation),
        "angle": (rotation, load, _number("SA", "slip angle", ".0f", unit="deg")),
    }
    return {
        table.name: (
            table.text,
            (
                *heads[table.scope],
                *(
                    column
                    for one in columns(table)
                    for column in _with_u(
                        one.column_name, one.column_text, f".{one.digits}f", one.printed_unit
                    )
                ),
            ),
        )
        for table in tables()
    }


def _model_columns() -> list[Column]:
    columns = []
    for channel in ("FY", "MZ"):
        columns += [
            _number(f"{channel}_parameters", f"parameters fitted for {channel}, all loads", "d", unit="1"),
            _number(f"{channel}_error", f"error of {channel} over the rows fitted", ".2f", unit="%"),
            _number(f"{channel}_floor", f"scatter of {channel} about its bin means", ".2f", unit="%"),
            _number(
                f"{channel}_left_out",
                f"error of {channel} where every load is predicted by a fit without it",
                ".2f",
                unit="%",
            ),
        ]
    return columns


def _fit_columns() -> list[Column]:
    shown = (
        ("B", "1/rad", ".3f"),
        ("C", "1", ".3f"),
        ("D", None, ".1f"),
        ("E", "1", ".3f"),
        ("Sh", "deg", ".3f"),
        ("Sv", None, ".2f"),
    )
    columns = []
    for name, unit, spec in shown:
        note = " in the channel's unit" if unit is None else ""
        own = f"u_{name}"
        columns.append(_number(name, f"Magic Formula {name}{note}", spec, unit=unit, U=own))
        columns.append(_number(own, f"standard error of {name}{note}", spec, unit=unit, U=own))
    return columns


TABLES: dict[str, tuple[str, tuple[Column, ...]]] = {
    "results": (
        "one row a condition, as measured, SAE J670",
        (
            _text("rotation", "direction of rotation"),
            _number("SA", "measured slip angle", ".2f", unit="deg"),
            _number("FZ", "measured load", ".0f", quantity="force"),
            _number("FY", "lateral force", ".1f", quantity="force", U="U_FY"),
            _number(
                "U_FY", "expanded uncertainty of FY, every source, k = 2", ".1f", quantity="force", U="U_FY"
            ),
            _number("MZ", "aligning moment", ".2f", quantity="moment", U="U_MZ"),
            _number(
                "U_MZ", "expanded uncertainty of MZ, every source, k = 2", ".2f", quantity="moment", U="U_MZ"
            ),
            _text("file", "recording"),
        ),
    ),
    **_wide_tables(),
    "budget": (
        "standard uncertainties of each characteristic at the summary's load by their source, to two digits "
        "of their sum; a dash below its last place",
        (
            _text("quantity", "name of the characteristic"),
            _text("rotation", "direction of rotation, or both"),
            _text("unit", "unit of the row"),
            *(_text(one.name, one.text) for one in BUDGET),
            _text("u", "standard uncertainty of all"),
        ),
    ),
    "stated": (
        "standard uncertainties that the machine states of what has no calibration record of its own",
        (
            _text("quantity", "what it is the uncertainty of"),
            _text("u", "standard uncertainty, in a unit and relative to the value"),
            _text("common", "whether its error is the same in all tests of the machine, or another in each"),
            _text("source", "where the figure comes from"),
        ),
    ),
    "characteristics": (
        "every characteristic, one row each",
        (
            _text("quantity", "name of the characteristic"),
            _text("rotation", "direction of rotation, or both"),
            _number("load", "load", ".0f", quantity="force"),
            _number("value", "value in the row's unit", ".2f", U="U"),
            _number("U", "expanded uncertainty (95 %) in the row's unit", ".2f", U="U"),
            _number("k", "coverage factor", ".2f", unit="1"),
            _text("unit", "unit of the row"),
        ),
    ),
    "fits": (
        "Magic Formula per load, channel and direction",
        (
            _text("channel", "FY or MZ"),
            _text("rotation", "direction of rotation"),
            _number("load", "mean load of the block", ".0f", quantity="force"),
            *_fit_columns(),
            _number("error", "error of the fit", ".2f", unit="%"),
            _number("floor", "scatter of the measurements about their bin means", ".2f", unit="%"),
        ),
    ),
    "models": (
        "tire models side by side, one row a model and condition; of the forward run, asked for by --models",
        (
            _text("model", "tire model; magic_formula has one curve a load, the others are over all loads"),
            _text("condition", "pure or combined slip"),
            *_model_columns(),
            replace(_number("seconds", "time of all fits of the model", ".2f", unit="s"), of_the_run=True),
            _text("converged", "yes where several starts ended at every lowest cost, else no"),
            _text("not_determined", "parameters that the data do not determine, by channel"),
        ),
    ),
    "calibration": (
        "coefficients of the calibration record",
        (
            _text("load", "computed load"),
            _text("term", "term"),
            _number("coefficient", "full-precision coefficient", ".6g"),
            _number("issued", "coefficient as issued on the certificate", ".6g"),
            _number("standard_error", "standard error", ".2g"),
            _text("unit", "unit of load and indication"),
        ),
    ),
    "acquisition": (
        "the acquisition program's own FY and MZ against the report's, one row a file",
        (
            _text("file", "recording"),
            _number("FY_difference", "largest |FY of the file - FY|", ".2f", quantity="force"),
            _number("MZ_difference", "largest |MZ of the file - MZ|", ".3f", quantity="moment"),
        ),
    ),
    "findings": (
        "departures from what was expected",
        (
            _text("rule", "rule"),
            _text("level", "error, warning or note"),
            _text("where", "file, block or channel"),
            _text("message", "what was found"),
        ),
    ),
    "opinions": (
        "opinions and interpretations, which are not results of the test",
        (
            _text("statement", "opinion or interpretation"),
            _text("basis", "what it rests on"),
        ),
    ),
    "files": (
        "the recordings and their hashes",
        (
            _text("file", "recording"),
            _text("rotation", "direction of rotation"),
            _text("sha256", "SHA-256 of the file"),
        ),
    ),
}
