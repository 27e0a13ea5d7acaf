"""Forms with files: whole, byte for byte, or refused."""

from __future__ import annotations

import random
from urllib.parse import quote

import pytest

from tests.workbench.conftest import Served
from toolkit.errors import ConfigError
from toolkit.workbench.forms import FILES_TYPE, FORM_TYPE, MOST_FIELDS, Upload, read_form
from toolkit.workbench.guard import LARGEST_UPLOAD

BOUNDARY = "XXX"
TYPE = f"{FILES_TYPE}; boundary={BOUNDARY}"


def form(*parts: tuple[str, bytes]) -> bytes:
    head = b"".join(
        f"--{BOUNDARY}\r\nContent-Disposition: form-data; {stated}\r\n\r\n".encode() + data + b"\r\n"
        for stated, data in parts
    )
    return head + f"--{BOUNDARY}--\r\n".encode()


@pytest.mark.parametrize("data", [
    b"", b"\r\n", b"\r", b"\n\r\n--", b"\r\n--XX", bytes(range(256)) * 3, b"a\r\n\r\nb",
])  # fmt: skip
def test_a_file_comes_as_it_was_sent(data: bytes) -> None:
    read = read_form(form(('name="a"', b"1"), ('name="f"; filename="x y.csv"', data)), TYPE)
    assert (read.fields, read.files) == ({"a": "1"}, {"f": (Upload("x y.csv", data),)})


def test_several_files_of_a_field_keep_their_order_and_none_chosen_is_none() -> None:
    read = read_form(
        form(*((f'name="f"; filename="{n}"', b"x") for n in "ba"), ('name="g"; filename=""', b"")), TYPE
    )
    assert [upload.name for upload in read.files["f"]] == ["b", "a"]
    assert "g" not in read.files


@pytest.mark.parametrize("body", [
    b"", b"--XXX--", b"--XXX\r\n\r\n", form(('name="a"', b"1"))[:-4], b"x" + form(('name="a"', b"1")),
    form(("", b"1")), form(('name="a"', b"\xff")), form(*[('name="a"', b"1")] * (MOST_FIELDS + 1)),
    form(('name="a"', b"1")).replace(b"\r\n", b"\n"), form(('name="a"', b"1")).replace(b"XXX", b"YYY"),
])  # fmt: skip
def test_what_is_no_whole_form_is_refused(body: bytes) -> None:
    if body == b"--XXX--":  # an empty form is one
        assert read_form(body, TYPE).fields == {}
        return
    with pytest.raises(ValueError):
        read_form(body, TYPE)


@pytest.mark.parametrize(
    "content_type", [FILES_TYPE, f"{FILES_TYPE}; boundary=", f'{FILES_TYPE}; boundary="a\nb"']
)
def test_a_form_without_boundary_is_refused(content_type: str) -> None:
    with pytest.raises(ValueError):
        read_form(form(('name="a"', b"1")), content_type)


def test_damage_is_refused_or_read_and_nothing_else() -> None:
    good, source = form(('name="a"', b"1"), ('name="f"; filename="x"', b"data")), random.Random(1)
    for _ in range(2000):
        bad = bytearray(good)
        for _ in range(source.randint(1, 4)):
            bad[source.randrange(len(bad))] = source.randrange(256)
        try:
            read_form(bytes(bad[: source.randint(0, len(bad))]), TYPE)
        except ValueError:
            continue


def test_a_form_with_files_needs_the_key_of_our_pages_and_its_limit(own: Served) -> None:
    path = f"{own.place}/session"
    body = form(('name="from"', b"files"), ('name="files"; filename="SESSION.toml"', b"schema = 1"))
    assert own.ask(path, "POST", body, Content_Type=TYPE).status == 403
    assert own.ask(path, "POST", Content_Type=TYPE).status == 400
    stranger = own.upload("/session", [("files", "SESSION.toml", b"")], form_key="wrong")
    assert stranger.status == 403
    too_large = b"x" * (LARGEST_UPLOAD + 1)
    assert own.upload("/session", [("files", "a.csv", too_large)]).status == 413
    assert not (own.home / "drafts").exists()


@pytest.mark.parametrize("text", [b"%ff", b"%c3", b"a%80"])
def test_text_that_is_no_utf_8_is_refused(text: bytes) -> None:
    with pytest.raises(ValueError):
        read_form(b"a=" + text, FORM_TYPE)


@pytest.mark.parametrize("text", ["\x00", "a\x0bb", "\x1b[2J", "\u202eb", "\x85"])
def test_a_field_that_no_document_can_print_is_refused_in_either_form(text: str) -> None:
    for body, kind in (
        (f"reason={quote(text)}".encode(), FORM_TYPE),
        (form(('name="reason"', text.encode())), TYPE),
    ):
        with pytest.raises(ConfigError) as caught:
            read_form(body, kind)
        assert (caught.value.rule, caught.value.where) == ("unprintable", "reason")


def test_lines_and_tabs_of_a_field_stay() -> None:
    assert read_form(b"a=1%0D%0A2%09", FORM_TYPE).fields == {"a": "1\r\n2\t"}


def test_a_file_as_it_is_typed_is_judged_by_its_reader() -> None:
    assert read_form(b"session=%00&by=B", FORM_TYPE).fields == {"session": "\x00", "by": "B"}
