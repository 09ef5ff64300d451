"""Run every benchmark and write RESULTS.md: `python benchmarks/run.py [name ...]`."""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
RESULTS = HERE / "RESULTS.md"
SCRIPTS = {
    "first_minutes": "The first minutes",
    "overlays": "Drawing in place, against one memcpy of the picture",
    "resample": "Resizing, against torch and Pillow",
    "geometry": "Largest free rectangle",
    "dataset_builds": "Building and reading datasets",
    "rows_by_source": "Rows from recordings that people hold",
    "ray_builds": "Building datasets on Ray",
    "ray_episodes": "Episodes on Ray",
    "augment": "Training-time augmentation, against other libraries",
    "labels": "Labels of a sample",
    "gpu": "On a GPU",
    "gpu_host": "The host's work for a GPU",
    "gpu_training": "Training a model of 7 billion weights on a GPU",
    "levels": "Severity levels, measured",
    "proof": "Is the augmentation worth using?",
    "offline_scoring": "Scoring agents on datasets",
    "online": "The embedded desktop",
    "install_times": "Installing the embedded desktop",
    "desktop_image": "Images of the desktop",
    "effects": "Effects on a live desktop",
    "guards": "Guards",
    "slow_network": "slow_network by severity",
    "gnome": "Effects on GNOME",
    "browser": "A browser as the desktop",
    "browser_layer": "Nodes of a page against the drawn picture",
    "browsergym_miniwob": "MiniWoB++ in BrowserGym under corruptions",
    "suite": "The suite of tasks",
    "live_steps": "Corruptions on a live desktop, step by step",
    "everyday_faults": "Everyday faults",
    "worst_case": "The worst case",
    "reports": "Reports",
    "interval_coverage": "Intervals of reports, simulated",
    "viewer_runs": "The page of runs",
    "pixel": "Reading by OCR: the agent pixel",
    "ocr_engines": "OCR: who finds the lines",
    "chat_agent": "Agents of models, beside their endpoint",
    "kills": "A benchmark that is killed",
    "training_time": "Training with corruptions",
    "serving": "Desktops behind a server",
    "agent_process": "An agent in a process of its own",
    "bench_rate": "What the runner of benchmarks costs",
    "osworld_machines": "OSWorld's tasks on machines behind HTTP",
}
NOT_HERE = "Not measured: "  # what a script prints where it cannot measure
HEAD = """# Results

Every table is remade by `python benchmarks/NAME.py`, all of them by `make bench`. Ratios are taken within one run;
times are milliseconds, min / median / max. The machine is a shared virtual one: trust ratios and minima.
`python benchmarks/compare.py` names the ratios that got 1.3 times worse than those of a commit.

"""


def main() -> None:
    """Run the named benchmarks, or all, and replace their sections."""
    expected = sys.argv[1:] or list(SCRIPTS)
    sections = read_sections()
    for name in expected:
        print(f"{name} ...", flush=True)
        process = subprocess.run(
            [sys.executable, HERE / f"{name}.py"], capture_output=True, text=True, check=False
        )
        if process.returncode:
            sys.exit(f"{name} failed:\n{process.stderr}")
        if process.stdout.startswith(NOT_HERE) and name in sections:
            print(f"{name}: kept as it was. {process.stdout.strip()}", flush=True)
            continue
        command = f"`python benchmarks/{name}.py`"
        sections[name] = f"## {SCRIPTS[name]}\n\n{command}\n\n{process.stdout.strip()}\n"
    ordered = [sections[name] for name in SCRIPTS if name in sections]
    RESULTS.write_text(HEAD + "\n".join(ordered))


def read_sections() -> dict[str, str]:
    """Return the sections of RESULTS.md by name."""
    text = RESULTS.read_text() if RESULTS.exists() else ""
    names = {title: name for name, title in SCRIPTS.items()}
    sections: dict[str, str] = {}
    for part in text.split("\n## ")[1:]:
        title, _, _ = part.partition("\n")
        if title in names:
            body = part.rstrip("\n")
            sections[names[title]] = f"## {body}\n"
    return sections


if __name__ == "__main__":
    main()
