"""The stored model: how it is built and reduced, and the .eitm file that holds it."""
