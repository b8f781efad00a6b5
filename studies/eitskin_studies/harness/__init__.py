"""What experiments and benchmarks share: runs on the emulated core, stored results, page
sections."""
