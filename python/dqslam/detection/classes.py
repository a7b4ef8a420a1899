"""The classes of COCO, with which most detectors that are given away are trained."""

from __future__ import annotations

from pathlib import Path

from dqslam.io.detections import read_class_names

_COCO = """
person, bicycle, car, motorcycle, airplane, bus, train, truck, boat, traffic light, fire hydrant,
stop sign, parking meter, bench, bird, cat, dog, horse, sheep, cow, elephant, bear, zebra, giraffe,
backpack, umbrella, handbag, tie, suitcase, frisbee, skis, snowboard, sports ball, kite,
baseball bat, baseball glove, skateboard, surfboard, tennis racket, bottle, wine glass, cup, fork,
knife, spoon, bowl, banana, apple, sandwich, orange, broccoli, carrot, hot dog, pizza, donut, cake,
chair, couch, potted plant, bed, dining table, toilet, tv, laptop, mouse, remote, keyboard,
cell phone, microwave, oven, toaster, sink, refrigerator, book, clock, vase, scissors, teddy bear,
hair drier, toothbrush
"""
_NAMES = [name.strip() for name in _COCO.split(",")]
#: Numbers of the data set's categories that have no objects.
_UNUSED = {12, 26, 29, 30, 45, 66, 68, 69, 71, 83}
_CATEGORIES = [number for number in range(1, 91) if number not in _UNUSED]

#: Names of classes by number: counted from 0, or numbered as the data set does.
KNOWN = {
    "coco": dict(enumerate(_NAMES)),
    "coco91": dict(zip(_CATEGORIES, _NAMES, strict=True)),
}


def class_names(given: str | Path) -> dict[int, str]:
    """Return names of classes by number: one of KNOWN by its name, or those of a file."""
    known = KNOWN.get(str(given))
    return read_class_names(given) if known is None else known
