"""Make the dataset of recordings of our own under all nine corruptions, ready for the Hub.

`python examples/hub_dataset.py OUT` records a task in a browser on an embedded desktop, adds the
recordings of examples/recordings, builds, verifies and checks the dataset in OUT/dataset. With
`--push OWNER/NAME` it is uploaded, privately; `huggingface_hub` finds its token by itself. The
recordings are ours, under Apache-2.0.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from datasets import load_dataset
from huggingface_hub import DatasetCard

from hijack_data.paths import example_recordings
from pipelines import build, verify
from pipelines.exports.hub import push_to_hub

# A touch at step 1: at a later one, menus are open or the screen shows nothing that was recorded.
CORRUPTIONS = (
    "pop_ups,resolution,marks,subtitle,multi_apps,accidental_touch:step=1,"
    "app_minimization,network_error,verification"
)
BROWSER_TASK = "register_course"


def main() -> None:
    """Record, build, check, and upload if asked to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--push", metavar="OWNER/NAME")
    options = parser.parse_args()
    recordings, dataset = options.out / "recordings", options.out / "dataset"
    if not recordings.exists():
        words = ["desktop", "record", "--task", BROWSER_TASK, "-o", str(recordings)]
        subprocess.run([sys.executable, "-m", "hijack_data", *words], check=True)
    sources = [example_recordings(), recordings]
    report = build(sources, dataset, corruptions=CORRUPTIONS, seed=7, resume=True)
    print(*report.lines(), sep="\n")
    check(dataset)
    finish_card(dataset / "README.md")
    if options.push:
        print(push_to_hub(dataset, options.push))


def check(dataset: Path) -> None:
    """End with a message unless the Hub can read the card, and the rows are those of all nine."""
    card = DatasetCard.load(dataset / "README.md")
    declared = {split["name"]: split["num_examples"] for split in card.data.dataset_info["splits"]}
    rows = load_dataset(str(dataset))
    counted = {name: len(split) for name, split in rows.items()}
    if declared != counted:
        raise SystemExit(f"{dataset}: the card says {declared} rows, there are {counted}")
    names = {name for split in rows.values() for name in split["corruption"]}
    lacking = {name.partition(":")[0] for name in CORRUPTIONS.split(",")} - names
    if lacking:
        raise SystemExit(f"{dataset}: no row shows {', '.join(sorted(lacking))}")
    problems = verify(dataset).problems
    if problems:
        raise SystemExit(f"{dataset}: {problems[0]}")
    print(f"{dataset}: all nine, {counted} rows, all is well")


def finish_card(path: Path) -> None:
    """State the licence of the recordings, and the files that the Hub's viewer shows."""
    card = DatasetCard.load(path)
    card.data.license = "apache-2.0"
    card.data.license_name = card.data.license_link = None
    files = {"split": "train", "path": "data/train-*.parquet"}
    card.data.configs = [{"config_name": "default", "data_files": [files]}]
    before, title, after = card.text.partition("## Licence\n\n")
    _, _, assets = after.partition("\n")  # what it says of the asset pack stays
    card.text = f"{before}{title}The recordings are AgentHijack's own, under Apache-2.0.\n{assets}"
    card.save(path)
    load_dataset(str(path.parent), split="train")


if __name__ == "__main__":
    main()
