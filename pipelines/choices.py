"""What users of builds and exports choose by name.

This module imports nothing: the command line shows the choices, and must not wait for the modules
that use them.
"""

PIXELS = "pixels"
FRACTIONS = "fractions"
THOUSAND = "thousand"
RESIZED = "resized"
COORDINATES = (PIXELS, FRACTIONS, THOUSAND, RESIZED)
XYWH = "xywh"
XYXY = "xyxy"
BOXES = (XYWH, XYXY)
LOCAL = "local"  # an engine
ONLOOKER = "onlooker"  # an export of three tables
# The other exports, and where their writers are.
EXPORTS = {
    "atif": "pipelines.exports.atif:AtifWriter",
    "chat": "pipelines.exports.chat:ChatWriter",
    "verl": "pipelines.exports.verl:VerlWriter",
    "webdataset": "pipelines.exports.webdataset:WebDatasetWriter",
}
DIALECTS = ("pyautogui", "ui_tars", "ui_tars_1.5")
SAMPLE = 3  # trajectories of each format on which `hijack inspect` tries corruptions
