"""The checks of `hijack verify`, one file for each thing that a dataset is compared with.

`manifest`: the files of the folder, and the fields that follow from others. `order`: rows among
each other. `recorded`: the recorded step of rows, from the dataset or from its source. `rows`: each
row against the picture, plan and labels that the build's own code makes again. `events`: rows of
events on the machine, from their plan and the asset pack. `rebuild` and `retrace`: runs.
"""
