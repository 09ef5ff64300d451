#!/bin/sh
# DA-GRPO in verl on the desktops of other machines: start it on the first GPU node. Needs the extra verl, vLLM as verl's
# documentation installs it, Ray running on all GPU nodes (`ray start`), and the servers of desktops.sh.
#   AGENTHIJACK_SERVE_TOKEN=... examples/cluster/verl.sh "http://cpu-1:8000,http://cpu-2:8000" [KEY=VALUE of verl]...
# With TASKS=tasks.txt it trains on tasks of OSWorld: docs/osworld_vm.md#training has the servers, and how the file is made;
# OSWORLD_SPLIT=agenthijack as well if the servers have that split.
set -eu
: "${AGENTHIJACK_SERVE_TOKEN:?the secret of the servers}"
servers=${1:?the addresses of the servers, parted by commas}
shift
cd "$(dirname "$0")/../.."
out=${OUT:-runs/verl}
mkdir -p "$out"
python examples/cluster/prepare.py "$servers" "$out" ${TASKS:+"$TASKS" "${OSWORLD_SPLIT:-osworld}"}
if [ -n "${TASKS:-}" ]; then  # a screenshot of 1920x1080 has 2691 tokens
  set -- data.max_prompt_length=4096 data.max_response_length=30720 \
    actor_rollout_ref.rollout.max_model_len=36864 \
    "+trainer.v1.sampler.sampler_kwargs.osworld_split=${OSWORLD_SPLIT:-osworld}" "$@"
fi
exec python -m verl.trainer.main_ppo -cp "$PWD/configs/train" -cn verl \
  "data.train_files=$out/train.parquet" "data.val_files=$out/val.parquet" \
  "actor_rollout_ref.rollout.agent.agent_loop_config_path=$out/agent.yaml" \
  "actor_rollout_ref.rollout.agent.num_workers=${WORKERS:-4}" "trainer.default_local_dir=$out" \
  "trainer.nnodes=${NODES:-1}" "trainer.n_gpus_per_node=${GPUS:-2}" "$@"
