"""The seal of a run: the hashes of its files, signed with an SSH key.

`seal.json` holds the SHA-256 of `run.json`, of `records.jsonl` and of each `episode.json`, whose
chains of hashes cover all lines and pictures (see `run_log`), and that of `sessions.jsonl` if the
run was resumed. It is signed by OpenSSH's own `ssh-keygen -Y sign`, so anyone can check
`seal.json.sig` without this library.
"""

import json
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..errors import HijackError, MissingDependencyError
from ..file_io import read_regular, write_atomic
from .run_log import EPISODE, EPISODES, RECORDS, RUN, SEAL, SESSIONS, SIGNATURE, file_digest

NAMESPACE = "agenthijack-run"  # signatures made for another purpose do not count
FORMAT = "agenthijack-seal"
VERSION = 1
_SIGNER = "signer"
_TIMEOUT_S = 120.0  # because a key on a token waits for a touch


class SealError(HijackError, ValueError):
    """A key cannot be used, or a signature cannot be made."""


def check_key(key: str) -> None:
    """Sign a test file, so that a wrong key is noticed before a run.

    Raises:
        SealError: the key cannot sign.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, SEAL)
        path.write_text("{}\n")
        _sign(path, key)


def sign(folder: Path, key: str) -> None:
    """Write the seal of a run and its signature, replacing earlier ones.

    Args:
        folder: of the run.
        key: path of the private key, or of the public key if `ssh-agent` holds the private one.

    Raises:
        SealError: the key cannot be used.
        HijackError: the files cannot be written.
    """
    (folder / SIGNATURE).unlink(missing_ok=True)
    write_atomic(folder / SEAL, json.dumps(contents(folder), indent=1) + "\n")
    _sign(folder / SEAL, key)


def contents(folder: Path) -> dict[str, Any]:
    """Return the content of a run's seal, computed from its present files."""
    episodes = sorted((folder / EPISODES).glob(f"*/{EPISODE}"))
    sessions = file_digest(folder / SESSIONS)
    return {
        "format": FORMAT,
        "version": VERSION,
        **({} if sessions is None else {"sessions": sessions}),
        "run": file_digest(folder / RUN),
        "records": file_digest(folder / RECORDS),
        "episodes": {path.parent.name: file_digest(path) for path in episodes},
    }


def problems(folder: Path, key: str | None) -> Iterator[str]:
    """Yield what is wrong with a run's seal; without `key`, a run may have none.

    `key` is the path of the public key that must have signed it; with `None`, any key may have.
    """
    if not (folder / SEAL).exists():
        if key is not None:
            yield f"{SEAL}: is missing: the run is not signed"
        return
    try:
        sealed: object = json.loads(read_regular(folder / SEAL))
    except (OSError, ValueError, RecursionError) as error:
        yield f"{SEAL}: cannot be read ({error})"
        return
    if sealed != contents(folder):
        yield f"{SEAL}: the run is not what was sealed"
    yield from _signature_problems(folder, key)


def signer(folder: Path) -> str:
    """Return the fingerprint of the signing key, as `ssh-keygen` prints it; empty without one.

    It is empty, too, if the seal cannot be read: `problems` then says so.
    """
    try:
        query = _run(["-Y", "check-novalidate", "-n", NAMESPACE], folder)
    except OSError:
        return ""
    return query.stdout.split()[-1] if query.returncode == 0 else ""


def _signature_problems(folder: Path, key: str | None) -> Iterator[str]:
    if not (folder / SIGNATURE).exists():
        yield f"{SIGNATURE}: is missing"
        return
    if key is None:
        if not signer(folder):
            yield f"{SIGNATURE}: is not a signature of {SEAL}"
        return
    with tempfile.NamedTemporaryFile("w", suffix=".signers") as signers:
        signers.write(f"{_SIGNER} {_public(key)}\n")
        signers.flush()
        command = ["-Y", "verify", "-n", NAMESPACE, "-I", _SIGNER, "-f", signers.name]
        if _run(command, folder).returncode:
            yield f"{SIGNATURE}: is not a signature of {SEAL} by {key}"


def _public(key: str) -> str:
    """Return the line of a public key.

    Raises:
        SealError: the file cannot be read, or does not hold a public key.
    """
    try:
        text = Path(key).read_text().strip()
    except (OSError, ValueError) as error:
        raise SealError(f"--key {key}: cannot be read ({error})") from None
    if "PRIVATE KEY" in text or len(text.splitlines()) != 1:
        raise SealError(f"--key {key}: is not a public SSH key; give the file that ends in .pub")
    return text


def _sign(path: Path, key: str) -> None:
    process = _ssh_keygen(["-Y", "sign", "-q", "-n", NAMESPACE, "-f", key, str(path)])
    if process.returncode:
        reason = " ".join(process.stderr.split()) or f"ssh-keygen ended with {process.returncode}"
        advice = "ssh-keygen -t ed25519 -f run.key makes one"
        raise SealError(f"{key}: is not a key that can sign ({reason:.300}); {advice}")


def _run(command: Sequence[str], folder: Path) -> "subprocess.CompletedProcess[str]":
    """Run an `ssh-keygen` query about the signature of a seal.

    Raises:
        OSError: the seal cannot be read.
    """
    content = read_regular(folder / SEAL).decode(errors="replace")
    return _ssh_keygen([*command, "-s", str(folder / SIGNATURE)], content)


def _ssh_keygen(command: Sequence[str], content: str = "") -> "subprocess.CompletedProcess[str]":
    try:
        return subprocess.run(
            ["ssh-keygen", *command],
            input=content,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
    except FileNotFoundError:
        requirement = "signatures need ssh-keygen, version 8.2 or later"
        raise MissingDependencyError(f"{requirement}: apt install openssh-client") from None
    except subprocess.TimeoutExpired:
        raise SealError(f"ssh-keygen did not answer within {_TIMEOUT_S:g} s") from None
