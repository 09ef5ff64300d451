"""The figure of the README: the clean screen, then the nine, with their names and what they cost.

`python docs/site/figure.py` writes docs/images/nine.webp from the recordings and the published
report. Its gaps are transparent, and it looks the same on light and dark pages.
"""

from pathlib import Path

import pictures
from corruption_pages import TEXTS
from PIL import Image, ImageDraw, ImageFont

import hijack_data as hj
from online_env.report.build import read_report

ROOT = Path(__file__).resolve().parents[2]
FIGURE = ROOT / "docs" / "images" / "nine.webp"
REPORT = ROOT / "docs" / "results" / "reference_agents" / "report.json"
FONT = ROOT / "hijack_data" / "fonts" / "DejaVuSans.ttf"
AGENT = "pixel"
NINE = hj.corruption_names()[:9]
TILE, GAP, COLUMNS = (492, 277), 12, 3  # width and height, in pixels
PANEL, TEXT = (30, 38, 52), (240, 243, 248)


def solved() -> dict[str, int]:
    """Tasks that the agent solves, in percent, by condition."""
    report = read_report(REPORT)
    cells = {label: report.cell(AGENT, label) for label in report.labels}
    return {
        label: round(100 * cell.success)
        for label, cell in cells.items()
        if cell is not None and cell.success is not None
    }


def tile(name: str, share: int) -> Image.Image:
    """One condition on its screen, with its name and what is solved under it."""
    screen = pictures.shot(pictures.screen_of(name))
    pixels, title = screen.pixels, "Clean"
    if name != "clean":
        pixels = pictures.corrupted(hj.make_corruption(name), screen, pictures.SEED)
        title = TEXTS[name]["title"]
    picture = Image.fromarray(pixels).resize(TILE, Image.Resampling.LANCZOS)
    draw, font = ImageDraw.Draw(picture), ImageFont.truetype(FONT, 25)
    text = f"{title}: {share} %"
    width = round(draw.textlength(text, font)) + 24
    draw.rectangle((0, 0, width, 40), PANEL)
    draw.text((12, 20), text, TEXT, font, anchor="lm")
    return picture


def panel(shares: dict[str, int]) -> Image.Image:
    """What the numbers are, on two tiles."""
    corrupted = [share for label, share in shares.items() if label != "clean"]
    picture = Image.new("RGB", (2 * TILE[0] + GAP, TILE[1]), PANEL)
    draw = ImageDraw.Draw(picture)
    arrow = "\N{RIGHTWARDS ARROW}"
    lines = (
        (80, 66, f"{shares['clean']} %  {arrow}  {min(corrupted)} to {max(corrupted)} %"),
        (168, 29, "Tasks solved by an agent that reads the screen by OCR:"),
        (212, 29, "on a clean desktop, and under each of the nine corruptions."),
    )
    for y, size, text in lines:
        draw.text((40, y), text, TEXT, ImageFont.truetype(FONT, size), anchor="lm")
    return picture


def main() -> None:
    """Write the figure."""
    shares = solved()
    rows = 1 + len(NINE) // COLUMNS
    size = (TILE[0] + GAP) * COLUMNS - GAP, (TILE[1] + GAP) * rows - GAP
    whole = Image.new("RGBA", size)
    whole.paste(tile("clean", shares["clean"]), (0, 0))
    whole.paste(panel(shares), (TILE[0] + GAP, 0))
    for place, name in enumerate(NINE, COLUMNS):
        row, column = divmod(place, COLUMNS)
        whole.paste(tile(name, shares[name]), (column * (TILE[0] + GAP), row * (TILE[1] + GAP)))
    whole.save(FIGURE, "WEBP", quality=80, method=6)


if __name__ == "__main__":
    main()
