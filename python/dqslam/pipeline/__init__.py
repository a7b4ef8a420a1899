"""From a recording, in memory or in files, to an estimate and a report: at once or step by step."""

from dqslam.pipeline.conclude import RunResult as RunResult
from dqslam.pipeline.files import run_files as run_files
from dqslam.pipeline.options import RunFilesOptions as RunFilesOptions
from dqslam.pipeline.options import RunOptions as RunOptions
from dqslam.pipeline.recording import run as run
