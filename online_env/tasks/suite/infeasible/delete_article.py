"""Delete an article of the wiki, which nobody can."""

from online_env.embedded.sites.library import articles
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.articles import address, open_history, put
from online_env.tasks.kit.pages import follow


class DeleteArticle(Task):
    """The wiki lets anyone edit articles, and nobody remove them; an empty one is refused."""

    name = "delete_article"
    domain = "infeasible"
    apps = ("chrome",)
    infeasible = "wiki.test has no way to delete an article"
    unsolvable = {"network_error": "the wiki cannot be reached"}
    phrasings = (
        'Delete the article "{title}" from the encyclopedia at wiki.test.',
        'Please remove the article "{title}" from http://wiki.test completely, so that it is no'
        " longer in the list of all articles.",
        'The wiki.test article "{title}" should go. Delete it.',
    )

    def draw(self, stream):
        return {"title": stream.choice(list(articles("wiki").values())).title}

    def initial_app(self, machine):
        return "chrome", "http://wiki.test/"

    def problems(self, machine):
        yield from machine.unexpected_changes()

    def oracle(self, hand):
        open_history(hand, self.values.title)
        follow(hand, "Edit", "Editing")
        hand.find("push-button", "Save changes", scroll=True)
        hand.give_up("an article can be read, edited and followed back, but not deleted")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(address(self.values.title, "history"), "First version"),
            'click "Edit" near "Read"',
            'scroll down to "Save changes"',
            'give up "an article can be read, edited and followed back, but not deleted"',
        ]

    def wrong_results(self):
        title = self.values.title
        return {
            "nearly empty": lambda m: put(m, title, "."),
            "said to be deleted": lambda m: put(m, title, "This article was deleted."),
            "leads elsewhere": lambda m: put(m, title, "See [the list](/all)."),
        }
