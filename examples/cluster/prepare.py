"""Write what verl reads: the rows of the training tasks, and an agent file that names the servers.

python examples/cluster/prepare.py SERVER,SERVER... OUT [TASKS.txt [SPLIT]]

The tasks are the suite's, or those that `hijack serve osworld ... --dry-run` has listed in a file;
SPLIT is the `--osworld-split` of that command.
"""

import sys
from pathlib import Path

import yaml

from online_env.agents.chat.prompts import read_prompt
from pipelines.train.adapters.verl_rows import write_evaluation_rows, write_rows
from pipelines.train.split import members

WHERE = "It stands beside the first screenshot."  # the instruction, which is no part of a row
OSWORLD_SIZE = [1080, 1920]  # of the machines' screens
TEMPLATE = Path(__file__).parents[2] / "configs" / "train" / "verl_served.yaml"


def main() -> None:
    """Write the three files."""
    servers, out = sys.argv[1].split(","), Path(sys.argv[2])
    loops = yaml.safe_load(TEMPLATE.read_text())
    # The prompt of the agent files that play the trained model.
    prompt = read_prompt(loops[0]["dialect"])
    how = prompt.fill({"language": "English", "instruction": WHERE}).first
    settings = loops[0]["environment_args"]
    settings["addresses"] = servers
    training, held_out = members("suite/training"), members("suite/held_out")
    split = sys.argv[4] if len(sys.argv) > 4 else "osworld"
    if len(sys.argv) > 3:
        settings["size"] = OSWORLD_SIZE
        training = Path(sys.argv[3]).read_text().split()
        held_out = members(f"{split}/held_out")
    (out / "agent.yaml").write_text(yaml.safe_dump(loops, sort_keys=False))
    count = write_rows(
        out / "train.parquet", training, how, evaluation=held_out, osworld_split=split
    )
    write_evaluation_rows(out / "val.parquet", held_out, how, corruption="clean")
    print(f"{out}: {count} training tasks, {len(held_out)} held out, {len(servers)} servers")


if __name__ == "__main__":
    main()
