"""A skin in ROS 2."""
