"""The checks of `hijack verify` on a run, its episodes and their lines, one module each."""
