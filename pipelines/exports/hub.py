"""Upload of a dataset to the Hugging Face hub."""

import os
from pathlib import Path
from typing import Any, cast

from hijack_data import extras

from ..dataset.manifest import read_manifest
from ..errors import BuildError


def push_to_hub(
    folder: str | os.PathLike[str],
    repo_id: str,
    *,
    token: str | None = None,
    private: bool = True,
    revision: str | None = None,
    endpoint: str | None = None,
    message: str = "Add dataset",
) -> str:
    """Upload a finished dataset unchanged, with card and manifest, and return its address.

    Check the licence of the source recordings first (the card says where they are from); a new
    repository is private by default. `huggingface_hub` does the upload, and finds its token as
    usual.

    Args:
        folder: a dataset that `build` made.
        repo_id: `name` or `owner/name`.
        token: as `huggingface_hub.HfApi` has it.
        private: whether a new repository is private.
        revision: the branch, as `huggingface_hub.HfApi` has it.
        endpoint: the address of the hub, as `huggingface_hub.HfApi` has it.
        message: message of the commit.

    Raises:
        BuildError: the hub cannot be reached, or refuses the upload.
        DatasetError: the folder is not a finished dataset.
        MissingDependencyError: `huggingface_hub` is not installed.
    """
    read_manifest(Path(folder))
    hub = _hub()
    api = hub.HfApi(endpoint=endpoint, token=token)
    try:
        api.create_repo(repo_id, repo_type="dataset", private=private, exist_ok=True)
        commit = api.upload_folder(
            repo_id=repo_id,
            repo_type="dataset",
            folder_path=os.fspath(folder),
            revision=revision,
            commit_message=message,
            ignore_patterns=[".build/*", ".*.tmp"],
        )
    except (OSError, ValueError, *_network_errors()) as error:
        raise BuildError(f"{repo_id}: not uploaded ({type(error).__name__}: {error})") from None
    return str(commit.commit_url)


def _hub() -> Any:
    try:
        import huggingface_hub
    except ImportError:
        raise extras.missing("uploading needs huggingface_hub", "hf") from None
    return huggingface_hub


def _network_errors() -> tuple[type[Exception], ...]:
    """Return the errors of the HTTP client, which depends on the version of huggingface_hub."""
    from huggingface_hub.errors import HfHubHTTPError

    return cast("tuple[type[Exception], ...]", HfHubHTTPError.__bases__)
