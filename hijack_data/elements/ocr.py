"""Read lines of text from the picture with RapidOCR.

Its wheel carries the PP-OCR models; nothing is downloaded. Where OpenVINO is installed, it finds
the lines: on a processor with AVX-512 in a third of the processor time of ONNX Runtime, on one
without in no less. Both find the same.
"""

import os
from functools import lru_cache
from typing import Any, cast

import numpy as np

from .. import extras
from ..types import as_boxes, clip_boxes
from .base import Elements
from .picture_pixels import image_pixels

# RapidOCR shrinks what is larger than this.
MAX_SIDE = 2000
# A picture that is lower or narrower than this cannot be a screen; RapidOCR would fail on it, or
# enlarge it without end.
MIN_SIDE = 8
MAX_RATIO = 20
# With more threads than half the cores, threads spin while waiting for each other: on a busy
# machine with two cores, two threads took 1.4 times the processor time of one, and three times as
# long.
MAX_THREADS = 4


def boxes_from_ocr(image: object) -> Elements:
    """Find the lines of text of a screenshot, and what they say.

    Args:
        image: one uint8 RGB picture: `[H, W, 3]`, a torch tensor `[3, H, W]` or a PIL image.
            RapidOCR shrinks what is larger than `MAX_SIDE`, so small print on a 4K screen may be
            missed.

    Returns one box per line, with the text as its name and the role `"text"`. The first call loads
    the models (about a second), later calls in the same process reuse them.

    Raises:
        ImageError: the picture has another shape.
        ImageTypeError: the picture is of another kind or dtype.
        MissingDependencyError: RapidOCR is not installed.
    """
    pixels = image_pixels(image)
    height, width = pixels.shape[:2]
    engine = _engine(os.getpid())
    readable = min(height, width) >= max(MIN_SIDE, max(height, width) / MAX_RATIO)
    result = engine(np.ascontiguousarray(pixels[..., ::-1])) if readable else None
    corners = getattr(result, "boxes", None)  # [N, 4 corners, x and y], or None
    if result is None or corners is None:
        return Elements(source="ocr", notes=("no text was found in the picture",))
    places = np.asarray(corners, np.float64)
    boxes = np.concatenate([np.floor(places.min(1)), np.ceil(places.max(1))], 1)
    names = tuple(cast("tuple[str, ...]", result.txts))
    return Elements(
        clip_boxes(as_boxes(boxes), (height, width)), names, ("text",) * len(names), "ocr"
    )


@lru_cache(maxsize=1)
def _engine(process: int) -> Any:
    """Load the models, once per process, because an ONNX session does not survive a fork."""
    try:
        import onnxruntime  # noqa: F401  # pyright: ignore
        from rapidocr import EngineType, RapidOCR  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]
    except ImportError:
        problem = extras.missing("reading text needs RapidOCR", "ocr")
        raise problem from None
    params: dict[str, Any] = {
        "Global.log_level": "critical",
        "EngineConfig.onnxruntime.intra_op_num_threads": threads(),
        "Global.max_side_len": MAX_SIDE,
        "Global.use_cls": False,  # lines on a screen are upright
        # By default a strip is enlarged to a height of 736 pixels.
        "Det.limit_side_len": MIN_SIDE * 8,
    }
    if not has_openvino():
        return cast("Any", RapidOCR)(params=params)
    params["Det.engine_type"] = EngineType.OPENVINO
    engine = cast("Any", RapidOCR)(params=params)
    engine(np.zeros((MIN_SIDE * 8, MIN_SIDE * 8, 3), np.uint8))  # it loads its model only now
    _compile(engine.text_det.session)
    return engine


def has_openvino() -> bool:
    """Return whether OpenVINO is installed, which then finds the lines."""
    return not extras.lacking(("openvino",))


def threads() -> int:
    """Return how many threads read a picture."""
    return max(1, min(MAX_THREADS, (os.cpu_count() or 1) // 2))


def _compile(finder: Any) -> None:
    """Compile the model that finds lines again: RapidOCR leaves two things to OpenVINO.

    It would compute in bfloat16 where the processor has it, and find other lines than elsewhere.
    And it would keep what it prepares for each size of a picture, some 4 MB, so the memory would
    grow with every new size.
    """
    import openvino

    options = {
        "INFERENCE_PRECISION_HINT": "f32",
        "INFERENCE_NUM_THREADS": threads(),
        "CPU_RUNTIME_CACHE_CAPACITY": 0,
    }
    compiled = openvino.Core().compile_model(finder.model, "CPU", options)
    finder.session = compiled.create_infer_request()
