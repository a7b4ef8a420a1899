"""YAML that would take all time and memory, or that its parser cannot make values of."""

import pytest

from dqslam.io import FileError
from dqslam.io.yaml import parse_yaml

pytest.importorskip("yaml", reason="PyYAML is not installed: pip install 'dqslam[yaml]'")

LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 10)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LAUGHS, r"a\.yaml:2: has an alias, \*a0: not read"),
        ("a: !!bool x", "not YAML: a value cannot be read"),
        ("a: !!int x", "not YAML: a value cannot be read"),
        ("a: 2024-99-99", "not YAML: a value cannot be read"),
        ("a: " + "9" * 5000, "not YAML: a value cannot be read"),
        ("a: !!python/object:os.system x", r"a\.yaml:1: not YAML"),
        ("a: " + "[" * 100000, r"a\.yaml:1: nested too deeply"),
        ("a:\n" + "".join(" " * i + "- \n" for i in range(1, 200)), "nested too deeply|not YAML"),
        ("a: 1\nb:\n  c: 2\n  c: 3\n", r"a\.yaml:4: c is there twice, with different values"),
        ("- 1", "holds no table of named values"),
    ],
)
def test_what_is_refused(text, message):
    with pytest.raises(FileError, match=message) as error:
        parse_yaml("a.yaml", text)
    assert len(str(error.value)) < 300


def test_a_key_may_be_repeated_with_the_same_value():
    assert parse_yaml("a.yaml", "a: 1\na: 1\n") == {"a": 1}


def test_anchors_without_aliases_and_later_documents():
    assert parse_yaml("a.yaml", "a: &x 1\n---\nb: *y\n") == {"a": 1}
