"""`hijack bench`: agents on live desktops under each corruption.

A run is a list of jobs (task x corruption x seed x agent). Each job leaves a record, which proves
its corruption. `scores.rows` computes the table of a run from its records, and `online_env.report`
the report.
"""
