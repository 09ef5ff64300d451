"""The scripts for clusters agree with each other and with the split."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

pytest.importorskip("pyarrow", reason="needs the extra [hf]")
import pyarrow.parquet as parquet

from pipelines.train.split import members

ROOT = Path(__file__).resolve().parents[3]
CLUSTER = ROOT / "examples" / "cluster"


def loop(path):
    (value,) = yaml.safe_load(path.read_text())
    return value


def test_servers_and_trainer_have_the_same_corruptions():
    served = re.search(r"--corruptions (\S+)", (CLUSTER / "desktops.sh").read_text())[1]
    trained = loop(ROOT / "configs" / "train" / "verl_served.yaml")["corruptions"]
    assert served.split(",") == [*trained, "clean"]


def test_what_verl_reads_is_written(tmp_path):
    servers = "http://a:8000,http://b:8000"
    command = [sys.executable, str(CLUSTER / "prepare.py"), servers, str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    output = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert "80 training tasks, 52 held out, 2 servers" in output.stdout
    rows = parquet.read_table(tmp_path / "train.parquet").to_pylist()
    assert {row["extra_info"]["task"] for row in rows} == set(members("suite/training"))
    # The trained model is asked as agent files ask it, in the dialect that the loop reads.
    assert loop(tmp_path / "agent.yaml")["dialect"] == "ui_tars_1.5"
    (how,) = {row["prompt"][0]["content"] for row in rows}
    assert "click(start_box='<|box_start|>(x1,y1)<|box_end|>')" in how
    assert "{" not in how
    assert loop(tmp_path / "agent.yaml")["environment_args"]["addresses"] == servers.split(",")


def test_verl_trains_on_the_tasks_of_osworld_that_a_server_lists(tmp_path):
    served = tmp_path / "tasks.txt"
    names = sorted(members("osworld/training"))[:3]
    served.write_text("".join(f"{name}\n" for name in names))
    command = [sys.executable, CLUSTER / "prepare.py", "http://a:8000", tmp_path, served]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    output = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert "3 training tasks, 241 held out, 1 servers" in output.stdout
    rows = parquet.read_table(tmp_path / "train.parquet").to_pylist()
    assert [row["extra_info"]["task"] for row in rows] == names
    settings = loop(tmp_path / "agent.yaml")["environment_args"]
    assert settings == {"addresses": ["http://a:8000"], "size": [1080, 1920]}


@pytest.mark.parametrize(
    ("script", "problem"), [("desktops.sh", "openssl rand"), ("verl.sh", "the secret of the serve")]
)
def test_without_a_secret_nothing_starts(script, problem):
    environment = {"PATH": os.environ["PATH"]}
    output = subprocess.run(
        [CLUSTER / script, "http://a:8000"], capture_output=True, text=True, env=environment
    )
    assert (output.returncode != 0, problem in output.stderr) == (True, True)


@pytest.mark.parametrize("script", sorted(CLUSTER.glob("*.s*"), key=str))
def test_the_shell_reads_each_script(script):
    subprocess.run(["bash", "-n", script], check=True)
