"""The description of a skin: its outline, its electrodes, and the order in which they are driven
and measured."""
