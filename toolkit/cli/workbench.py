"""`toolkit open [HOME]`: the workbench in the browser of this computer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NotRequired, TypedDict

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import Output


class OpenAnswer(TypedDict):
    """Where the workbench is served."""

    address: Annotated[str | None, "of whoever sits at this computer"]
    home: Path
    people: NotRequired[Annotated[Mapping[str, str], "address of each person, with --host"]]


NAME = "open"


@answers(OpenAnswer)
def command(
    home: Annotated[
        Path | None,
        "Laboratory's home; default: the nearest folder upward.",
        ARGUMENT,
        Mark(metavar="[HOME]"),
    ] = None,
    no_browser: Annotated[bool, "Print the address and open nothing."] = False,
    port: Annotated[int, "Port; default: a free one.", Mark(min=0, max=65535)] = 0,
    host: Annotated[
        str | None, "Address that other computers reach; needs --certificate and --key, and people enrolled."
    ] = None,
    certificate: Annotated[Path | None, "Certificate of the host, PEM.", Mark(metavar="FILE")] = None,
    key: Annotated[Path | None, "Its private key, PEM.", Mark(metavar="FILE")] = None,
    *,
    output: Output,
) -> int:
    """Open the workbench: what needs a decision, sessions, records with their gates, decisions.

    It serves this computer alone, asks no other host for anything, and ends with Ctrl-C. Whoever has the
    address that is printed is let in; with --host each person who is enrolled has another.

    Example: toolkit open laboratory --no-browser
    """
    from toolkit.lab.home import find_home, open_registry
    from toolkit.workbench.server import LOOPBACK, Addresses, Listening, serve

    folder = find_home(home)
    listening = Listening(host=host or LOOPBACK, port=port, certificate=certificate, key=key)

    def say(addresses: Addresses) -> None:
        people = {person: address for person, address in addresses.items() if person is not None}
        payload = {"address": addresses.get(None), "home": folder, **({"people": people} if people else {})}
        lines = [
            address if person is None else f"{person} {address}" for person, address in addresses.items()
        ]
        text = "\n".join([f"workbench of {folder}", *lines, "end it with Ctrl-C"])
        output.answer(payload, text)

    serve(folder, open_registry(home=folder), listening, browser=not no_browser, say=say)
    return 0
