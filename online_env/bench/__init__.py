"""`hijack bench`: agents on live desktops under each corruption.

A run is a list of jobs (task x corruption x seed x agent), carried out one after the other; each
leaves a record that proves its corruption. `scores.rows` makes the table of a run from its records,
`online_env.report` the report.
"""
