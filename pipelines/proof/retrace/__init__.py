"""The checks of `hijack verify` on a run: a file for its journal, an episode, and a line."""
