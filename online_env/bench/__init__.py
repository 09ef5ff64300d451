"""`hijack bench`: agents on live desktops under each corruption.

A run is a list of jobs (task x corruption x seed x agent). Each job leaves a record, which proves
its corruption. `online_env.results` holds the records and computes scores from them, and
`online_env.report` shows them.
"""
