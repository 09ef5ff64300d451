"""A chat agent and a real vision model: a Qwen2.5-VL of some thousand random parameters with its
real processor, made here and served over HTTP."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")

from online_env.bench.episodes import play
from online_env.bench.jobs import Job

from support.chatting import agent_of
from support.endpoints import serving
from support.episodes import make as make_env

torch = pytest.importorskip("torch", reason="needs the extra [train]")
transformers = pytest.importorskip("transformers", reason="needs the extra [train]")
pytestmark = pytest.mark.usefixtures("no_waiting")
SPECIAL = [
    "<|endoftext|>",
    "<|im_start|>",
    "<|im_end|>",
    "<|vision_start|>",
    "<|vision_end|>",
    "<|image_pad|>",
    "<|video_pad|>",
]
PIXELS = {"min_pixels": 784, "max_pixels": 28 * 28 * 60}
TEMPLATE = (
    "{% for m in messages %}<|im_start|>{{ m['role'] }}\n"
    "{% if m['content'] is string %}{{ m['content'] }}{% else %}{% for c in m['content'] %}"
    "{% if c['type'] == 'image' %}<|vision_start|><|image_pad|><|vision_end|>"
    "{% else %}{{ c['text'] }}{% endif %}{% endfor %}{% endif %}<|im_end|>\n{% endfor %}"
    "<|im_start|>assistant\n"
)


def words():
    """A tokenizer with a token for each byte, and Qwen's special tokens."""
    from tokenizers import pre_tokenizers

    letters = sorted(pre_tokenizers.ByteLevel.alphabet())
    qwen2_tokenizer = transformers.Qwen2Tokenizer(
        vocab={letter: number for number, letter in enumerate(letters)},
        merges=[],
        eos_token="<|im_end|>",
        pad_token="<|endoftext|>",
        unk_token=None,
    )
    qwen2_tokenizer.add_special_tokens({"additional_special_tokens": SPECIAL})
    return qwen2_tokenizer


class TinyModel:
    """Answers requests in the form of chat completions."""

    def __init__(self):
        size = {"shortest_edge": PIXELS["min_pixels"], "longest_edge": PIXELS["max_pixels"]}
        self.words = words()
        self.processor = transformers.Qwen2_5_VLProcessor(
            transformers.Qwen2VLImageProcessor(size=size),
            self.words,
            transformers.Qwen2VLVideoProcessor(),
            chat_template=TEMPLATE,
        )
        torch.manual_seed(0)
        self.net = transformers.Qwen2_5_VLForConditionalGeneration(self.config()).eval()
        self.seen = []  # (height, width) of the last picture of each request, as the model has it

    def config(self):
        at = self.words.convert_tokens_to_ids
        text = {
            "vocab_size": len(self.words),
            "hidden_size": 32,
            "intermediate_size": 64,
            "num_hidden_layers": 2,
            "num_attention_heads": 2,
            "num_key_value_heads": 1,
            "max_position_embeddings": 8192,
            "eos_token_id": at("<|im_end|>"),
            "bos_token_id": None,
            "pad_token_id": at("<|endoftext|>"),
            "rope_parameters": {
                "rope_type": "default",
                "rope_theta": 10_000.0,
                "mrope_section": [2, 3, 3],
            },
        }
        vision = {
            "depth": 2,
            "hidden_size": 32,
            "intermediate_size": 64,
            "num_heads": 2,
            "out_hidden_size": 32,
            "fullatt_block_indexes": [1],
        }
        return transformers.Qwen2_5_VLConfig(
            text_config=text,
            vision_config=vision,
            image_token_id=at("<|image_pad|>"),
            video_token_id=at("<|video_pad|>"),
            vision_start_token_id=at("<|vision_start|>"),
            vision_end_token_id=at("<|vision_end|>"),
        )

    def __call__(self, body):
        talk = [_plain(message) for message in body["messages"]]
        inputs = self.processor.apply_chat_template(
            talk, tokenize=True, return_dict=True, return_tensors="pt"
        )
        _, rows, columns = inputs["image_grid_thw"][-1].tolist()
        self.seen.append((rows * 14, columns * 14))
        with torch.no_grad():
            result = self.net.generate(
                **inputs,
                max_new_tokens=min(8, body["max_tokens"]),
                do_sample=True,
                temperature=body["temperature"],
                top_p=body["top_p"],
            )
        return self.words.decode(result[0, inputs["input_ids"].shape[1] :])


class AimingModel(TinyModel):
    """Says what a trained one would: a click at the middle of the picture that the model has."""

    def __call__(self, body):
        super().__call__(body)
        height, width = self.seen[-1]
        point = f"<|box_start|>({width // 2},{height // 2})<|box_end|>"
        return f"Thought: the middle\nAction: click(start_box='{point}')"


def _plain(message):
    if isinstance(message["content"], str):
        return message
    return {"role": message["role"], "content": [_part(part) for part in message["content"]]}


def _part(part):
    if part["type"] == "text":
        return part
    data = base64.b64decode(part["image_url"]["url"].rpartition(",")[2])
    return {"type": "image", "image": Image.open(io.BytesIO(data)).convert("RGB")}


def agent(tmp_path, url):
    keys = {"prompt": "ui_tars_1.5", "parser": "ui_tars_1.5", "timeout": 60, "history": 2}
    return agent_of(tmp_path, url, **keys, **PIXELS)


def test_a_model_that_babbles_plays_an_episode_to_its_end(tmp_path):
    tiny = TinyModel()
    with serving(tiny) as endpoint:
        env, _ = make_env(max_steps=3)
        result = agent(tmp_path, endpoint.url)
        record = play(env, result, Job("agent", "t", "clean", 0), 0, None)
    assert (record["status"], record["ended"], record["steps"]) == ("ok", "max_steps", 3)
    assert record["malformed"] == 3
    assert len(tiny.seen) == 3


@pytest.mark.parametrize("size", [(360, 640), (300, 500), (61, 999)])
def test_clicks_land_where_the_model_aims_in_its_own_picture(tmp_path, size):
    noise = np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)
    tiny = AimingModel()
    with serving(tiny) as endpoint:
        result = agent(tmp_path, endpoint.url)
        _, [action] = result.predict("do it", {"screenshot": noise})
    assert tiny.seen == [result._parser.model_size(size)], "our smart_resize is the processor's"
    assert tiny.seen != [size]
    x, y = map(int, action.removeprefix("pyautogui.click(").removesuffix(")").split(", "))
    assert abs(x - size[1] / 2) <= 1 + size[1] / tiny.seen[0][1]
    assert abs(y - size[0] / 2) <= 1 + size[0] / tiny.seen[0][0]
