"""The workflows of continuous integration: what can be known of them without running them."""

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install 'dqslam[yaml]'")


def load(path: Path) -> dict[str, Any]:
    # YAML 1.1, PyYAML's, reads the key `on` as the truth.
    return {
        "on" if key is True else key: value
        for key, value in yaml.safe_load(path.read_text()).items()
    }


def steps(path: Path) -> list[dict[str, Any]]:
    return [step for job in load(path)["jobs"].values() for step in job["steps"]]


def jobs_of_run() -> set[str]:
    usage = subprocess.run([ROOT / "run", "help"], capture_output=True, text=True, check=True)
    return set(re.findall(r"^  (\w+) ", usage.stdout, flags=re.MULTILINE))


def test_there_is_one_for_tests_wheels_and_documentation() -> None:
    assert [path.stem for path in WORKFLOWS] == ["docs", "tests", "wheels"]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_keys(path: Path) -> None:
    workflow = load(path)
    assert set(workflow) <= {"name", "on", "permissions", "concurrency", "jobs"}
    assert workflow["name"] == path.stem
    assert workflow["permissions"] == {"contents": "read"}, "more is given by job, where needed"
    for name, job in workflow["jobs"].items():
        assert "runs-on" in job, name
        needs = job.get("needs", [])
        assert set([needs] if isinstance(needs, str) else needs) <= set(workflow["jobs"]), name
    for step in steps(path):
        assert ("run" in step) != ("uses" in step), step
        assert "name" in step or "uses" in step, step
        assert re.fullmatch(r"[\w-]+/[\w-]+@v[\d.]+", step.get("uses", "a/b@v1")), step


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_names_of_a_matrix_are_defined(path: Path) -> None:
    for job in load(path)["jobs"].values():
        used = set(re.findall(r"matrix\.(\w+)", yaml.safe_dump(job)))
        assert used == set(job.get("strategy", {}).get("matrix", {}))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_what_they_run_exists(path: Path) -> None:
    jobs = jobs_of_run()
    for line in "\n".join(step["run"] for step in steps(path) if "run" in step).splitlines():
        program, *arguments = line.split()
        if program == "./run":
            assert arguments[0] in jobs, line
        else:
            assert program.startswith(".ci/"), line
            assert os.access(ROOT / program, os.X_OK), line


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_paths_that_start_them_exist(path: Path) -> None:
    for event in load(path)["on"].values():
        for pattern in (event or {}).get("paths", []):
            assert list(ROOT.glob(pattern.removesuffix("/**"))), pattern


@pytest.mark.skipif(shutil.which("actionlint") is None, reason="actionlint is not installed")
def test_actionlint() -> None:
    result = subprocess.run(["actionlint", *WORKFLOWS], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout


def test_what_cibuildwheel_runs_exists() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["cibuildwheel"]
    linux, mac = settings["linux"], settings["macos"]
    commands = " ".join([*linux["test-command"], mac["test-command"], settings["before-all"]])
    scripts = re.findall(r"\.ci/[\w.]+", commands)
    assert len(scripts) == 4
    assert all((ROOT / script).is_file() for script in scripts)
    folder = settings["before-all"].split()[-1]
    assert linux["config-settings"]["cmake.define.DQSLAM_STATIC"] == f"/project/{folder}"
    assert f"-DDQSLAM_STATIC=$(pwd)/{folder}" in mac["environment"]["CMAKE_ARGS"]
    assert "DQSLAM_STATIC" in (ROOT / "CMakeLists.txt").read_text()


def test_a_tag_publishes_all_that_was_built_without_a_token() -> None:
    """What is uploaded is what is built, and only after it was compared with the other build."""
    jobs = load(ROOT / ".github" / "workflows" / "wheels.yml")["jobs"]
    publish = jobs["publish"]
    assert publish["if"] == "startsWith(github.ref, 'refs/tags/v')"
    assert set(publish["needs"]) == set(jobs) - {"publish", "sources"}
    assert publish["permissions"] == {"id-token": "write"}
    fetched, uploaded = publish["steps"]
    assert uploaded["uses"].startswith("pypa/gh-action-pypi-publish@")
    assert "with" not in uploaded and "secrets" not in yaml.safe_dump(jobs)
    built = [
        step["with"]["name"]
        for step in [*jobs["build"]["steps"], *jobs["sdist"]["steps"]]
        if step.get("uses", "").startswith("actions/upload-artifact@")
    ]
    assert built == ["wheels-${{ matrix.machine }}", "wheels-sdist"]
    assert fetched["with"]["pattern"] == "wheels-*"
    assert not jobs["sources"]["steps"][-1]["with"]["name"].startswith("wheels-")
    machines = jobs["build"]["strategy"]["matrix"]["machine"]
    assert machines == ["ubuntu-24.04", "ubuntu-24.04-arm", "macos-15"]  # x86-64, ARM, ARM


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")), ids=lambda path: path.stem
)
def test_issue_templates(path: Path) -> None:
    """The keys that forms of issues have; ids are unique, and each field has a label."""
    template = yaml.safe_load(path.read_text(encoding="utf-8"))
    if path.stem == "config":
        assert template == {"blank_issues_enabled": True}
        return
    assert set(template) == {"name", "description", "labels", "body"}
    fields = [part for part in template["body"] if part["type"] != "markdown"]
    assert {field["type"] for field in fields} <= {"input", "textarea"}
    assert all(field["attributes"]["label"] for field in fields)
    ids = [field["id"] for field in fields]
    assert len(ids) == len(set(ids)) >= 2
