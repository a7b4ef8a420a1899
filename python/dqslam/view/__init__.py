"""The scene of ``dqslam view``, on a live page, on a static page, or as a Rerun file."""

from dqslam.view.foxglove import serve_foxglove as serve_foxglove
from dqslam.view.foxglove import write_mcap as write_mcap
from dqslam.view.live import serve as serve
from dqslam.view.page import write_page as write_page
from dqslam.view.rerun import write_rerun as write_rerun
from dqslam.view.scene import Scene as Scene
from dqslam.view.scene import SceneObject as SceneObject
from dqslam.view.scene import build_scene as build_scene
from dqslam.view.scene import rgb as rgb
from dqslam.view.session import SessionRecorder as SessionRecorder
from dqslam.view.session import record_session as record_session
from dqslam.view.session import serve_session as serve_session
from dqslam.view.tracks import SceneTrack as SceneTrack
