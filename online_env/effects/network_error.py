"""Network error on a live machine: a firewall makes the outside world unreachable.

The spec is `hijack_data/corruptions/network_error.py`, its look in recordings
`pipelines/edits/network_error.py`.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from hijack_data.params import address

from ..desktops.protocol import Capability
from ..errors import MissingCapabilityError
from . import firewall_rules
from .base import EffectError, EffectRecord, LiveEffect, Probe, Undone, register
from .guest import Guest

# Sites to try until one answers: on the embedded desktop's local internet, then on the real one.
SITES: tuple[tuple[str, int], ...] = (
    ("search.test", 80),
    ("example.com", 80),
    ("www.wikipedia.org", 443),
)
SITE_TIMEOUT_S = 6.0  # s within which a site answers on a working network
MIN_SILENCE_S = 0.5  # s after which a site counts as silent, if it was faster before
SLOWDOWN_FACTOR = 5.0  # an answer may take this many times as long as before


@dataclass(frozen=True, kw_only=True)
class _Tool:
    """A program that sets rules: the shell scripts that do it."""

    close: Callable[[Sequence[str], Sequence[str]], str]
    open: Callable[[], str]
    count: Callable[[], str]
    listing: str


_TOOLS = {
    "nft": _Tool(
        close=firewall_rules.nft_close,
        open=firewall_rules.nft_open,
        count=firewall_rules.nft_count,
        listing="nft list tables",
    ),
    "iptables": _Tool(
        close=firewall_rules.iptables_close,
        open=firewall_rules.iptables_open,
        count=firewall_rules.iptables_count,
        listing="iptables -w -S",
    ),
}
_INTERFACE = re.compile(r"[A-Za-z0-9_.:@-]{1,15}")


@register
class Firewall(LiveEffect):
    """Drops packets that would leave or enter through the interfaces of the default routes."""

    kind: ClassVar[str] = "firewall"
    needs: ClassVar[frozenset[Capability]] = frozenset({"firewall"})
    before_setup: ClassVar[bool] = True

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Record which sites answer now, then close the network."""
        allowed_addresses = _addresses(params)
        sites = _sites(params)
        tool, listing = self._tool(guest)
        facts = guest.net("survey", SITE_TIMEOUT_S, sites=sites)
        interfaces = [name for name in facts["interfaces"] if _INTERFACE.fullmatch(name)]
        hosts = sorted({*allowed_addresses, *_controlling(facts["hosts"])})
        is_closed = firewall_rules.TABLE in listing or firewall_rules.CHAINS["OUTPUT"] in listing
        before = [] if is_closed else _answering(facts["reached"])
        record: EffectRecord = {
            "tool": tool,
            "interfaces": interfaces,
            "hosts": hosts,
            "already": is_closed,
            "before": before,
            "targets": before or facts["reached"],
        }
        if interfaces:
            result = guest.root(_TOOLS[tool].close(interfaces, hosts))
            record["error"] = "" if result.ok else result.error.strip()[-300:]
        return record

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that sites which answered before no longer do, because our rules drop packets."""
        dropped_before = self._dropped(guest, record["tool"])
        slowest = [SLOWDOWN_FACTOR * target["seconds"] for target in record["before"]]
        timeout = max([MIN_SILENCE_S, *slowest])
        targets = [_question(target) for target in record["targets"]]
        reached = guest.net("reach", timeout, targets=targets)["reached"]
        dropped_after = self._dropped(guest, record["tool"])
        facts = {
            "before": record["before"],
            "now": reached,
            "in_force": dropped_after is not None,
            "already": record["already"],
            "dropped": (dropped_after or 0) - (dropped_before or 0),
            "guest_answers": True,
        }
        problems = list(_problems(facts, record))
        return Probe(not problems, facts, "; ".join(problems))

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Remove our rules and nothing else; then the sites must answer again."""
        tools = [record["tool"]] if record else self._working(guest)
        removed = all(guest.root(_TOOLS[tool].open()).ok for tool in tools)
        facts: EffectRecord = {"removed": removed}
        if not removed:
            return Undone(False, facts, f"the rules of {' and '.join(tools)} could not be removed")
        targets = [_question(target) for target in record.get("before", [])]
        facts["now"] = []
        if targets:
            facts["now"] = guest.net("reach", SITE_TIMEOUT_S, targets=targets)["reached"]
        silent = _named(target for target in facts["now"] if not target["ok"])
        return Undone(not silent, facts, f"still out of reach: {silent}" if silent else "")

    def can_be_lifted(self, guest: Guest) -> bool:
        """Return whether the rules are inside the guest, where root may remove them."""
        return not guest.network_is_ours

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return which sites answered before, and how many packets were dropped."""
        sites = " and ".join(_site(target) for target in facts["before"]) or "nothing"
        answered = f"{sites} answered before and do not now"
        if facts["already"]:
            answered = "was closed already"
        return f"{answered}; our rules dropped {facts['dropped']} packets"

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return that the rules are gone, and whether the sites answer again."""
        again = ", what answered before answers again" if facts["now"] else ""
        return f"our rules are gone{again}"

    def _tool(self, guest: Guest) -> tuple[str, str]:
        """Return the first tool that root may use, and its listing.

        Raises:
            MissingCapabilityError: the guest lacks what it needs, which the message names.
        """
        errors: list[str] = []
        for name, tool in _TOOLS.items():
            result = guest.root(tool.listing)
            if result.ok:
                return name, result.output
            errors.append(f"{name}: {result.error.strip()[-150:] or 'failed'}")
        raise MissingCapabilityError(
            "the guest's firewall is out of reach: neither nft nor iptables works as root"
            f" ({'; '.join(errors)})"
        )

    def _working(self, guest: Guest) -> list[str]:
        names = [name for name, tool in _TOOLS.items() if guest.root(tool.listing).ok]
        return names or [self._tool(guest)[0]]

    def _dropped(self, guest: Guest, name: str) -> int | None:
        """Return how many packets our rules have dropped; `None` if they are not in force."""
        listing = guest.root(_TOOLS[name].count())
        return firewall_rules.dropped(listing.output) if listing.ok else None


def _problems(facts: EffectRecord, record: EffectRecord) -> Iterator[str]:
    """Yield the reasons why the facts of a probe do not prove the effect."""
    if record.get("error"):
        yield f"the rules were refused: {record['error']}"
    if not record["before"] and not record["already"]:
        yield "the network was already down before, so this is not our doing"
    reached = _named(target for target in facts["now"] if target["ok"])
    if reached:
        yield f"still reachable: {reached}"
    if not facts["in_force"]:
        yield "our rules are not in force"
    elif facts["dropped"] < 1:
        yield "our rules dropped nothing of what was tried"


def _named(targets: Iterator[EffectRecord]) -> str:
    return ", ".join(f"{target['kind']} {target['host']}" for target in targets)


def _site(target: Mapping[str, Any]) -> str:
    kind = "name server" if target["kind"] == "dns" else "site"
    return f"{kind} {target['host']}"


def _answering(reached: Sequence[EffectRecord]) -> list[EffectRecord]:
    """Return the targets that answered: one site, by its address, and the name server.

    With the address, asking again needs no name lookup.
    """
    answering = [target for target in reached if target["ok"]]
    sites = [target for target in answering if target["kind"] == "tcp"]
    servers = [target for target in answering if target["kind"] == "dns"]
    by_address = [{**target, "host": target["address"]} for target in sites[:1]]
    return by_address + servers


def _question(target: Mapping[str, Any]) -> EffectRecord:
    return {key: target[key] for key in ("kind", "host", "port", "name") if key in target}


def _addresses(params: Mapping[str, Any]) -> list[str]:
    try:
        return [address(text) for text in params.get("allow", ())]
    except (ValueError, TypeError) as error:
        addresses = params.get("allow")
        raise EffectError(
            f"firewall: allow must be a list of IP addresses, got {addresses!r:.200}: {error}"
        ) from None


def _controlling(hosts: Sequence[object]) -> list[str]:
    """Return the controlling hosts that the guest named.

    They become part of a script that root runs, which may be root of this machine: what is no
    address, an agent that took over the guest may have made up.

    Raises:
        EffectError: One of them is no IP address.
    """
    try:
        return [address(str(host)) for host in hosts]
    except ValueError as error:
        raise EffectError(
            f"firewall: the guest names a controlling host that is no address: {str(error)[:200]}"
        ) from None


def _sites(params: Mapping[str, Any]) -> list[tuple[str, int]]:
    values = params.get("sites", SITES)
    try:
        return [(str(host), int(port)) for host, port in values] or list(SITES)
    except (ValueError, TypeError):
        raise EffectError(
            f"firewall: sites must be a list of [host, port], got {values!r:.200}"
        ) from None
