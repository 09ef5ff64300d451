"""The files of a benchmark's run: names in its log, its chain of hashes, and signatures."""
