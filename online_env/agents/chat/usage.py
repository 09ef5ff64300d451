"""Counts of requests, tokens and money: of an episode, and of each of its steps."""

from dataclasses import asdict, dataclass
from typing import Any

from ..settings import TokenPrices


@dataclass(kw_only=True)
class TokenCounts:
    """Usage counts. `usd` is `None` if the price of any part is unknown."""

    requests: int = 0
    retries: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    usd: float | None = 0.0
    seconds: float = 0.0

    def add(self, other: "TokenCounts") -> None:
        """Add other counts."""
        self.requests += other.requests
        self.retries += other.retries
        self.input_tokens += other.input_tokens
        self.output_tokens += other.output_tokens
        self.seconds = round(self.seconds + other.seconds, 4)
        if self.usd is None or other.usd is None:
            self.usd = None
        else:
            self.usd = round(self.usd + other.usd, 9)


class UsageMeter:
    """Counts the usage of an episode."""

    def __init__(self) -> None:
        self._total = TokenCounts()
        self._steps: list[TokenCounts] = []
        self.unreadable_checks = 0

    @property
    def step(self) -> int:
        """The current step, from 0."""
        return max(0, len(self._steps) - 1)

    def begin_step(self) -> None:
        """Count everything from now on for the next step."""
        self._steps.append(TokenCounts())

    def add(
        self,
        input_tokens: int,
        output_tokens: int,
        prices: TokenPrices | None,
        seconds: float,
        tries: int,
    ) -> None:
        """Count one answered request; `tries` is how often it was sent.

        Every request and every answer has tokens, so a count of 0 means that the endpoint does not
        count: the cost is then unknown, unless tokens of that kind are free.
        """
        if prices is not None and (
            (not input_tokens and prices.input) or (not output_tokens and prices.output)
        ):
            prices = None
        counts = TokenCounts(
            requests=1,
            retries=tries - 1,
            input_tokens=input_tokens,
            output_tokens=output_tokens,
            usd=None if prices is None else prices.cost(input_tokens, output_tokens),
            seconds=seconds,
        )
        self._total.add(counts)
        if self._steps:
            self._steps[-1].add(counts)

    def to_data(self) -> dict[str, Any]:
        """Return the counts as JSON data, those of each step in `steps`."""
        data = asdict(self._total)
        if self.unreadable_checks:
            data["unreadable_checks"] = self.unreadable_checks
        data["steps"] = [asdict(step) for step in self._steps]
        return data
