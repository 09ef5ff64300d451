"""Connects to the services given as HOST:PORT, or @NAME for an abstract socket. Prints OPEN for
each that answers."""

import socket
import sys

for place in sys.argv[1:]:
    host, _, port = place.rpartition(":")
    unix = place.startswith("@")
    line = socket.socket(socket.AF_UNIX if unix else socket.AF_INET)
    line.settimeout(1)
    try:
        line.connect("\0" + place[1:] if unix else (host, int(port)))
        print("OPEN:", place, line.recv(100))
    except OSError as error:
        print("refused:", place, error)
