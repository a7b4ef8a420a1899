"""The node: topics, tf and services around `Session`, which does the work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import rclpy
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    TransformStamped,
    Vector3,
)
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tf2_ros import Buffer, TransformBroadcaster, TransformException, TransformListener
from vision_msgs.msg import (
    Detection2DArray,
    Detection3D,
    Detection3DArray,
    ObjectHypothesisWithPose,
)
from visualization_msgs.msg import Marker, MarkerArray

from dqslam._colors import class_colors
from dqslam_ros.session import MapObject, Session, SessionOptions


class DqslamNode(Node):
    """Subscribes to camera_info, odom and detections; publishes tf, pose, objects and path."""

    def __init__(self) -> None:
        super().__init__("dqslam")
        for name, value in (
            ("map_frame", "map"), ("odom_frame", "odom"), ("base_frame", "base_link"),
            ("min_score", 0.5), ("has_ids", False), ("folder", "dqslam_map"),
            ("translation_sigma", 0.03), ("rotation_sigma", 0.02), ("wait_s", 1.0),
            ("silence_s", 3.0), ("odometry_from_tf", False),
        ):  # fmt: skip
            self.declare_parameter(name, value)
        names = [one.name for one in fields(SessionOptions) if self.has_parameter(one.name)]
        self.session = Session(SessionOptions(**{name: self._value(name) for name in names}))
        self.tf = Buffer()
        self.listener = TransformListener(self.tf, self)
        self.broadcaster = TransformBroadcaster(self)
        self.markers = self.create_publisher(MarkerArray, "objects", 1)
        self.boxes = self.create_publisher(Detection3DArray, "objects_3d", 1)
        self.pose = self.create_publisher(PoseWithCovarianceStamped, "pose", 1)
        self.path = self.create_publisher(Path, "path", 1)
        sensor = qos_profile_sensor_data
        self.create_subscription(CameraInfo, "camera_info", self.on_camera, sensor)
        if not self._value("odometry_from_tf"):
            self.create_subscription(Odometry, "odom", self.session.take_odometry, sensor)
        detections = self.session.take_detections
        self.create_subscription(Detection2DArray, "detections", detections, sensor)
        self._serve("save", lambda: self._in_folder(self.session.save, "wrote"))
        self._serve("load", lambda: self._in_folder(self.session.load, "looking for the camera in"))
        self._serve("relocalize", self._relocalize)
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

    def _serve(self, name: str, call: Callable[[], str]) -> None:
        """Offer a call as a service, whose message says what was done or why it was not."""

        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.success, response.message = True, call()
            except (OSError, ValueError) as error:
                response.success, response.message = False, str(error)
            return response

        self.create_service(Trigger, name, answer)

    def _in_folder(self, call: Callable[[str], None], done: str) -> str:
        folder = self._value("folder")
        call(folder)
        return f"{done} {folder}"

    def _relocalize(self) -> str:
        self.session.relocalize()
        return "looking for the camera in the map"

    def _ask_tf(self) -> None:
        """Take the odometry at the times of images from tf, as far as it is there."""
        frames = self._value("odom_frame"), self._value("base_frame")
        for time in self.session.waiting_times:
            at = Time(nanoseconds=round(time * 1e9))
            try:
                found = self.tf.lookup_transform(*frames, at).transform
            except TransformException:
                continue  # not yet, or never: the session waits for its time
            self.session.take_pose(time, found.translation, found.rotation)

    def on_timer(self) -> None:
        """Take the images that are ready, and publish."""
        if self._value("odometry_from_tf"):
            self._ask_tf()
        counts, log = self.session.counts, self.get_logger()
        before = len(counts.refused), len(counts.not_located)
        steps = self.session.step()
        for reason in (*counts.refused[before[0] :], *counts.not_located[before[1] :]):
            log.warning(reason)
        now = self.get_clock().now()
        if (silence := self.session.silence(now.nanoseconds * 1e-9)) is not None:
            log.warning(silence, throttle_duration_sec=5.0)
        correction = self.session.map_from_odom()
        if correction is not None:
            moved = TransformStamped()
            moved.header.stamp = now.to_msg()
            moved.header.frame_id = self._value("map_frame")
            moved.child_frame_id = self._value("odom_frame")
            x, y, z, *turn = map(float, correction)
            moved.transform.translation = Vector3(x=x, y=y, z=z)
            moved.transform.rotation = _quaternion(turn)
            self.broadcaster.sendTransform(moved)
        if steps:
            self.publish()

    def publish(self) -> None:
        """Publish the pose of the robot, objects and path."""
        frame = self._value("map_frame")
        header = Header(frame_id=frame, stamp=self.get_clock().now().to_msg())
        found = self.session.map_from_base()
        if found is not None:
            at = Header(frame_id=frame, stamp=Time(nanoseconds=round(found[0] * 1e9)).to_msg())
            pose = PoseWithCovarianceStamped(header=at)
            pose.pose.pose = _pose(found[1])
            pose.pose.covariance = self.session.covariance_in_map().ravel().tolist()
            self.pose.publish(pose)
        objects = self.session.objects()
        self.markers.publish(_markers(objects, header))
        self.boxes.publish(
            Detection3DArray(header=header, detections=[_detection(one, header) for one in objects])
        )
        path = Path(header=header)
        for pose in self.session.slam.poses.tolist():
            path.poses.append(PoseStamped(header=header, pose=_pose(pose)))
        self.path.publish(path)


def _markers(objects: list[MapObject], header: Header) -> MarkerArray:
    """Return an ellipsoid for each object, and the removal of all that were shown before."""
    colors = class_colors([one.class_name for one in objects])
    markers = [Marker(header=header, ns="objects", action=Marker.DELETEALL)]
    for one in objects:
        marker = Marker(header=header, ns="objects", id=one.id, type=Marker.SPHERE)
        marker.pose, marker.scale = _pose(one.pose), _vector(one.size)
        red, green, blue = bytes.fromhex(colors[one.class_name][1:])
        marker.color.r, marker.color.g, marker.color.b = red / 255, green / 255, blue / 255
        marker.color.a = 0.7
        markers.append(marker)
    return MarkerArray(markers=markers)


def _detection(one: MapObject, header: Header) -> Detection3D:
    """Return an object as the box of its axes, in the layout of vision_msgs 4 or earlier."""
    result = ObjectHypothesisWithPose()
    inner = getattr(result, "hypothesis", result)
    setattr(inner, "class_id" if hasattr(inner, "class_id") else "id", one.class_name)
    inner.score = 1.0
    result.pose.pose = _pose(one.pose)
    detection = Detection3D(header=header, results=[result])
    detection.bbox.center, detection.bbox.size = _pose(one.pose), _vector(one.size)
    if hasattr(detection, "id"):
        detection.id = str(one.id)
    return detection


def _pose(numbers) -> Pose:
    x, y, z, *turn = map(float, numbers)
    return Pose(position=Point(x=x, y=y, z=z), orientation=_quaternion(turn))


def _vector(numbers) -> Vector3:
    return Vector3(**dict(zip("xyz", map(float, numbers), strict=True)))


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
