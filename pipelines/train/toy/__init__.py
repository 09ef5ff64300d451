"""A desktop small enough to train on with a CPU: 96x64 pixels, one window, tasks of 2 to 3 actions.

It has the interface of `CorruptedEnv`, and the corruptions are those of `hijack_data`: plans are
applied to its pixels, and effects change its state. It shows what an algorithm does; it says
nothing about how well a large model does on a real desktop.
"""
