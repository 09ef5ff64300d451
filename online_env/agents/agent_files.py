"""Agent files: a model, its endpoint, its prompt and its dialect, in YAML.

A file is named by its path or, if it comes with the package (`configs/agents/`), by its bare name.
All its mistakes are reported at once, each as `file:line:column: message`. A path in a file is
relative to the file.
"""

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from hijack_data.actions import DIALECTS
from hijack_data.config.corruption_settings import check
from hijack_data.config.nodes import (
    ConfigNode,
    MappingNode,
    Position,
    Problems,
    ScalarNode,
    SequenceNode,
    describe_node,
    plain,
)
from hijack_data.config.yaml_reader import read_yaml
from hijack_data.config_files import available, read_config
from hijack_data.errors import ConfigError, suggest
from hijack_data.params import Parameter
from hijack_data.smart_resize import MAX_PIXELS, MIN_PIXELS

from .chat import prompts
from .settings import (
    CLIENTS,
    COORDINATES,
    TOOL_PARSERS,
    TOOLS,
    AgentSettings,
    KnownError,
    ModelSettings,
    OnlookerSettings,
    SamplingSettings,
    TokenPrices,
)

FOLDER = "agents/"  # the folder of the packaged agent files
SUFFIXES = (".yaml", ".yml")
DEFAULT_ERRORS = "onlookers/errors"
_TEXT = Parameter("str", "")
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,79}")

_MODEL: Mapping[str, Parameter] = {
    "model": _TEXT,
    "client": Parameter("choice", "", choices=CLIENTS),
    "tool": _TEXT,
    "retries": Parameter("int", "", low=0, high=20),
    "timeout": Parameter("float", "", low=0.01, high=3600),
}
_MODEL_SECTIONS = ("base_url", "api_key_env", "sampling", "request", "prices")
# Fields of a request that the agent sets itself.
_OWN_FIELDS = ("model", "messages", "input", "tools", "stream")
_AGENT: Mapping[str, Parameter] = {
    "prompt": _TEXT,
    "parser": Parameter("choice", "", choices=DIALECTS),
    "coordinates": Parameter("choice", "", choices=COORDINATES),
    "history": Parameter("int", "", low=0, high=100),
    "min_pixels": Parameter("int", "", low=784, high=2**26),
    "max_pixels": Parameter("int", "", low=784, high=2**26),
    "prompts": _TEXT,
    "serve": _TEXT,
}
_ONLOOKER: Mapping[str, Parameter] = {
    "check": Parameter("bool", ""),
    "reinit": Parameter("bool", ""),
    "summarise": Parameter("bool", ""),
    "errors": _TEXT,
}
_SAMPLING: Mapping[str, Parameter] = {
    "temperature": Parameter("float", "", low=0, high=2, optional=True),
    "top_p": Parameter("float", "", low=0, high=1, optional=True),
    "max_tokens": Parameter("int", "", low=1, high=1_000_000, optional=True),
}
_PRICE = Parameter("float", "", low=0, high=1_000_000)
_PRICES: Mapping[str, Parameter] = {"input": _PRICE, "output": _PRICE}
# Clients that an onlooker may use.
_ONLOOKER_CLIENTS = Parameter("choice", "", choices=("openai", "anthropic"))
_ERROR: Mapping[str, Parameter] = {"name": _TEXT, "looks": _TEXT, "say": _TEXT}


def packaged() -> tuple[str, ...]:
    """Return the bare names of the agent files that come with the package."""
    names = [name for name in available() if name.startswith(FOLDER)]
    return tuple(name.removeprefix(FOLDER) for name in names)


def is_agent_file(text: str) -> bool:
    """Return whether a text names an agent file: a path, or a packaged one."""
    return text.endswith(SUFFIXES) or text.removeprefix(FOLDER) in packaged()


def read_agent(path_or_name: str) -> AgentSettings:
    """Read an agent file.

    Args:
        path_or_name: a path (it may begin with `~`), or the name of a packaged file.

    Raises:
        ConfigError: all mistakes of the file.
    """
    path = os.path.expanduser(path_or_name)
    if not os.path.isfile(path) and path.removeprefix(FOLDER) in packaged():
        path = FOLDER + path.removeprefix(FOLDER)
    name, data = read_config(path)
    problems = Problems()
    tree = _mapping(name, data, problems, "model: ..., prompt: pyautogui, parser: pyautogui")
    settings = _AgentReader(problems, name, data).read(tree)
    problems.check()
    if settings is None:  # every needed key is present now, since a missing one is a problem
        raise ConfigError([f"{name}: cannot be read"])
    return settings


def read_errors(path_or_name: str) -> tuple[tuple[KnownError, ...], str]:
    """Read an error repository: a list of `name`, `looks` and `say`.

    Returns:
        The entries, and the SHA-256 of the file.

    Raises:
        ConfigError: all mistakes of the file.
    """
    name, data = read_config(path_or_name)
    problems = Problems()
    tree = _mapping(name, data, problems, "errors: [{name: ..., looks: ..., say: ...}]")
    listed = tree.items.get("errors")
    entries: list[KnownError] = []
    if not isinstance(listed, SequenceNode) or not listed.items or len(tree.items) != 1:
        problems.stop(tree.position, "an error repository has one key, errors, with a list")
    for index, item in enumerate(listed.items):
        values = _section(problems, f"errors[{index}]", item, _ERROR, required=tuple(_ERROR))
        if len(values) == len(_ERROR):
            entries.append(KnownError(**values))
    problems.check()
    return tuple(entries), hashlib.sha256(data).hexdigest()


def _mapping(name: str, data: bytes, problems: Problems, example: str) -> MappingNode:
    tree = read_yaml(data, name, problems)
    if isinstance(tree, MappingNode):
        return tree
    content = "the file is empty" if tree is None else f"got {describe_node(tree)}"
    problems.stop(Position(name, 1, 1), f"this file is a mapping such as {example}; {content}")


def _section(
    problems: Problems,
    section: str,
    tree: ConfigNode,
    parameters: Mapping[str, Parameter],
    required: Sequence[str] = (),
    unchecked: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the checked values of a mapping with the keys of `parameters`.

    The keys in `unchecked` are allowed and skipped; those in `required` must be there.
    """
    if not isinstance(tree, MappingNode):
        listed = ", ".join([*parameters, *unchecked])
        problems.add(
            tree.position, f"{section} must be a mapping ({listed}), got {describe_node(tree)}"
        )
        return {}
    prefix = f"{section}." if section else ""
    values: dict[str, Any] = {}
    for key, item in tree.items.items():
        if key in unchecked:
            continue
        if key not in parameters:
            hint = suggest(key, [*parameters, *unchecked])
            problems.add(tree.keys[key], f"{prefix or 'an agent file '}has no key {key!r}{hint}")
            continue
        before = len(problems.mistakes)
        value = check(problems, parameters[key], f"{prefix}{key}", item)
        if isinstance(value, str) and not value.strip():
            problems.add(item.position, f"{prefix}{key} must not be empty")
        if len(problems.mistakes) == before:
            values[key] = value
    for key in required:
        if key not in tree.items:
            problems.add(tree.position, f"{prefix}{key} is missing")
    return values


class _AgentReader:
    """Reads one file; mistakes go into `problems`."""

    def __init__(self, problems: Problems, name: str, data: bytes) -> None:
        self._problems = problems
        self._name = name
        self._hash = hashlib.sha256(data)

    def read(self, tree: MappingNode) -> AgentSettings | None:
        values = _section(
            self._problems,
            "",
            tree,
            {**_MODEL, **_AGENT},
            required=("model", "prompt", "parser"),
            unchecked=(*_MODEL_SECTIONS, "onlooker"),
        )
        model_values = {key: values.pop(key) for key in _MODEL if key in values}
        values.pop("serve", None)
        model_values |= self._model_sections("", tree)
        self._check_parser(tree, values, model_values)
        self._check_pixels(tree, values)
        self._check_prompt(tree, values)
        # A missing one has been noted as a problem.
        model = ModelSettings(**{"model": "", **model_values})
        onlooker = self._onlooker(tree, model, values)
        if self._problems.mistakes:
            return None
        return AgentSettings(
            source=self._name,
            sha256=self._hash.hexdigest(),
            model=model,
            onlooker=onlooker,
            **values,
        )

    def _model_sections(self, prefix: str, tree: MappingNode) -> dict[str, Any]:
        sections: dict[str, Any] = {}
        for key in _MODEL_SECTIONS:
            if key not in tree.items:
                continue
            value = self._model_section(key, f"{prefix}{key}", tree.items[key])
            if value is not None:
                sections[key] = value
        return sections

    def _model_section(self, key: str, path: str, item: ConfigNode) -> Any:
        match key:
            case "api_key_env":
                return self._variable(path, item)
            case "sampling":
                return SamplingSettings(**_section(self._problems, path, item, _SAMPLING))
            case "prices":
                prices = _section(self._problems, path, item, _PRICES, required=tuple(_PRICES))
                return TokenPrices(**prices) if len(prices) == len(_PRICES) else None
            case "base_url":
                return self._address(path, item)
            case _:
                return self._request(path, item)

    def _variable(self, path: str, item: ConfigNode) -> str | None:
        value = item.value if isinstance(item, ScalarNode) else ""
        if isinstance(value, str) and _VARIABLE.fullmatch(value):
            return value
        # The value is not shown: it may be a key.
        self._problems.add(
            item.position,
            f"{path} is the name of an environment variable, such as OPENAI_API_KEY, and never the"
            " key itself",
        )
        return None

    def _address(self, path: str, item: ConfigNode) -> str | None:
        value = item.value if isinstance(item, ScalarNode) else ""
        if not isinstance(value, str) or not _is_address(value):
            self._problems.add(
                item.position,
                f"{path} is an address such as http://127.0.0.1:8000/v1, without name and password"
                " (keys come by api_key_env)",
            )
            return None
        return value

    def _request(self, path: str, item: ConfigNode) -> dict[str, Any] | None:
        if isinstance(item, MappingNode):
            for key in item.keys.keys() & set(_OWN_FIELDS):
                self._problems.add(item.keys[key], f"{path}.{key} is set by the agent itself")
            return plain(item)
        self._problems.add(
            item.position,
            f"{path} must be a mapping of further fields of a request, got {describe_node(item)}",
        )
        return None

    def _check_parser(
        self, tree: MappingNode, values: Mapping[str, Any], model: dict[str, Any]
    ) -> None:
        """Check that client, tool, parser and coordinates go together."""
        client = model.get("client", CLIENTS[0])
        parser = values.get("parser")
        expected_client = TOOL_PARSERS.get(parser or "")
        position = tree.keys.get("parser", tree.position)
        if expected_client is not None and client != expected_client:
            self._problems.add(
                position, f"parser {parser} reads the tool of client: {expected_client}"
            )
        elif expected_client is None and client == "openai_computer" and parser is not None:
            self._problems.add(position, "client openai_computer needs parser: openai")
        elif expected_client is not None:
            model.setdefault("tool", TOOLS[client][0])
        tool = model.get("tool")
        tools = TOOLS.get(client, ()) if expected_client is not None else ()
        if tool is not None and tool not in tools:
            hint = suggest(tool, tools) if tools else ": this client and parser use none"
            self._problems.add(tree.keys.get("tool", position), f"unknown tool {tool!r}{hint}")
        if values.get("coordinates", "pixels") != "pixels" and parser != "pyautogui":
            self._problems.add(
                tree.keys["coordinates"],
                "coordinates goes with parser: pyautogui; the other dialects define their own",
            )

    def _check_pixels(self, tree: MappingNode, values: Mapping[str, Any]) -> None:
        """Check that some size of a picture is within both limits."""
        low = values.get("min_pixels", MIN_PIXELS)
        high = values.get("max_pixels", MAX_PIXELS)
        if low <= high:
            return
        key = "min_pixels" if "min_pixels" in values else "max_pixels"
        self._problems.add(
            tree.keys[key], f"min_pixels ({low}) must not be above max_pixels ({high})"
        )

    def _check_prompt(self, tree: MappingNode, values: dict[str, Any]) -> None:
        folder = values.get("prompts")
        if folder is not None:
            prompt_folder = self._resolve_path(folder)
            values["prompts"] = prompt_folder
            if not Path(prompt_folder).is_dir():
                self._problems.add(
                    tree.items["prompts"].position, f"{prompt_folder}: no such folder"
                )
                return
        names = prompts.names(values.get("prompts"))
        prompt = values.get("prompt")
        if prompt is not None and prompt not in names:
            self._problems.add(
                tree.items["prompt"].position, f"no prompt {prompt!r}{suggest(prompt, names)}"
            )
        elif prompt is not None and folder is not None:
            self._check_texts(tree.items["prompt"].position, prompt, values["prompts"])

    def _check_texts(self, position: Position, prompt: str, folder: str) -> None:
        """Check the file of a prompt in a folder of the user."""
        try:
            prompts.read_prompt(prompt, (folder,))
        except ConfigError as error:
            for problem in error.problems:
                self._problems.add(position, problem)

    def _onlooker(
        self, tree: MappingNode, actor: ModelSettings, values: Mapping[str, Any]
    ) -> OnlookerSettings | None:
        node = tree.items.get("onlooker")
        if node is None:
            return None
        keys = {key: _MODEL[key] for key in _MODEL if key != "tool"}
        keys |= {"client": _ONLOOKER_CLIENTS, **_ONLOOKER}
        values_read = _section(self._problems, "onlooker", node, keys, unchecked=_MODEL_SECTIONS)
        if not isinstance(node, MappingNode):
            return None
        if values_read.get("summarise", True) and values.get("parser") in TOOL_PARSERS:
            self._problems.add(
                node.position,
                "onlooker.summarise cannot replace the history of a computer tool, which is made"
                " of the model's own calls; write summarise: false",
            )
        errors = self._errors(node, values_read.pop("errors", None))
        switches = {key: values_read.pop(key) for key in tuple(_ONLOOKER) if key in values_read}
        values_read |= self._model_sections("onlooker.", node)
        return OnlookerSettings(
            model=_onlooker_model(actor, values_read), errors=errors, **switches
        )

    def _errors(self, node: MappingNode, path: str | None) -> tuple[KnownError, ...]:
        name = DEFAULT_ERRORS
        if path is not None:
            name = self._resolve_path(path)
            name = name if os.path.isfile(name) else path
        try:
            entries, digest = read_errors(name)
        except ConfigError as error:
            position = node.items["errors"].position if path is not None else node.position
            for problem in error.problems:
                self._problems.add(position, problem)
            return ()
        self._hash.update(digest.encode())
        return entries

    def _resolve_path(self, path: str) -> str:
        """Convert a path relative to the agent file to one relative to the current folder."""
        return os.path.join(os.path.dirname(self._name), os.path.expanduser(path))


def _is_address(text: str) -> bool:
    """Return whether a text is an address of a server, without name and password."""
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:  # brackets without an IPv6 address, or no port of 0 to 65535
        return False
    if parts.scheme not in ("http", "https") or port == 0:
        return False
    return bool(parts.hostname) and "@" not in parts.netloc


def _onlooker_model(actor: ModelSettings, overrides: dict[str, Any]) -> ModelSettings:
    """Return the onlooker's model, with omitted fields taken from the model that acts."""
    client = "openai" if actor.client == "openai_computer" else actor.client
    if overrides.get("client", client) != client:
        return ModelSettings(**{"model": actor.model, **overrides})
    model = replace(actor, client=client, tool=None)
    if overrides.get("model", actor.model) != actor.model:
        model = replace(model, prices=None)  # these fields belong to another model
    return replace(model, **overrides)
