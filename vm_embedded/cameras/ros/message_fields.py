"""The messages of ROS 2 that this project reads and writes: their fields in the order of their .msg files.

vision_msgs and visualization_msgs are those of ROS 2 Humble and later. Tests compare the bytes of each message with
those of the library rosbags.
"""

from __future__ import annotations

FIELDS = {
    "builtin_interfaces/msg/Time": "int32 sec, uint32 nanosec",
    "builtin_interfaces/msg/Duration": "int32 sec, uint32 nanosec",
    "std_msgs/msg/Header": "Time stamp, string frame_id",
    "std_msgs/msg/ColorRGBA": "float32 r, float32 g, float32 b, float32 a",
    "geometry_msgs/msg/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/msg/Vector3": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Pose": "Point position, Quaternion orientation",
    "geometry_msgs/msg/PoseStamped": "Header header, Pose pose",
    "geometry_msgs/msg/PoseArray": "Header header, Pose[] poses",
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
    "soccer_vision_attribute_msgs/msg/Confidence": "float32 confidence",
    "soccer_vision_attribute_msgs/msg/Goalpost": "uint8 side, uint8 team",
    "soccer_vision_attribute_msgs/msg/Robot": "uint8 player_number, uint8 team, uint8 state, uint8 facing",
    "soccer_vision_3d_msgs/msg/Ball": "Point center, Confidence confidence",
    "soccer_vision_3d_msgs/msg/BallArray": "Header header, Ball[] balls",
    "soccer_vision_3d_msgs/msg/Goalpost": "BoundingBox3D bb, GoalpostAttributes attributes, Confidence confidence",
    "soccer_vision_3d_msgs/msg/GoalpostArray": "Header header, Goalpost[] posts",
    "soccer_vision_3d_msgs/msg/Robot": "BoundingBox3D bb, RobotAttributes attributes, Confidence confidence",
    "soccer_vision_3d_msgs/msg/RobotArray": "Header header, Robot[] robots",
    "soccer_vision_3d_msgs/msg/MarkingEllipse": "float64 diameter, Pose center, Confidence confidence",
    "soccer_vision_3d_msgs/msg/MarkingIntersection": "Point center, int32 num_rays, Vector3[] rays, "
    "Confidence confidence",
    "soccer_vision_3d_msgs/msg/MarkingSegment": "Point start, Point end, Confidence confidence",
    "soccer_vision_3d_msgs/msg/MarkingArray": "Header header, MarkingEllipse[] ellipses, "
    "MarkingIntersection[] intersections, MarkingSegment[] segments",
    "soccer_vision_3d_msgs/msg/FieldBoundary": "Header header, Point[] points, Confidence confidence",
    "soccer_vision_2d_msgs/msg/Ball": "BoundingBox2D bb, Point2D center, Confidence confidence",
    "soccer_vision_2d_msgs/msg/BallArray": "Header header, Ball2D[] balls",
    "soccer_vision_2d_msgs/msg/Goalpost": "BoundingBox2D bb, GoalpostAttributes attributes, Confidence confidence",
    "soccer_vision_2d_msgs/msg/GoalpostArray": "Header header, Goalpost2D[] posts",
    "soccer_vision_2d_msgs/msg/Robot": "BoundingBox2D bb, RobotAttributes attributes, Confidence confidence",
    "soccer_vision_2d_msgs/msg/RobotArray": "Header header, Robot2D[] robots",
    "soccer_vision_2d_msgs/msg/MarkingEllipse": "BoundingBox2D bb, Point2D center, Confidence confidence",
    "soccer_vision_2d_msgs/msg/MarkingIntersection": "Point2D center, int32 num_rays, float64[] heading_rays, "
    "Confidence confidence",
    "soccer_vision_2d_msgs/msg/MarkingSegment": "Point2D start, Point2D end, Confidence confidence",
    "soccer_vision_2d_msgs/msg/MarkingArray": "Header header, MarkingEllipse2D[] ellipses, "
    "MarkingIntersection2D[] intersections, MarkingSegment2D[] segments",
    "soccer_vision_2d_msgs/msg/FieldBoundary": "Header header, Point2D[] points, Confidence confidence",
    "visualization_msgs/msg/UVCoordinate": "float32 u, float32 v",
    "visualization_msgs/msg/MeshFile": "string filename, uint8[] data",
    "visualization_msgs/msg/Marker": "Header header, string ns, int32 id, int32 type, int32 action, Pose pose, "
    "Vector3 scale, ColorRGBA color, Duration lifetime, bool frame_locked, Point[] points, ColorRGBA[] colors, "
    "string texture_resource, CompressedImage texture, UVCoordinate[] uv_coordinates, string text, "
    "string mesh_resource, MeshFile mesh_file, bool mesh_use_embedded_materials",
    "visualization_msgs/msg/MarkerArray": "Marker[] markers",
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


def short_name(full: str) -> str:
    """The unique short name of a message: its last part, and Attributes or 2D where others have it."""
    package, _, name = full.split("/")
    if package == "soccer_vision_attribute_msgs" and name != "Confidence":
        return f"{name}Attributes"
    return f"{name}2D" if package == "soccer_vision_2d_msgs" else name


MESSAGES = {short_name(full): full for full in FIELDS | _FOXGLOVE_FIELDS}
"""The full name of each message by its short name."""


def fields_of(full: str) -> list[tuple[str, str]]:
    """Type and name of each field of a message."""
    return [(kind, name) for kind, name in (each.split(" ") for each in (FIELDS | _FOXGLOVE_FIELDS)[full].split(", "))]
