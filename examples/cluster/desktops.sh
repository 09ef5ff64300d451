#!/bin/sh
# Desktops for a trainer, on a machine of their own: start it on every CPU node. Needs the extras online and serve in an
# environment of their own, the desktop (`hijack desktop install`), and in AGENTHIJACK_SERVE_TOKEN a secret that all nodes share.
#   examples/cluster/desktops.sh [DESKTOPS] [OPTION OF HIJACK SERVE]...
set -eu
: "${AGENTHIJACK_SERVE_TOKEN:?set it to a secret, such as that of: openssl rand -hex 32}"
desktops=${1:-$(nproc)}  # a desktop works one core and reserves 1.5 GiB
[ $# -eq 0 ] || shift
# The tasks of the training side; the corruptions are those of configs/train/verl_served.yaml.
exec hijack serve embedded --desktops "$desktops" --sessions $((2 * desktops)) --size 1280x720 \
  --corruptions pop_ups,marks,subtitle,resolution,multi_apps,clean --host 0.0.0.0 --port "${PORT:-8000}" "$@"
