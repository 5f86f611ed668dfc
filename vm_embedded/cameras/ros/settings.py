"""Section [ros]: which topics and frames of ROS 2 the detector uses."""

from __future__ import annotations

from dataclasses import dataclass

from ...config.entries import check_entries, one_of, text_line

CLOCKS = ("wall", "arrival")

NODE = "vm_ros"
"""Name of the node, and first part of the topics that it publishes."""

DRAWN = DEBUG_IMAGE, MAP = ("debug_image/compressed", "map/compressed")
"""The topics of images that it draws."""


@dataclass(frozen=True, kw_only=True)
class RosSettings:
    """Topics, frames and clock, for vm-ros and for bags."""

    image: str = text_line("", "topic of the images; empty: /camera/image_raw, or the only topic of images in a bag")
    camera_info: str = text_line("", "topic of the lens; empty: camera_info beside the topic of the images")
    plane_frame: str = text_line(
        "base_footprint", "tf frame of the observation plane: z points up, and z = 0 is the plane"
    )
    camera_frame: str = text_line("", "tf frame of the camera, with optical axes; empty: the frame_id of the images")
    clock: str = one_of(
        CLOCKS,
        "wall",
        "clock of the stamps; wall: the system's clock; arrival: another clock, as when a bag is played; its offset is "
        "estimated from the times of arrival",
    )
    middleware: str = one_of(
        ("auto", "rclpy", "cyclonedds"),
        "auto",
        "package that connects vm-ros to ROS 2; auto: rclpy where ROS is sourced, otherwise cyclonedds",
    )
    namespace: str = text_line(f"/{NODE}", "first part of the topics that vm-ros publishes")

    def __post_init__(self) -> None:
        check_entries(self)


def camera_info_beside(image_topic: str) -> str:
    """The usual topic of the lens for a topic of images, raw or compressed, as image_transport names it."""
    parts = image_topic.removesuffix("/compressed").split("/")
    return "/".join([*parts[:-1], "camera_info"])
