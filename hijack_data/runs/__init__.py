"""What a run of the benchmark writes: names in its log, its chain of hashes, and signatures."""
