"""Makes system calls that reach past namespaces, and sockets of such families. Prints OPEN for each
that there is."""

import ctypes
import errno
import socket
import sys

CALLS = {
    "x86_64": {
        "add_key": 248,
        "keyctl": 250,
        "request_key": 249,
        "bpf": 321,
        "perf_event_open": 298,
        "io_uring_setup": 425,
        "open_by_handle_at": 304,
    },
    "aarch64": {
        "add_key": 217,
        "keyctl": 219,
        "request_key": 218,
        "bpf": 280,
        "perf_event_open": 241,
        "io_uring_setup": 425,
        "open_by_handle_at": 265,
    },
}
libc = ctypes.CDLL(None, use_errno=True)
for name, number in CALLS[sys.argv[1]].items():
    ctypes.set_errno(0)
    libc.syscall(number, 0, 0, 0, 0, 0)
    if ctypes.get_errno() != errno.ENOSYS:
        print("OPEN:", name, ctypes.get_errno())
for family in (socket.AF_PACKET, socket.AF_VSOCK, socket.AF_ALG):
    try:
        socket.socket(family, socket.SOCK_STREAM if family == socket.AF_VSOCK else socket.SOCK_RAW)
        print("OPEN:", family)
    except OSError as error:
        print("refused:", family, error)
