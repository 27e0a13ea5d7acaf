"""Who may decide in a laboratory: people, their keys and roles, and the rules, as ``people.toml`` has them.

Every version of the file is an entry of the log of people, signed by somebody whom the version before it
allowed to. An entry of any log is judged by the version of its time; a key that was revoked since, from a
date on, signed nothing from that date on, whatever the version of that time said.

Two spellings of one name are one person (`name_key`).
"""

from __future__ import annotations

import functools
import re
import unicodedata
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Annotated, ClassVar, Literal

from toolkit.declared import AtLeast, Distinct, Entry, Fault, Format, Size, Text, read_text, toml_text
from toolkit.errors import TrustError
from toolkit.files import sha256_bytes
from toolkit.trust.ssh import PublicKey, parse_public

FILE = "people.toml"
NAMESPACE = "toolkit-ledger@v1"

RECOVERY = "recovery"
"""Id of a head's key that is kept apart: a second key, and no second person who could approve."""

ROOT_HEADS = 2  # people, one of which may be a printed recovery key: a lost key must not end a laboratory

Role = Literal["operator", "checker", "head", "auditor"]
Action = Literal["enter", "approve", "withdraw", "discard", "import", "issue", "enrol"]
MEANINGS: Mapping[Action, str] = {
    "enter": "entered", "approve": "approved", "withdraw": "withdrawn", "discard": "discarded",
    "import": "entered", "issue": "issued", "enrol": "enrolled",
}  # fmt: skip


STATED: Mapping[Action, tuple[str, ...]] = {
    "approve": ("by", "approved_by"), "withdraw": ("by",), "discard": ("by",), "enrol": ("by",),
    "issue": ("by",),
}  # fmt: skip
"""The entries of a decision that name people: each of them signs it."""


def moment(text: str) -> datetime | None:
    """Return a UTC time to the second; None where a text is none.

    >>> moment("2026-02-30T00:00:00Z") is None
    True
    """
    try:
        return datetime.strptime(text, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)
    except ValueError:
        return None


def _is_moment(text: str) -> bool:
    return moment(text) is not None


_Moment = Annotated[
    str, Text(strip=True, pattern=r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z", accepts=_is_moment)
]
_TIME = "a UTC time such as 2026-11-22T10:11:12Z"


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A public key and the time in which its owner signs with it."""

    key: Annotated[
        str,
        Text(strip=True),
        Entry(
            "public key",
            example="ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIHLYyvkM0WuTMRE79NDWJ1VKjWPHV6sFqZPYQ+0nhFDQ",
        ),
    ]
    since: Annotated[_Moment, Entry("signs from", key="from", example="2026-11-22T10:11:12Z", expected=_TIME)]
    until: Annotated[
        _Moment | None,
        Entry(
            "signed nothing from this time on: replaced or lost",
            example="2027-11-22T10:11:12Z",
            expected=_TIME,
        ),
    ] = None

    @property
    def public(self) -> PublicKey:
        """The key itself."""
        return parse_public(self.key, where=FILE)

    def valid_at(self, time: str) -> bool:
        """Tell whether the key signs at a time."""
        return self.since <= time and (self.until is None or time < self.until)

    def faults(self) -> Iterator[Fault]:
        """Yield a key that is refused, and a time that ends before it begins."""
        try:
            parse_public(self.key)
        except TrustError as error:
            yield Fault(
                key=("key",), got=error.got, expected=error.expected or "a public key", rule="weak-key"
            )
        if self.until is not None and self.until < self.since:
            yield Fault(key=("until",), got=self.until, expected=f"a time from {self.since} on")


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """Somebody who signs."""

    id: Annotated[str, Text(pattern=r"[a-z][a-z0-9._-]{0,63}"), Entry("short name, once", example="anna")]
    name: Annotated[str, Text(strip=True), Entry("as documents print it", example="Anna Example")]
    roles: Annotated[tuple[Role, ...], Size(1), Distinct(), Entry("what the person does", example=["head"])]
    keys: Annotated[tuple[Key, ...], Size(1), Distinct("key"), Entry("of the person")]

    def is_named(self, text: str) -> bool:
        """Tell whether a text is this person's id or name, however that is written."""
        return name_key(text) in (self.id, name_key(self.name))

    def key_at(self, fingerprint: str, time: str) -> Key | None:
        """Return the person's key of a fingerprint, where it signs at a time."""
        for key in self.keys:
            if key.public.fingerprint == fingerprint and key.valid_at(time):
                return key
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """Who must sign a decision, and how many."""

    roles: Annotated[
        tuple[Role, ...], Size(1), Distinct(), Entry("one of which each signer has", example=["head"])
    ]
    signatures: Annotated[int, AtLeast(1), Entry("of different people")] = 1


_OPERATORS: tuple[Role, ...] = ("operator", "checker", "head")


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """What each decision takes. The operator of a session never approves it, whatever stands here."""

    enter: Annotated[Demand, Entry("enter a session's record")] = Demand(roles=_OPERATORS)
    approve: Annotated[Demand, Entry("put a record in force")] = Demand(roles=("checker", "head"))
    withdraw: Annotated[Demand, Entry("withdraw a record")] = Demand(roles=("head",))
    discard: Annotated[Demand, Entry("end a candidate")] = Demand(roles=("checker", "head"))
    import_: Annotated[Demand, Entry("enter a legacy record", key="import")] = Demand(roles=("head",))
    issue: Annotated[Demand, Entry("issue a certificate or report")] = Demand(roles=("checker", "head"))
    enrol: Annotated[Demand, Entry("change this file")] = Demand(roles=("head",))

    def demand(self, action: Action) -> Demand:
        """Return what a decision takes."""
        demand: Demand = getattr(self, "import_" if action == "import" else action)
        return demand


@dataclass(frozen=True, slots=True, kw_only=True)
class People:
    """The people of a laboratory and its rules."""

    FORMAT: ClassVar[Format] = Format(
        title="people", schema=1,
        next_step="change people with: toolkit person enrol, or toolkit person revoke",
    )  # fmt: skip

    person: Annotated[tuple[Person, ...], Size(1), Distinct("id"), Entry("who signs")]
    policy: Annotated[Policy, Entry("what each decision takes")] = Policy()

    def faults(self) -> Iterator[Fault]:
        """Yield a name or a key that two people have, and a decision that nobody could make."""
        owners: dict[str, str] = {}
        names: dict[str, str] = {}
        for index, person in enumerate(self.person):
            for text in {person.id, name_key(person.name)}:
                namesake = names.setdefault(text, person.id)
                if namesake != person.id:
                    yield Fault(
                        key=("person", index, "name"), got=f"{person.name}, as {namesake} is called",
                        expected="a name of this person's own: one person decides under one id",
                    )  # fmt: skip
            for place, key in enumerate(person.keys):
                try:
                    owner = owners.setdefault(key.public.fingerprint, person.id)
                except TrustError:
                    continue  # the key's own fault
                if owner != person.id:
                    yield Fault(
                        key=("person", index, "keys", place), got=f"the key of {owner}",
                        expected="a key of this person's own",
                    )  # fmt: skip
        for action in MEANINGS:
            demand = self.policy.demand(action)
            able = [person.id for person in self.person if set(person.roles) & set(demand.roles)]
            if action == "enrol" and len(able) < demand.signatures:
                yield Fault(
                    key=("policy", action), got=f"{demand.signatures} of {', '.join(able) or 'nobody'}",
                    expected="as many people as it takes, or nobody could change this file again",
                )  # fmt: skip

    def of(self, person_id: str) -> Person | None:
        """Return a person by id."""
        return next((person for person in self.person if person.id == person_id), None)

    def owner(self, public: PublicKey) -> Person | None:
        """Return whose key it is, or was."""
        for person in self.person:
            if any(key.public == public for key in person.keys):
                return person
        return None

    def with_person(self, person: Person) -> People:
        """Return the people with one more, or with that one changed."""
        others = tuple(other for other in self.person if other.id != person.id)
        place = next((at for at, other in enumerate(self.person) if other.id == person.id), len(others))
        return replace(self, person=(*others[:place], person, *others[place:]))

    def text(self) -> str:
        """Return the content of ``people.toml``."""
        return toml_text(self)


def parse_people(data: bytes, *, where: object, entered: bool = False) -> People:
    """Read the content of a ``people.toml``; ``entered``: a version that the laboratory has already.

    Raises
    ------
    ConfigError
        an entry that cannot be used; all are told at once
    """
    return read_text(People, data, where=where, entered=entered)


@dataclass(frozen=True, slots=True)
class Version:
    """The people from a time on, the text that says so, and its hash."""

    since: str
    sha256: str
    people: People
    text: str = field(repr=False)


@functools.lru_cache(maxsize=256)
def version_of(data: bytes, since: str) -> Version:
    """Return the version of the content of a ``people.toml``.

    Raises
    ------
    ConfigError
        an entry that cannot be used
    """
    people = parse_people(data, where=FILE, entered=True)
    return Version(since=since, sha256=sha256_bytes(data), people=people, text=data.decode())


@dataclass(frozen=True)
class History:
    """Every version of the people of a laboratory, oldest first; none where nobody is enrolled.

    Without slots: when each key ended is looked up once and kept.
    """

    versions: tuple[Version, ...] = ()

    @property
    def now(self) -> Version | None:
        """The newest version."""
        return self.versions[-1] if self.versions else None

    def at(self, time: str, sha256: str | None = None) -> Version | None:
        """Return the version of a time; of several within one second the one of a hash, else the newest."""
        past = [version for version in self.versions if version.since <= time]
        ended = sum(later.since < time for later in past[1:])
        return next(
            (version for version in past[ended:] if version.sha256 == sha256), past[-1] if past else None
        )

    def titled(self, text: str) -> str:
        """Return a person's name, with the id by which a text names them; any other text as it is."""
        key = name_key(text)
        people = (version.people.of(key) for version in reversed(self.versions))
        person = next((person for person in people if person is not None), None)
        return text if person is None or key == name_key(person.name) else f"{person.name} ({person.id})"

    def before(self, number: int) -> History:
        """Return the versions by which version ``number`` (from 1) is judged; the first founds itself."""
        return History(self.versions[: max(number - 1, 1)])

    def revoked(self, fingerprint: str, time: str) -> str | None:
        """Return from when on a key that would sign at a time was revoked by any later version."""
        end = self._ends.get(fingerprint)
        return end if end is not None and end <= time else None

    @functools.cached_property
    def _ends(self) -> Mapping[str, str]:
        ends: dict[str, str] = {}
        for version in self.versions:
            for person in version.people.person:
                for key in person.keys:
                    if key.until is not None:
                        name = key.public.fingerprint
                        ends[name] = min(key.until, ends.get(name, key.until))
        return ends


def inability(
    version: Version | None, action: Action, time: str, public: PublicKey, operators: Collection[str] = ()
) -> str | None:
    """Say why a key's owner cannot sign a decision at a time, under a version; None where that is possible.

    ``operators`` are the people, by id or name, who entered what is approved: none of them approves it.
    """
    if version is None:
        return f"nobody was enrolled at {time}"
    demand = version.people.policy.demand(action)
    person = version.people.owner(public)
    if person is None:
        return f"{public.fingerprint} is the key of nobody enrolled at {time}"
    if person.key_at(public.fingerprint, time) is None:
        return f"the key {public.fingerprint} of {person.id} did not sign at {time}"
    if not set(person.roles) & set(demand.roles):
        return f"{person.id} is {' and '.join(person.roles)}; to {action} takes {' or '.join(demand.roles)}"
    if action == "approve" and any(person.is_named(text) for text in operators):
        return f"{person.id} entered what {person.id} approves"
    return None


def objections(
    version: Version | None,
    action: Action,
    time: str,
    signers: Sequence[PublicKey],
    *,
    stated: Collection[str] = (),
    operators: Collection[str] = (),
) -> list[str]:
    """Say why keys that signed a decision at a time, under a version, do not make it; empty where they do.

    ``stated`` are the people whom the decision names; ``operators`` as of `inability`.
    """
    reasons = [
        reason for public in signers if (reason := inability(version, action, time, public, operators))
    ]
    if version is None or reasons:
        return reasons or [f"nobody was enrolled at {time}"]
    owners = [version.people.owner(public) for public in signers]
    people = {person.id: person for person in owners if person is not None}
    if len(people) < len(signers):
        return ["somebody signs it twice"]
    demand = version.people.policy.demand(action)
    if len(people) < demand.signatures:
        reasons.append(f"{len(people)} of {demand.signatures} signatures by {' or '.join(demand.roles)}")
    named = [(text, [key for key, person in people.items() if person.is_named(text)]) for text in stated]
    reasons += [f"{text!r} is named and did not sign" for text, keys in named if not keys]
    if len({key for _, keys in named for key in keys}) < sum(len(keys) for _, keys in named):
        reasons.append(f"{' and '.join(map(repr, stated))} are one person")
    return reasons


# Small letters that are drawn like Latin ones, of the confusables of Unicode Technical Standard 39.
_CYRILLIC = str.maketrans("асеіјорѕухһԁԛԝвкмнт", "aceijopsyxhdqwbkmht")
_GREEK = str.maketrans("αορνυικτχβηζ", "aopvuiktxbhz")


# What is drawn as nothing and is no format character (Default_Ignorable_Code_Point of Unicode 15), and
# letters and signs that are drawn as a blank.
_UNDRAWN = re.compile("[\u034f\u17b4\u17b5\u180b-\u180f\ufe00-\ufe0f\ufff0-\ufff8\U000e0000-\U000e0fff]")
_BLANK = re.compile("[\u115f\u1160\u2800\u3164\uffa0]")


def name_key(name: str) -> str:
    """Return what two spellings of one name have in common; empty where nothing can be seen.

    >>> name_key(" J.  Smith ") == name_key("j. smith") == name_key("J. S\u200bmith")
    True
    """
    drawn = _BLANK.sub(" ", _UNDRAWN.sub("", name))
    # Compatibility forms first: they may unfold to spaces, capitals and marks.
    text = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", drawn).casefold())
    visible = "".join(
        c for c in text if unicodedata.category(c) not in ("Cf", "Cc", "Cn", "Co") or c.isspace()
    )
    return " ".join(visible.split()).translate(_CYRILLIC).translate(_GREEK)
