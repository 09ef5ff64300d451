"""The checks of `hijack verify`.

For a dataset, `verify` runs them all. `manifest_checks` checks the files of the folder, and fields
that follow from other fields. `row_order` compares rows with each other. `recorded_steps` finds the
recorded step of rows, in the dataset or in its source. `row_checks` compares each row with the
picture, plan and labels that the code of the build makes again. `event_rows` checks rows with
events on the machine against their plan and the asset pack. For a run, `rebuild` computes
everything again with `run_checks`.
"""
