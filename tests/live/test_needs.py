"""What a test says when this machine lacks what it needs: why, and the command that adds it."""

import re
from pathlib import Path

import pytest

from online_env.embedded import doctor, packages

from support import needs

HERE = Path(__file__).parent


@pytest.fixture
def bare(monkeypatch):
    """A machine on which no program is found."""
    monkeypatch.setattr(needs.shutil, "which", lambda name, path=None: None)


@pytest.mark.parametrize(
    ("program", "profile"),
    [
        ("geany", "office"),
        ("soffice", "office"),
        ("gimp", "media"),
        ("chromium", "web"),
        ("Xvfb", "core"),
    ],
)
def test_a_program_is_named_with_the_profile_that_has_it(program, profile, bare):
    line = f"not installed: {program}; .venv/bin/hijack desktop install --profile {profile}"
    assert needs.lack_of_apps(program) == line
    mark = needs.needs_apps(program).mark
    assert (mark.name, mark.args, mark.kwargs["reason"]) == ("skipif", (True,), line)


def test_programs_of_two_profiles_name_both(bare):
    assert needs.lack_of_apps("geany", "vlc", "gimp").endswith(
        "--profile office and .venv/bin/hijack desktop install --profile media"
    )


def test_what_is_there_is_no_lack(monkeypatch):
    monkeypatch.setattr(needs.shutil, "which", lambda name, path=None: f"/usr/bin/{name}")
    assert needs.lack_of_apps("geany", "soffice") == ""
    assert needs.needs_apps("geany").mark.args == (False,)


def test_memory_is_what_is_free():
    assert needs.lack_of_memory(0.001) == ""
    assert re.fullmatch(
        r"needs 1e\+06 GiB of free memory, [0-9.]+ are; end something", needs.lack_of_memory(1e6)
    )


def test_a_desktop_that_cannot_be_is_told_of_in_one_line(monkeypatch):
    lacks = doctor.Finding(
        "packages core", False, "2 of 43 are missing: xvfb thunar", "hijack desktop install"
    )
    later = doctor.Finding("golden home", False, "not made yet", "hijack desktop install")
    monkeypatch.setattr(doctor, "diagnose", lambda profiles: [later, lacks])
    needs.lack_of_desktop.cache_clear()
    try:
        why = "no embedded desktop here: packages core: 2 of 43 are missing; hijack desktop install"
        with pytest.raises(pytest.skip.Exception, match=f"^{why}$"):
            needs.desktop()
        monkeypatch.setattr(doctor, "diagnose", lambda profiles: [later])
        needs.lack_of_desktop.cache_clear()
        needs.desktop()  # it is made when it is needed
    finally:
        needs.lack_of_desktop.cache_clear()


def test_ci_tries_again_what_core_and_web_could_not_show():
    """`.ci/run` runs the suite with these two, then by name what needs more."""
    output = re.search(r'-k "([^"]+)"', (HERE.parents[1] / ".ci" / "run").read_text())
    names = output[1].split(" or ")
    small = packages.packages(["web"])
    for path in HERE.rglob("test_*.py"):
        text = path.read_text()
        if "needs.osworld(" in text and path != Path(__file__):
            assert "osworld" in path.name or "def osworld(" in text, (
                f"{path.name}: -k does not find it"
            )
            assert "osworld" in names
        for options, test in re.findall(r"needs_apps\(([^)]*)\)\n(?:@.*\n)*def (\w+)", text):
            more = [
                name
                for name in re.findall(r'"(.+?)"', options)
                if needs.profile_of(name) not in ("core", "web")
            ]
            assert not more or any(name in test for name in names), (
                f"{test} needs {more}: name it so in .ci/run"
            )
    assert "geany" not in small


def test_every_reason_comes_from_there():
    """No test here words a reason of its own, so that none forgets the command."""
    for path in HERE.rglob("*.py"):
        if path == Path(__file__):
            continue
        text = path.read_text()
        assert "pytest.skip(" not in text, path
        assert "skipif(" not in text, path
        reasons = re.findall(r"importorskip\(([^)]*)\)", text)
        ours = tuple(
            f"reason=needs.{name}"
            for name in (
                *("ONLINE", "HF", "INSPECT", "RAY", "OCR", "SERVE", "BROWSER", "MCP"),
                *("PLAYWRIGHT", "WEBSOCKET", "BROWSERGYM", "AGENTLAB"),
            )
        )
        assert all(reason.endswith(ours) for reason in reasons), path
