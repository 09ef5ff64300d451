"""One training example, before a writer gives it the form of an export format."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hijack_data.errors import ActionError

from ..building.splits import TRAIN
from ..dataset.columns import VISIBLE, Row
from ..prompts import question

# Placeholders that trainers replace by pictures, videos and sounds, and special tokens that end
# turns or mark pictures in chat models. In a text they would stand for a picture that is not there,
# or end the turn.
_SPECIAL = re.compile(
    r"<(?=\|[A-Za-z0-9_]+\|>"  # Qwen, Llama, Phi, GPT: <|im_end|>, <|image_pad|>
    r"|/?(?:image|video|audio|img|IMG_CONTEXT|s|pad|bos|eos|unk)>"
    r"|(?:start|end)_of_(?:turn|image)>|image_soft_token>)"
    r"|\[(?=/?INST\]|/?IMG(?:_BREAK|_END)?\])"
)
IMAGE = "<image>"
HISTORY = (
    "The first picture is the screen before your last action, the second the screen now. Your last"
    " action:"
)


@dataclass(frozen=True)
class PreviousStep:
    """The step before an example, where only both together show what happened.

    Args:
        png: the bytes of its screenshot.
        answer: its action as text.
    """

    png: bytes
    answer: str


@dataclass(frozen=True)
class Example:
    """A screenshot, the question about it, and the answer.

    Args:
        key: `SHARD-NUMBER`, unique.
        row: the row of the dataset without its screenshot.
        answer_form: the sentence about the form of the answer.
        answer: the action as text.
        png: the bytes of the screenshot.
        dialect: the dialect of the answer.
        previous: the step before, if the row follows an action that a fault of the input concerns.
        split: the split of the row.
    """

    key: str
    row: Row
    answer_form: str
    answer: str
    png: bytes
    dialect: str = "pyautogui"
    previous: PreviousStep | None = None
    split: str = TRAIN

    @property
    def question(self) -> str:
        """The user's message: the place of the picture, the task, and how to answer."""
        return f"{IMAGE}\n{question(escape_tokens(self.row['instruction']), self.answer_form)}"

    @property
    def question_with_history(self) -> str:
        """The user's message about `pictures`: as `question`, with the step before if known."""
        if self.previous is None:
            return self.question
        history = f"{HISTORY} {self.previous.answer}\n{self.answer_form}"
        return f"{IMAGE}\n{IMAGE}\n{question(escape_tokens(self.row['instruction']), history)}"

    @property
    def pictures(self) -> tuple[bytes, ...]:
        """The pictures of `question_with_history`, PNG, in their order."""
        return (self.png,) if self.previous is None else (self.previous.png, self.png)

    @property
    def about(self) -> Row:
        """The columns of the row that are kept as metadata of the example."""
        return {name: self.row[name] for name in ABOUT}


ABOUT = (
    "id",
    "trajectory_id",
    "step",
    "source",
    "domain",
    "corruption",
    "severity",
    "fidelity",
    "width",
    "height",
    "target_box",
    "target_visible",
    "plan_digest",
    "image_sha256",
)


def is_hidden(row: Row) -> bool:
    """Return whether too little of the row's target shows for its action to be a label."""
    visible = row["target_visible"]
    return visible is not None and visible < VISIBLE


def escape_tokens(text: str) -> str:
    """Return text without placeholders and special tokens: `<image>` becomes `< image>`."""
    return _SPECIAL.sub(lambda match: f"{match[0]} ", text)


def checked_answer(text: str) -> str:
    """Check an answer, and return it unchanged, since escaping would change the label.

    Raises:
        ActionError: the answer contains a placeholder or a special token of chat models.
    """
    match = _SPECIAL.search(text)
    if match is None:
        return text
    token_match = re.match(r"[^>\]]*[>\]]", text[match.start() :])
    token = token_match[0] if token_match else ""
    raise ActionError(f"the answer holds {token}, which is a token of chat models")


def check_task(row: Row) -> None:
    """Check that a row has an instruction, without which there is no question.

    Raises:
        ActionError: the row has no instruction.
    """
    if not str(row["instruction"]).strip():
        raise ActionError("the instruction is empty")


def ground_truth(example: Example) -> Mapping[str, Any]:
    """Return the facts that a reward function needs."""
    return {
        "answer": example.answer,
        "action": example.row["action"],
        "target_box": example.row["target_box"],
    }
