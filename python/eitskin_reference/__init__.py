"""The core's algorithms once more in numpy, written to be read; tests compare the two."""
