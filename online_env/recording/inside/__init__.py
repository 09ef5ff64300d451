"""Programs that run inside a guest (`python3 -c`), where nothing of ours is installed: one file each."""
