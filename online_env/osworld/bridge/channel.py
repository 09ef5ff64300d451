"""JSON lines between this process (stdin and the real stdout) and the one that controls it."""

import json
import os
import sys
from typing import Any, TextIO

Message = dict[str, Any]


class Channel:
    """One message a line. What `desktop_env` prints goes to the standard error instead."""

    def __init__(self) -> None:
        incoming = os.dup(0)
        outgoing = os.dup(1)
        self.incoming: TextIO = os.fdopen(incoming, encoding="utf-8")
        self.outgoing: TextIO = os.fdopen(outgoing, "w", encoding="utf-8")
        os.dup2(2, 1)
        null_device = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null_device, 0)
        sys.stdout = sys.stderr

    def receive(self) -> Message | None:
        """Return the next message, or `None` if the other side has gone."""
        line = self.incoming.readline()
        if not line:
            return None
        return json.loads(line)

    def send(self, message: Message) -> None:
        """Write one message."""
        line = json.dumps(message)
        self.outgoing.write(f"{line}\n")
        self.outgoing.flush()

    def ask(self, question: str) -> Message:
        """Ask the controlling process a question in the middle of a call, and return its answer.

        Raises:
            SystemExit: The other side has ended or refused.
        """
        self.send({"ask": question})
        answer = self.receive()
        if answer is None or "answer" not in answer:
            raise SystemExit("the controlling process ended or refused: no pristine desktop")
        return answer["answer"]
