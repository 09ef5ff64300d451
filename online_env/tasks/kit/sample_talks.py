"""Short talks that seeds draw: slides with a title and a text."""

from typing import Any

from hijack_data.rng import Stream

from .word_lists import CITIES, GOODS, sample, shuffled

PARTS = {
    "Why {city}": "Friendly people\nA river and two hills\nGood bread",
    "Getting there": "By train from {city} north\nOn foot from the harbour",
    "A day in {city}": "Market in the morning\nMuseum at noon\nMusic at night",
    "What we paid": "{price} euros a night\nThe {thing} was free",
    "Mistakes": "No {thing} in the bag\nNo map of {city}",
    "The neighbours": "They own a {thing}\nThey sing on Sundays",
    "Weather": "Rain on {count} days\nFog over {city} on the others",
    "Thanks": "To the people of {city}\nAnd to the {thing}",
}


def talk(stream: Stream) -> dict[str, Any]:
    """Return a drawn talk.

    It has the keys `file`, `path`, `city`, `slides` (title and text of each) and `spare` (a title
    that no slide has).
    """
    city = stream.choice(CITIES)
    words = {
        "city": city,
        "price": stream.integer(30, 90),
        "count": stream.integer(3, 9),
        "thing": stream.choice(GOODS),
    }
    parts = shuffled(stream, list(PARTS))
    spare = parts.pop().format(**words)
    kept = sample(stream, parts, stream.integer(4, 5))
    slides = [(title.format(**words), PARTS[title].format(**words)) for title in kept]
    file = f"{city.lower()}-{stream.integer(2019, 2025)}.pptx"
    return {
        "file": file,
        "path": f"Documents/{file}",
        "city": city,
        "slides": [(f"Our trip to {city}", f"{words['count']} days with a bag"), *slides],
        "spare": spare,
    }
