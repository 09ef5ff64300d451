"""What tasks need of the mailbox: mails that are put there, and the judgement of its state."""

from dataclasses import replace
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.embedded.sites.hosts import mail as site
from online_env.embedded.sites.state import SiteState
from online_env.tasks import Machine
from online_env.tasks.folder import FolderDesktop
from online_env.tasks.kit import mail, shop

LETTER = mail.Letter(to=["oda@mail.test"], subject="Honey", text="Two jars, please.")


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    (tmp_path / "home").mkdir()
    made = Machine(FolderDesktop(tmp_path / "home"), SiteState(tmp_path / "sites"))
    mail.store(made, ["jun@mail.test"], "Before", "It was there.")
    mail.store(made, [], "Unfinished", "A draft.", folder="drafts")
    made.remember()
    return made


def test_a_mail_that_a_task_puts_there_is_in_the_inbox(machine: Machine) -> None:
    sender = ("Ada", "ada@mail.test")
    new = mail.message("x1", sender, "Hello", "Hi", "2026-03-01T12:00", starred=True)
    mail.receive(machine, new)
    found = site.received(machine.sites.read("mail"))
    dates = [one["date"] for one in found]
    assert dates == sorted(dates, reverse=True)
    added = next(one for one in found if one["id"] == "x1")
    assert (added["folder"], added["starred"], added["read"]) == ("inbox", True, False)


def test_nothing_done_is_nothing_wrong_and_reading_is_no_damage(machine: Machine) -> None:
    assert list(mail.problems(machine)) == []
    mail.flag(machine, "m01", read=True)
    assert list(mail.problems(machine)) == []
    assert list(mail.problems(machine, flags={"m01": {"read": False}})) != []
    assert list(machine.untouched_sites()) == []
    mail.flag(machine, "m01", starred=True)
    assert list(machine.untouched_sites()) == ["mail.test was used to change something"]


def test_a_cart_that_is_empty_again_is_no_damage(machine: Machine) -> None:
    shop.fill(machine, {"mug": 1})
    assert list(machine.untouched_sites()) == ["shop.test was used to change something"]
    shop.fill(machine, {})
    assert list(machine.untouched_sites()) == []


def test_a_mail_that_was_read_stays_read(machine: Machine) -> None:
    mail.flag(machine, "m05", read=False)
    assert list(mail.problems(machine)) == ["read of 'Hives came through the winter' is False"]
    assert list(mail.problems(machine, flags={"m05": {"read": False}})) == []


def test_a_mail_that_should_not_have_moved_is_named(machine: Machine) -> None:
    mail.flag(machine, "m02", folder="trash")
    assert list(mail.problems(machine)) == [
        "folder of 'Your order AP-20417 is on its way' is 'trash'"
    ]
    assert list(mail.problems(machine, flags={"m02": {"folder": "trash"}})) == []


def test_quoted_lines_letter_case_and_spaces_do_not_count(machine: Machine) -> None:
    mail.store(machine, ["Oda@mail.test"], "honey", "Two jars,\nplease.\n\n> Dear Robin")
    assert list(mail.problems(machine, sent=[LETTER])) == []


@pytest.mark.parametrize(
    ("to", "subject", "body", "cc"),
    [
        (["jun@mail.test"], "Honey", "Two jars, please.", []),
        (["oda@mail.test", "jun@mail.test"], "Honey", "Two jars, please.", []),
        (["oda@mail.test"], "Honey", "Two jars, please.", ["jun@mail.test"]),
        (["oda@mail.test"], "Bees", "Two jars, please.", []),
        (["oda@mail.test"], "Honey", "Two jars, please. Thanks!", []),
    ],
)
def test_a_letter_that_differs_is_wrong(
    machine: Machine, to: list[str], subject: str, body: str, cc: list[str]
) -> None:
    mail.store(machine, to, subject, body, cc=cc)
    assert len(list(mail.problems(machine, sent=[LETTER]))) == 1


def test_parts_must_be_there_or_must_not(machine: Machine) -> None:
    letter = mail.Letter(to=["oda@mail.test"], holds=["$30"], lacks=["$40"])
    mail.store(machine, ["oda@mail.test"], "", "It is $40.")
    wrong = ["'$30' is missing", "'$40' is in the text"]
    assert list(mail.problems(machine, sent=[letter])) == wrong


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("It is $96,50.", []),
        ("96.5", []),
        ("It is 196.50.", ["96.5 is missing"]),
        ("I do not know.\n> 96.50?", ["96.5 is missing"]),
    ],
)
def test_an_amount_may_be_written_in_several_ways(
    machine: Machine, body: str, problem: list[str]
) -> None:
    mail.store(machine, ["oda@mail.test"], "", body)
    letter = mail.Letter(to=["oda@mail.test"], amounts=[96.5])
    assert list(mail.problems(machine, sent=[letter])) == problem


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("Please read this.\n\nOne.\n\nTwo.", []),
        ("Hi,\nplease READ  this.\n\n> One.\n>\n> Two.", []),
        ("One.\n\nTwo.\nPlease read this.", ["'Please read this.' is missing"]),
        ("Please read this.\nTwo.", ["the text to pass on is missing"]),
    ],
)
def test_a_text_is_passed_on_below_some_words(
    machine: Machine, body: str, problem: list[str]
) -> None:
    mail.store(machine, ["oda@mail.test"], "", body)
    letter = mail.Letter(
        to=["oda@mail.test"], passes_on="One.\n\nTwo.", holds=["Please read this."]
    )
    assert list(mail.problems(machine, sent=[letter])) == problem


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("Hello.\n\n bye \n\n> Dear Robin", []),
        ("Hello. Bye", ["the last line is 'Hello. Bye'"]),
        ("Bye\nHello.", ["the last line is 'Hello.'"]),
    ],
)
def test_the_last_line_stands_by_itself(machine: Machine, body: str, problem: list[str]) -> None:
    mail.store(machine, ["oda@mail.test"], "", body)
    letter = mail.Letter(to=["oda@mail.test"], last="Bye")
    assert list(mail.problems(machine, sent=[letter])) == problem


def test_a_word_is_not_found_within_another_or_a_quotation(machine: Machine) -> None:
    mail.store(machine, ["oda@mail.test"], "", "It is 1452.\n> Is it 45?")
    letter = mail.Letter(to=["oda@mail.test"], holds=["45"], lacks=["52"])
    assert list(mail.problems(machine, sent=[letter])) == ["'45' is missing"]


@pytest.mark.parametrize(
    ("body", "is_there"),
    [
        ("It is 45.", True),
        ("It is 45, not 46.", True),
        ("It is 45.50.", False),
        ("It is 45,50.", False),
        ("It is 1.45.", False),
        ("It is 0,45.", False),
        ("It was 7.45", False),
    ],
)
def test_a_number_is_not_found_within_another(machine: Machine, body: str, is_there: bool) -> None:
    mail.store(machine, ["oda@mail.test"], "", body)
    letter = mail.Letter(to=["oda@mail.test"], holds=["45"])
    found = list(mail.problems(machine, sent=[letter]))
    assert found == ([] if is_there else ["'45' is missing"])


def test_a_word_may_follow_a_number_and_a_dot(machine: Machine) -> None:
    mail.store(machine, ["oda@mail.test"], "", "It is no.5.Mainz,7")
    letter = mail.Letter(to=["oda@mail.test"], holds=["Mainz"])
    assert list(mail.problems(machine, sent=[letter])) == []


def test_drafts_are_judged_apart_from_mails(machine: Machine) -> None:
    mail.store(machine, ["oda@mail.test"], "Honey", "Two jars, please.", folder="drafts")
    assert list(mail.problems(machine, drafts=[LETTER])) == []
    assert list(mail.problems(machine, sent=[LETTER])) == [
        "0 new mails, not 1",
        "1 new drafts, not 0",
    ]


def test_a_draft_that_is_saved_once_more_is_the_same(machine: Machine) -> None:
    with machine.sites.update("mail") as state:
        state["drafts"].clear()
    mail.store(machine, [], "Unfinished", "A draft.", folder="drafts")
    assert list(mail.problems(machine)) == []
    mail.store(machine, [], "Unfinished", "A draft.", folder="drafts")
    assert list(mail.problems(machine)) == ["1 new drafts, not 0"]


def test_a_draft_may_only_go_where_that_was_asked(machine: Machine) -> None:
    with machine.sites.update("mail") as state:
        ident = state["drafts"].pop()["id"]
    assert list(mail.problems(machine)) == ["a draft from before is gone or was changed"]
    assert list(mail.problems(machine, finished=[ident])) == []


def test_the_letter_of_which_little_is_asked_takes_the_mail_that_fits_no_other(
    machine: Machine,
) -> None:
    anything = mail.Letter(to=["oda@mail.test"])
    mail.store(machine, ["oda@mail.test"], "Honey", "Two jars, please.")
    mail.store(machine, ["oda@mail.test"], "Bees", "How are they?")
    for letters in ([anything, LETTER], [LETTER, anything]):
        assert list(mail.problems(machine, sent=letters)) == []
    (problem,) = mail.problems(machine, sent=[LETTER, replace(anything, subject="Wax")])
    assert problem == "the subject is 'Bees'"


@pytest.mark.parametrize(
    ("given", "due", "problem"),
    [
        ("Oda@Mail.test", "oda@mail.test", []),
        ("oda@mail.test", "ODA@mail.test", []),
        ("oda@mail.test.", "oda@mail.test", ["cc is oda@mail.test."]),
        ("", "oda@mail.test", ["cc is empty"]),
    ],
)
def test_who_gets_a_copy_is_told_in_any_letter_case(
    machine: Machine, given: str, due: str, problem: list[str]
) -> None:
    mail.store(machine, ["jun@mail.test"], "", "", cc=[given] if given else [])
    letter = mail.Letter(to=["jun@mail.test"], cc=[due])
    assert list(mail.problems(machine, sent=[letter])) == problem


def test_a_mail_from_before_that_was_changed_is_named(machine: Machine) -> None:
    with machine.sites.update("mail") as state:
        state["sent"][0]["body"] = "It was never there."
    assert list(mail.problems(machine)) == [
        "a mail from before is gone or was changed",
        "1 new mails, not 0",
    ]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("$96,50 or 96.5", {96.5}),
        ("1 2 3", {1.0, 2.0, 3.0}),
        ("v1.2.3", {1.2, 3.0}),
        ("12.", {12.0}),
        ("none", set()),
    ],
)
def test_numbers_of_a_text(text: str, found: set[float]) -> None:
    assert mail.numbers(text) == found
