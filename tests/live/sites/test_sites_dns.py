"""The DNS responder, over UDP and packet by packet."""

import socket
import struct
from ipaddress import IPv4Address
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from online_env.embedded.sites import HOSTS
from online_env.embedded.sites.dns import answer

OURS = IPv4Address("10.77.0.1")


def question(name: str, kind: int = 1, ident: int = 77, flags: int = 0x0100) -> bytes:
    labels = b"".join(bytes([len(x)]) + x for x in name.encode().split(b"."))
    return (
        struct.pack("!6H", ident, flags, 1, 0, 0, 0) + labels + b"\0" + struct.pack("!2H", kind, 1)
    )


def ask_dns(web: Any, packet: bytes) -> bytes:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(5)
        link.sendto(packet, ("127.0.0.1", web.dns))
        return link.recv(512)


@pytest.mark.parametrize("name", [*HOSTS, "ShOp.TeSt"])
def test_our_names_have_our_address(web: Any, name: str) -> None:
    packet = question(name)
    reply = ask_dns(web, packet)
    assert struct.unpack("!6H", reply[:12]) == (77, 0x8580, 1, 1, 0, 0)
    # letters as they were asked (resolvers check that)
    assert reply[12 : len(packet)] == packet[12:]
    assert reply[len(packet) :] == struct.pack("!3HIH", 0xC00C, 1, 1, 5, 4) + OURS.packed


@pytest.mark.parametrize("kind", [28, 65, 16, 15])
def test_other_types_of_our_names_are_empty(web: Any, kind: int) -> None:
    assert struct.unpack("!6H", ask_dns(web, question("mail.test", kind))[:12]) == (
        77,
        0x8580,
        1,
        0,
        0,
        0,
    )


@pytest.mark.parametrize("name", ["example.com", "test", "x.shop.test", "shop.test.com", "shop"])
def test_other_names_do_not_exist(web: Any, name: str) -> None:
    assert struct.unpack("!6H", ask_dns(web, question(name))[:12]) == (77, 0x8583, 1, 0, 0, 0)


def test_a_dot_inside_a_label_makes_no_name() -> None:
    packet = question("ab").replace(b"\x02ab", b"\x09shop.test")
    reply = answer(packet, HOSTS, OURS)
    assert reply is not None
    assert reply[3] & 15 == 3


def test_malformed_packets_are_answered_or_dropped_and_never_end_the_server(web: Any) -> None:
    good = question("shop.test")
    bad = [good[:n] for n in range(len(good))] + [
        good[:12] + b"\xc0\x0c" + good[-4:],
        good[:12] + b"\x3f" * 400,
        b"\xff" * 500,
    ]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        for packet in bad:
            link.sendto(packet, ("127.0.0.1", web.dns))
    assert ask_dns(web, good)[-4:] == OURS.packed


@pytest.mark.parametrize(
    "name",
    [
        b"\xc0\x0c",
        b"\x40" + b"a" * 64 + b"\0",
        b"\x3f" + b"a" * 63,
        (b"\x3f" + b"a" * 63) * 4 + b"\0",
    ],
)
def test_names_that_are_compressed_too_long_or_cut_short_are_format_errors(name: bytes) -> None:
    packet = (
        question("shop.test")[:12] + name + (b"" if len(name) == 64 else struct.pack("!2H", 1, 1))
    )
    assert answer(packet, HOSTS, OURS) == struct.pack("!6H", 77, 0x8581, 0, 0, 0, 0)


def test_responses_are_never_answered() -> None:
    assert answer(question("shop.test", flags=0x8180), HOSTS, OURS) is None


@given(st.binary(max_size=600))
def test_any_packet_gives_a_header_with_its_number_or_nothing(packet: bytes) -> None:
    reply = answer(packet, HOSTS, OURS)
    if len(packet) < 12 or packet[2] & 0x80:
        assert reply is None
    else:
        assert reply is not None
        assert reply[:2] == packet[:2]
        assert reply[2] & 0x80
        assert len(reply) <= len(packet) + 16


@given(st.binary(max_size=80), st.integers(0, 0xFFFF), st.sampled_from(HOSTS))
def test_what_follows_the_question_is_ignored(tail: bytes, ident: int, name: str) -> None:
    reply = answer(question(name, ident=ident) + tail, HOSTS, OURS)
    assert reply == answer(question(name, ident=ident), HOSTS, OURS)
    assert reply is not None
    assert reply[-4:] == OURS.packed
