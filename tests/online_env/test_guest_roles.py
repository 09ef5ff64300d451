"""The names of roles, when objects are destroyed while the tree is read.

That race can't be had from a real application at will, so its answers are written down.
"""

import pytest

from online_env.embedded.guest.atspi.reader import AtspiNode, AtspiReader
from online_env.embedded.guest.atspi.states import DOCUMENT_WEB

CHROMIUM = ":1.9"


class Answers:
    """A wire that answers with the name of an object's role, by its path."""

    def __init__(self, names: dict[str, str | None]) -> None:
        self.names = names
        self.asked = 0

    def ask(self, calls):
        self.asked += len(calls)
        return [self.names[reference[1]] for reference, _ in calls]


def read(names: dict[str, str | None], wire: Answers, reader: AtspiReader) -> list[str]:
    """Return the names that a read gives to objects of the role of a page."""
    wire.names = names
    nodes = [AtspiNode((CHROMIUM, path), role=DOCUMENT_WEB) for path in names]
    reader._name_roles(nodes)
    return [node.role_name for node in nodes]


@pytest.fixture
def wire() -> Answers:
    return Answers({})


@pytest.fixture
def reader(wire: Answers) -> AtspiReader:
    result = AtspiReader.__new__(AtspiReader)  # without a bus
    result.wire = wire
    result._role_names = {}
    return result


def test_another_object_names_the_role_of_one_that_was_destroyed(wire, reader) -> None:
    assert read({"/a": "invalid", "/b": "document-web"}, wire, reader) == ["document-web"] * 2


@pytest.mark.parametrize("gone", ["invalid", None])
def test_the_answer_of_a_destroyed_object_is_not_kept(gone, wire, reader) -> None:
    assert read({"/a": gone}, wire, reader) == ["unknown"]
    assert read({"/a": "document-web"}, wire, reader) == ["document-web"]


def test_a_role_is_asked_for_once(wire, reader) -> None:
    read({"/a": "document-web", "/b": "document-web"}, wire, reader)
    read({"/a": "document-web"}, wire, reader)
    assert wire.asked == 1


def test_few_objects_of_a_role_are_asked(wire, reader) -> None:
    assert read({f"/{n}": "invalid" for n in range(90)}, wire, reader) == ["unknown"] * 90
    assert wire.asked == 3


def test_an_object_without_a_role_has_an_invalid_one(wire, reader) -> None:
    wire.names = {"/a": "invalid"}
    node = AtspiNode((CHROMIUM, "/a"), role=0)
    reader._name_roles([node])
    assert node.role_name == "invalid"
