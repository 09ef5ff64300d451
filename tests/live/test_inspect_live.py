"""Inspect and gymnasium on a real embedded desktop, with the code of docs/score_my_agent.md."""

import re

import numpy as np
import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)

from support.docs import ROOT, blocks_of

PAGE = ROOT / "docs" / "score_my_agent.md"
pytestmark = [pytest.mark.usefixtures("embedded_machine"), pytest.mark.filterwarnings("ignore")]


def block_with(words):
    [value] = [block.text for block in blocks_of(PAGE) if words in block.text]
    return value


def writer():
    """A model that does `write_note` without looking: its window is open, the text is in the
    instruction."""
    from inspect_ai.model import ModelOutput, ModelUsage

    def output(messages, tools, tool_choice, config):
        requests = next(message for message in messages if message.role == "user").text
        name = re.search(r"[a-z]+-\d\d\.txt", requests)[0]
        text = requests.partition("\n\n")[2]
        plan = [
            {"action": "left_click", "coordinate": [900, 500]},
            {"action": "type", "text": text},
            {"action": "key", "text": "ctrl+s"},
            {"action": "wait", "duration": 1},
            {"action": "key", "text": "alt+n"},
            {"action": "key", "text": "ctrl+a"},
            {"action": "type", "text": f"~/Documents/{name}"},
            {"action": "wait", "duration": 1},
            {"action": "key", "text": "Return"},
            {"action": "wait", "duration": 1},
        ]
        total = sum(message.role == "tool" for message in messages)
        call = ("submit", {"answer": "DONE"})
        if total < len(plan):
            call = ("computer", plan[total])
        result = ModelOutput.for_tool_call("mockllm/model", *call)
        result.usage = ModelUsage(input_tokens=1, output_tokens=1, total_tokens=2)
        return result

    return output


def test_inspect_plays_the_benchmark_on_real_desktops(tmp_path, monkeypatch):
    pytest.importorskip("inspect_ai", reason=needs.INSPECT)
    from inspect_ai.log import read_eval_log
    from inspect_ai.model import get_model

    monkeypatch.setenv("INSPECT_LOG_DIR", str(tmp_path))
    code = block_with("from inspect_ai import eval")
    model = get_model("mockllm/model", custom_outputs=writer(), memoize=False)
    names = {"the_model": model}
    exec(code.replace("get_model()", "the_model"), names)
    log = read_eval_log(names["log"].location, resolve_attachments=True)
    assert log.status == "success", log.error
    samples = {sample.id: sample for sample in log.samples}
    assert set(samples) == {"write_note-clean-s0", "write_note-marks-s0"}
    scores = {name: sample.scores["task_score"] for name, sample in samples.items()}
    records = [score.metadata["record"] for score in scores.values()]
    assert {name: score.value for name, score in scores.items()} == dict.fromkeys(samples, 1.0), [
        (record["reason"], record["problem"]) for record in records
    ]
    assert [(record["status"], record["ended"]) for record in records] == [("ok", "agent")] * 2
    pictures = {
        name: [
            part.image
            for message in sample.messages
            for part in message.content
            if not isinstance(part, str) and part.type == "image"
        ]
        for name, sample in samples.items()
    }
    assert {len(picture) for picture in pictures.values()} == {11}
    assert pictures["write_note-clean-s0"][0] != pictures["write_note-marks-s0"][0]


def test_the_page_plays_by_gymnasium(capsys):
    names = {}
    exec(block_with("gymnasium.make"), names)
    assert capsys.readouterr().out == "ok 0.0\n"
    assert names["obs"]["screenshot"].dtype == np.uint8
