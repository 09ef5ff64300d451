"""What the doctor says where the kernel, or a container, refuses a desktop: one line, with the way
out."""

import pytest

from online_env.embedded import doctor
from online_env.embedded.image import cache
from online_env.embedded.runtime import rootless


@pytest.fixture
def switches(tmp_path, monkeypatch):
    """The kernel's settings, in files of the test's own; all allow user namespaces."""
    entries = {}
    moved_paths = {}
    for path, switch in rootless._SWITCHES.items():
        name = path.rpartition("/")[2]
        entries[name] = tmp_path / name
        entries[name].write_text("10000")
        moved_paths[str(entries[name])] = switch
    monkeypatch.setattr(rootless, "_SWITCHES", moved_paths)
    monkeypatch.setattr(rootless, "in_container", lambda: False)
    monkeypatch.setattr(rootless.os, "geteuid", lambda: 1000)
    return entries


@pytest.mark.parametrize(
    ("name", "value", "command"),
    [
        ("unprivileged_userns_clone", "0", "kernel.unprivileged_userns_clone=1"),
        (
            "apparmor_restrict_unprivileged_userns",
            "1",
            "kernel.apparmor_restrict_unprivileged_userns=0",
        ),
        ("max_user_namespaces", "0", "user.max_user_namespaces=10000"),
    ],
)
def test_each_switch_of_the_kernel_is_named(switches, name, value, command):
    switches[name].write_text(f"{value}\n")
    assert rootless.way_out("unshare(0x10000000): Operation not permitted") == (
        f"sudo sysctl {command}"
    )


@pytest.mark.parametrize(
    ("reason", "way"),
    [
        ("OSError: [Errno 1] mount overlay on /x/usr: Operation not permitted", "Linux 5.11"),
        ("OSError: [Errno 28] unshare(0x10000000): No space left on device", "max_user_namespaces"),
        ("OSError: [Errno 1] unshare(0x10000000): Operation not permitted", "sudo "),
    ],
)
def test_other_refusals_have_a_way_out(switches, reason, way):
    result = rootless.way_out(reason)
    assert way in result
    assert "\n" not in result


def test_in_a_container_the_option_is_named(switches, monkeypatch):
    monkeypatch.setattr(rootless, "in_container", lambda: True)
    refused = "OSError: [Errno 1] unshare(0x10000000): Operation not permitted"
    assert "--security-opt seccomp=unconfined" in rootless.way_out(refused)
    monkeypatch.setattr(rootless.os, "geteuid", lambda: 0)
    assert "docker run --privileged" in rootless.way_out(refused)


def test_with_an_image_the_packages_of_the_machine_do_not_matter(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    monkeypatch.setattr(doctor.packages.shutil, "which", lambda name: None)
    without = {entries.name: entries for entries in doctor.diagnose(("core",), cache.HOST)}
    assert not without["system"].ok
    assert "hijack desktop install" in without["system"].fix
    assert without["packages core"].required
    entries = {entries.name: entries for entries in doctor.diagnose(("core",), "never-made")}
    assert entries["system"].ok
    assert not [name for name in entries if name.startswith("packages")]
    assert not entries["image"].ok
    assert entries["image"].required
    assert "no image 'never-made'" in entries["image"].detail
