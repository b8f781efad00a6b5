"""Two models of a Cortex-M7's time: one that flatters it and one that does not. Silicon lies
between them; nobody has measured it here."""
