"""Images of the desktop: a Debian 12 root file system that any Linux builds, keeps and starts from.

`debian` and `sources` choose and fetch packages, `chamber` runs dpkg, `build` puts it together;
`manifest`, `tree` and `archive` pin, check and pack it; `cache` holds what is there.
"""
