"""The formats of results of other harnesses, and what an episode of them has."""

from collections.abc import Mapping
from types import MappingProxyType

AMOUNTS = ("steps", "tokens", "cost")  # of an episode; cost in USD
FIELDS = ("task", "condition", "agent", "score", "seed", *AMOUNTS)
READERS: Mapping[str, str] = MappingProxyType(
    {
        "table": "online_env.results.outcome_readers.table:TableReader",
        "inspect": "online_env.results.outcome_readers.inspect_log:InspectReader",
        "harbor": "online_env.results.outcome_readers.harbor:HarborReader",
        "agentlab": "online_env.results.outcome_readers.agentlab:AgentLabReader",
        "cua_bench": "online_env.results.outcome_readers.cua_bench:CuaBenchReader",
        "atif": "online_env.results.outcome_readers.atif:AtifReader",
        "osworld": "online_env.results.outcome_readers.osworld:OSWorldReader",
    }
)
