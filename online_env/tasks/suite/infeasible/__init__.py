"""What cannot be done: the right answer is `FAIL`."""
