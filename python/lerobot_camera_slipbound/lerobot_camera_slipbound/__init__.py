"""A LeRobot camera that gives what a soft fingertip feels: its picture, or its slip field as a picture."""

from .config_slipbound import SlipboundCameraConfig
from .slipbound import SlipboundCamera

__all__ = ["SlipboundCamera", "SlipboundCameraConfig"]
