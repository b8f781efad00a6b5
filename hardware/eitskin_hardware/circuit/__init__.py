"""The circuit: parts, their connections, and the files that are made from them."""
