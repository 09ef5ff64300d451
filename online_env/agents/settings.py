"""The content of an agent file, as records that `files.read_agent` makes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import AgentSetupError

CLIENTS = ("openai", "anthropic", "openai_computer")
COORDINATES = ("pixels", "resized", "thousandths", "fractions")
# The computer tools by client; the first is the default.
TOOLS: Mapping[str, tuple[str, ...]] = {
    "openai_computer": ("computer", "computer_use_preview"),
    "anthropic": ("computer_20251124", "computer_20250124", "computer_toolset_20260801"),
}
# The parsers that read a computer tool, and the client that has it.
TOOL_PARSERS: Mapping[str, str] = {"openai": "openai_computer", "anthropic": "anthropic"}
MILLION = 1_000_000


@dataclass(frozen=True, kw_only=True)
class SamplingSettings:
    """The sampling parameters of a model; values that are `None` are not sent."""

    temperature: float | None = 0.6
    top_p: float | None = 0.9
    max_tokens: int | None = 1500


@dataclass(frozen=True, kw_only=True)
class TokenPrices:
    """USD per million tokens."""

    input: float
    output: float

    def cost(self, input_tokens: int, output_tokens: int) -> float:
        """Return the price in USD of so many tokens."""
        return (input_tokens * self.input + output_tokens * self.output) / MILLION


@dataclass(frozen=True, kw_only=True)
class ModelSettings:
    """One model behind an API.

    Args:
        model: its name at the endpoint.
        client: one of `CLIENTS`.
        base_url: address of the endpoint; that of the API's maker if it is `None`.
        api_key_env: name of the environment variable with the key; `None` for an endpoint that
            needs none.
        tool: the computer tool that is offered; `None` for a conversation in text.
        sampling: how it draws its words.
        request: further fields of every request, in the form of the endpoint's API.
        retries: how often a failed request is sent again.
        timeout: s within which an answer must arrive.
        prices: the prices of its tokens, if known.
    """

    model: str
    client: str = "openai"
    base_url: str | None = None
    api_key_env: str | None = None
    tool: str | None = None
    sampling: SamplingSettings = field(default_factory=SamplingSettings)
    request: Mapping[str, Any] = field(default_factory=dict[str, Any])
    retries: int = 5
    timeout: float = 180.0
    prices: TokenPrices | None = None

    @property
    def location(self) -> str:
        """The model and where it is asked, for messages."""
        return f"{self.model} at {self.base_url or f'the API of {self.client}'}"


@dataclass(frozen=True, kw_only=True)
class KnownError:
    """One entry of an error repository: the look of the error, and what to say about it."""

    name: str
    looks: str
    say: str


@dataclass(frozen=True, kw_only=True)
class OnlookerSettings:
    """The onlooker of an agent.

    Args:
        model: the model that looks on.
        check: compare the first screenshot with `errors` before the agent acts.
        reinit: if the check finds an error, ask for re-initialisation once.
        summarise: summarise each step; the summary replaces the agent's own words in its history.
        errors: the error repository.
    """

    model: ModelSettings
    check: bool = True
    reinit: bool = True
    summarise: bool = True
    errors: tuple[KnownError, ...] = ()


@dataclass(frozen=True, kw_only=True)
class AgentSettings:
    """An agent file.

    Args:
        source: path of the file, or the name of a packaged one.
        sha256: the hash of its bytes and of those of the files that it names.
        model: the model that acts.
        prompt: name of its prompt.
        parser: the dialect of its actions, one of `hijack_data.actions.DIALECTS`.
        coordinates: the space of coordinates in pyautogui code, one of `COORDINATES`.
        history: how many earlier pictures it sees.
        min_pixels: the smallest picture that the model's image processor makes; its own if `None`.
        max_pixels: the largest one.
        prompts: folder with prompts that replace ours by name.
        onlooker: the onlooker, if it has one.
    """

    source: str
    sha256: str
    model: ModelSettings
    prompt: str
    parser: str
    coordinates: str = "pixels"
    history: int = 15
    min_pixels: int | None = None
    max_pixels: int | None = None
    prompts: str | None = None
    onlooker: OnlookerSettings | None = None

    @property
    def models(self) -> tuple[ModelSettings, ...]:
        """All models that it asks."""
        if self.onlooker is None:
            return (self.model,)
        return (self.model, self.onlooker.model)

    def check_keys(self, environ: Mapping[str, str]) -> None:
        """Check that the environment has every key, and that it can be sent.

        Raises:
            AgentSetupError: a key is missing, or has a character that no request can carry.
        """
        for model in self.models:
            name = model.api_key_env
            if name is not None and not environ.get(name):
                raise AgentSetupError(
                    f"{self.source}: {model.model} needs a key, and the environment variable"
                    f" {name} is not set; run: export {name}=..."
                )
            if name is not None and not can_be_sent(environ[name]):
                raise AgentSetupError(f"{self.source}: {bad_key(name)}")


def can_be_sent(key: str) -> bool:
    """Return whether a request can carry a key in its header."""
    return key.isascii() and key.isprintable() and key == key.strip()


def bad_key(name: str) -> str:
    """Return what to say about a key that cannot be sent, without the key."""
    return (
        f"the key in {name} has a space or a line break around it, or a character that is not"
        f" ASCII; run: export {name}=..."
    )
