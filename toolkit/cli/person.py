"""`toolkit person ...` and `toolkit ledger ...`: who decides, and what the ledger was when it was issued."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict, cast, get_args

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import ask_passphrase
from toolkit.cli.options import (
    INTO_FILE,
    INTO_FOLDER,
    DecisionOptions,
    Output,
    RegistryOptions,
    Sign,
    open_signers,
)

if TYPE_CHECKING:
    from toolkit.trust.people import Role


class KeyAnswer(TypedDict):
    """A new key."""

    key: Annotated[str, "file of the private half"]
    public: Annotated[str, "line of the public half"]
    fingerprint: str


person = typer.Typer(help="The people of the laboratory, their keys and roles.", no_args_is_help=True)
ledger = typer.Typer(help="The ledger, as documents and witnesses know it.", no_args_is_help=True)

By = Annotated[str | None, "Who decides, by id; default: whose key signs or has answered."]
Why = Annotated[str, "Why; the log of people keeps it."]
Instrument = Annotated[str, "Instrument, such as rig, or people: the log of people.", ARGUMENT]


@person.command()
@answers(KeyAnswer)
def key(
    file: Annotated[Path, "New private key; its public half is FILE.pub.", ARGUMENT, INTO_FILE],
    comment: Annotated[str, "Whose it is."] = "",
    *,
    output: Output,
) -> int:
    """Make an Ed25519 key, encrypted by a passphrase; keys that people have already serve as well.

    Example: toolkit person key ~/.ssh/laboratory --comment anna
    """
    from toolkit.trust.keys import make_key

    public = make_key(file, ask_passphrase(file, twice=True), comment)
    payload = {"key": str(file), "public": public.line, "fingerprint": public.fingerprint}
    output.answer(payload, f"{file}.pub  {public.fingerprint}")
    return 0


@person.command()
@answers("toolkit.lab.signatures.people:PeopleAnswer")
def enrol(
    person_id: Annotated[str, "Short name of the person.", ARGUMENT, Mark(metavar="ID")],
    name: Annotated[str, "As documents print it."],
    role: Annotated[list[str], "operator, checker, head or auditor; repeat it."],
    key: Annotated[Path, "The person's public key, FILE.pub."],
    reason: Why = "enrolled",
    recovery: Annotated[Path | None, "Key that is kept apart: first enrolment by one head."] = None,
    by: By = None,
    *,
    entering: DecisionOptions,
    output: Output,
) -> int:
    """Enrol a person, or give one another key; from the first one on decisions are signed.

    Example: toolkit person enrol anna --name "Anna E." --role head --key a.pub --sign a --recovery safe
    """
    from toolkit.lab.signatures.people import enrol_person, people_answer

    registry = entering.registry()
    recovered = open_signers([recovery])[0] if recovery is not None else None
    roles = cast("list[Role]", role)
    log = enrol_person(
        registry, person_id, name=name, roles=roles, key=key, reason=reason, recovery=recovered, by=by
    )
    output.answer(*people_answer(log))
    return 0


@person.command("list")
@answers("toolkit.lab.signatures.people:PeopleAnswer")
def list_people(*, place: RegistryOptions, output: Output) -> int:
    """List who is enrolled, with roles and keys.

    Example: toolkit person list
    """
    from toolkit.lab.signatures.people import people_answer

    output.answer(*people_answer(place.registry().people()))
    return 0


@person.command()
@answers("toolkit.lab.signatures.people:PeopleAnswer")
def revoke(
    person_id: Annotated[str, "Whose key.", ARGUMENT, Mark(metavar="ID")],
    since: Annotated[str, "First moment it signs nothing, 2026-11-22T10:11:12Z.", Mark(names=("--from",))],
    reason: Why,
    key: Annotated[str | None, "Its fingerprint; default: every key."] = None,
    by: By = None,
    *,
    entering: DecisionOptions,
    output: Output,
) -> int:
    """End a person's key from a time on; what it signed before holds, what it signed after decides nothing.

    Example: toolkit person revoke anna --from 2026-11-22T00:00:00Z --reason "laptop stolen" --sign ben
    """
    from toolkit.lab.signatures.people import people_answer, revoke_key

    registry = entering.registry()
    log = revoke_key(registry, person_id, fingerprint=key, since=since, reason=reason, by=by)
    output.answer(*people_answer(log))
    return 0


@person.command()
@answers("toolkit.lab.signatures.people:PeopleAnswer")
def policy(
    action: Annotated[str, "enter, approve, withdraw, discard, import, issue or enrol.", ARGUMENT],
    role: Annotated[list[str], "operator, checker, head or auditor; repeat it."],
    reason: Why,
    signatures: Annotated[int, "Number of signatures, each of another person."] = 1,
    by: By = None,
    *,
    entering: DecisionOptions,
    output: Output,
) -> int:
    """Say whose signatures a decision takes, and how many; what was decided before stays as it was.

    Example: toolkit person policy withdraw --role head --signatures 2 --reason "audit of May" --sign anna
    """
    from toolkit.lab.signatures.people import people_answer, set_demand
    from toolkit.trust.people import Action

    if action not in get_args(Action):
        raise typer.BadParameter(", ".join(get_args(Action)), param_hint="ACTION")
    registry = entering.registry()
    log = set_demand(
        registry, cast("Action", action), roles=cast("list[Role]", role), signatures=signatures,
        reason=reason, by=by,
    )  # fmt: skip
    output.answer(*people_answer(log))
    return 0


@ledger.command()
@answers("toolkit.lab.signatures.people:ProofAnswer")
def prove(
    instrument: Instrument,
    entry: Annotated[int | None, "Entry, from 1; default: the last."] = None,
    sign: Sign = None,
    time_stamp: Annotated[str | None, "Stamp the checkpoint (RFC 3161).", Mark(metavar="URL")] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Print an entry with the proof that it is in the ledger of today, for `ledger check` on any later day.

    Example: toolkit ledger prove rig
    """
    from toolkit.lab.signatures.people import anchor_document, checkpoint_of

    registry = place.registry(sign)
    document = anchor_document(registry, instrument, entry, checkpoint_of(registry, instrument))
    if time_stamp is not None:
        from toolkit.lab.signatures.sealing import stamped

        document = stamped(document, time_stamp)
    payload = json.loads(document)
    del payload["schema"]  # every answer has it
    # The same with --json and without: it is what `ledger check` takes.
    output.answer(payload, document.rstrip("\n"))
    return 0


@ledger.command()
@answers("toolkit.lab.signatures.people:CheckLedgerAnswer")
def check(
    against: Annotated[Path, "A document as it was issued, a proof, a QR code's text, a checkpoint."],
    instrument: Annotated[
        str | None, "Instrument; default: the one that the document's proof names.", ARGUMENT
    ] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Tell whether today's ledger continues the one of an earlier document; exit code 1 where it does not.

    Example: toolkit ledger check --against certificate.pdf
    """
    from toolkit.lab.signatures.people import check_against
    from toolkit.lab.signatures.sealing import TRUST, stamp_of, trusted

    registry = place.registry()
    concerned, comparison = check_against(registry, instrument, against)
    stamp = stamp_of(against, trusted(registry.folder.parent / TRUST))
    text = f"{comparison.continuity}: {comparison.why}"
    payload = {"instrument": concerned, "ledger": comparison.continuity, "why": comparison.why}
    if stamp is not None:
        text += f"\n{stamp.text}"
        payload["time_stamp"] = f"{stamp.at:%Y-%m-%dT%H:%M:%SZ}"
        payload["time_stamp_by"], payload["time_stamp_state"] = stamp.by, stamp.state
    output.answer(payload, text)
    return 0 if comparison.continuity == "continues" else 1


@ledger.command()
@answers("toolkit.lab.signatures.people:WitnessAnswer")
def witness(
    instrument: Instrument,
    folder: Annotated[Path, "The witness's folder: a share, a stick.", ARGUMENT, INTO_FOLDER],
    name: Annotated[str, "Of the witness."],
    key: Annotated[Path, "The witness's private key."],
    sign: Sign = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Let a second place countersign the ledger; it refuses what is no continuation of what it has signed.

    Example: toolkit ledger witness rig /mnt/north --name north --key north.key
    """
    from toolkit.lab.signatures.people import witness as countersigned

    registry = place.registry(sign)
    signer = open_signers([key])[0]
    checkpoint, before = countersigned(registry, instrument, folder, name=name, signer=signer)
    payload = {
        "instrument": instrument,
        "size": checkpoint.size,
        "before": before,
        "checkpoint": checkpoint.text,
    }
    output.answer(payload, checkpoint.text.rstrip("\n"))
    return 0
