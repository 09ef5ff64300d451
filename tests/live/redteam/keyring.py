"""Reads the key whose number is given, and searches the user's ring for `canary`. Prints OPEN with
what it holds."""

import ctypes
import sys

KEYCTL, REQUEST_KEY = (250, 249) if sys.maxsize > 2**32 and sys.argv[2] == "x86_64" else (219, 218)
SEARCH, READ, LINK, USER_RING, PROCESS_RING = 10, 11, 8, -4, -2
libc = ctypes.CDLL(None, use_errno=True)
number = int(sys.argv[1])
found = {number, libc.syscall(KEYCTL, SEARCH, USER_RING, b"user", b"canary", 0)}
found.add(libc.syscall(REQUEST_KEY, b"user", b"canary", None, PROCESS_RING))
for key in found - {-1}:
    for ring in (0, PROCESS_RING):
        if ring:
            libc.syscall(KEYCTL, LINK, key, ring)
        buffer = ctypes.create_string_buffer(100)
        if libc.syscall(KEYCTL, READ, key, buffer, 100) > 0:
            print("OPEN:", buffer.value)
print("tried")
