"""Batches: many recordings run like ``dqslam run``, resumable, on one machine or a cluster."""

from dqslam.studies.batch.combine import AlignOptions as AlignOptions
from dqslam.studies.batch.combine import Combined as Combined
from dqslam.studies.batch.combine import MergeOptions as MergeOptions
from dqslam.studies.batch.run import BatchRun as BatchRun
from dqslam.studies.batch.run import run_batch as run_batch
from dqslam.studies.batch.table import Row as Row
from dqslam.studies.batch.task import Task as Task
