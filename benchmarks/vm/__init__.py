"""The guest of `virtual_machine.py`: `image` builds it, `inside` is its init, `qemu` runs it."""
