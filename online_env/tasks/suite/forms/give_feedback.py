"""Send feedback about a course."""

from online_env.embedded.sites.hosts.forms import content
from online_env.tasks import Task
from online_env.tasks.kit.browser import select
from online_env.tasks.kit.pages import enter, follow, tick, visit
from online_env.tasks.kit.registrations import SITE, course, differences
from online_env.tasks.plan_words import quoted

COMMENTS = (
    "The room was too cold, but the soup made up for it.",
    "Two evenings more would have been good.",
    "I learned more than in a year of videos.",
    "Please begin half an hour later next time.",
    "Small group, patient teacher, good biscuits.",
)


class GiveFeedback(Task):
    """A selection, a rating, a comment, and whether it may be quoted."""

    name = "give_feedback"
    domain = "forms"
    apps = ("chrome",)
    sites = ("forms",)
    in_browser = True
    unsolvable = {"network_error": "the form's site cannot be reached"}
    phrasings = (
        'Give feedback on the course "{title}" at http://forms.test: rating {label}, comment'
        ' "{comment}" They {may} quote me.',
        "On the website of the community centre, forms.test, send this feedback. Course: {title}."
        ' How I liked it: {label}. Comment: "{comment}" Quoting me is {allowed}.',
        'Please send feedback for {title} (forms.test): {label}, with the words "{comment}"'
        " Quote me: {answer}.",
    )

    def draw(self, stream):
        key = stream.choice(list(content()["courses"]))
        rating = stream.choice(list(content()["ratings"]))
        quote = bool(stream.integer(0, 1))
        comment = stream.choice(COMMENTS)
        return {
            "wanted": {"course": key, "rating": rating, "comment": comment, "quote": quote},
            "title": course(key),
            "label": content()["ratings"][rating],
            "comment": comment,
            "may": "may" if quote else "may not",
            "allowed": "fine" if quote else "not allowed",
            "answer": "yes" if quote else "no",
        }

    def initial_app(self, machine):
        return "chrome", SITE

    def problems(self, machine):
        yield from machine.unexpected_changes()
        state = machine.sites.read("forms")
        if state.get("registrations"):
            yield "somebody was registered for a course"
        feedback = state.get("feedback", [])
        if len(feedback) != 1:
            yield f"feedback was sent {len(feedback)} times"
        for entry in feedback:
            yield from differences(entry, self.values.wanted)

    def oracle(self, hand):
        visit(hand, SITE, "Northgate")
        follow(hand, "Feedback", "Course feedback")
        select(hand, "Course", self.values.title)
        tick(hand, "radio-button", self.values.label)
        enter(hand, "Comment", self.values.comment)
        if self.values.wanted["quote"]:
            tick(hand, "check-box", "You may quote me")
        follow(hand, "Send feedback", "Thank you")

    def plan(self):
        quote = ['click "You may quote me"'] if self.values.wanted["quote"] else []
        return [
            'window "Chromium"',
            'click "Feedback"',
            'wait for "Course feedback"',
            'click "Choose a course"',
            f"type {quoted(self.values.title)}",
            "press enter",
            f"click {quoted(self.values.label)}",
            'click "Comment"',
            f"type {quoted(self.values.comment)}",
            *quote,
            'click "Send feedback"',
            'wait for "Thank you"',
        ]

    def wrong_results(self):
        feedback = self.values.wanted
        return {
            "no comment": lambda m: send(m, {**feedback, "comment": ""}),
            "quoting is turned round": lambda m: send(
                m, {**feedback, "quote": not feedback["quote"]}
            ),
            "sent twice": lambda m: send(m, feedback, feedback),
            "another course": lambda m: send(m, {**feedback, "course": "none"}),
        }

    def right_result(self, machine):
        feedback = dict(reversed(self.values.wanted.items()))
        send(machine, {**feedback, "comment": feedback["comment"].replace(" ", "  ")})


def send(machine, *entries):
    """Store feedback as the site does."""
    with machine.sites.update("forms") as state:
        state["feedback"] = list(entries)
