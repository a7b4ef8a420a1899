import numpy as np
import pytest

from dqslam import UNKNOWN_SIZE, SizePrior, SizePriors, load_size_priors
from dqslam.io import FileError

TABLE = """
[default]
median_m = 0.2
spread = 3.0

[classes.chair]
median_m = 0.4
spread = 1.5

[classes."traffic light"]
median_m = 0.25
spread = 1.3
"""


def written(tmp_path, text):
    path = tmp_path / "sizes.toml"
    path.write_text(text)
    return path


def test_a_table_by_hand(tmp_path):
    priors = load_size_priors(written(tmp_path, TABLE))
    chair = priors.of("chair")
    assert (chair.log_mean, chair.log_sigma) == pytest.approx((np.log(0.4), np.log(1.5)))
    assert priors.of("traffic light").log_mean == pytest.approx(np.log(0.25))
    assert priors.of("sofa") == SizePrior(np.log(0.2), np.log(3.0))


def test_without_a_default_other_classes_have_the_usual_one(tmp_path):
    priors = load_size_priors(written(tmp_path, "# nothing is known\n"))
    assert priors == SizePriors({})
    assert priors.of("sofa") == UNKNOWN_SIZE


def test_classes_that_are_not_there_are_named():
    priors = SizePriors({"cup": SizePrior(), "vase": SizePrior()})
    priors.check_classes(["vase", "cup", "bowl"])
    with pytest.raises(ValueError, match="no class 'vase' in the recording, only: bowl, cup"):
        priors.check_classes(["cup", "bowl"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("median_m = 0.4", "median_m = 0", r"classes\.chair\.median_m: .* greater than 0"),
        ("median_m = 0.4", "mean_m = 0.4", r":6: .*\.median_m is missing\n.*:7: .*mean_m; did"),
        ("spread = 1.5", "spread = 1", r"classes\.chair\.spread: .* greater than 1"),
        ("spread = 1.5", "spread = inf", r"classes\.chair\.spread: .* finite"),
        ("[classes.chair]", "[chair]", r":6: unknown key chair; there are: default, classes$"),
        ("[default]", "[default", "not a TOML file"),
    ],
)
def test_what_is_wrong_is_named_with_its_file(tmp_path, old, new, message):
    assert old in TABLE
    path = written(tmp_path, TABLE.replace(old, new))
    with pytest.raises(ValueError, match=message) as error:
        load_size_priors(path)
    assert str(error.value).startswith(f"{path}:")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match=r"no_such\.toml: no such file"):
        load_size_priors(tmp_path / "no_such.toml")
