"""System calls that no program of a desktop needs, and that reach past its namespaces.

Key rings are the machine's, `AF_VSOCK` leads to the machine's own host, and the others are known
for what they have let through. Light on purpose: the first process of a desktop imports it.
"""

import ctypes
import errno
import os
import struct

_PR_SET_SECCOMP = 22
_MODE_FILTER = 2
_X86_64 = 0xC000003E
_AARCH64 = 0xC00000B7
# linux/audit.h and the tables of system calls.
_CALLS = {
    "x86_64": (
        _X86_64,
        41,
        {
            "add_key": 248,
            "request_key": 249,
            "keyctl": 250,
            "bpf": 321,
            "perf_event_open": 298,
            "kexec_load": 246,
            "kexec_file_load": 320,
            "open_by_handle_at": 304,
            "userfaultfd": 323,
            "io_uring_setup": 425,
            "io_uring_enter": 426,
            "io_uring_register": 427,
            "quotactl": 179,
            "acct": 163,
            "swapon": 167,
            "swapoff": 168,
            "reboot": 169,
            "init_module": 175,
            "finit_module": 313,
            "delete_module": 176,
            "syslog": 103,
        },
    ),
    "aarch64": (
        _AARCH64,
        198,
        {
            "add_key": 217,
            "request_key": 218,
            "keyctl": 219,
            "bpf": 280,
            "perf_event_open": 241,
            "kexec_load": 104,
            "kexec_file_load": 294,
            "open_by_handle_at": 265,
            "userfaultfd": 282,
            "io_uring_setup": 425,
            "io_uring_enter": 426,
            "io_uring_register": 427,
            "quotactl": 60,
            "acct": 89,
            "swapon": 224,
            "swapoff": 225,
            "reboot": 142,
            "init_module": 105,
            "finit_module": 273,
            "delete_module": 106,
            "syslog": 116,
        },
    ),
}
# Families of sockets: raw frames, the kernel's ciphers, and the line to the machine's host.
_FAMILIES = {"AF_PACKET": 17, "AF_ALG": 38, "AF_VSOCK": 40}
_LOAD = 0x20
_EQUAL = 0x15
_AT_LEAST = 0x35
_RETURN = 0x06
_ALLOW = 0x7FFF0000
_ERRNO = 0x00050000
_NUMBER, _ARCHITECTURE, _FIRST_ARGUMENT = 0, 4, 16  # where struct seccomp_data has them
_X32 = 0x40000000


class _Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("code", ctypes.c_char_p)]


def forbid() -> None:
    """Refuse the calls above to this process and all it starts, for good.

    It needs rights over its user namespace.

    Raises:
        OSError: The kernel has no such filters.
    """
    code = program(os.uname().machine)
    libc = ctypes.CDLL(None, use_errno=True)
    described = _Program(len(code) // 8, code)
    if libc.prctl(_PR_SET_SECCOMP, _MODE_FILTER, ctypes.byref(described), 0, 0):
        number = ctypes.get_errno()
        raise OSError(number, f"prctl(PR_SET_SECCOMP): {os.strerror(number)}")


def program(machine: str) -> bytes:
    """Return the filter as the kernel reads it."""
    architecture, socket, calls = _CALLS[machine]
    refused = _statement(_RETURN, _ERRNO | errno.ENOSYS)
    steps = [
        _statement(_LOAD, _ARCHITECTURE),
        _statement(_EQUAL, architecture, 1, 0),
        refused,  # another kind of machine code would have other numbers
        _statement(_LOAD, _NUMBER),
        _statement(_AT_LEAST, _X32, 0, 1),
        refused,
    ]
    for number in sorted(calls.values()):
        steps += [_statement(_EQUAL, number, 0, 1), refused]
    steps += [_statement(_EQUAL, socket, 1, 0), _statement(_RETURN, _ALLOW)]
    steps.append(_statement(_LOAD, _FIRST_ARGUMENT))
    for family in sorted(_FAMILIES.values()):
        steps.append(_statement(_EQUAL, family, 0, 1))
        steps.append(_statement(_RETURN, _ERRNO | errno.EAFNOSUPPORT))
    return b"".join([*steps, _statement(_RETURN, _ALLOW)])


def _statement(code: int, operand: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return struct.pack("HBBI", code, if_true, if_false, operand)
