"""The messages of ROS 2 that this project reads and writes: their fields in the order of their .msg files.

vision_msgs is that of ROS 2 Humble and later. Tests compare the bytes of each message with those of the library
rosbags.
"""

from __future__ import annotations

FIELDS = {
    "builtin_interfaces/msg/Time": "int32 sec, uint32 nanosec",
    "std_msgs/msg/Header": "Time stamp, string frame_id",
    "geometry_msgs/msg/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/msg/Vector3": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Pose": "Point position, Quaternion orientation",
    "geometry_msgs/msg/PoseStamped": "Header header, Pose pose",
    "geometry_msgs/msg/PoseWithCovariance": "Pose pose, float64[36] covariance",
    "geometry_msgs/msg/Transform": "Vector3 translation, Quaternion rotation",
    "geometry_msgs/msg/TransformStamped": "Header header, string child_frame_id, Transform transform",
    "tf2_msgs/msg/TFMessage": "TransformStamped[] transforms",
    "sensor_msgs/msg/RegionOfInterest": "uint32 x_offset, uint32 y_offset, uint32 height, uint32 width, "
    "bool do_rectify",
    "sensor_msgs/msg/CameraInfo": "Header header, uint32 height, uint32 width, string distortion_model, float64[] d, "
    "float64[9] k, float64[9] r, float64[12] p, uint32 binning_x, uint32 binning_y, RegionOfInterest roi",
    "sensor_msgs/msg/Image": "Header header, uint32 height, uint32 width, string encoding, uint8 is_bigendian, "
    "uint32 step, uint8[] data",
    "sensor_msgs/msg/CompressedImage": "Header header, string format, uint8[] data",
    "vision_msgs/msg/Point2D": "float64 x, float64 y",
    "vision_msgs/msg/Pose2D": "Point2D position, float64 theta",
    "vision_msgs/msg/BoundingBox2D": "Pose2D center, float64 size_x, float64 size_y",
    "vision_msgs/msg/BoundingBox3D": "Pose center, Vector3 size",
    "vision_msgs/msg/ObjectHypothesis": "string class_id, float64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": "ObjectHypothesis hypothesis, PoseWithCovariance pose",
    "vision_msgs/msg/Detection2D": "Header header, ObjectHypothesisWithPose[] results, BoundingBox2D bbox, string id",
    "vision_msgs/msg/Detection2DArray": "Header header, Detection2D[] detections",
    "vision_msgs/msg/Detection3D": "Header header, ObjectHypothesisWithPose[] results, BoundingBox3D bbox, string id",
    "vision_msgs/msg/Detection3DArray": "Header header, Detection3D[] detections",
    "diagnostic_msgs/msg/KeyValue": "string key, string value",
    "diagnostic_msgs/msg/DiagnosticStatus": "byte level, string name, string message, string hardware_id, "
    "KeyValue[] values",
    "diagnostic_msgs/msg/DiagnosticArray": "Header header, DiagnosticStatus[] status",
}
"""Type and name of each field. Messages stand below those that they contain. A type is primitive or the short name of a
message, with [] for a sequence and [n] for n values."""

_FOXGLOVE_FIELDS = {
    "foxglove_msgs/msg/Color": "float64 r, float64 g, float64 b, float64 a",
    "foxglove_msgs/msg/Point2": "float64 x, float64 y",
    "foxglove_msgs/msg/CircleAnnotation": "Time timestamp, Point2 position, float64 diameter, float64 thickness, "
    "Color fill_color, Color outline_color",
    "foxglove_msgs/msg/PointsAnnotation": "Time timestamp, uint8 type, Point2[] points, Color outline_color, "
    "Color[] outline_colors, Color fill_color, float64 thickness",
    "foxglove_msgs/msg/TextAnnotation": "Time timestamp, Point2 position, string text, float64 font_size, "
    "Color text_color, Color background_color",
    "foxglove_msgs/msg/ImageAnnotations": "CircleAnnotation[] circles, PointsAnnotation[] points, "
    "TextAnnotation[] texts",
}
"""The same for the messages that Foxglove draws over images. They are only in files."""

MESSAGES = {full.rpartition("/")[2]: full for full in FIELDS | _FOXGLOVE_FIELDS}
"""The full name of each message by its short name, which is unique."""


def fields_of(full: str) -> list[tuple[str, str]]:
    """Type and name of each field of a message."""
    return [(kind, name) for kind, name in (each.split(" ") for each in (FIELDS | _FOXGLOVE_FIELDS)[full].split(", "))]
