"""The mailbox of mail.test: put mails into it, write, and judge what became of it."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

from hijack_data.errors import ParameterError

from ...embedded.sites.hosts import mail as site
from ..base import Task
from ..hand import Hand
from ..machine import Machine
from . import browser
from .assignment import best_assignment_problems
from .word_lists import FIRST_NAMES, even

INBOX = "http://mail.test/"
_QUOTED = re.compile(r"^> ?", re.MULTILINE)
Flags: TypeAlias = Mapping[str, object]


class MailTask(Task):
    """A task on the mailbox of mail.test, which is open at the start."""

    domain = "mail"
    apps = ("chrome",)
    sites = ("mail",)
    in_browser = True
    unsolvable: ClassVar = {"network_error": "the mailbox cannot be reached"}

    def initial_app(self, machine: Machine) -> Sequence[str]:
        """Return the browser with the inbox."""
        return "chrome", INBOX


@dataclass(frozen=True, kw_only=True)
class Letter:
    """What a sent mail, or a draft, should be.

    All that was written is judged, by `text` or by `answer`: no part of a mail is looked for while
    the rest may say anything.

    Args:
        to: Its recipients, in any order.
        cc: Who gets a copy, in any order.
        subject: Its subject in any case, or `None` for any.
        text: What was written, apart from quoted lines; letter case and spaces do not count.
        answer: What the mail should answer, and nothing else.
        last: What stands in the last line of what was written; `None` for any.
        passes_on: The received mail that stands as a whole below `text`, quoted or not, with the
            lines above it that the site writes or without them.

    Raises:
        ParameterError: Neither or both of `text` and `answer` are given.
    """

    to: Sequence[str]
    cc: Sequence[str] = ()
    subject: str | None = None
    text: str | None = None
    answer: "MailAnswer | None" = None
    last: str | None = None
    passes_on: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        if (self.text is None) == (self.answer is None):
            raise ParameterError("a Letter has either the text or the answer that should be in it")

    def problems(self, mail: Mapping[str, Any]) -> Iterator[str]:
        """Yield in what a mail, as the site stores it, differs."""
        for key, addresses in (("to", self.to), ("cc", self.cc)):
            if {a.lower() for a in mail[key]} != {a.lower() for a in addresses}:
                yield f"{key} is {', '.join(mail[key]) or 'empty'}"
        subject = mail["subject"]
        if self.subject is not None and even(subject) != even(self.subject):
            yield f"the subject is {subject!r}"
        text = own_text(mail["body"])
        if self.answer is not None:
            yield from self.answer.problems(text)
        elif self.passes_on is not None:
            full_text = even(_QUOTED.sub("", mail["body"]))
            bodies = (self.passes_on["body"], site.forwarded(self.passes_on)["body"])
            if full_text not in {even(f"{self.text} {body}") for body in bodies}:
                yield f"the mail is not the text and the mail to pass on: {full_text[:200]!r}"
        elif even(text) != even(self.text or ""):
            yield f"the text is {text[:200]!r}"
        last = text.rpartition("\n")[2]
        if self.last is not None and even(last) != even(self.last):
            yield f"the last line is {last!r}"


# The words of a polite sentence around an answer. None of them denies or doubts, or joins answers.
_POLITE_WORDS = """
a about according all altogether an and answer are as asked at be been best by called can comes cost
costs dear dollar dollars encyclopedia find for found from good greetings happy have hello helps
here hey hi hope i in into is it it's its just kind know let long looked love mail me more my of on
openfolio our price prices question quick regards reply said says see sincerely sum sure tell thank
thanks that that's the their there these they thing things this to today together total town up us
usd was we were what when where which who will with would yes you your yours robin hale
"""
_POLITE = frozenset(_POLITE_WORDS.split()) | {name.casefold() for name in FIRST_NAMES}
_DENIALS = {"no", "not", "never", "none", "nor", "neither", "without", "but", "except", "wrong"}
_PUNCTUATION = re.compile(r"[\w\s.,:;!$()*_'\"+-]*")


@dataclass(frozen=True, kw_only=True)
class MailAnswer:
    """An answer that stands alone in a free text.

    Beside it, a mail may have polite words and words of the question, and nothing else: no other
    number, no word that denies or doubts the answer, no second answer, no question mark.

    Args:
        value: A number such as `96.5` (then `$96.50` and `96,50 dollars` are right), or words, in
            any case.
        about: The question, and what else may be said, such as the sentence that has the answer.
    """

    value: str | float
    about: str

    def problems(self, body: str) -> Iterator[str]:
        """Yield why a text is not this answer alone."""
        text = even(body)
        remainder, count = self._pattern().subn(" ", text)
        if not count:
            yield f"{self.value} is missing"
        allowed_words = _POLITE | (frozenset(_words(even(self.about))) - _DENIALS)
        other_words = [word for word in _words(remainder) if word not in allowed_words]
        if other_words:
            yield f"beside the answer the mail says {' '.join(other_words)[:200]!r}"
        elif not _PUNCTUATION.fullmatch(remainder):
            yield f"the answer stands in {text[:200]!r}"

    def _pattern(self) -> re.Pattern[str]:
        if isinstance(self.value, str):
            value_pattern = re.escape(even(self.value))
        else:
            dollars, _, cents = f"{self.value:,.2f}".partition(".")
            dollars = dollars.replace(",", ",?")
            decimals = rf"[.,]{cents[0]}{cents[1] if cents[1] != '0' else '0?'}"
            value_pattern = dollars + (f"({decimals})?" if cents == "00" else decimals)
        before = r"(?<!\w)(?<!\d[.,])" + (r"(?<!-)" if value_pattern[0].isdigit() else "")
        return re.compile(rf"{before}{value_pattern}(?!\w)(?![.,]\d)")


def _words(text: str) -> list[str]:
    return re.findall(r"\w+(?:'\w+)*", text)


def own_text(body: str) -> str:
    """Return the body of a mail without the lines that quote another one."""
    lines = [line for line in body.splitlines() if not line.startswith(">")]
    return "\n".join(lines).strip()


def numbers(text: str) -> set[float]:
    """Return the numbers in a text, such as `96.5` of `$96,50`; none has separated thousands."""
    return {float(number.replace(",", ".")) for number in re.findall(r"\d+(?:[.,]\d+)?", text)}


# Behind the screen


def message(
    ident: str, sender: tuple[str, str], subject: str, body: str, date: str, **flags: object
) -> dict[str, Any]:
    """Return a received mail for `receive`.

    Args:
        ident: Its id; letters and digits.
        sender: Name and address.
        subject: Its subject.
        body: Its text.
        date: When it came, in February or March 2026, such as `2026-03-03T10:05`.
        **flags: `read`, `starred` or `folder`, if they are not those of a new mail.
    """
    name, address = sender
    return {
        "id": ident,
        "from": {"name": name, "address": address},
        "subject": subject,
        "body": body,
        "date": date,
        **flags,
    }


def receive(machine: Machine, *messages: Mapping[str, Any]) -> None:
    """Put mails into the mailbox."""
    with machine.sites.update("mail") as state:
        state.setdefault("received", []).extend(dict(mail) for mail in messages)


def flag(machine: Machine, *idents: str, **flags: object) -> None:
    """Change the flags of received mails: `read`, `starred`, `folder`."""
    with machine.sites.update("mail") as state:
        for ident in idents:
            state.setdefault("flags", {}).setdefault(ident, {}).update(flags)


def store(
    machine: Machine,
    to: Sequence[str],
    subject: str,
    body: str,
    *,
    cc: Sequence[str] = (),
    folder: str = "sent",
) -> None:
    """Store a sent mail, or one of the `drafts`, as the site does."""
    with machine.sites.update("mail") as state:
        state["count"] = state.get("count", 0) + 1
        message = {"to": list(to), "cc": list(cc), "subject": subject, "body": body}
        state.setdefault(folder, []).append({"id": f"s{state['count']:02d}", **message})


# The judgement


def problems(
    machine: Machine,
    sent: Sequence[Letter] = (),
    drafts: Sequence[Letter] = (),
    flags: Mapping[str, Flags] | None = None,
    finished: Sequence[str] = (),
) -> Iterator[str]:
    """Yield how the mailbox differs from the expected one: as before, apart from the arguments.

    A mail that was unread may be read; the ids of drafts do not count, since saving one without a
    change gives it another.

    Args:
        machine: It knows the state from before.
        sent: The mails that should have been sent since, in any order.
        drafts: The drafts that should have been saved since.
        flags: The flags that mails should have now, by their ids.
        finished: The ids of drafts that should be gone.
    """
    before = machine.before.sites["mail"]
    after = machine.sites.read("mail")
    yield from _flag_problems(before, after, flags or {})
    yield from _letter_problems("mail", before.get("sent", []), after.get("sent", []), sent)
    drafts_before = [draft for draft in before.get("drafts", []) if draft["id"] not in finished]
    yield from _letter_problems("draft", drafts_before, after.get("drafts", []), drafts)


def _flag_problems(
    before: Mapping[str, Any], after: Mapping[str, Any], expected: Mapping[str, Flags]
) -> Iterator[str]:
    """Yield received mails with flags that they should not have."""
    was = {mail["id"]: mail for mail in site.received(dict(before))}
    for mail in site.received(dict(after)):
        old = was[mail["id"]]
        flags = {"folder": old["folder"], "starred": old["starred"]}
        if old["read"]:
            flags["read"] = True
        for key, value in {**flags, **expected.get(old["id"], {})}.items():
            if mail[key] != value:
                yield f"{key} of {mail['subject']!r} is {mail[key]!r}"


def _letter_problems(
    kind: str,
    before: Sequence[Mapping[str, Any]],
    after: Sequence[Mapping[str, Any]],
    expected: Sequence[Letter],
) -> Iterator[str]:
    """Yield what is wrong with the mails, or drafts, that were written."""
    new = [{**mail, "id": ""} for mail in after]
    for old in before:
        unchanged = {**old, "id": ""}
        if unchanged in new:
            new.remove(unchanged)
        else:
            yield f"a {kind} from before is gone or was changed"
    if len(new) != len(expected):
        yield f"{len(new)} new {kind}s, not {len(expected)}"
        return
    problem_table = [[list(letter.problems(mail)) for letter in expected] for mail in new]
    yield from best_assignment_problems(problem_table)


# On the screen


def open_mail(hand: Hand, sender: str, subject: str) -> None:
    """Open a mail of the list that shows."""
    browser.follow(hand, browser.starting(sender, subject), subject)


def search(hand: Hand, words: str) -> None:
    """Look for mails with certain words."""
    browser.enter(hand, "Search mail", words)
    hand.press("enter")
    hand.find("heading", f"Search: {words}", app=browser.APP)


def compose(hand: Hand, *, to: str = "", cc: str = "", subject: str = "", text: str = "") -> None:
    """Fill the fields of the message that is open; those that get nothing stay as they are.

    The text comes above what is quoted.
    """
    hand.find("heading", "New message", app=browser.APP)
    hand.click_on(("combo-box", "entry"), "To", app=browser.APP)
    fields = (("To", to), ("Cc", cc), ("Subject", subject))
    for label, content in fields:
        # From field to field by the keyboard: a list of contacts may cover what is below.
        hand.find(("combo-box", "entry"), label, app=browser.APP, state="focused")
        if content:
            hand.replace(content)
        hand.press("tab")
    hand.find("entry", "Message", app=browser.APP, state="focused")
    if text:
        hand.press("ctrl", "home")
        hand.type(text)


def send(hand: Hand) -> None:
    """Send the message that is open."""
    browser.push(hand, "Send", "Sent")


def save_draft(hand: Hand) -> None:
    """Keep the message that is open as a draft."""
    browser.push(hand, "Save draft", "Drafts")


def lists(hand: Hand, sender: str, subject: str) -> bool:
    """Return whether the list that is open has a mail, on the screen or further down."""
    return browser.shows_text(hand, "link", browser.starting(sender, subject))
