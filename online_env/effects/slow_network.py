"""Slow network on a live machine: the kernel limits the rate in both directions.

The spec is `hijack_data/corruptions/slow_network.py`. A token bucket (tbf) is on each interface of
a default route, and one on an ifb device to which what comes in is redirected. `mpu` lets each
packet count as a full one, so that a small packet waits, too: not every kernel has netem.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any, ClassVar

from ..desktops.protocol import Capability
from ..errors import MissingCapabilityError
from .base import EffectError, EffectRecord, LiveEffect, Probe, Undone, register
from .guest import Guest
from .network_error import SITE_TIMEOUT_S, SITES

IFB = "ah-slow"  # the device for what comes in
HANDLE = "5107:"  # of our token buckets
PACKET_BITS = 8 * 1514  # of a full frame of Ethernet
ROUNDS = 4  # connections that are timed; the first finds the bucket full
RATE_SECONDS = 2.0  # s for which a download is timed at most
MIN_PACKETS = 8  # of a download that says something about the rate
MIN_SHARE = 0.5  # of a packet's time that a round trip must take
MAX_RATE_FACTOR = (
    1.3  # by which a download may be faster than the rate, as the bucket is full first
)
_NAME = re.compile(r"[A-Za-z0-9_.:@-]{1,15}")
_BUCKET = "tbf rate {rate}kbit burst 1600 latency 3s mtu 1600 mpu 1514"
# The redirection is found by its target: who removed our bucket has left it, and without the target
# nothing comes in any more.
_REMOVE = (
    f"for dev in $(tc qdisc show | sed -n 's/^qdisc tbf {HANDLE} dev \\([^ ]*\\) .*/\\1/p'); do"
    ' tc qdisc del dev "$dev" root; done;'
    " for dev in $(tc qdisc show | sed -n 's/^qdisc ingress [^ ]* dev \\([^ ]*\\) .*/\\1/p'); do"
    f' tc filter show dev "$dev" parent ffff: | grep -q "Redirect to device {IFB}"'
    ' && tc qdisc del dev "$dev" ingress; done;'
    f" ip link del {IFB} 2>/dev/null; ! ip link show {IFB} >/dev/null 2>&1"
)
# On a device of its own, so that nothing of the desktop's network changes.
_TRY = (
    "set -e; ip link add ah-try type ifb; trap 'ip link del ah-try' EXIT; ip link set ah-try up;"
    f" tc qdisc add dev ah-try root {_BUCKET.format(rate=256)}; tc qdisc add dev ah-try ingress;"
    " tc filter add dev ah-try parent ffff: protocol all u32 match u32 0 0"
    " action mirred egress redirect dev ah-try"
)


@register
class SlowLink(LiveEffect):
    """Limits the rate of the interfaces of the default routes."""

    kind: ClassVar[str] = "slow_link"
    needs: ClassVar[frozenset[Capability]] = frozenset({"firewall"})
    conflicts: ClassVar[Mapping[str, str]] = {
        "firewall": "no site answers while the network is cut, so no rate can be measured"
    }

    def require(self, guest: Guest) -> None:
        """Check that the kernel has what limits a rate.

        Raises:
            MissingCapabilityError: It has not, or the tools are missing; nothing was changed.
        """
        result = guest.root(_TRY)
        if not result.ok:
            raise MissingCapabilityError(
                "the guest's network cannot be slowed down: it needs tc and ip (apt-get install"
                " iproute2) and a kernel with tbf, ifb, u32 and mirred"
                f" ({result.error.strip()[-200:] or 'failed'})"
            )

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Measure a site, then limit the rate."""
        rate = _rate(params)
        self.require(guest)
        facts = guest.net("survey", SITE_TIMEOUT_S, sites=SITES)
        interfaces = [name for name in facts["interfaces"] if _NAME.fullmatch(name)]
        sites = [answer for answer in facts["reached"] if answer["kind"] == "tcp" and answer["ok"]]
        already = _buckets(guest) > 0
        record: EffectRecord = {
            "rate": rate,
            "interfaces": interfaces,
            "already": already,
            "site": None,
            "before": None,
            "error": "",
        }
        if sites:
            site = {"host": sites[0]["address"], "name": sites[0]["host"], "port": sites[0]["port"]}
            record["site"] = site
            record["before"] = _measure(guest, site)
        if interfaces and not already:
            result = guest.root(_limit(interfaces, rate))
            record["error"] = "" if result.ok else result.error.strip()[-300:]
            if not result.ok:
                guest.root(_REMOVE)
        return record

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that our buckets are in force, and measure the site again."""
        now = None if record["site"] is None else _measure(guest, record["site"])
        facts = {
            "rate": record["rate"],
            "buckets": _buckets(guest),
            "before": record["before"],
            "now": now,
            "already": record["already"],
        }
        problems = list(_problems(facts, record))
        return Probe(not problems, facts, "; ".join(problems))

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Remove our buckets and nothing else; then the site must answer as fast as before."""
        removed = guest.root(_REMOVE).ok and not _buckets(guest)
        facts: EffectRecord = {"removed": removed, "now": None}
        if not removed:
            return Undone(False, facts, "our token buckets could not be removed")
        if record.get("site") and record["before"] and not record["already"]:
            facts["now"] = _measure(guest, record["site"])
            limit_s = MIN_SHARE * _packet_seconds(record["rate"]) + record["before"]["round_trip"]
            if facts["now"]["round_trip"] is None or facts["now"]["round_trip"] > limit_s:
                return Undone(False, facts, f"the site is still slow: {facts['now']}")
        return Undone(True, facts)

    def can_be_lifted(self, guest: Guest) -> bool:
        """Return whether the buckets are inside the guest, where root may remove them."""
        return not guest.network_is_ours

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return how fast the site was before, and how fast it is now."""
        return (
            f"{facts['rate']} kbit/s: a site answered in {_in_words(facts['before'])} before, and"
            f" in {_in_words(facts['now'])} now"
        )

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return that the limits are gone, and how fast the site is again."""
        again = f"; the site answers in {_in_words(facts['now'])}" if facts["now"] else ""
        return f"our limits are gone{again}"


def _limit(interfaces: Sequence[str], rate: int) -> str:
    """Return the shell script that limits interfaces in both directions."""
    bucket = f"root handle {HANDLE} {_BUCKET.format(rate=rate)}"
    lines = [f"ip link add {IFB} type ifb", f"ip link set {IFB} up"]
    for name in interfaces:
        lines += [
            f"tc qdisc add dev {name} ingress",
            f"tc filter add dev {name} parent ffff: protocol all u32 match u32 0 0"
            f" action mirred egress redirect dev {IFB}",
            f"tc qdisc add dev {name} {bucket}",
        ]
    lines.append(f"tc qdisc add dev {IFB} {bucket}")
    return " && ".join(lines)


def _buckets(guest: Guest) -> int:
    """Return how many of our token buckets are in force."""
    listing = guest.root("tc qdisc show").output
    return sum(line.startswith(f"qdisc tbf {HANDLE} ") for line in listing.splitlines())


def _measure(guest: Guest, site: Mapping[str, Any]) -> EffectRecord:
    """Return the median round trip to a site in s, and the rate of a download in kbit/s."""
    facts = guest.net("speed", SITE_TIMEOUT_S, rounds=ROUNDS, max_seconds=RATE_SECONDS, **site)
    trips = facts["seconds"]
    rate = facts["bytes"] * 8 / 1000 / facts["download"] if facts["bytes"] else None
    return {
        # The first finds the bucket full, and shows nothing of it.
        "round_trip": round(median(trips[1:]), 4) if len(trips) > 1 else None,
        "kbit": None if rate is None else round(rate, 1),
        "bytes": facts["bytes"],
    }


def _problems(facts: EffectRecord, record: EffectRecord) -> Iterator[str]:
    """Yield the reasons why the facts of a probe do not prove the effect."""
    if record["error"]:
        yield f"the limits were refused: {record['error']}"
    expected = len(record["interfaces"]) + 1  # and the one for what comes in
    if facts["buckets"] != expected:
        yield f"{facts['buckets']} of our {expected} token buckets are in force"
    before, now, packet_s = record["before"], facts["now"], _packet_seconds(record["rate"])
    if now is None or before is None or before["round_trip"] is None:
        yield "no site answered before, so nothing can be measured"
        return
    if now["round_trip"] is None:
        yield "the site does not answer any more: the network is not slow, but gone"
        return
    if not record["already"] and before["round_trip"] > MIN_SHARE * packet_s:
        yield f"the site took {before['round_trip']:g} s before, so this is not our doing"
    if now["round_trip"] < MIN_SHARE * packet_s:
        yield f"the site answers in {now['round_trip']:g} s, a packet should take {packet_s:.3f} s"
    is_long = now["kbit"] is not None and 8 * now["bytes"] > MIN_PACKETS * PACKET_BITS
    if is_long and now["kbit"] > MAX_RATE_FACTOR * record["rate"]:
        yield f"{now['kbit']:g} kbit/s come through, {record['rate']} should"


def _packet_seconds(rate: int) -> float:
    return PACKET_BITS / (1000 * rate)


def _in_words(measured: Mapping[str, Any] | None) -> str:
    if measured is None or measured["round_trip"] is None:
        return "no time"
    rate = "" if measured["kbit"] is None else f" ({measured['kbit']:g} kbit/s)"
    return f"{1000 * measured['round_trip']:.0f} ms{rate}"


def _rate(params: Mapping[str, Any]) -> int:
    rate = params.get("rate")
    if not isinstance(rate, int) or isinstance(rate, bool) or rate < 1:
        raise EffectError(f"slow_link: rate must be kbit/s, an integer of at least 1, got {rate!r}")
    return rate
