"""What every reader shares: messages for people, JSON with care, and one limit of memory."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sarl_core.documents import parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.limits import READ_LIMIT, limited_bytes, read_limit, require_memory


@given(text=st.text(max_size=2000) | st.text(st.characters(categories=("Cc", "Cs")), max_size=99))
def test_a_message_is_short_and_on_one_line_whatever_it_repeats(text):
    error = InputError(f"it is wrong: {text}; mend it")
    message = str(error)
    assert len(message) <= 480
    assert message.splitlines() == [message]
    assert message.startswith("it is wrong: ")
    assert message.endswith("; mend it")
    assert "\x1b" not in message
    message.encode()
    assert str(pickle.loads(pickle.dumps(error))) == message


@given(
    value=st.recursive(
        st.text() | st.binary() | st.integers() | st.floats() | st.booleans() | st.none(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
@example(value="\xad")
@example(value="\u200b")
@example(value="\U000e0001")
def test_what_is_quoted_is_short_and_for_people(value):
    text = quoted(value)
    assert len(text) <= 90
    assert not re.search(r"\\[xuUN]", text.replace("\\\\", ""))
    assert InputError(text).args == (text,)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (b"word", "'word'"),
        ("\N{DEGREE SIGN}".encode() * 100, "'" + "\N{DEGREE SIGN}" * 40 + "...'"),
        (b"x" + "\N{EURO SIGN}".encode() * 60, "'x" + "\N{EURO SIGN}" * 39 + "...'"),
        (b"a\tb", "'a b'"),
        (b"", "''"),
        (b"\0\0\0\x3f", "bytes that are no text"),
        (b"\xff\xfe", "bytes that are no text"),
        (b"\xe2\x82", "bytes that are no text"),
    ],
)
def test_bytes_are_quoted_as_the_text_that_they_are(value, text):
    assert quoted(value) == text


def test_a_number_that_python_does_not_write_is_quoted():
    assert quoted(10**5000) == "far too large"
    assert quoted(-3) == "-3"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"\xff\xfe\xfd", "UTF-8"),
        (b'["\xed\xa0\x80"]', "UTF-8"),
        (b'["\\uD800"]', "half of a surrogate pair"),
        ('{"\ud800": 1}', "half of a surrogate pair"),
        ("[" * 100_000, "nested too deeply"),
        ("[NaN]", "NaN"),
        ("[1e999]", "too large"),
        ("1" * 5000, "5,000 digits"),
        ("{", "line 1"),
    ],
)
def test_json_that_is_none_is_one_kind_of_error(text, reason):
    with pytest.raises(ValueError, match=reason):
        parse_json(text)


def test_a_pair_that_is_whole_is_a_sign():
    assert parse_json(rb'["\ud83d\ude00", "\\ud800"]') == ["\U0001f600", r"\ud800"]


def test_json_that_would_take_too_much_memory_is_not_parsed(monkeypatch):
    monkeypatch.setenv(READ_LIMIT, "0.01")
    text = "[" + "[]," * 200_000 + "[]]"
    with pytest.raises(InputError, match=rf"0\.01 GiB.*{READ_LIMIT}"):
        parse_json(text)
    monkeypatch.setenv(READ_LIMIT, "0.1")
    assert len(parse_json(text)) == 200_001


def test_the_limit_is_a_setting(monkeypatch):
    monkeypatch.delenv(READ_LIMIT, raising=False)
    assert read_limit() == 2**30
    monkeypatch.setenv(READ_LIMIT, "2.5")
    assert read_limit() == 2.5 * 2**30
    require_memory(2 * 2**30)
    with pytest.raises(InputError, match=rf"3\.0 GiB, more than the 2\.5 GiB.*{READ_LIMIT}"):
        require_memory(3 * 2**30)


@pytest.mark.parametrize("text", ["none", "0", "-1", "nan", "inf", "1e99", "\x1b[0m"])
def test_a_limit_that_is_none_is_said(monkeypatch, text):
    monkeypatch.setenv(READ_LIMIT, text)
    with pytest.raises(InputError, match=f"{READ_LIMIT} is '.*set it to the GiB"):
        read_limit()


def test_a_file_that_never_ends_is_not_read_to_its_end(tmp_path):
    with pytest.raises(InputError, match="more than the 3 MB"):
        limited_bytes(Path("/dev/zero"), 3 * 2**20)
    path = tmp_path / "four"
    path.write_bytes(b"1234")
    assert limited_bytes(path, 4) == b"1234"
    with pytest.raises(InputError, match="more than the 0 MB"):
        limited_bytes(path, 3)
