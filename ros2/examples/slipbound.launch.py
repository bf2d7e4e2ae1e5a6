"""Starts the node beside others: `ros2 launch slipbound.launch.py config:=/path/to/node.toml`.

`slipbound-ros2` is a program, not an ament package: it is started as a process, and has to be on the PATH.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration


def generate_launch_description():
    node = ExecuteProcess(cmd=["slipbound-ros2", "node", LaunchConfiguration("config")], output="screen")
    return LaunchDescription([
        DeclareLaunchArgument("config", description="parameters of the node, a TOML file"),
        node,
        # A hand without its fingers should not go on: everything that was launched ends with the node.
        RegisterEventHandler(OnProcessExit(target_action=node, on_exit=[EmitEvent(event=Shutdown(reason="slipbound-ros2 ended"))])),
    ])
