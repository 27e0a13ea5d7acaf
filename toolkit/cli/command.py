"""A command of the command line: its options are the types, texts and marks of its parameters.

    out: Annotated[Path | None, "Folder for the results.", INTO_FOLDER] = None

is ``--out`` with that help. What is said besides stands behind the text as a `Mark`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import pkgutil
import typing
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypedDict

import typer

from toolkit.errors import ConfigError
from toolkit.files import is_number, number_expected
from toolkit.printable import check_text, unprintable


class Mark(TypedDict, total=False):
    """What is said of an option besides its type and its text; several marks add up."""

    argument: Annotated[bool, "it stands by its place, without a name"]
    names: Annotated[tuple[str, ...], "where they are not that of the parameter"]
    metavar: Annotated[str, "what stands for its value"]
    min: float
    max: float
    parser: Callable[[str], Any]
    check: Annotated[str, "``module:function`` that refuses a value before anything is worked out"]


ARGUMENT = Mark(argument=True)


class Command:
    """A command that takes the options of each dataclass among its parameters one by one.

    Options that commands share are declared once, as the fields of such a class (`toolkit.cli.options`).
    ``answer`` is the declaration of its JSON answer. Its options are worked out when they are asked for.
    """

    def __init__(self, command: Callable[..., int], answer: str | type | None = None) -> None:
        self._command, self.answer = command, answer
        functools.update_wrapper(self, command)

    def __call__(self, *arguments: Any, **options: Any) -> int:
        """Run the command; what is not given has its default."""
        bound = self.__signature__.bind(*arguments, **options)
        bound.apply_defaults()
        values = bound.arguments
        self._check(values)
        groups = {
            name: group(**{option.name: values.pop(option.name) for option in _options(group)})
            for name, group in self._groups.items()
        }
        return self._command(**values, **groups)

    def _check(self, values: Mapping[str, Any]) -> None:
        """Refuse words that no document can print, and numbers that are none.

        A path is whatever the disk has, and is no such word. What has no limit is not stated: no command
        takes a time, a size or a share that is infinite, nor a number beyond those that files may hold.
        """
        for parameter in self._parameters:
            value = values[parameter.name]
            for given in value if isinstance(value, list | tuple) else (value,):
                if type(given) is str and unprintable(given):
                    check_text(given, where=_word(parameter))
                if type(given) in (int, float) and not is_number(given):
                    raise ConfigError(
                        "an option's number cannot be used", where=_word(parameter), got=given,
                        expected=number_expected(given, "a number such as 1.5 or 2e3"),
                        next_step="state such a number, or leave the option out", rule="usage",
                    )  # fmt: skip

    @functools.cached_property
    def _hints(self) -> dict[str, Any]:
        return typing.get_type_hints(self._command, include_extras=True)

    @functools.cached_property
    def _groups(self) -> dict[str, Any]:
        return {name: held for name, held in self._hints.items() if dataclasses.is_dataclass(held)}

    @functools.cached_property
    def _parameters(self) -> list[inspect.Parameter]:
        """Its options as they are declared, those of a class in its place."""
        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(self._command).parameters.values():
            group = self._groups.get(parameter.name)
            if group is None:
                parameters.append(parameter.replace(annotation=self._hints[parameter.name]))
                continue
            hints = typing.get_type_hints(group, include_extras=True)
            parameters += [
                inspect.Parameter(
                    option.name, parameter.KEYWORD_ONLY, default=option.default, annotation=hints[option.name]
                )
                for option in _options(group)
            ]
        return parameters

    @functools.cached_property
    def __signature__(self) -> inspect.Signature:
        """Its options as the parser takes them."""
        return inspect.Signature([_parsed(parameter) for parameter in self._parameters])


def answers(declared: str | type) -> Callable[[Callable[..., int]], Command]:
    """Declare the JSON answer of a command: a type, or ``module:name`` of what is heavy to import.

    `toolkit.cli.groups` prints it as page and schema; a test looks for commands without it.
    """
    return functools.partial(Command, answer=declared)


def _options(group: Any) -> list[dataclasses.Field[Any]]:
    return [field for field in dataclasses.fields(group) if field.init]


def _parsed(parameter: inspect.Parameter) -> inspect.Parameter:
    """Return a parameter as the parser takes it; what is not of the command line stays as it is."""
    if not (said := getattr(parameter.annotation, "__metadata__", ())):
        return parameter
    mark = _mark(parameter)
    of_parser = ("metavar", "min", "max", "parser")
    facts: dict[str, Any] = {name: fact for name, fact in mark.items() if name in of_parser}
    if "check" in mark:
        facts["callback"] = _callback(mark["check"])
    names = () if "argument" in mark else _names(parameter, mark)
    stated = typer.Option(*names, help=said[0], **facts) if names else typer.Argument(help=said[0], **facts)
    return parameter.replace(annotation=Annotated[parameter.annotation.__origin__, stated])


def _callback(check: str) -> Callable[[Any], Any]:
    def checked(value: Any) -> Any:
        if value is not None:
            pkgutil.resolve_name(check)(value)
        return value

    return checked


def _mark(parameter: inspect.Parameter) -> Mark:
    mark = Mark()
    for more in getattr(parameter.annotation, "__metadata__", ())[1:]:
        mark |= more
    return mark


def _names(parameter: inspect.Parameter, mark: Mark) -> tuple[str, ...]:
    return mark.get("names", (f"--{parameter.name.replace('_', '-')}",))


def _word(parameter: inspect.Parameter) -> str:
    """Return what a parameter is called among the words of a command: ``--checked-by``, ``ID``."""
    mark = _mark(parameter)
    return mark.get("metavar", parameter.name.upper()) if "argument" in mark else _names(parameter, mark)[0]
