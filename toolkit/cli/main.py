"""The `toolkit` command: every subcommand is a file of this folder, registered here."""

from __future__ import annotations

import sys
import traceback
from functools import cache
from typing import Annotated, Any, NoReturn

import typer

from toolkit.cli.console import answer, print_error, print_usage_error
from toolkit.errors import ToolkitError
from toolkit.inputs import raise_limits, size_of
from toolkit.trust.requested import Requested
from toolkit.version import __version__

# typer carries a copy of click whose exceptions it does not export: the root of its usage errors.
_UsageError: type[Exception] = typer.BadParameter.__mro__[2]

app = typer.Typer(
    name="toolkit",
    help="Calibration and standards toolkit for a tire force-and-moment laboratory.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"max_content_width": 110},
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"toolkit {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    pass


@cache
def _register() -> None:
    # Each module holds commands and imports what is heavy only when one of them runs.
    from toolkit.cli import (
        audit,
        calibrate,
        calibration,
        compare,
        convert,
        demo,
        diagnose,
        evaluate,
        fit,
        inspect,
        installation,
        machine,
        person,
        plan,
        process,
        report,
        sign,
        simulate,
        starters,
        template,
        verify,
        watch,
        workbench,
    )

    app.command(demo.NAME)(demo.command)
    app.command("init")(installation.init)
    app.command("migrate")(installation.migrate)
    app.command("doctor")(installation.doctor)
    app.command("docs")(installation.docs)
    for module in (inspect, calibrate):
        app.command(module.NAME)(module.command)
    app.add_typer(calibration.app, name="calibration")
    for module in (process, fit, evaluate, convert, compare, report, watch):
        app.command(module.NAME)(module.command)
    app.add_typer(template.app, name="template")
    machine.app.command(starters.NEW)(starters.new_machine)
    app.add_typer(machine.app, name="machine")
    for name in ("session", "test", "case"):
        app.add_typer(getattr(starters, name), name=name)
    plan.app.command(starters.NEW)(starters.new_plan)
    app.add_typer(plan.app, name="plan")
    app.add_typer(person.person, name="person")
    app.add_typer(person.ledger, name="ledger")
    for module in (sign, audit, simulate, diagnose, verify):
        app.command(module.NAME)(module.command)
    app.command("explain")(installation.explain)
    app.command("qualify")(installation.qualify)
    app.command(workbench.NAME)(workbench.command)


@cache
def command_tree() -> Any:
    """Return the group of all commands."""
    # Built once: whoever calls `run` many times in a process would wait for the options every time.
    from toolkit.cli.groups import build_group

    _register()
    sizes = typer.main.get_command(_options).params[0]
    # What a command reads is opened by one opener: each takes --max-size.
    return build_group(app, lambda command: command.params.append(sizes))


def _raise_limits(size: str | None) -> None:
    try:
        raise_limits(0 if size is None else size_of(size))
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--max-size") from None


_options = typer.Typer(add_completion=False)


@_options.command()
def _of_every_command(
    max_size: Annotated[
        str | None,
        typer.Option(
            metavar="SIZE", callback=_raise_limits, expose_value=False,
            help="Read inputs up to SIZE, such as 2GB; default: a limit for each format.",
        ),
    ] = None,
) -> None:  # fmt: skip
    pass


def run(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line: 0 clean, 1 findings, 2 bad input, 101 a bug."""
    arguments = sys.argv[1:] if arguments is None else arguments
    as_json = "--json" in arguments
    if as_json and "--version" in arguments and {*arguments} <= {"--version", "--json", "--quiet", "-q"}:
        answer({"version": __version__}, "", as_json=True, quiet=False)
        sys.exit(0)
    try:
        code = command_tree()(args=arguments, prog_name="toolkit", standalone_mode=False)
    except Requested as outcome:
        from toolkit.lab.signatures.signing import requested

        quiet = not {"--quiet", "-q"}.isdisjoint(arguments)
        answer(*requested(outcome), as_json=as_json, quiet=quiet)
        code = 0
    except ToolkitError as error:
        print_error(error, as_json=as_json)
        code = error.exit_code
    except _UsageError as error:
        print_usage_error(error, arguments, command_tree(), as_json=as_json)
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        typer.echo("interrupted; nothing was left half-written", err=True)
        code = 130
    except BrokenPipeError:
        code = 0
    except OSError as error:  # a name that no file can have, a disk that fails: nothing that is wrong here
        refused = ToolkitError(
            "the system refuses a file or folder", where=error.filename, got=error.strerror or error,
            expected="one that can be reached", next_step="check its name, its permissions and the disk",
            rule="system",
        )  # fmt: skip
        print_error(refused, as_json=as_json)
        code = refused.exit_code
    except Exception:  # noqa: BLE001  the last line of defence: a bug, told as one
        traceback.print_exc()
        typer.echo(
            f"\ntoolkit {__version__}: this is a bug. Please report it with the lines above.", err=True
        )
        code = 101
    sys.exit(code if isinstance(code, int) else 0)
