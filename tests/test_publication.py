"""Results of one command: in place together or not at all, wherever it is killed or its disk fails."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.crash.calls import contents, counted, failing, killed
from toolkit import publication as module
from toolkit.errors import OutputError
from toolkit.files import write_atomic
from toolkit.publication import (
    ENTERING,
    PENDING,
    check_file,
    check_folder,
    publication,
    settle,
    write_result,
)
from toolkit.staging import supersede

OLD = {
    "a.docx": b"old a",
    "b.pdf": b"old b",
    "manifest.json": b"old m",
    "part/x.csv": b"old x",
    "gone.toml": b"g",
}
NEW = {"a.docx": b"new a", "b.pdf": b"new b", "manifest.json": b"new m", "part/x.csv": b"new x"}
NOTES = {"notes.txt": b"a person's own"}
KINDS = ("fresh", "exchanged", "among others")


def fill(folder: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def publish(folder: Path, files: dict[str, bytes] = NEW) -> None:
    with publication(folder) as stage:
        fill(stage, files)
        supersede(stage, "gone.toml")


def prepared(base: Path, kind: str) -> tuple[Path, dict[str, bytes]]:
    """Return a folder of this kind and what stands in it beside results."""
    out = base / "out"
    others = NOTES if kind == "among others" else {}
    if kind != "fresh":
        fill(out, OLD | others)
    else:
        base.mkdir(parents=True, exist_ok=True)
    return out, others


def generation(seen: dict[str, bytes]) -> set[str]:
    return {data.decode().partition(" ")[0] for data in seen.values()}


@pytest.mark.parametrize("kind", KINDS)
def test_results_replace_the_old_ones_and_nothing_else(tmp_path: Path, kind: str) -> None:
    out, others = prepared(tmp_path, kind)
    publish(out)
    assert contents(out) == NEW | others
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


ALIKE = pytest.mark.campaign(
    "a fresh folder, and one with other files: one that is exchanged is killed at any call in every run"
)


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[ALIKE] * (kind != "exchanged")) for kind in KINDS]
)
def test_killed_at_any_call_the_set_is_never_mixed_and_the_next_command_completes_it(
    tmp_path: Path, kind: str
) -> None:
    ends: list[str] = []
    for at in itertools.count(1):
        out, others = prepared(tmp_path / str(at), kind)
        if not killed(lambda out=out: publish(out), at):
            break
        seen = {name: data for name, data in contents(out).items() if not name.startswith(".toolkit-")}
        assert {name: seen.pop(name) for name in others} == others
        if kind == "among others":
            # Part of one generation, or all of it: never of both.
            assert len(generation(seen) - {"g"}) <= 1
            assert "manifest.json" not in seen or seen in (OLD, NEW)
        else:
            assert seen in ({} if kind == "fresh" else OLD, NEW)
        settle(out)
        after = {
            name: data for name, data in contents(out).items() if not name.startswith(".toolkit-staged-")
        }
        assert after in ((others if kind == "fresh" else OLD | others), NEW | others)
        ends.append("new" if after == NEW | others else "old")
        publish(out)
        assert contents(out) == NEW | others
        assert [path.name for path in out.parent.iterdir()] == ["out"]
    # There is one point of no return.
    assert ends == sorted(ends, reverse=True)
    assert {"old", "new"} <= set(ends)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("kind", KINDS)
def test_a_disk_that_fails_at_any_call_changes_nothing_or_says_that_the_results_are_whole(
    tmp_path: Path, kind: str, number: int
) -> None:
    for at in itertools.count(1):
        out, others = prepared(tmp_path / str(at), kind)
        before = OLD | others if kind != "fresh" else {}
        try:
            with counted(failing(at, number)) as count:
                publish(out)
        except OutputError as error:
            said = error
        else:
            assert contents(out) == NEW | others
            if count.calls < at:
                break
            continue
        assert (said.rule, said.got) == ("not-writable", os.strerror(number))
        if "whole" in said.what:
            settle(out)
            assert contents(out) == NEW | others
        else:
            assert "nothing was changed" in str(said.next_step)
            assert contents(out) == before
        publish(out)
        assert contents(out) == NEW | others
        assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_a_single_file_is_the_old_or_the_new_one_and_leaves_no_part(tmp_path: Path) -> None:
    target = tmp_path / "out" / "a.txt"
    for at in itertools.count(1):
        fill(tmp_path, {"out/a.txt": b"old", "out/notes.txt": b""})
        if not killed(lambda: write_result(target, "new"), at):
            break
        assert target.read_bytes() in (b"old", b"new")
        write_result(target, "again")
        assert contents(tmp_path) == {"out/a.txt": b"again", "out/notes.txt": b""}
        assert sorted(path.name for path in target.parent.iterdir()) == ["a.txt", "notes.txt"]
    assert at > 5
    for failed in range(1, at):
        fill(tmp_path, {"out/a.txt": b"old"})
        with contextlib.suppress(OutputError), counted(failing(failed, errno.EIO)):
            write_result(target, "new")
        assert target.read_bytes() in (b"old", b"new")
        write_result(target, "again")
        assert sorted(path.name for path in target.parent.iterdir()) == ["a.txt", "notes.txt"]


def test_what_is_replaced_keeps_its_mode(tmp_path: Path) -> None:
    fill(tmp_path / "out", OLD)
    (tmp_path / "out" / "b.pdf").chmod(0o640)
    publish(tmp_path / "out")
    assert (tmp_path / "out" / "b.pdf").stat().st_mode & 0o777 == 0o640
    write_result(tmp_path / "out" / "b.pdf", b"")
    assert (tmp_path / "out" / "b.pdf").stat().st_mode & 0o777 == 0o640


def test_an_error_of_the_command_leaves_no_trace(tmp_path: Path) -> None:
    def fail() -> None:
        with publication(tmp_path / "new" / "out") as stage:
            (stage / "a").write_bytes(b"half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_writer_s_error_names_the_folder_and_not_the_staging(tmp_path: Path) -> None:
    fill(tmp_path, {"out/file": b""})

    def write() -> None:
        with publication(tmp_path / "out") as stage:
            fill(stage, {"file": b""})
            write_atomic(stage / "file" / "a.txt", "x")

    with pytest.raises(OutputError) as caught:
        write()
    assert caught.value.where == str(tmp_path / "out" / "file" / "a.txt")
    assert contents(tmp_path) == {"out/file": b""}


def test_a_file_in_the_folder_s_place_and_a_folder_in_a_result_s_place(tmp_path: Path) -> None:
    fill(tmp_path, {"file": b"", "out/a.docx/inside": b"kept"})
    for place in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "out"):
        before = contents(tmp_path)
        with pytest.raises(OutputError):
            publish(place)
        assert contents(tmp_path) == before


def test_a_link_in_the_way_leads_nowhere(tmp_path: Path) -> None:
    fill(tmp_path, {"elsewhere/x.csv": b"not ours", "out/notes.txt": b""})
    (tmp_path / "out" / "part").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="cannot be written"):
        publish(tmp_path / "out")
    assert (tmp_path / "elsewhere" / "x.csv").read_bytes() == b"not ours"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["notes.txt", "part"]


@pytest.mark.parametrize("name", [PENDING, ENTERING])
def test_a_folder_from_outside_reaches_nothing_beyond_itself(tmp_path: Path, name: str) -> None:
    fill(tmp_path, {"elsewhere/x": b"not ours", f"out/{name}/way/x": b"planted"})
    (tmp_path / "out" / "way").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="not all in their place"):
        settle(tmp_path / "out")
    link = tmp_path / "second" / name
    link.parent.mkdir()
    link.symlink_to(tmp_path / "elsewhere")
    settle(tmp_path / "second")
    assert (tmp_path / "elsewhere" / "x").read_bytes() == b"not ours"


def test_a_linked_output_folder_stays_a_link(tmp_path: Path) -> None:
    fill(tmp_path, {"real/a.docx": b"old a"})
    (tmp_path / "out").symlink_to("real")
    publish(tmp_path / "out")
    assert (tmp_path / "out").is_symlink()
    assert contents(tmp_path / "real") == NEW


def test_the_working_folder_stays_the_same_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(tmp_path, OLD)
    monkeypatch.chdir(tmp_path)
    number = tmp_path.stat().st_ino
    publish(Path())
    assert contents(tmp_path) == NEW
    assert tmp_path.stat().st_ino == number


def test_the_folder_keeps_its_mode(tmp_path: Path) -> None:
    fill(tmp_path / "out", OLD)
    (tmp_path / "out").chmod(0o2750)
    publish(tmp_path / "out")
    assert (tmp_path / "out").stat().st_mode & 0o7777 == 0o2750


def test_a_file_system_that_cannot_exchange(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Library:
        def __init__(self, *_args: object, **_kwargs: object) -> None:
            self.renameat2: Callable[..., int] = lambda *_args: -1

    monkeypatch.setattr(module.ctypes, "CDLL", Library)
    fill(tmp_path / "out", OLD)
    publish(tmp_path / "out")
    assert contents(tmp_path) == {f"out/{name}": data for name, data in NEW.items()}


def test_two_writers_never_interleave(tmp_path: Path) -> None:
    """All ways at once: a fresh folder, exchanges, and a folder with others' files."""
    sets = [{name: f"{number} {name}".encode() for name in NEW} for number in range(4)]

    def write(files: dict[str, bytes]) -> None:
        for _ in range(10):
            publish(tmp_path / "out", files)

    threads = [threading.Thread(target=write, args=(files,)) for files in sets]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert contents(tmp_path / "out") in sets
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_staging_of_the_living_is_not_swept(tmp_path: Path) -> None:
    with publication(tmp_path / "out") as first:
        fill(first, {"a": b"1"})
        publish(tmp_path / "out")
        assert contents(first) == {"a": b"1"}
    assert contents(tmp_path / "out") == NEW | {"a": b"1"}


@pytest.mark.parametrize(
    ("one", "other"),
    [("a.pdf", "A.pdf"), ("part/x", "Part/y"), ("stra\u00dfe", "STRASSE"), ("e\u0301", "\u00c9")],
)
@pytest.mark.parametrize("kind", KINDS)
def test_results_that_some_file_systems_take_for_one_are_refused(
    tmp_path: Path, one: str, other: str, kind: str
) -> None:
    out, others = prepared(tmp_path, kind)
    before = contents(out) if out.exists() else {}
    with pytest.raises(OutputError, match="case alone") as caught:
        publish(out, {one: b"1", other: b"2"})
    assert caught.value.rule == "not-writable"
    assert (contents(out) if out.exists() else {}) == before
    assert others.items() <= before.items()


def test_where_case_is_told_another_name_is_another_file(tmp_path: Path) -> None:
    (tmp_path / "A.PDF").write_bytes(b"a person's own")
    write_result(tmp_path / "a.pdf", b"new")
    assert contents(tmp_path) == {"A.PDF": b"a person's own", "a.pdf": b"new"}


def test_where_case_is_not_told_another_s_file_is_not_replaced(tmp_path: Path) -> None:
    # A second name of one file, as such a file system has it.
    (tmp_path / "A.PDF").write_bytes(b"a person's own")
    (tmp_path / "a.pdf").hardlink_to(tmp_path / "A.PDF")
    with pytest.raises(OutputError, match="would replace it"):
        write_result(tmp_path / "a.pdf", b"new")
    assert (tmp_path / "A.PDF").read_bytes() == b"a person's own"


@pytest.mark.parametrize("kind", ["pipe", "device", "loop"])
def test_a_result_takes_the_place_of_no_pipe_and_no_device(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.pdf"
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "device":
            path.symlink_to("/dev/null")
        case "loop":
            path.symlink_to(path.name)
    before = path.lstat()
    for write in (check_file, lambda path: write_result(path, b"new")):
        with pytest.raises(OutputError) as caught:
            write(path)
        assert caught.value.rule == "not-writable"
        assert path.lstat() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.pdf"]


def test_a_place_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / ("n" * 300), Path("a\0b")):
        with pytest.raises(OutputError):
            check_folder(folder)
    for path in (tmp_path, tmp_path / "file" / "below", tmp_path / ("n" * 300)):
        with pytest.raises(OutputError):
            check_file(path)
    check_folder(tmp_path / "new" / "deep")
    check_file(tmp_path / "new" / "deep" / "file")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def home_of(base: Path) -> Path:
    """Return a home with a registry, a log of people, and one folder that is nobody's."""
    for folder in ("calibrations/press", "people", "results"):
        (base / "home" / folder).mkdir(parents=True)
    for name in ("ledger.jsonl", "head.json"):
        for folder in ("calibrations/press", "people"):
            (base / "home" / folder / name).write_text("{}")
    return base / "home"


@pytest.mark.parametrize(
    "place",
    ["calibrations", "calibrations/press", "calibrations/press/deep", "calibrations/new", "people"],
)
@pytest.mark.parametrize(
    "write",
    [
        check_folder,
        lambda folder: check_file(folder / "o.csv"),
        publish,
        lambda f: write_result(f / "o", b""),
    ],
    ids=["check_folder", "check_file", "publication", "write_result"],
)
def test_no_result_enters_a_place_of_records_and_ledgers(
    tmp_path: Path, place: str, write: Callable[[Path], object]
) -> None:
    home = home_of(tmp_path)
    before = contents(home)
    with pytest.raises(OutputError) as caught:
        write(home / place)
    assert caught.value.rule == "guarded"
    assert all((caught.value.where, caught.value.got, caught.value.expected, caught.value.next_step))
    assert contents(home) == before


def test_a_registry_of_any_name_is_known_by_what_it_holds_and_a_link_to_it_too(tmp_path: Path) -> None:
    home = home_of(tmp_path)
    (home / "calibrations").rename(home / "records")
    (tmp_path / "elsewhere").symlink_to(home / "records")
    for place in (home / "records", tmp_path / "elsewhere" / "press"):
        with pytest.raises(OutputError, match="among records"):
            check_folder(place)
    # A home, a folder beside the registry, and one that holds a copy of an instrument among others are free.
    for place in (home, home / "results", tmp_path):
        check_folder(place)
