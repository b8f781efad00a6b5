from setuptools import setup

setup(
    name="eitskin_ros",
    version="0.1.0",
    packages=["eitskin_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/eitskin_ros"]),
        ("share/eitskin_ros", ["package.xml"]),
        ("share/eitskin_ros/launch", ["launch/skin.launch.py"]),
        ("share/eitskin_ros/urdf", ["urdf/skin.urdf"]),
    ],
    install_requires=["setuptools", "eitskin"],
    entry_points={"console_scripts": ["skin = eitskin_ros.skin:main"]},
)
