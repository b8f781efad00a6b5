"""The core's numbers that are a choice; tables/constants.toml has their reasons. Written by
tables/make_tables.py from tables/constants.toml.
"""

# model
MAX_GAIN = 4.0
REFERENCE_TRACKING_FRAMES = 512
TRACK_DETECTION = 0.75
TRACK_CONFIRM = 2
TRACK_HOLD = 2
TRACK_SMOOTH = 0.66
FORM_TOLERANCE = 0.001
FORM_WEIGHT_TOLERANCE = 0.01
FORM_MAX_NORM = 1.01

# frame
MAX_ROW_GAIN = 3.0
MAX_RATIO = 16.0
RATIO_DEFINED = 1e-06
