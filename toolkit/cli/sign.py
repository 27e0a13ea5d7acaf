"""`toolkit sign REQUEST`: a person's signature of a decision, on that person's own computer."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, TypedDict

import typer

from toolkit.cli.command import ARGUMENT, answers
from toolkit.cli.console import ask_passphrase, say
from toolkit.cli.options import INTO_FILE, Output
from toolkit.errors import ConfigError


class SignAnswer(TypedDict):
    """A signed request."""

    answer: Annotated[str, "file that goes back to where the request was made"]
    by: Annotated[str, "person who signed"]
    key: Annotated[str, "fingerprint"]


NAME = "sign"


@answers(SignAnswer)
def command(
    request: Annotated[Path, "What --request wrote, or the answer of another person.", ARGUMENT],
    key: Annotated[Path | None, "Private SSH key, or the public one of a key in the agent."] = None,
    agent: Annotated[bool, "The key of the SSH agent that may sign it."] = False,
    out: Annotated[Path | None, "Answer; default: beside the request, by who signs.", INTO_FILE] = None,
    passphrase_fd: Annotated[int | None, "File descriptor that gives the key's passphrase."] = None,
    yes: Annotated[bool, "Sign without asking, for use without a terminal."] = False,
    *,
    output: Output,
) -> int:
    """Show everything that a request asks to sign, and sign it; no laboratory's home is needed here.

    The answer goes back to where the request was made: the same command, with --answer FILE.

    Example: toolkit sign request.json --key ~/.ssh/anna
    """
    from toolkit.lab.signatures.signing import agent_signer_of, passphrase_of, request_text, sign_request
    from toolkit.trust.keys import open_signer
    from toolkit.trust.requests import read_request

    if agent == (key is not None):
        raise _usage("--key, --agent", "both" if agent else "neither", "one of the two")
    opened = read_request(request)
    if not (yes and output.quiet):  # consent is to what was shown
        say(request_text(opened), err=True)
    if key is None:
        signer = agent_signer_of(opened)
    elif passphrase_fd is not None:
        signer = open_signer(key, lambda: passphrase_of(passphrase_fd))
    else:
        signer = open_signer(key, lambda: ask_passphrase(key))
    if not yes:
        if not sys.stdin.isatty():
            raise _usage("--yes", "no terminal to ask at", "consent: a terminal, or --yes")
        typer.confirm("sign this?", abort=True, err=True)
    path, person = sign_request(opened, signer, out)
    payload = {"answer": str(path), "by": person.id, "key": signer.public.fingerprint}
    output.answer(payload, f"signed by {person.id} ({person.name}): {path}")
    return 0


def _usage(where: str, actual: str, expected: str) -> ConfigError:
    return ConfigError(
        "it is not clear how to sign", where=where, got=actual, expected=expected,
        next_step="see 'toolkit sign --help'; nothing was signed", rule="usage",
    )  # fmt: skip
