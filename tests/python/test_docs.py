"""The pages of docs/: what they show is executed, what they name exists, and Sphinx builds them."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import typer

import dqslam
import realdata
from dqslam.cli import app, main
from pages import PAGES, ROOT, blocks, commands, execute, execute_block

READ = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *PAGES]
EXECUTED = [page for page in PAGES if blocks(page, "bash", "python")]
NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))
EXAMPLES = sorted((ROOT / "examples").glob("plot_*.py"))
# Without running gallery and notebooks, which are tested by themselves, and with a small table.
QUICK = ("plot_gallery=0", "dqslam_paper_trials=2", "nb_execution_mode=off")


def stem(page):
    return page.stem


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Make what pages work on: a simulated recording and its results."""
    folder = tmp_path_factory.mktemp("made")
    recording = folder / "recording"
    assert main(["simulate", "orbit", "--seed", "1", "--out", str(recording)]) == 0
    files = {"camera": "camera.json", "odometry": "odometry.txt", "detections": "boxes.csv"}
    options = [word for kind, name in files.items() for word in (f"--{kind}", recording / name)]
    assert main(["run", *map(str, options), "--out", str(folder / "results/mine")]) == 0
    return folder


@pytest.mark.parametrize("page", EXECUTED, ids=stem)
def test_blocks_of_a_page(page, made, tmp_path):
    """In order, in a directory with the recording, its results and the repository's data."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    (tmp_path / "data").symlink_to(ROOT / "data")
    for block in blocks(page, "bash", "python"):
        execute_block(block, tmp_path)


@pytest.mark.parametrize("page", READ, ids=stem)
def test_commands_that_are_not_run_exist(page):
    """What takes long or needs files that are not here stands behind a $."""
    known = typer.main.get_command(app).commands
    for command in commands(page, "console", "$ dqslam "):
        name, *words = command.split("#")[0].split()
        options = {
            option for one in known[name].params for option in (*one.opts, *one.secondary_opts)
        }
        given = {word for word in words if word.startswith("-") and len(word) > 1}
        assert given <= options, (command, given - options)


def headings(page):
    """Give the anchors of a page's headings, as forges make them."""
    text = re.sub(
        r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    titles = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", READ, ids=stem)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"https?:|mailto:", target):
            continue
        way, _, anchor = target.partition("#")
        file = (page.parent / way).resolve() if way else page
        assert file.exists(), target
        assert not anchor or anchor in headings(file), target


def test_every_command_of_a_cost_is_where_it_says():
    page = ROOT / "docs/add_cost.md"
    rows = re.findall(
        r"^\| .* \| \[`(.*)`\]\(.*\) \| `(.*)` \|$", page.read_text(), flags=re.MULTILINE
    )
    assert len(rows) == 4
    for file, name in rows:
        assert name in (ROOT / file).read_text(), (file, name)


def test_a_cost_is_known_to_few_files():
    knows = re.compile(r"RangeCost|costs/range\.h")
    files = [
        file.relative_to(ROOT).as_posix()
        for room in ("cpp", "python", "tests/cpp", "docs", "benchmarks", "examples")
        for file in (ROOT / room).rglob("*")
        if file.suffix in {".h", ".cc", ".py", ".pyi", ".md"}
        and "_generated" not in file.parts
        and knows.search(file.read_text())
    ]
    assert knows.search((ROOT / "CMakeLists.txt").read_text())
    assert sorted(files) == [  # and CMakeLists.txt
        "cpp/dqslam/costs/measurements.h",
        "cpp/dqslam/costs/range.h",
        "docs/add_cost.md",
        "tests/cpp/measurements_test.cc",
    ]


def test_the_api_reference_has_every_public_name():
    """Each on one page, which the reference lists."""
    pages = sorted((ROOT / "docs/api").glob("*.md"))
    listed = re.findall(r"\]\(api/(\w+)\.md\)", (ROOT / "docs/api.md").read_text())
    assert sorted(listed) == [page.stem for page in pages]
    directive = re.compile(r"auto(?:class|data|function):: dqslam\.(\w+)$", flags=re.MULTILINE)
    documented = [name for page in pages for name in directive.findall(page.read_text())]
    assert sorted(documented) == sorted(set(dqslam.__all__) - {"__version__"})


def test_the_citation_has_the_version():
    (version,) = re.findall(r"VERSION (\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text())
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version = {{{version}}}" in (ROOT / "docs/cite.md").read_text()


@pytest.mark.parametrize("example", EXAMPLES, ids=stem)
def test_example(example, tmp_path, monkeypatch):
    beside = Path(os.environ.get("DQSLAM_REALDATA", realdata.BESIDE))
    if beside.is_dir():
        monkeypatch.setenv("DQSLAM_REALDATA", str(beside))
    execute([sys.executable, str(example)], tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=stem)
def test_notebook(notebook, tmp_path):
    """Its cells run in order; it has no outputs, for the site executes it."""
    cells = [
        cell
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        if cell["cell_type"] == "code"
    ]
    assert not any(cell["outputs"] or cell["execution_count"] for cell in cells)
    code = "\n".join("".join(cell["source"]) for cell in cells)
    execute([sys.executable, "-c", code], tmp_path)
    assert not list(tmp_path.iterdir())


def searched(site):
    """Return the pages whose words the search of a site finds."""
    text = (site / "searchindex.js").read_text()
    index = json.loads(text[text.index("{") : text.rindex("}") + 1])
    rows = set()
    for found in (*index["terms"].values(), *index["titleterms"].values()):
        rows |= set(found) if isinstance(found, list) else {found}
    return {index["docnames"][row] for row in rows}


@pytest.mark.skipif(find_spec("sphinx_gallery") is None, reason="needs the extra docs")
def test_the_site_is_built_without_a_warning(tmp_path):
    """On a copy, for the build writes into docs/."""
    for path in ROOT.iterdir():
        if path.name not in ("docs", "build"):
            (tmp_path / path.name).symlink_to(path)
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("_generated"))
    settings = [word for one in QUICK for word in ("-D", one)]
    call = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *settings, "docs", "site"]
    result = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    site = tmp_path / "site"
    assert len(re.findall("<math ", (site / "method.html").read_text())) > 20
    assert "this build" in (site / "paper_experiment.html").read_text()
    assert (site / "_images/paper_maps.png").is_file()
    assert "How sure is it?" in (site / "notebooks/boxes_to_map.html").read_text()
    assert (site / "_generated/source/cpp/dqslam/geometry/blocks.h.html").is_file()
    assert 'id="dqslam.OnlineSlam"' in (site / "api/online.html").read_text()
    found = searched(site)
    assert "method" in found
    assert not [page for page in found if page.startswith("_generated/source/")]
    for page in (
        *site.glob("*.html"),
        *site.glob("api/*.html"),
        *site.glob("notebooks/*.html"),
    ):  # nothing is fetched from elsewhere
        fetched = r'<(?:script|img|iframe)[^>]* src="https?://|<link[^>]* href="https?://'
        assert not re.findall(fetched, page.read_text()), page.name
