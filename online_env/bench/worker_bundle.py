"""Everything that a node of a cluster needs to play a run: packed by the runner, unpacked there.

Agent files, prompts and the log of a replay are sent. Python files of the user are not, because
they may read other files: each node needs them under the same path, with the same bytes. Keys of
models are never sent; each node reads them from its own environment.
"""

import hashlib
import importlib.metadata
import importlib.util
import pickle
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from hijack_data.errors import HijackError
from hijack_data.loading import SUFFIX, find_loaded_file, loaded_files, run_file

from ..agents.chat.prompts import PATTERN
from ..agents.chat.request_log import log_folder
from ..agents.makers import FileAgentMaker
from ..agents.references import AgentReference
from ..agents.registry import AGENTS
from ..agents.settings import AgentSettings
from ..errors import ClusterError
from ..results.records import PACKAGES
from .config import Bench
from .workers import WorkerSetup

OURS = ("hijack_data", "online_env")
CODE = "code of agenthijack"
_HASH_DIGITS = 12  # digits of a hash in messages
_REMEDY = "every node needs this file under this path: copy it there, or use a shared folder"

_Files = Mapping[str, bytes]


@dataclass(frozen=True, kw_only=True)
class WorkerBundle:
    """The data sent to the nodes.

    Args:
        software: The versions that must be the same on all machines, by name.
        python_files: Path and SHA-256 of each Python file of the user that the run needs.
        agent_files: The same of agents that run in processes of their own; the nodes do not import
            them.
        setup: The pickled `WorkerSetup`.
        agents: The content of the agent files, by the names of their agents.
        agent_prompts: The prompts that an agent file names, by the same names.
        prompts: Those of `--prompts`.
        replay: The log of `--replay`.
    """

    software: Mapping[str, str]
    python_files: tuple[tuple[str, str], ...]
    agent_files: tuple[tuple[str, str], ...] = ()
    setup: bytes
    agents: Mapping[str, AgentSettings]
    agent_prompts: Mapping[str, _Files]
    prompts: _Files | None
    replay: _Files | None


def pack(setup: WorkerSetup) -> WorkerBundle:
    """Return the parcel for the nodes.

    Raises:
        ClusterError: The corruptions cannot be sent to other processes.
    """
    agents = dict(_agents(setup.bench))
    models = setup.models
    try:
        content = pickle.dumps(setup)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ClusterError(
            f"the corruptions cannot be sent to other processes ({error}); use planners that hold"
            " no open files, locks or the like"
        ) from None
    return WorkerBundle(
        software=software(),
        python_files=tuple(_loaded_files(setup.bench)),
        agent_files=tuple(_agent_files(setup.bench)),
        setup=content,
        agents=agents,
        agent_prompts={
            name: _read_files(Path(agent.prompts), PATTERN)
            for name, agent in agents.items()
            if agent.prompts is not None
        },
        prompts=None if models.prompts is None else _read_files(models.prompts, PATTERN),
        replay=None if models.replay is None else _read_files(log_folder(models.replay), "*.jsonl"),
    )


def unpack(bundle: WorkerBundle, folder: Path) -> WorkerSetup:
    """Load everything that the run needs in this process, and return its setup.

    Args:
        bundle: What `pack` returned.
        folder: A new folder of this node; the episodes go into it.

    Raises:
        ClusterError: The software of this node differs from the runner's, or a file is missing.
    """
    check_software(bundle.software)
    for path, sha256 in bundle.agent_files:
        _check_file(path, sha256)
    for path, sha256 in bundle.python_files:
        _load(path, sha256)
    setup: WorkerSetup = pickle.loads(bundle.setup)  # noqa: S301  (the runner made it)
    for index, (name, settings) in enumerate(bundle.agents.items()):
        prompts = bundle.agent_prompts.get(name)
        prompt_folder = _write_files(prompts, folder / f"prompts-{index}")
        own_settings = replace(
            settings, prompts=None if prompt_folder is None else str(prompt_folder)
        )
        AGENTS.add(FileAgentMaker(own_settings), name)
    models = replace(
        setup.models,
        prompts=_write_files(bundle.prompts, folder / "prompts"),
        replay=_write_files(bundle.replay, folder / "replay"),
    )
    run = folder / "run"
    run.mkdir()
    return replace(setup, folder=run, models=models)


def software() -> dict[str, str]:
    """Return the versions of the packages that affect results, and a hash of our own code."""
    versions = {name: _version(name) for name in PACKAGES}
    digest = hashlib.sha256()
    for package in OURS:
        spec = importlib.util.find_spec(package)
        origin = None if spec is None else spec.origin
        root = Path(origin or ".").parent
        for path in sorted(root.rglob("*.py")):
            digest.update(f"{package}/{path.relative_to(root)}\n".encode())
            digest.update(path.read_bytes())
    versions[CODE] = digest.hexdigest()[:_HASH_DIGITS]
    return versions


def check_software(expected: Mapping[str, str]) -> None:
    """Check that this machine has the same software as the runner.

    Raises:
        ClusterError: It has not; the message lists all differences.
    """
    versions = software()
    differences = [
        f"{name} {versions.get(name)} instead of {version}"
        for name, version in expected.items()
        if versions.get(name) != version
    ]
    if differences:
        raise ClusterError(f"has {', '.join(differences)}; install the same on every node")


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _agents(bench: Bench) -> list[tuple[str, AgentSettings]]:
    makers = [(name, AGENTS.get(name)) for name in bench.asked_agents]
    return [(name, maker.settings) for name, maker in makers if isinstance(maker, FileAgentMaker)]


def _loaded_files(bench: Bench) -> Iterator[tuple[str, str]]:
    """Yield the files of classes that a run names, and loaded files that register plug-ins."""
    named_files = [find_loaded_file(entry) for _, _, entry in bench.foreign()]
    for file in loaded_files():
        if file.names or file in named_files:
            yield file.path, file.sha256


def _agent_files(bench: Bench) -> Iterator[tuple[str, str]]:
    """Yield the files of agents that run in processes of their own."""
    for _, _, entry in bench.foreign():
        if isinstance(entry, AgentReference) and entry.place.partition(":")[0].endswith(SUFFIX):
            yield entry.source["path"], entry.source["sha256"]


def _load(path: str, sha256: str) -> None:
    """Load a Python file of the user.

    Raises:
        ClusterError: The file is missing here, or has different bytes.
    """
    try:
        actual_sha256 = run_file(path).sha256
    except HijackError as error:
        raise ClusterError(f"{error}; {_REMEDY}") from None
    _check_hash(path, actual_sha256, sha256)


def _check_file(path: str, sha256: str) -> None:
    """Compare a file of this node with that of the runner.

    Raises:
        ClusterError: The file is missing here, or has different bytes.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise ClusterError(f"{path}: cannot be read ({error.strerror}); {_REMEDY}") from None
    _check_hash(path, hashlib.sha256(content).hexdigest(), sha256)


def _check_hash(path: str, digest: str, expected: str) -> None:
    if digest != expected:
        digests = f"SHA-256 {digest[:_HASH_DIGITS]} instead of {expected[:_HASH_DIGITS]}"
        raise ClusterError(f"{path}: is another file here ({digests}); {_REMEDY}")


def _read_files(folder: Path, pattern: str) -> _Files:
    return {path.name: path.read_bytes() for path in sorted(folder.glob(pattern))}


def _write_files(files: _Files | None, folder: Path) -> Path | None:
    if files is None:
        return None
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder
