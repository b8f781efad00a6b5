"""The robot of skin.urdf, touches on its skin, and RViz: ``ros2 launch eitskin_ros skin.launch.py
device:=auto``. The touches come over DDS from  eitskin stream --to ros2:  (pip install
'eitskin[ros2]'); no node of ours runs."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    urdf = Path(get_package_share_directory("eitskin_ros")) / "urdf" / "skin.urdf"
    stream = ["eitskin", "stream", "--device", LaunchConfiguration("device")]
    return LaunchDescription(
        [
            DeclareLaunchArgument("device", default_value="sim:swipe?speed=1&loop=1"),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{"robot_description": urdf.read_text()}],
            ),
            ExecuteProcess(cmd=[*stream, "--name", "skin", "--to", "ros2:"], output="screen"),
            Node(package="rviz2", executable="rviz2", arguments=["-f", "base_link"]),
        ]
    )
