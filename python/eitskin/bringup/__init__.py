"""The first measurements on an instrument that somebody has built, stage by stage."""
