"""The node: topics, tf and services around `Session`, which does the work."""

from __future__ import annotations

import numpy as np
import rclpy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, TransformStamped, Vector3
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo
from std_srvs.srv import Trigger
from tf2_ros import Buffer, TransformBroadcaster, TransformException, TransformListener
from vision_msgs.msg import Detection2DArray
from visualization_msgs.msg import Marker, MarkerArray

from dqslam import _core
from dqslam._colors import class_colors
from dqslam_ros.session import Session, SessionOptions


class DqslamNode(Node):
    """Subscribes to camera_info, odom and detections; publishes tf, objects and path."""

    def __init__(self) -> None:
        super().__init__("dqslam")
        for name, value in (
            ("map_frame", "map"), ("odom_frame", "odom"), ("base_frame", "base_link"),
            ("min_score", 0.5), ("has_ids", False), ("folder", "dqslam_map"),
            ("translation_sigma", 0.03), ("rotation_sigma", 0.02), ("wait_s", 1.0),
        ):  # fmt: skip
            self.declare_parameter(name, value)
        names = ("min_score", "has_ids", "translation_sigma", "rotation_sigma", "wait_s")
        self.session = Session(SessionOptions(**{name: self._value(name) for name in names}))
        self.tf = Buffer()
        self.listener = TransformListener(self.tf, self)
        self.broadcaster = TransformBroadcaster(self)
        self.markers = self.create_publisher(MarkerArray, "objects", 1)
        self.path = self.create_publisher(Path, "path", 1)
        sensor = qos_profile_sensor_data
        self.create_subscription(CameraInfo, "camera_info", self.on_camera, sensor)
        self.create_subscription(Odometry, "odom", self.session.take_odometry, sensor)
        detections = self.session.take_detections
        self.create_subscription(Detection2DArray, "detections", detections, sensor)
        self.create_service(Trigger, "save", self.on_save)
        self.create_timer(0.05, self.on_timer)

    def _value(self, name: str):
        return self.get_parameter(name).value

    def on_camera(self, message: CameraInfo) -> None:
        """Take the camera, and its mount from tf."""
        if self.session.is_ready:
            return
        try:
            base, camera = self._value("base_frame"), message.header.frame_id
            mount = self.tf.lookup_transform(base, camera, Time()).transform
            t, q = mount.translation, mount.rotation
            self.session.take_camera_info(message)
            self.session.set_mount([t.x, t.y, t.z, q.x, q.y, q.z, q.w])
        except (TransformException, ValueError) as error:
            self.get_logger().warning(str(error), throttle_duration_sec=5.0)

    def on_timer(self) -> None:
        """Take the images that are ready, and publish."""
        refused = len(self.session.counts.refused)
        steps = self.session.step()
        for reason in self.session.counts.refused[refused:]:
            self.get_logger().warning(reason)
        correction = self.session.map_from_odom()
        if correction is not None:
            moved = TransformStamped()
            moved.header.stamp = self.get_clock().now().to_msg()
            moved.header.frame_id = self._value("map_frame")
            moved.child_frame_id = self._value("odom_frame")
            x, y, z, *turn = map(float, correction)
            moved.transform.translation = Vector3(x=x, y=y, z=z)
            moved.transform.rotation = _quaternion(turn)
            self.broadcaster.sendTransform(moved)
        if steps:
            self.publish()

    def publish(self) -> None:
        """Publish objects and path."""
        slam, frame = self.session.slam, self._value("map_frame")
        now = self.get_clock().now().to_msg()
        objects = slam.objects
        colors = class_colors(objects.class_names)
        markers = []
        shapes = _core.ellipsoid_shapes(objects.ellipsoids)
        for row, shape in enumerate(shapes):
            squares, axes = np.linalg.eigh(shape)
            axes[:, 0] *= np.linalg.det(axes)
            marker = Marker(ns="objects", id=int(objects.object_ids[row]), type=Marker.SPHERE)
            marker.header.frame_id, marker.header.stamp = frame, now
            x, y, z = map(float, objects.centers[row])
            turn = Rotation.from_matrix(axes).as_quat()
            marker.pose = Pose(position=Point(x=x, y=y, z=z), orientation=_quaternion(turn))
            sides = map(float, 2.0 * np.sqrt(squares))
            marker.scale = Vector3(**dict(zip("xyz", sides, strict=True)))
            red, green, blue = bytes.fromhex(colors[objects.class_names[row]][1:])
            marker.color.r, marker.color.g, marker.color.b = red / 255, green / 255, blue / 255
            marker.color.a = 0.7
            markers.append(marker)
        self.markers.publish(MarkerArray(markers=markers))
        path = Path()
        path.header.frame_id, path.header.stamp = frame, now
        for x, y, z, *turn in slam.poses.tolist():
            pose = PoseStamped(header=path.header)
            pose.pose = Pose(position=Point(x=x, y=y, z=z), orientation=_quaternion(turn))
            path.poses.append(pose)
        self.path.publish(path)

    def on_save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Save the session into the folder of the parameter."""
        try:
            self.session.save(self._value("folder"))
            response.success, response.message = True, f"wrote {self._value('folder')}"
        except (OSError, ValueError) as error:
            response.success, response.message = False, str(error)
        return response


def _quaternion(xyzw) -> Quaternion:
    x, y, z, w = map(float, xyzw)
    return Quaternion(x=x, y=y, z=z, w=w)


def main() -> None:
    """Run the node until Ctrl-C."""
    rclpy.init()
    node = DqslamNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
