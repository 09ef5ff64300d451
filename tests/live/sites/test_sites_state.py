"""The state folder: whole writes, locks, damage."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from online_env.embedded.sites.state import MAX_BYTES, SiteState, StorageFullError
from online_env.errors import DesktopError

ROOT = Path(__file__).resolve().parents[3]


def test_state_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    state = SiteState(tmp_path / "new" / "state")
    assert state.read("mail") == {}
    with state.update("mail") as value:
        value["a"] = "ü"
    with pytest.raises(ZeroDivisionError), state.update("mail") as value:
        value["a"] = 1 // 0
    with pytest.raises(StorageFullError), state.update("mail") as value:
        value["b"] = "x" * MAX_BYTES
    assert state.read("mail") == {"a": "ü"}
    assert sorted(p.name for p in state.folder.iterdir()) == [".lock", "mail.json"]


def test_a_write_that_fails_half_way_leaves_what_was_there(tmp_path: Path) -> None:
    with SiteState(tmp_path).update("mail") as value:
        value["a"] = "kept"
    # a file may not grow beyond 1000 bytes here: as on a full disk, the write fails in the middle
    code = (
        "import resource, signal, sys; from online_env.errors import DesktopError\nfrom"
        " online_env.embedded.sites import SiteState\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        " resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\ntry:\n    with"
        " SiteState(sys.argv[1]).update('mail') as value: value['a'] = 'x' * 5000\nexcept"
        " DesktopError as error: sys.exit('cannot be written' not in str(error))\nsys.exit(3)"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, check=False
        ).returncode
        == 0
    )
    assert SiteState(tmp_path).read("mail") == {"a": "kept"}
    assert sorted(p.name for p in tmp_path.iterdir()) == [".lock", "mail.json"]


@pytest.mark.parametrize("damage", [b"", b"{", b"[1]", b"\xff\xfe", b"[" * 100_000])
def test_damaged_state_is_reported(tmp_path: Path, damage: bytes) -> None:
    state = SiteState(tmp_path)
    state.path("shop").write_bytes(damage)
    with pytest.raises(DesktopError, match=re.escape(str(tmp_path))):
        state.read("shop")


def test_a_folder_that_went_with_its_desktop_is_not_an_empty_one(tmp_path: Path) -> None:
    state = SiteState(tmp_path / "sites")
    with state.update("forms") as value:
        value["a"] = 1
    shutil.rmtree(tmp_path / "sites")
    with pytest.raises(DesktopError, match="has the desktop ended"):
        state.read("forms")


def test_unknown_sites_and_bad_folders_are_reported(tmp_path: Path) -> None:
    with pytest.raises(DesktopError, match="known: forms, mail"):
        SiteState(tmp_path).read("../../etc/passwd")
    (tmp_path / "file").write_text("")
    with pytest.raises(DesktopError, match="cannot be made"):
        SiteState(tmp_path / "file")


def test_two_processes_do_not_lose_each_others_changes(tmp_path: Path) -> None:
    code = (
        "import sys; from online_env.embedded.sites.state import SiteState\n"
        "for n in range(60):\n"
        "    with SiteState(sys.argv[1]).update('forms') as s: s.setdefault('n', []).append(n)"
    )
    results = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], cwd=ROOT) for _ in range(2)
    ]
    assert [p.wait(timeout=30) for p in results] == [0, 0]
    assert len(SiteState(tmp_path).read("forms")["n"]) == 120


def test_the_server_does_not_load_numpy() -> None:
    code = "import sys, online_env.embedded.sites.__main__; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
