"""The wheel and the sdist hold what they should: `.ci/package` then installs and tries them."""

import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("hijack_data", "pipelines", "online_env")
# Where a folder of the clone lies in the wheel.
MOVED = {
    "configs": "hijack_data/_configs",
    "examples/recordings": "hijack_data/_examples/recordings",
}


def tracked(*folders: str) -> list[str]:
    """The files of some folders that a release is made of."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *folders]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in process.stdout.splitlines() if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def built_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both."""
    pytest.importorskip("hatchling", reason="needs the extra [dev]; make env")
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-d", folder],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    return folder


@pytest.fixture(scope="module")
def wheel(built_wheel: Path) -> zipfile.ZipFile:
    (path,) = built_wheel.glob("*.whl")
    return zipfile.ZipFile(path)


def test_the_wheel_holds_every_file_of_the_packages_and_no_other(wheel: zipfile.ZipFile):
    expected = set(tracked(*PACKAGES))
    for folder, destination in MOVED.items():
        expected |= {destination + name.removeprefix(folder) for name in tracked(folder)}
    names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == expected
    assert {f"{package}/py.typed" for package in PACKAGES} <= names


def test_the_sdist_holds_what_the_wheel_is_made_of(built_wheel: Path):
    (path,) = built_wheel.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert set(tracked(*PACKAGES, *MOVED)) <= names
    assert {"README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "pyproject.toml"} <= names
    assert not [name for name in names if name.startswith(("tests/", "benchmarks/", ".ci"))]


def test_the_metadata_say_how_it_is_used(wheel: zipfile.ZipFile):
    name = next(name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    text = wheel.read(name).decode()
    for line in ("Typing :: Typed", "Programming Language :: Python :: 3.13"):
        assert f"Classifier: {line}" in text
    core = [
        line for line in text.splitlines() if line.startswith("Requires-Dist") and ";" not in line
    ]
    named = {re.sub(r"Requires-Dist: ([a-z]+).*", r"\1", line) for line in core}
    assert named == {"numpy", "pillow", "pyyaml", "click", "rich"}


def test_one_version_is_written_everywhere():
    import hijack_data

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert project["version"] == citation["version"] == hijack_data.__version__
    assert f"## {project['version']}" in (ROOT / "CHANGELOG.md").read_text()


def test_what_is_new_is_taken_into_the_changelog():
    """Towncrier leaves out files of another kind without a word."""
    pytest.importorskip("towncrier", reason="needs the extra [dev]")
    command = [sys.executable, "-m", "towncrier", "build", "--draft", "--version", "next"]
    draft = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    output = " ".join(draft.split())
    for file in (ROOT / ".changes").iterdir():
        if file.name != "README.md":
            assert " ".join(file.read_text().split()) in output, file.name


@pytest.mark.parametrize("name", ["tests", "wheels", "docs"])
def test_a_workflow_calls_what_ci_calls(name: str):
    flow = yaml.safe_load((ROOT / ".github" / "workflows" / f"{name}.yml").read_text())
    steps = [step for job in flow["jobs"].values() for step in job["steps"]]
    commands = [step["run"] for step in steps if "run" in step]
    ours = [line for line in commands if re.match(r"make |\.ci/", line)]
    assert ours
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.M)
    for line in ours:
        program, _, arguments = line.partition(" ")
        assert program != "make" or arguments in targets, line
        assert program == "make" or (ROOT / program).is_file(), line
