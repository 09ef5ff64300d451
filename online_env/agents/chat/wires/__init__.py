"""The APIs: how each is asked, and how its answers are read. One module each."""

from collections.abc import Mapping
from typing import Any, Protocol

from ...settings import ModelSettings
from ..query import ModelQuery, Reply


class ModelWire(Protocol):
    """One API."""

    def connect(self, settings: ModelSettings, key: str) -> Any:
        """Return the client of the API's vendor, configured not to retry."""
        ...

    def body(self, query: ModelQuery, settings: ModelSettings) -> dict[str, Any]:
        """Return the request as JSON data, with `EmbeddedPicture` pictures."""
        ...

    def send(self, client: Any, body: Mapping[str, Any]) -> str:
        """Send a request with encoded pictures, and return the raw answer."""
        ...

    def read(self, answer: Mapping[str, Any]) -> Reply:
        """Parse an answer; raises `EndpointError` if parts that its API promises are missing."""
        ...


def make_wire(client: str) -> ModelWire:
    """Return the API of a client, one of `settings.CLIENTS`."""
    if client == "anthropic":
        from .anthropic_messages import AnthropicMessages

        return AnthropicMessages()
    if client == "openai_computer":
        from .openai_responses import OpenAIResponses

        return OpenAIResponses()
    from .openai_chat import OpenAIChat

    return OpenAIChat()
