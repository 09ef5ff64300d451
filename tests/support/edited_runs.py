"""Edits of a run that was recorded, as somebody makes them who wants another result."""

import json
import shutil

import numpy as np
from PIL import Image

from hijack_data import apply
from hijack_data.picture_io import pixel_sha256
from hijack_data.plan import Plan
from hijack_data.runs.run_head import config_digest
from hijack_data.runs.run_log import sha256_hex

from .recorded import IDS

CLEAN, MARKS, MINIMISED, HALF = IDS


def home(run, name=MARKS):
    return run / "episodes" / name


def read_lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def write_lines(path, rows):
    path.write_text("".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows))


def journal(edit):
    """Edit the records of the journal."""

    def tamper(run):
        rows = read_lines(run / "records.jsonl")
        write_lines(run / "records.jsonl", edit(rows) or rows)

    return tamper


def steps(edit, name=MARKS):
    """Edit the lines of an episode."""

    def tamper(run):
        rows = read_lines(home(run, name) / "steps.jsonl")
        write_lines(home(run, name) / "steps.jsonl", edit(rows) or rows)

    return tamper


def episode(name=MARKS, /, **changes):
    """Change the record in `episode.json`."""

    def tamper(run):
        path = home(run, name) / "episode.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))

    return tamper


def record(name=MARKS, /, **changes):
    """Change the record in the journal."""
    return journal(lambda rows: [row | changes if row["id"] == name else row for row in rows])


def both(name=MARKS, /, **changes):
    """Change a record in both places."""
    return lambda run: [part(name, **changes)(run) for part in (episode, record)]


def step(number, name=MARKS, /, **changes):
    """Change a line."""
    return steps(lambda rows: rows[number].update(changes), name)


def picture(name, *files):
    """Change a pixel."""

    def tamper(run):
        for file in files:
            path = home(run, name) / "frames" / file
            pixels = np.array(Image.open(path))
            pixels[-1, 3] ^= 1
            Image.fromarray(pixels).save(path)

    return tamper


def file(name, content):
    """Write a file, or remove it."""

    def tamper(run):
        path = run / name
        if content is None:
            path.unlink()
        else:
            path.write_bytes(content(path.read_bytes()))

    return tamper


def removed(name):
    return lambda run: shutil.rmtree(home(run, name))


def head(edit):
    def tamper(run):
        data = json.loads((run / "run.json").read_text())
        edit(data)
        (run / "run.json").write_text(json.dumps(data, indent=1))

    return tamper


def both_pictures_and_hash(run):
    """The clean screen of one step and what the agent saw, with both hashes and the plan as it
    was."""
    folder = home(run)
    picture(MARKS, "0001.png")(run)
    rows = read_lines(folder / "steps.jsonl")
    clean = np.array(Image.open(folder / "frames/0001.png"))
    calls = apply(Plan.from_data(rows[1]["plan"]), clean)
    Image.fromarray(calls).save(folder / "frames/0001.seen.png")
    rows[1] |= {"image_sha256": pixel_sha256(clean), "seen_sha256": pixel_sha256(calls)}
    write_lines(folder / "steps.jsonl", rows)


def replaced_by_clean(run):
    """The plan of one step, its digest, its picture and its hash are those of no corruption."""
    folder = home(run)
    rows = read_lines(folder / "steps.jsonl")
    clean = Plan.clean((360, 640))
    picture_hash = pixel_sha256(np.array(Image.open(folder / "frames/0001.png")))
    rows[1] |= {
        "plan": clean.to_data(),
        "plan_digest": clean.digest(),
        "seen": None,
        "seen_sha256": picture_hash,
    }
    write_lines(folder / "steps.jsonl", rows)


def all_clean(run):
    """Every plan of an episode, and what its records say."""
    folder = home(run)
    rows = read_lines(folder / "steps.jsonl")
    clean = Plan.clean((360, 640))
    for row in rows:
        hashed = pixel_sha256(np.array(Image.open(folder / row["image"])))
        row |= {
            "plan": clean.to_data(),
            "plan_digest": clean.digest(),
            "seen": None,
            "seen_sha256": hashed,
        }
    write_lines(folder / "steps.jsonl", rows)
    both(MARKS, params={}, planner="clean")(run)


def relabelled(run):
    """An episode becomes one of the clean condition, name and folder included."""
    name = MARKS.replace("marks", "clean")
    removed(CLEAN)(run)
    journal(lambda rows: [row for row in rows if row["id"] != CLEAN])(run)
    both(MARKS, id=name, corruption="clean", params={}, planner="clean")(run)
    home(run).rename(home(run, name))


def swapped(a, b):
    def edit(rows):
        rows[a], rows[b] = rows[b], rows[a]

    return edit


def probe(entry, ok=False):
    entry["record"]["probes"][0]["ok"] = ok


def flip_in_record(rows):
    for row in rows:
        for effect in row["effects"]:
            probe(effect)


def flip_everywhere(run):
    path = home(run, MINIMISED) / "episode.json"
    data = json.loads(path.read_text())
    flip_in_record([data])
    path.write_text(json.dumps(data))
    journal(flip_in_record)(run)
    steps(
        lambda rows: [probe(event) for row in rows for event in row["events"]] and None, MINIMISED
    )(run)


def without_effects(run):
    steps(lambda rows: [row | {"events": []} for row in rows], MINIMISED)(run)
    both(MINIMISED, effects=[])(run)


def chained_anew(run):
    """Write all hashes of the journal anew, as who knows this library can."""
    before = (run / "run.json").read_bytes()
    lines = []
    for row in read_lines(run / "records.jsonl"):
        episode_bytes = (home(run, row["id"]) / "episode.json").read_bytes()
        row |= {"previous": sha256_hex(before), "episode_sha256": sha256_hex(episode_bytes)}
        before = json.dumps(row, ensure_ascii=False).encode()
        lines.append(before)
    (run / "records.jsonl").write_bytes(b"".join(line + b"\n" for line in lines))


def hashed_anew(run):
    """Write every hash of a run anew: those of steps, episodes and journal."""
    for path in sorted((run / "episodes").glob("*/episode.json")):
        before = sha256_hex(path.parent.name.encode())
        lines = []
        for row in read_lines(path.parent / "steps.jsonl"):
            line = json.dumps(row | {"previous": before}, ensure_ascii=False)
            before = sha256_hex(line.encode())
            lines.append(f"{line}\n")
        (path.parent / "steps.jsonl").write_text("".join(lines))
        chain = {"lines": len(lines), "chain": before}
        path.write_text(json.dumps(json.loads(path.read_text()) | chain))
        journal(
            lambda rows, name=path.parent.name, chain=chain: [
                row | chain if row["id"] == name else row for row in rows
            ]
        )(run)
    chained_anew(run)


def renamed(old, new, **changes):
    """Give an episode another id, in every place."""

    def tamper(run):
        both(old, id=new, **changes)(run)
        home(run, old).rename(home(run, new))
        head(
            lambda data: data.update(
                episodes=[new if name == old else name for name in data["episodes"]]
            )
        )(run)

    return tamper


def config_digest_anew(run):
    """Write the hash of the configuration anew, also in `sessions.jsonl`."""
    digest = config_digest(json.loads((run / "run.json").read_text())["config"])
    head(lambda data: data.update(config_sha256=digest))(run)
    path = run / "sessions.jsonl"
    if path.exists():
        write_lines(path, [row | {"config_sha256": digest} for row in read_lines(path)])


def configured(edit):
    """Change the configuration, and its hash with it."""

    def tamper(run):
        head(lambda data: edit(data["config"]))(run)
        config_digest_anew(run)

    return tamper
