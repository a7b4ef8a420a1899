"""Settings from TOML: the line of every key, every mistake at once, and back into a file."""

import tomllib
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field

from dqslam.config import key_lines, load_toml_model, read_toml, toml_text
from dqslam.io import FileError

TEXT = '''# a comment with = and [brackets]
first = 1
"quoted key" = "a # is no comment" # this is
long = """
not = a key
[nor a section]
"""
date = 2024-02-29T07:32:00.5
list = [ # of
  1.5,
  { inner = 2, "in.ner" = [3] },
]
dotted.a.b = true

[section]
first = 'C:\\'
[section.deep]
x = -1e-3
[[many]]
x = 1
[[many]]
y = """a""b\\\\"""
[many.below]
z = 2
'''


def every_location(content, location=()):
    """Walk what the standard library reads: all locations that are in the file."""
    if location:
        yield location
    items = content.items() if isinstance(content, dict) else enumerate(content)
    for name, value in items:
        if isinstance(value, dict | list):
            yield from every_location(value, (*location, name))
        else:
            yield (*location, name)


def test_every_key_has_its_line():
    lines = key_lines(TEXT)
    assert set(lines) == set(every_location(tomllib.loads(TEXT)))
    rows = TEXT.splitlines()
    for location, line in lines.items():
        if isinstance(location[-1], str):
            assert location[-1] in rows[line - 1]
    assert lines["long",] == 4
    assert lines["list", 1, "in.ner", 0] == 11
    assert lines["dotted", "a", "b"] == 13
    assert lines["section", "first"] == 16
    assert (lines["many", 0], lines["many", 1], lines["many", 1, "below", "z"]) == (19, 21, 24)


class Round(BaseModel):
    model_config = ConfigDict(extra="forbid")
    kind: Literal["round"]
    radius_m: Annotated[float, Field(gt=0.0)]


class Square(BaseModel):
    model_config = ConfigDict(extra="forbid")
    kind: Literal["square"]
    side_m: float


class Settings(BaseModel):
    model_config = ConfigDict(extra="forbid")
    trials: int
    names: list[str] = []
    shape: Annotated[Round | Square, Field(discriminator="kind")]
    more: dict[str, Square] = {}


GOOD = """trials = 3
names = ["a", "b"]
[shape]
kind = "round"
radius_m = 0.5
[more.x]
kind = "square"
side_m = 1
"""


def load(tmp_path, text):
    path = tmp_path / "s.toml"
    path.write_text(text)
    return load_toml_model(path, Settings)


def test_a_file_becomes_a_model(tmp_path):
    settings = load(tmp_path, GOOD)
    assert (settings.trials, settings.names, settings.shape.radius_m) == (3, ["a", "b"], 0.5)
    assert settings.more["x"].side_m == 1.0


def test_all_mistakes_at_once_each_with_its_line(tmp_path):
    text = GOOD.replace("trials", "trails").replace('"b"', "7")
    text = text.replace("0.5", "-0.5").replace("side_m", "sid_m")
    with pytest.raises(FileError) as error:
        load(tmp_path, text)
    path = tmp_path / "s.toml"
    assert str(error.value).splitlines() == [
        f"{path}: trials is missing",
        f"{path}:1: unknown key trails; did you mean trials?",
        f"{path}:2: names.1: Input should be a valid string, not 7",
        f"{path}:5: shape.radius_m: Input should be greater than 0, not -0.5",
        f"{path}:6: more.x.side_m is missing",
        f"{path}:8: unknown key more.x.sid_m; did you mean side_m?",
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius_m", "raduis_m", ":5: unknown key shape.raduis_m; did you mean radius_m?"),
        ("radius_m", "side_m", ":5: unknown key shape.side_m; there are: kind, radius_m"),
        ("[more.x]", "[zz.x]", ":6: unknown key zz; there are: trials, names, shape, more"),
        ('"round"', '"flat"', ":3: shape: Input tag 'flat' found using 'kind' does not match"),
        ("trials = 3", "trials 3", ":1: not a TOML file: Expected '=' after a key"),
        ("side_m = 1", "side_m = ", ":8: not a TOML file: Invalid value"),
        ("side_m = 1", "side_m = [1", ":8: not a TOML file: "),
        ("[more.x]", "[shape]", ":6: not a TOML file: Cannot declare"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, old, new, message):
    assert old in GOOD
    with pytest.raises(FileError) as error:
        load(tmp_path, GOOD.replace(old, new))
    assert f"s.toml{message}" in str(error.value)


@pytest.mark.parametrize(("text", "message"), [("", "is empty"), ("\xff", "not a text file")])
def test_what_is_no_settings_file(tmp_path, text, message):
    path = tmp_path / "s.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(FileError, match=message):
        load_toml_model(path, Settings)
    with pytest.raises(FileError, match=r"none\.toml: no such file"):
        load_toml_model(tmp_path / "none.toml", Settings)


def test_what_is_written_is_read_again():
    settings = {
        "text": 'C:\\ "quoted"\n\u00b5 \U0001f697 \x7f\x01',
        "count": 3,
        "small": 1e-05,
        "third": 1 / 3,
        "yes": True,
        "list": ["a", "b"],
        "empty": [],
        "huge": float("inf"),
    }
    assert tomllib.loads(toml_text(settings | {"nothing": None})) == settings


def test_what_no_file_can_hold_is_refused():
    with pytest.raises(TypeError, match="no setting of a file"):
        toml_text({"x": object()})


def test_brackets_without_end_are_an_error_of_the_file(tmp_path):
    path = tmp_path / "deep.toml"
    path.write_text("a = " + "[" * 5000)
    with pytest.raises(FileError, match=r"deep\.toml: nested too deeply"):
        read_toml(path)
