"""Locks between processes: one holder, who can be named, and none that outlives its process."""

import os
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest

from hijack_data.locking import LockedError, lock

ROOT = Path(__file__).resolve().parents[2]

HOLDER = """
    import sys, time
    from pathlib import Path
    from hijack_data.locking import lock
    held = lock(Path(sys.argv[1]))
    if sys.argv[2] == "signed":
        held.sign()
    print("held", flush=True)
    time.sleep(100)
"""


@pytest.fixture
def holder(request, tmp_path):
    """A process that holds a lock; returns it and what is locked."""
    kind = request.param
    path = tmp_path / "lock"
    if kind == "folder":
        path.mkdir()
    argv = [sys.executable, "-c", textwrap.dedent(HOLDER), str(path), kind]
    process = subprocess.Popen(argv, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process, path
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("holder", ["signed", "unsigned", "folder"], indirect=True)
def test_a_lock_excludes_others_until_its_process_is_killed(holder):
    process, path = holder
    with pytest.raises(LockedError) as caught:
        lock(path)
    signed = path.is_file() and path.stat().st_size > 0
    assert caught.value.holder.startswith(f"process {process.pid} on " if signed else "another")
    assert str(path) in str(caught.value)

    waiting = threading.Thread(target=lambda: lock(path, wait=True).release())
    waiting.start()
    process.kill()
    waiting.join(timeout=60)
    assert not waiting.is_alive()
    lock(path).release()


def test_a_lock_excludes_its_own_process_until_it_is_released(tmp_path):
    path = tmp_path / "file"
    path.write_text("content")
    with lock(path) as result:
        with pytest.raises(LockedError, match="another process"):
            lock(path)
        assert path.read_text() == "content"
    result.release()
    again = lock(path)
    again.sign()
    with pytest.raises(LockedError, match=f"process {os.getpid()} on "):
        lock(path)
    del again  # as when an exception drops it
    lock(path).release()


def test_a_link_in_the_place_of_a_file_is_not_followed(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="link"):
        lock(tmp_path / "link")
    assert not (tmp_path / "elsewhere").exists()


def test_a_missing_file_gets_the_given_permissions(tmp_path):
    lock(tmp_path / "file", mode=0o600).release()
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o600
