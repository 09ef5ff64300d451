"""A browser as the target of corruptions: Chromium over the DevTools protocol, without a desktop.

It needs neither root nor a namespace. `BrowserDesktop` has the `Desktop` protocol, so runs,
records, reports and `hijack verify` are those of desktops.
"""
