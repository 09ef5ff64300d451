"""Images of the desktop: a Debian 12 root file system that any Linux builds, keeps and starts from.

`debian` and `sources` choose and fetch packages, `unprivileged_chroot` runs dpkg, `build` puts the
image together; `manifest`, `file_entries` and `archive` pin, check and pack it; `cache` holds the
images of this machine.
"""
