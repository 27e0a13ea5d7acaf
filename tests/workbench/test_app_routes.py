"""The addresses of the workbench stand at its pages."""

from __future__ import annotations

import inspect
from importlib import import_module

from toolkit.workbench.page import TEMPLATES


def test_every_page_declares_the_addresses_of_its_handlers_once() -> None:
    names = sorted(path.stem for path in TEMPLATES.parent.glob("*_page.py"))
    seen: set[tuple[str, str]] = set()
    for name in names:
        module = import_module(f"toolkit.workbench.{name}")
        routed = {handler for _, _, handler in module.ROUTES}
        handlers = {
            function for function in vars(module).values()
            if inspect.isfunction(function) and function.__module__ == module.__name__
            and [*inspect.signature(function).parameters] == ["request"]
                and inspect.signature(function).return_annotation == "Response"
            and not function.__name__.startswith("_")
        }  # fmt: skip
        assert routed == handlers, name
        addresses = {(method, path) for method, path, _ in module.ROUTES}
        assert len(addresses) == len(module.ROUTES)
        assert not addresses & seen, name
        seen |= addresses
    assert ("GET", "/") in seen
