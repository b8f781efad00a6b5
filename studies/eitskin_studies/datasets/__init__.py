"""Many scenes drawn from one."""
