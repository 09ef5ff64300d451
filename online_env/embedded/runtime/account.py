"""The desktop's user.

The account exists inside the desktops only: the machine's own /etc/passwd stays as it is.
"""

from pathlib import Path

NAME = "user"
PASSWORD = "password"
# A number that no distribution gives away, so that limits per user are not shared with a person on
# this machine.
UID = 47077
HOME = "/home/user"
HOST_NAME = "desktop"
# SHA-512 crypt of PASSWORD. It is public on purpose: OSWorld's tasks and agents know this password.
_HASH = (
    "$6$desktop$"
    "meOPY4gs85RS49fuU9OwAfN616eSB3n8QbKe2n/1N7GQVz5AeRpv8JouL4J/J4ul5S8JWVQLIeLeBGbb40PNb0"
)


def write_account(root: Path, passwordless_sudo: bool, shadowed: bool = True) -> None:
    """Add the account to the `/etc` under `root`: password `password`, sudo for everything.

    Args:
        root: of the file system.
        passwordless_sudo: sudo never asks, as in OSWorld's virtual machine (its tasks call `sudo`
            without `-S`).
        shadowed: keep the password where only root reads it. Without root there is no other user
            who could compare it, so that the locked screen has to.
    """
    etc = root / "etc"
    password = "x" if shadowed else _HASH
    _add(etc / "passwd", f"{NAME}:{password}:{UID}:{UID}:User:{HOME}:/bin/bash")
    _add(etc / "group", f"{NAME}:x:{UID}:")
    _add(etc / "shadow", f"{NAME}:{_HASH}:20000:0:99999:7:::")
    rule = etc / "sudoers.d" / NAME
    if rule.parent.is_dir():
        tag = "NOPASSWD: " if passwordless_sudo else ""
        rule.write_text(f"{NAME} ALL=(ALL:ALL) {tag}ALL\n", encoding="ascii")
        rule.chmod(0o440)
    hosts = f"127.0.0.1 localhost {HOST_NAME}\n::1 localhost\n"
    (etc / "hostname").write_text(f"{HOST_NAME}\n", encoding="ascii")
    (etc / "hosts").write_text(hosts, encoding="ascii")


def _add(path: Path, line: str) -> None:
    """Replace the entry of that name by `line`."""
    old = path.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    rows = [row for row in old if not row.startswith(f"{NAME}:")]
    path.write_text("\n".join([*rows, line, ""]), encoding="utf-8", errors="surrogateescape")
