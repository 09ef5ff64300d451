"""The rules that close a guest's network, for nft and for iptables; in chains of our own only.

The rules are those of the paper's Algorithm "Network Error", for the interfaces that exist:
loopback, the controlling host and established connections pass, everything else is dropped.
"""

import re
from collections.abc import Sequence

# Not `agenthijack`: the embedded desktop's fence has that name, in the same namespace.
TABLE = "inet agenthijack_offline"
CHAINS = {"OUTPUT": "AGENTHIJACK_OUT", "INPUT": "AGENTHIJACK_IN"}
FAMILIES = ("iptables", "ip6tables")


def nft_close(interfaces: Sequence[str], hosts: Sequence[str]) -> str:
    """Return a shell script that closes the network with nft, in one transaction."""
    chains = [
        _nft_chain("out", "output", "oifname", "daddr", interfaces, hosts),
        _nft_chain("in", "input", "iifname", "saddr", interfaces, hosts),
    ]
    text = f"add table {TABLE}\ndelete table {TABLE}\ntable {TABLE} {{\n{''.join(chains)}}}"
    return f"nft -f - <<'RULES'\n{text}\nRULES"


def _nft_chain(
    name: str, hook: str, device: str, address: str, interfaces: Sequence[str], hosts: Sequence[str]
) -> str:
    names = ", ".join(f'"{interface}"' for interface in interfaces)
    accept_rules = [f"  {_nft_family(host)} {address} {host} accept\n" for host in hosts]
    # Without neighbour discovery, a host that controls the guest over IPv6 could not be reached.
    neighbours = "  icmpv6 type { nd-neighbor-solicit, nd-neighbor-advert } accept\n"
    return (
        f" chain {name} {{\n  type filter hook {hook} priority -5; policy accept;\n"
        f'  {device} "lo" accept\n{"".join(accept_rules)}{neighbours}  ct state established,related'
        " accept\n"
        f"  {device} {{ {names} }} counter drop\n }}\n"
    )


def _nft_family(host: str) -> str:
    return "ip6" if ":" in host else "ip"


def nft_open() -> str:
    """Return a shell script that removes our table, if it exists."""
    return f"nft delete table {TABLE} 2>/dev/null; ! nft list table {TABLE} >/dev/null 2>&1"


def nft_count() -> str:
    """Return a shell script that prints our rules with the packets that each has dropped."""
    return f"nft list table {TABLE}"


def iptables_close(interfaces: Sequence[str], hosts: Sequence[str]) -> str:
    """Return a shell script that closes the network with iptables, and ip6tables if it works."""
    families = [_iptables_family(tool, interfaces, hosts) for tool in FAMILIES]
    return "\n".join([iptables_open(), *families])


def _iptables_family(tool: str, interfaces: Sequence[str], hosts: Sequence[str]) -> str:
    is_6 = tool == "ip6tables"
    family_hosts = [host for host in hosts if (":" in host) == is_6]
    lines: list[str] = []
    for hook, device, address in (("OUTPUT", "-o", "-d"), ("INPUT", "-i", "-s")):
        chain = CHAINS[hook]
        add = f"{tool} -w -A {chain}"
        lines.append(f"{tool} -w -N {chain}")
        lines.append(f"{add} {device} lo -j ACCEPT")
        lines += [f"{add} {address} {host} -j ACCEPT" for host in family_hosts]
        if is_6:
            kinds = (135, 136)  # without neighbour discovery no address is found
            lines += [f"{add} -p icmpv6 --icmpv6-type {kind} -j ACCEPT" for kind in kinds]
        lines.append(f"{add} -m conntrack --ctstate ESTABLISHED,RELATED -j ACCEPT")
        lines += [f"{add} {device} {name} -j DROP" for name in interfaces]
        lines.append(f"{tool} -w -I {hook} 1 -j {chain}")
    script = " &&\n".join(lines)
    if is_6:
        return f"if {tool} -w -S >/dev/null 2>&1; then\n{script}\nfi"
    return script


def iptables_open() -> str:
    """Return a shell script that removes our chains, if they exist."""
    lines: list[str] = []
    for tool in FAMILIES:
        for hook, chain in CHAINS.items():
            lines += [f"while {tool} -w -D {hook} -j {chain} 2>/dev/null; do :; done"]
            lines += [f"{tool} -w -F {chain} 2>/dev/null; {tool} -w -X {chain} 2>/dev/null"]
    return "\n".join([*lines, f"! {FAMILIES[0]} -w -S {CHAINS['OUTPUT']} >/dev/null 2>&1"])


def iptables_count() -> str:
    """Return a shell script that prints our chains with the packets that each rule has dropped."""
    names = " && ".join(f"{FAMILIES[0]} -w -L {chain} -v -x -n" for chain in CHAINS.values())
    return names


def dropped(listing: str) -> int:
    """Return how many packets our rules have dropped, from the output of a count script."""
    counts = re.findall(
        r"counter packets (\d+) bytes \d+ drop|^\s*(\d+)\s+\d+\s+DROP\b", listing, re.MULTILINE
    )
    return sum(int(nft_count or iptables_count) for nft_count, iptables_count in counts)
