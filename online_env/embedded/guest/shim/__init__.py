"""The modules that agents' code sees in the desktop.

They are copied to /usr/local/lib/desktop/shim without the rest of the package.
"""
