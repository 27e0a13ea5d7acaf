"""Groups of commands that build the command that is called and no other: ``--help`` needs no options."""

from __future__ import annotations

import copy
import inspect
import json
import pkgutil
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any, get_args

from typer import BadParameter, Typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info, get_command_name, get_group_from_info
from typer.models import CommandInfo, TyperInfo

Finish = Callable[[Any], None]
"""What is done to each command once it is built."""


class Group(TyperGroup):
    """A group whose help is printed from the docstrings of its commands; their options wait."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each command's name and first sentence."""
        commands: Any = self.commands
        titles: Any = {name: TyperCommand(name, help=text) for name, text in commands.titles.items()}
        TyperGroup(commands=titles, rich_markup_mode=None).format_commands(ctx, formatter)


class SaidOnce(TyperCommand):
    """A command that refuses what is lost unseen: an option of one value given twice, an empty path."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options and arguments of a call."""
        read: tuple[dict[str, Any], Any, list[Any]] = self.make_parser(ctx).parse_args(args=list(args))
        values, _, given = read
        parameters: list[Any] = self.params
        for parameter in parameters:
            word = values.get(parameter.name)
            if parameter.name in self._paths and "" in (word if isinstance(word, list | tuple) else (word,)):
                # It would be the working folder: of a variable of the shell that is not set.
                raise BadParameter("a path, and no empty word", ctx=ctx, param=parameter)
        for option in dict.fromkeys(given):
            is_one_value = option.param_type_name == "option" and not option.multiple and not option.is_flag
            if is_one_value and given.count(option) > 1:
                raise BadParameter("one value, given once", ctx=ctx, param=option)
        return super().parse_args(ctx, args)

    @cached_property
    def _paths(self) -> set[str]:
        """Names of the parameters that are paths, or hold some."""
        parameters: Any = {} if self.callback is None else inspect.signature(self.callback).parameters
        kinds = {name: getattr(of.annotation, "__origin__", of.annotation) for name, of in parameters.items()}
        return {name for name, kind in kinds.items() if Path in (kind, *get_args(kind))}


class Commands(MutableMapping[str, Any]):
    """The commands of a group by name, each built when it is first asked for."""

    def __init__(self, app: Typer, finish: Finish) -> None:
        self.titles: dict[str, str] = {}
        self._build: dict[str, Callable[[], Any]] = {}
        self._built: dict[str, Any] = {}
        for command in app.registered_commands:
            name = command.name or get_command_name(getattr(command.callback, "__name__", ""))
            self.titles[name] = inspect.getdoc(command.callback) or ""
            self._build[name] = partial(_command, command, finish)
        for below in app.registered_groups:
            inner, name = below.typer_instance or Typer(), below.name or ""
            self.titles[name] = inner.info.help or ""
            self._build[name] = partial(build_group, inner, finish, name=name)

    def __getitem__(self, name: str) -> Any:
        if name not in self._built:
            self._built[name] = self._build[name]()
        return self._built[name]

    def __setitem__(self, name: str, command: Any) -> None:
        raise TypeError("commands are registered, never set")

    def __delitem__(self, name: str) -> None:
        raise TypeError("commands are registered, never removed")

    def __iter__(self) -> Iterator[str]:
        return iter(self._build)

    def __len__(self) -> int:
        return len(self._build)


def build_group(app: Typer, finish: Finish, *, name: str | None = None) -> Any:
    """Return the group of an app; ``finish`` is called with each command once it is built."""
    bare = copy.copy(app)
    bare.registered_commands, bare.registered_groups = [], []
    group = get_group_from_info(
        TyperInfo(bare, name=name, cls=Group), pretty_exceptions_short=False, rich_markup_mode=None,
        suggest_commands=app.suggest_commands,
    )  # fmt: skip
    group.commands = Commands(app, finish)
    return group


def leaves(group: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield every command of a group and of the groups in it, with the words that call it."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, (*above, name))
        else:
            yield " ".join((*above, name)), command


def declared_answers(group: Any) -> dict[str, Any]:
    """Return what each command with ``--json`` declares as its answer; None: nothing."""
    return {
        name: getattr(command.callback, "answer", None)
        for name, command in leaves(group)
        if any("--json" in parameter.opts for parameter in command.params)
    }


def declared_type(declaration: Any) -> Any:
    """Return the type that a declaration stands for, imported where it is ``module:name``."""
    return pkgutil.resolve_name(declaration) if isinstance(declaration, str) else declaration


def schema_text(command: str, declared: Mapping[str, Any]) -> str:
    """Return the JSON schema of a command's answer as text; ``declared`` has the declarations by command.

    Raises
    ------
    ConfigError
        ``usage``: there is no such command; those that answer are named
    """
    from toolkit.declared.answers import answer_schema
    from toolkit.errors import ConfigError

    if command not in declared:
        raise ConfigError(
            "no such command answers in JSON", where="--answer", got=command,
            expected=" | ".join(declared), next_step="choose one of them", rule="usage",
        )  # fmt: skip
    return json.dumps(answer_schema(declared_type(declared[command])), indent=2, ensure_ascii=False)


def _command(info: CommandInfo, finish: Finish) -> Any:
    info = copy.copy(info)
    info.cls = SaidOnce
    command = get_command_from_info(info, pretty_exceptions_short=False, rich_markup_mode=None)
    finish(command)
    return command
