"""What tasks need of the mailbox: mails that are put there, and the judgement of its state."""

from dataclasses import replace
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.errors import ParameterError
from online_env.embedded.sites.hosts import mail as site
from online_env.embedded.sites.state import SiteState
from online_env.tasks import Machine
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import mail, shop

LETTER = mail.Letter(to=["oda@mail.test"], subject="Honey", text="Two jars, please.")


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    (tmp_path / "home").mkdir()
    result = Machine(FolderDesktop(tmp_path / "home"), SiteState(tmp_path / "sites"))
    mail.store(result, ["jun@mail.test"], "Before", "It was there.")
    mail.store(result, [], "Unfinished", "A draft.", folder="drafts")
    result.remember()
    return result


def test_a_mail_that_a_task_puts_there_is_in_the_inbox(machine: Machine) -> None:
    sender = ("Ada", "ada@mail.test")
    new = mail.message("x1", sender, "Hello", "Hi", "2026-03-01T12:00", starred=True)
    mail.receive(machine, new)
    result = site.received(machine.sites.read("mail"))
    dates = [item["date"] for item in result]
    assert dates == sorted(dates, reverse=True)
    added = next(item for item in result if item["id"] == "x1")
    assert (added["folder"], added["starred"], added["read"]) == ("inbox", True, False)


def test_nothing_done_is_nothing_wrong_and_reading_is_no_damage(machine: Machine) -> None:
    assert list(mail.problems(machine)) == []
    mail.flag(machine, "m01", read=True)
    assert list(mail.problems(machine)) == []
    assert list(mail.problems(machine, flags={"m01": {"read": False}})) != []
    assert list(machine.unexpected_site_changes()) == []
    mail.flag(machine, "m01", starred=True)
    assert list(machine.unexpected_site_changes()) == ["mail.test was used to change something"]


def test_a_cart_that_is_empty_again_is_no_damage(machine: Machine) -> None:
    shop.fill(machine, {"mug": 1})
    assert list(machine.unexpected_site_changes()) == ["shop.test was used to change something"]
    shop.fill(machine, {})
    assert list(machine.unexpected_site_changes()) == []


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


def test_a_letter_says_what_should_be_in_it() -> None:
    with pytest.raises(ParameterError, match="either the text or the answer"):
        mail.Letter(to=["oda@mail.test"])


AMOUNT = mail.MailAnswer(value=96.5, about="What do they cost in all?")
FAMILY = mail.MailAnswer(
    value="Apidae", about="Which family does the honey bee belong to, not wasps?"
)


@pytest.mark.parametrize(
    ("answer", "body"),
    [
        (AMOUNT, "It is $96,50."),
        (AMOUNT, "96.5"),
        (AMOUNT, "Hi Ada,\n\nthey cost 96.50 dollars in all.\n\nBest regards,\nRobin\n> 12?"),
        (mail.MailAnswer(value=1200.0, about=""), "$1,200"),
        (FAMILY, "The honey bee does belong to the family APIDAE!"),
        (FAMILY, "Dear Eva, thank you for your mail. Apidae. Greetings, Robin"),
        (mail.MailAnswer(value="45", about=""), "no.45".removeprefix("no.")),
    ],
)
def test_an_answer_may_stand_in_a_polite_sentence(answer: mail.MailAnswer, body: str) -> None:
    assert list(answer.problems(mail.own_text(body))) == []


@pytest.mark.parametrize(
    ("answer", "body"),
    [
        (AMOUNT, "It is 196.50."),
        (AMOUNT, "It is 96.501 or -96.50"),
        (AMOUNT, "I do not know.\n> 96.50?"),
        (AMOUNT, "$96.50, or $80.00"),
        (AMOUNT, "It isn't 96.50."),
        (FAMILY, "It is certainly not Apidae."),
        (FAMILY, "Not Apidae"),
        (FAMILY, "Apidae, but that is wrong."),
        (FAMILY, "Is it Apidae?"),
        (FAMILY, "Apidae, Vespidae, Sphecidae"),
        (FAMILY, "anything but Apidae"),
        (FAMILY, "Apidae \N{CROSS MARK}"),
        (mail.MailAnswer(value="45", about=""), "It is 45.50."),
        (mail.MailAnswer(value="45", about=""), "It is 1452."),
        (mail.MailAnswer(value="45", about=""), "It is 0,45"),
    ],
)
def test_an_answer_that_is_denied_or_stands_beside_others_is_wrong(
    answer: mail.MailAnswer, body: str
) -> None:
    assert list(answer.problems(mail.own_text(body))) != []


RECEIVED = mail.message(
    "x1", ("Ada", "ada@mail.test"), "Numbers", "One.\n\nTwo.", "2026-03-01T12:00"
)
PASSED = "---------- Forwarded message ----------\nFrom: Ada <ada@mail.test>\nSubject: Numbers"


@pytest.mark.parametrize(
    ("body", "is_right"),
    [
        ("Please read this.\n\nOne.\n\nTwo.", True),
        ("please READ  this.\n\n> One.\n>\n> Two.", True),
        (f"Please read this.\n\n{PASSED}\n\nOne.\n\nTwo.", True),
        ("One.\n\nTwo.\nPlease read this.", False),
        ("Please read this.\nTwo.", False),
        ("Do not please read this.\nOne. Two.", False),
        ("Please read this.\nOne. Two. Forget it.", False),
    ],
)
def test_a_mail_is_passed_on_below_a_text(machine: Machine, body: str, is_right: bool) -> None:
    mail.store(machine, ["oda@mail.test"], "", body)
    letter = mail.Letter(to=["oda@mail.test"], text="Please read this.", passes_on=RECEIVED)
    assert (list(mail.problems(machine, sent=[letter])) == []) == is_right


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("Hello.\n\n bye \n\n> Dear Robin", []),
        ("Hello. Bye", ["the last line is 'Hello. Bye'"]),
        ("Hello.\nBye\n", []),
    ],
)
def test_the_last_line_stands_by_itself(machine: Machine, body: str, problem: list[str]) -> None:
    mail.store(machine, ["oda@mail.test"], "", body)
    letter = mail.Letter(to=["oda@mail.test"], text="Hello. Bye", last="Bye")
    assert list(mail.problems(machine, sent=[letter])) == problem


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


def test_the_letter_without_a_subject_takes_the_mail_that_fits_no_other(machine: Machine) -> None:
    anything = mail.Letter(to=["oda@mail.test"], text="Two jars, please.")
    mail.store(machine, ["oda@mail.test"], "Honey", "Two jars, please.")
    mail.store(machine, ["oda@mail.test"], "Bees", "Two jars, please.")
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
    letter = mail.Letter(to=["jun@mail.test"], cc=[due], text="")
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
