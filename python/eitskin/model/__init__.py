"""The stored model: reduction, the .eitm file, and how one is built."""
