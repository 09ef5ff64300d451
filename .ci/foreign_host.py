"""Runs inside the host that `.ci/foreign_host` made: from an image's file to all nine corruptions.

`python3 foreign_host.py root|user|container IMAGE`
"""

import ctypes
import errno
import os
import shutil
import struct
import subprocess
import sys
import time

HIJACK = [sys.executable, "-m", "hijack_data"]
ABSENT = ("Xvfb", "ip", "nft", "dbus-daemon", "chromium", "xfwm4", "sudo", "gpgv")
# What Docker's default seccomp profile forbids without CAP_SYS_ADMIN, by asm/unistd.h.
FORBIDDEN = {
    "x86_64": {"unshare": 272, "mount": 165, "setns": 308, "pivot_root": 155},
    "aarch64": {"unshare": 97, "mount": 40, "setns": 268, "pivot_root": 41},
}
# The capabilities that Docker leaves to root in a container, by linux/capability.h.
KEPT = {0, 1, 3, 4, 5, 6, 7, 8, 10, 13, 18, 27, 29, 31}
LAST = 40


def hijack(*words: str, code: int = 0) -> str:
    """What a command of ours prints; ends with an error if its exit code is another one."""
    process = subprocess.run([*HIJACK, *words], capture_output=True, text=True, check=False)
    output = process.stdout + process.stderr
    if process.returncode != code:
        sys.exit(f"hijack {' '.join(words)} ended with {process.returncode}, not {code}:\n{output}")
    return output


def need(is_so: bool, otherwise: str) -> None:
    """End with `otherwise` unless it is so."""
    if not is_so:
        sys.exit(otherwise)


def forbid() -> None:
    """Give up, here and in all children, what a container of Docker's lacks by default."""
    libc = ctypes.CDLL(None, use_errno=True)
    for number in sorted(set(range(LAST + 1)) - KEPT):
        libc.prctl(24, number, 0, 0, 0)  # PR_CAPBSET_DROP
    numbers = list(FORBIDDEN[os.uname().machine].values())
    lines = [(0x20, 0, 0, 0)]
    lines += [(0x15, len(numbers) - place, 0, number) for place, number in enumerate(numbers)]
    lines += [(0x06, 0, 0, 0x7FFF0000), (0x06, 0, 0, 0x00050000 | errno.EPERM)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *line) for line in lines))
    program = struct.pack("HxxxxxxP", len(lines), ctypes.addressof(code))
    libc.prctl(38, 1, 0, 0, 0)  # PR_SET_NO_NEW_PRIVS
    if libc.prctl(22, 2, ctypes.create_string_buffer(program), 0, 0):  # PR_SET_SECCOMP
        sys.exit(f"no seccomp filter: {os.strerror(ctypes.get_errno())}")


def in_container(image: str) -> None:
    """Check that each refusal is one line that says what is missing, and the way out."""
    open("/run/.containerenv", "w").close()
    if "no images" in hijack("desktop", "image", "list"):
        hijack("desktop", "image", "import", image)  # needs no rights
    hijack("desktop", "image", "verify", hijack_name())
    forbid()
    told = hijack("desktop", "doctor", "--image", hijack_name(), code=1)
    (line,) = [line for line in told.splitlines() if line.startswith("FAIL  namespaces")]
    print(line)
    need("root may make no namespaces" in line, told)
    need("docker run --privileged" in told, told)
    said = hijack("desktop", "up", "--image", hijack_name(), code=2)
    print(said.strip())
    (refusal,) = [line for line in said.splitlines() if line.startswith("hijack: error:")]
    need("--privileged" in refusal, said)
    need("image container" in refusal, said)


def live(image: str) -> None:
    """Lead from the file to a desktop, prove all nine on it, and have the suite's oracle play."""
    present = [name for name in ABSENT if shutil.which(name)]
    need(not present, f"no foreign host: it has {present}")
    start = time.monotonic()
    print(hijack("desktop", "install", "--image", image).strip().splitlines()[-1])
    imported = time.monotonic() - start
    os.environ["AGENTHIJACK_IMAGE"] = hijack_name()
    import hijack_data as hj
    from online_env import EmbeddedDesktop
    from online_env.corrupting.desktop_corruption import corrupt_desktop
    from online_env.effects import resume

    with EmbeddedDesktop.up(size=(800, 1200), apps=("editor",)) as desktop:
        need(desktop.screenshot().std() > 1, "the screen is empty")
        seconds = time.monotonic() - start
        print(
            f"image there after {imported:.1f} s, first screenshot after {seconds:.1f} s",
            flush=True,
        )
        for name in hj.corruption_names()[:9]:
            done = corrupt_desktop(desktop, hj.make_corruption(name), seed=3)
            print(f"{name}: {done.saw}", flush=True)
            need(done.ok, name)
            for record in reversed(done.records):
                undone = resume(record, desktop).undo()
                need(undone.ok, f"{name}: {undone.problem}")
            if name == "accidental_touch":  # who knows what it opened
                desktop.reset()
    print(hijack("desktop", "doctor").strip(), flush=True)
    oracle()


def oracle() -> None:
    """Have the oracle play the tasks of `ORACLE`, by name or all; each has to be solved."""
    tasks = os.environ["ORACLE"]
    chosen = () if tasks == "all" else ("--tasks", tasks)
    out = os.path.join(os.environ["HOME"], "runs")
    bench = ("bench", "embedded", *chosen, "--agent", "oracle", "--corruptions", "clean")
    print(hijack(*bench, "--desktops", os.environ["DESKTOPS"], "--out", out).strip()[-1000:])
    print(hijack("gate", out, "--fail-under", "success=1").strip())


def hijack_name() -> str:
    """The name of the only image."""
    return hijack("desktop", "image", "list").split()[0]


def main() -> None:
    """Do what the arguments say."""
    way, image = sys.argv[1:]
    if way == "container":
        in_container(image)
        return
    need((os.geteuid() == 0) == (way == "root"), f"not {way}")
    live(image)


if __name__ == "__main__":
    main()
