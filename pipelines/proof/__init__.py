"""The checks of `hijack verify`, one module for each thing with which a dataset is compared.

`manifest` checks the files of the folder, and fields that follow from other fields. `order`
compares rows with each other. `recorded` finds the recorded step of rows, in the dataset or in its
source. `rows` compares each row with the picture, plan and labels that the code of the build makes
again. `events` checks rows with events on the machine against their plan and the asset pack.
`rebuild` and `retrace` check runs.
"""
