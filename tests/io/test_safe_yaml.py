from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, MclError, UsageError
from mclcli.io.tables import safe_yaml
from mclcli.io.tables.yaml_text import to_yaml

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

TOKENS = (
    *("a", "ü", "1.5", "1e3", "007", "yes", "true", "~", ".inf", "0x1F", '"x"', "'y'", "k: ", "key: 1\n", "- ", "- - "),
    *("[", "]", "{", "}", ", ", ",", "\n", "  ", "\n  ", "\r\n", "#c", "# c\n", "|\n  x\n", ">-\n  y\n", "? ", ": "),
    *("&a ", "*a", "!!int ", "! ", "<<: ", "---\n", "...\n", "\n---\n", "%", "@", "\\", '"', "'"),
)


@pytest.fixture(autouse=True, scope="module", params=["libyaml", "pure"])
def parser(request: pytest.FixtureRequest) -> Iterator[None]:
    """Everything below with libyaml, and as where PyYAML was built without it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml, "__with_libyaml__", request.param == "libyaml")
        yield


def test_this_pyyaml_has_libyaml() -> None:
    assert hasattr(yaml, "CLoader")


def _load(text: str, *, several: bool = False) -> safe_yaml.Value:
    return safe_yaml.parse(text.encode(), "m.yaml", several=several).value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5e-2", 0.05), ("5E+3", 5000.0), (".5", 0.5), ("-1.", -1.0), ("+2", 2), ("0", 0), ("-0.0", 0.0),
        (".inf", math.inf), ("-.Inf", -math.inf), ("12345678901234567890", 12345678901234567890.0),
        ("true", True), ("False", False), ("null", None), ("~", None), ("", None),
        ("yes", "yes"), ("007", "007"), ("1_000", "1_000"), ("0x10", "0x10"), ("inf", "inf"), ("1:30", "1:30"),
        ("'5'", "5"), ('"true"', "true"), ("nan", "nan"), ("1e", "1e"), (".", "."), ("trinary # words", "trinary"),
    ],
)  # fmt: skip
def test_scalars(text: str, value: safe_yaml.Value) -> None:
    found = _load(f"a: {text}\n")
    assert found == {"a": value}
    assert isinstance(found, dict)
    assert type(found["a"]) is type(value)


def test_nested_values_and_the_lines_they_stand_on() -> None:
    document = safe_yaml.parse(b"\xef\xbb\xbf# map\na: [1, two]\nb:\n  c:\n  - d: 1\n  - {e: ~}\n", "m.yaml")
    assert document.value == {"a": [1, "two"], "b": {"c": [{"d": 1}, {"e": None}]}}
    assert [document.line(*path) for path in (("a",), ("b", "c"), ("b", "c", 0, "d"), ("b", "c", 1))] == [2, 4, 5, 6]
    assert document.line("a", 1) == 2, "an item is where its list is"
    assert document.line("nowhere") == 1


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("a: &x 1\n", "anchor or alias (& or *), line 1"),
        ("b: 1\na: *x\n", "anchor or alias (& or *), line 2"),
        ("&k a: 1\n", "anchor"),
        ("<<: {a: 1}\n", "merge (<<), line 1"),
        ("a: !!float 1\n", "tag (tag:yaml.org,2002:float), line 1"),
        ("a: !!python/object/apply:os.system [ls]\n", "tag"),
        ("a: ! 1\n", "tag"),
        ("!t {a: 1}\n", "tag"),
        ("a: 1\nb: 2\na: 3\n", "'a' stands there twice, line 3"),
        ("c: {a: 1, 'a': 2}\n", "'a' stands there twice"),
        ("? [a, b]\n: 1\n", "a key that is not plain text, line 1"),
        ("a: " + "[" * 8, "nesting deeper than 8, line 1"),
        ("a:\n\tb: 1\n", "line 2"),
        ("a: 1\n}\n", "line 2"),
        ("%YAML 1.3\n---\na: 1\n", "directive (%), line 1"),
        ("a: 1\n---\nb: 2\n", "more than one document"),
        ("# nothing\n", "nothing but comments"),
        ("", "empty"),
        ("a: \x07\n", "not valid YAML"),
        ("a: 1\nb: 2 # c\x85d: 3\n", "a line separator or byte order mark (U+0085, U+2028, U+2029, U+FEFF), line 2"),
        ('a: "x\u2028y"\n', "line separator"),
        ("a: 1\n# c\u2029b: 2\n", "line separator"),
        ("a: 1\n\ufeffb: 2\n", "byte order mark"),
        ("\ta: 1\n", "not valid YAML"),
        ('a: "\\UFFFFFFFF"\n', "not valid YAML"),
        ("version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
        ("\n<!DOCTYPE html><html>", "web page"),
        ("a: " + "x" * 70_000, "longer than 65536 bytes"),
    ],
)
def test_what_is_refused(text: str, named: str) -> None:
    with pytest.raises(InputError) as caught:
        _load(text)
    assert str(caught.value).startswith("m.yaml: ")
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_just_within_the_limits() -> None:
    value = _load("a: " + "[" * 7 + "]" * 7 + "\n#" + "x" * 65_000)
    for _ in range(7):
        value = value["a"] if isinstance(value, dict) else value[0]  # type: ignore[index]
    assert value == []


@pytest.mark.parametrize(
    ("text", "more"),
    [("a: 1\n---\n", False), ("a: 1\n...\n", False), ("a: 1\n---\n---\n", False), ("a: 1\n---\nb: 1\n", True),
     ("a: 1\n---\nb: [1,", True), ("---\na: 1\n---\nb\n", True)],
)  # fmt: skip
def test_streams_of_documents(text: str, more: bool) -> None:  # noqa: FBT001 - a parameter
    document = safe_yaml.parse(text.encode(), "m.yaml", several=True)
    assert document.value == {"a": 1}
    assert document.more is more


def test_a_second_document_that_is_empty_is_none() -> None:
    assert _load("a: 1\n---\n") == {"a": 1}


def test_text_that_is_not_utf8_names_the_line() -> None:
    with pytest.raises(InputError, match="not UTF-8 text, line 2"):
        safe_yaml.parse(b"a: 1\nb: \xff\n", "m.yaml")


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        safe_yaml.read(tmp_path / "none.yaml")
    with pytest.raises(UsageError, match="not a regular file"):
        safe_yaml.read(tmp_path)
    (tmp_path / "a.yaml").write_text("a: 1\n")
    assert safe_yaml.read(tmp_path / "a.yaml").value == {"a": 1}


def test_damage_never_escapes_as_another_error() -> None:
    """Seeded edits of a valid document: each gives a value or an InputError."""
    rng = random.Random(7)  # noqa: S311 - not for secrets
    valid = (
        "image: a.pgm\norigin: [1.0, -2, 0]\nb: {c: 'd', e: \"f\\x41\"}\nt: |\n  x\n  y\nu: >-\n  z\nw:\n- 1\n- v: 2\n"
    )
    signs = "\n :-[]{}#&*!|>'\"%@`,?~\\\tab01.\x85\u2028\ufeff\U0001f600"
    refused = 0
    for _ in range(400):
        text = list(valid)
        for _ in range(rng.randint(1, 4)):
            place = rng.randrange(len(text))
            text[place : place + rng.choice((0, 1, 1, 5))] = rng.choice(("", rng.choice(signs), rng.choice(signs) * 2))
        try:
            _load("".join(text))
        except MclError as error:
            refused += 1
            assert "\n" not in str(error)  # noqa: PT017 - the message is what matters
    assert 100 < refused < 400


PLAIN = st.recursive(
    st.floats(allow_nan=False) | st.integers(-(10**15), 10**15) | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.dictionaries(st.from_regex(r"[a-z_]{1,8}", fullmatch=True), inner, min_size=1, max_size=4),
    max_leaves=10,
)
NUMBERS = st.lists(st.floats(allow_nan=False), max_size=9)


@given(st.dictionaries(st.from_regex(r"k[a-z]{0,6}", fullmatch=True), PLAIN | NUMBERS, min_size=1, max_size=5))
def test_what_is_written_reads_back(value: dict[str, safe_yaml.Value]) -> None:
    limits = safe_yaml.Limits(size=1 << 20, depth=30)
    assert safe_yaml.parse(to_yaml(value).encode(), "m.yaml", limits).value == value


@pytest.mark.parametrize(
    "word", ["null", "Yes", "n", "true", "1e5", ".inf", "", " a", "a: b", "#", "-", "\x7f\n\u2028"]
)
def test_words_that_look_like_something_else_stay_words(word: str) -> None:
    assert safe_yaml.parse(to_yaml({"a": word}).encode(), "m.yaml").value == {"a": word}


def test_where_keys_may_stand_twice_the_last_counts_and_is_named() -> None:
    text = b"a: {x: 1, y: 2}\na:\n  x: 3\nb: {z: 1, z: 2}\n"
    document = safe_yaml.parse(text, "f.yaml", safe_yaml.Limits(repeats=True))
    assert document.value == {"a": {"x": 3}, "b": {"z": 2}}
    assert document.repeated == {("a",), ("b", "z")}
    assert document.line("a", "x") == 3


@given(st.lists(st.sampled_from(TOKENS), max_size=14).map("".join))
def test_both_parsers_read_the_same(text: str) -> None:
    """What PyYAML's own parser takes, libyaml takes too, and reads alike; only libyaml knows ``?`` within words."""

    def result(*, libyaml: bool) -> object:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(yaml, "__with_libyaml__", libyaml)
            try:
                document = safe_yaml.parse(text.encode(), "m.yaml", several=True)
            except InputError:
                return None
        return repr((document.value, document.more)), document.lines

    fast, slow = result(libyaml=True), result(libyaml=False)
    assert fast == slow or (slow is None and "?" in text)


@pytest.mark.parametrize("layout", ["- {}\n", "  - {}\n", "[{}]\n"])
def test_a_long_list_is_read_number_by_number(layout: str) -> None:
    numbers = ["1.0", "-2", ".inf", "-.inf", "1e-05", "007", "true", "abc", "null", "5.0", "0.1"] * 66
    lines = layout.format(", ".join(numbers)) if "[" in layout else "".join(layout.format(word) for word in numbers)
    document = safe_yaml.parse(
        f"a: 1\nranges:\n{lines if '[' not in layout else '  ' + lines}b: 2\n".encode(), "m.yaml"
    )
    assert document.value == {"a": 1, "ranges": [safe_yaml.resolve(number) for number in numbers], "b": 2}
    assert document.line("b") == (4 if "[" in layout else 3 + len(numbers))
