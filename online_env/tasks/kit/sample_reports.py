"""Short reports that seeds draw: paragraphs, lines that introduce a part, and things to bring."""

from typing import Any

from hijack_data.rng import Stream

from .word_lists import CITIES, FIRST_NAMES, GOODS, LAST_NAMES, MONTHS, sample

OCCASIONS = ("Harbour walk", "Autumn fair", "Chess weekend", "Museum night", "Boat repair")
PARTS = ("Where we meet", "What it costs", "Who takes part", "How we travel", "If it rains")
SENTENCES = {
    "Where we meet": "The group meets in front of the station of {city} at {hour} o'clock sharp.",
    "What it costs": "Everybody pays {price} euros on the day, and {person} collects the money.",
    "Who takes part": "So far {count} people have put their names down, two of them children.",
    "How we travel": "There is a slow train in the morning, and {person} knows the timetable.",
    "If it rains": "The {thing} stays dry under the bridge, so the plan stands in any weather.",
}
CLOSING = "Questions go to {person}, who answers the telephone after {hour} in the evening."


def report(stream: Stream) -> dict[str, Any]:
    """Return a drawn report.

    It has the keys `title`, `file`, `path`, `person`, `paragraphs` (all texts after the title, in
    order), `lines` (those that introduce a part), `bodies` (the sentence below each of them) and
    `items` (the things to bring, at the end).
    """
    occasion = stream.choice(OCCASIONS)
    city = stream.choice(CITIES)
    person = f"{stream.choice(FIRST_NAMES)} {stream.choice(LAST_NAMES)}"
    goods = sample(stream, GOODS, stream.integer(3, 5))
    words = {
        "city": city,
        "person": person,
        "hour": stream.integer(5, 9),
        "price": stream.integer(11, 48),
        "count": stream.integer(7, 23),
        "thing": goods[0],
    }
    lines = sample(stream, PARTS, 3)
    bodies = [SENTENCES[line].format(**words) for line in lines]
    items = [f"one {item} for {stream.integer(2, 9)} people" for item in goods]
    start = f"This letter is about the {occasion.lower()} near {city}, planned by {person}."
    pairs = [text for pair in zip(lines, bodies, strict=True) for text in pair]
    month = stream.choice(MONTHS)
    file = f"{occasion.lower().replace(' ', '-')}-{month.lower()}.docx"
    return {
        "title": f"{occasion} in {month}",
        "file": file,
        "path": f"Documents/{file}",
        "person": person,
        "lines": lines,
        "bodies": bodies,
        "items": items,
        "paragraphs": [start, *pairs, CLOSING.format(**words), "Please bring:", *items],
    }
