"""A container that is a desktop: its process 1 in new namespaces with what Docker leaves to root.

No engine is needed; the image is one that is there, as in `test_embedded_image`.
"""

import os
import subprocess
import tarfile
from pathlib import Path

import pytest

import hijack_data as hj
from online_env.corrupting.desktop_corruption import corrupt_desktop
from online_env.desktops.container import ContainerResetter
from online_env.desktops.http import HttpDesktop
from online_env.effects import resume
from online_env.embedded.container.entry import TOKEN
from online_env.embedded.image import cache, container
from online_env.errors import DesktopError, MissingCapabilityError

from support import needs

PORT = 5790
SECRET = "words that nobody inside may read"
KEPT = (
    "chown dac_override fowner fsetid kill setgid setuid setpcap net_bind_service net_raw"
    " sys_chroot mknod audit_write setfcap"
)
# As an engine does it: an overlay on the layers, a root of its own, few rights.
START = """
cd "$1"
mount -t tmpfs tmpfs up
mkdir up/upper up/work root
mount -t overlay -o lowerdir=layer:"$2",upperdir=up/upper,workdir=up/work overlay root
mount -t proc proc root/proc
mount --rbind /dev root/dev
mount -t tmpfs -o size=512m,mode=1777 shm root/dev/shm
mount -t tmpfs tmpfs root/run
touch root/run/.containerenv
cp /etc/hosts root/etc/hosts
cd root
pivot_root . mnt
umount -l mnt
shift 2
exec setpriv --bounding-set "$1" --inh-caps "$1" /usr/bin/python3 -I -S -B -c "$2" \
  --port "$3" --size 1000x700 --app editor
"""


@pytest.fixture(scope="module")
def desktop(embedded_machine, tmp_path_factory):
    needs.root("playing a container engine")
    names = [name for name in cache.names() if os.environ.get(cache.CHOICE) in (None, "", name)]
    if not names:
        needs.skip(f"no image in {cache.images_folder()}", f"{needs.HIJACK} desktop image build")
    image = cache.resolve(names[0])
    folder = tmp_path_factory.mktemp("container")
    for name in ("up", "layer"):
        (folder / name).mkdir()
    container._desktop(image, folder / "layer.tar")
    with tarfile.open(folder / "layer.tar") as tar:
        tar.extractall(folder / "layer", filter="fully_trusted")
    bounding = ",".join(["-all", *(f"+{name}" for name in KEPT.split())])
    words = [str(folder), str(image / "root"), bounding, container._START, str(PORT)]
    spaces = ["--mount", "--pid", "--fork", "--kill-child", "--uts", "--ipc"]
    log = folder / "log"
    with open(log, "wb") as out:
        process = subprocess.Popen(
            ["unshare", *spaces, "--propagation", "private", "sh", "-ec", START, "sh", *words],
            stdout=out,
            stderr=subprocess.STDOUT,
            env={**os.environ, TOKEN: SECRET.replace(" ", "-")},
        )
    try:
        yield _reached(process, log)
    finally:
        process.kill()
        process.wait()


def _reached(process: "subprocess.Popen[bytes]", log: Path) -> HttpDesktop:
    from support.waiting import until

    until(lambda: process.poll() is not None or "ready" in log.read_text(), "its start")
    assert process.poll() is None, log.read_text()
    token = SECRET.replace(" ", "-")
    resetter = ContainerResetter(f"http://127.0.0.1:{PORT + 1}", token)
    return HttpDesktop(f"http://127.0.0.1:{PORT}", token, resetter=resetter)


def test_it_is_a_desktop_without_a_firewall(desktop):
    assert desktop.screenshot().shape == (700, 1000, 3)
    assert desktop.capabilities == {"accessibility", "apps", "files", "lock", "windows"}
    with pytest.raises(MissingCapabilityError, match="--cap-add NET_ADMIN"):
        corrupt_desktop(desktop, hj.make_corruption("network_error"), seed=3)


@pytest.mark.parametrize(
    "name", [name for name in hj.corruption_names()[:9] if name != "network_error"]
)
def test_the_others_are_applied_proved_and_undone(desktop, name):
    result = corrupt_desktop(desktop, hj.make_corruption(name), seed=3)
    assert result.ok, result.saw
    for record in reversed(result.records):
        assert resume(record, desktop).undo().ok
    if name == "accidental_touch":  # who knows what it opened
        desktop.reset()


def test_root_inside_neither_ends_it_nor_learns_the_token(desktop):
    output = desktop.execute(
        "echo password | sudo -S sh -c 'id -u; kill -9 1; cat /proc/1/environ /proc/1/mem'"
    )
    assert output.output == "0\n"
    assert SECRET.split()[0] not in output.output + output.error
    result = desktop.execute("ls /usr/local/lib/desktop-server; env")
    assert "Permission denied" in result.error
    assert SECRET.replace(" ", "-") not in result.output


def test_a_reset_is_pristine_or_refused(desktop):
    desktop.execute("touch ~/note /tmp/note /var/tmp/note /dev/shm/note; (sleep 600 &)")
    desktop.execute("echo password | sudo -S true")
    desktop.reset()
    remaining_files = desktop.execute(
        "ls ~/note /tmp/note /var/tmp/note /dev/shm/note; pgrep sleep"
    ).output
    assert remaining_files == ""
    assert "mousepad" in desktop.execute("wmctrl -lx").output
    desktop.execute("echo password | sudo -S touch /usr/share/note")
    with pytest.raises(DesktopError, match=r"changed .*/usr/share/note.*start a fresh container"):
        desktop.reset()
