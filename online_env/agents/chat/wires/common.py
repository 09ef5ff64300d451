"""Helpers for all APIs: parse answers without trusting their form."""

from collections.abc import Iterator, Mapping
from typing import Any

from hijack_data import extras
from hijack_data.errors import short_repr
from hijack_data.runs.amounts import is_count

from ....errors import EndpointError
from ...settings import AgentSettings, ModelSettings

EXTRA = "agents"
RETRIES = "tenacity"
NO_KEY = "none"  # the key sent to endpoints that need none, since the client insists on one
MODULES = {"openai": "openai", "openai_computer": "openai", "anthropic": "anthropic"}


def require_clients(settings: AgentSettings) -> None:
    """Check that the clients of an agent's models are installed; otherwise raise the remedy."""
    modules = {RETRIES}
    for model in settings.models:
        modules.add(MODULES[model.client])
    user = f"the agent {settings.source}"
    extras.require(user, EXTRA, sorted(modules))


def load(module: str, settings: ModelSettings) -> Any:
    """Import the client of an API; a missing client is an error that names the extra."""
    return extras.load(module, f"client {settings.client}", EXTRA)


def openai_client(settings: ModelSettings, key: str) -> Any:
    """Return the official client `openai`, without retries, since the endpoint retries."""
    openai = load("openai", settings)
    return openai.OpenAI(
        api_key=key or NO_KEY, base_url=settings.base_url, timeout=settings.timeout, max_retries=0
    )


def broken(problem: str, value: object) -> EndpointError:
    """Return the error for an answer that does not have the form promised by its API."""
    return EndpointError(f"the answer {problem}: {short_repr(value)}", transient=True)


def items(value: object, field: str) -> list[Mapping[str, Any]]:
    """Return a list of mappings.

    Raises:
        broken: An `EndpointError`: the value is not a list of mappings.
    """
    if not isinstance(value, list):
        raise broken(f"has no list {field}", value)
    for item in value:
        if not isinstance(item, Mapping):
            raise broken(f"has a list {field} of something else", item)
    return value


def label(item: Mapping[str, Any], field: str) -> str:
    """Return the name by which a later request refers to a part of an answer.

    Raises:
        broken: An `EndpointError`: the part has none.
    """
    value = item.get(field)
    if not isinstance(value, str) or not value:
        raise broken(f"has a part without {field}", dict(item))
    return value


def tokens(usage: object, *names: str) -> int:
    """Return the sum of counts; missing or invalid counts are 0."""
    if not isinstance(usage, Mapping):
        return 0
    return sum(filter(is_count, (usage.get(name) for name in names)))


def texts(value: object) -> Iterator[str]:
    """Yield the texts of a message's content, which is one text or a list of parts."""
    if isinstance(value, str):
        yield value
    if not isinstance(value, list):
        return
    for part in value:
        text = part.get("text") if isinstance(part, Mapping) else None
        if isinstance(text, str):
            yield text


def sampled(settings: ModelSettings, longest: str) -> dict[str, Any]:
    """Return the fields of sampling that are sent; `longest` is the API's name for the limit."""
    sampling = settings.sampling
    fields = {
        "temperature": sampling.temperature,
        "top_p": sampling.top_p,
        longest: sampling.max_tokens,
    }
    parameters = {name: value for name, value in fields.items() if value is not None}
    return {**parameters, **settings.request}
