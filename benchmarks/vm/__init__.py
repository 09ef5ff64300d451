"""The guest that `virtual_machine.py` measures: `image` builds it, `inside` is its first process, `qemu` runs it."""
