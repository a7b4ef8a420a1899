"""Whether the four numbers of boxes are what their format says."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam.inspection.comparison import difference
from dqslam.inspection.evidence import Evidence, Finding, NotEnoughDataError
from dqslam.inspection.image_checks import (
    IMPOSSIBLE_SHARE,
    LEFT_SHARE,
    MOST_NAMED,
    border_within,
    clearly_better_rays,
    fitting_images,
    impossible_share,
    left_over,
    longer,
    middle_of,
)
from dqslam.inspection.pose_checks import GOOD
from dqslam.io.readings import BOX_FORMS, BoxReading, form_of

Floats = NDArray[np.float64]

# A form that is named leaves at most so much more of the motion than the best one.
NEARLY = 4 / 3
WORDS = {
    "xyxy": "x1 y1 x2 y2",
    "xywh": "x, y, width, height",
    "cxcywh": "middle x, y, width, height",
    "yxyx": "y1 x1 y2 x2",
}


def check_box_form(evidence: Evidence) -> Finding | None:
    """Check whether the four numbers of boxes have another form than their format says.

    The first test counts impossible boxes, which are inverted or far outside of the image. If no
    form makes many impossible, the second one compares how much motion poses explain.
    """
    camera, table = evidence.camera, evidence.table
    given = impossible_share(camera, table.box)
    size = (camera.width, camera.height)
    stated = form_of(table)
    left, found = {}, []
    for form in BOX_FORMS:
        if form == stated:
            continue
        box = BoxReading(form=form).boxes(table, size)
        left[form] = impossible_share(camera, box)
        counted = given >= IMPOSSIBLE_SHARE and left[form] <= LEFT_SHARE
        if counted or (given < IMPOSSIBLE_SHARE and left[form] == 0 and _preferred(evidence, box)):
            found.append((form, box))
    if not found or (given < IMPOSSIBLE_SHARE and _other_image(evidence, found)):
        return None
    named = _best_forms(evidence, found)
    if not named:
        return None
    words = " or ".join(f"{WORDS[form]} (--box-form {form})" for form in named)
    why = (
        f"{given:.0%} of the boxes are inverted or leave the image, read so {left[named[0]]:.0%}"
        if given >= IMPOSSIBLE_SHARE
        else "rays to an object meet far better then"
    )
    return Finding("box corners", f"{WORDS[stated]} look like {words}: {why}")


def _other_image(evidence: Evidence, found: list[tuple[str, Floats]]) -> bool:
    """Tell whether boxes of another size of image explain as much as other forms: (form, boxes)."""
    if border_within(evidence):
        return True
    images = fitting_images(evidence, 0.0)
    if not images or images[0].explanation is None:
        return False
    least = np.inf
    for _, box in found:
        with contextlib.suppress(NotEnoughDataError):
            views = longer(evidence.windows(evidence.tracks(box), box))
            least = min(least, left_over(views.given))
    return left_over(images[0].explanation) <= least + 0.1


def _best_forms(evidence: Evidence, found: list[tuple[str, Floats]]) -> list[str]:
    """Return the form that explains the boxes best, and those that explain them as well."""
    explained = []
    for form, box in found:
        try:
            explained.append((form, evidence.windows(evidence.tracks(box), box).explanation()))
        except NotEnoughDataError:
            continue
    if not explained:
        return [form for form, _ in found]
    with contextlib.suppress(NotEnoughDataError):
        given = evidence.windows().given.unexplained
        if given <= GOOD and min(one.unexplained for _, one in explained) > given:
            return []  # the boxes are right as they are, and of another image
    explained.sort(key=lambda one: one[1].unexplained)
    least = explained[0][1].unexplained
    return [form for form, one in explained if one.unexplained <= NEARLY * least][:MOST_NAMED]


def _preferred(evidence: Evidence, box: Floats) -> bool:
    """Tell whether poses explain far more of the motion of other boxes, of the same objects."""
    try:
        tracks = evidence.tracks(box)
        other = evidence.windows(tracks, box)
        given = replace(other, middle=middle_of(evidence.table.box)[other.windows.rows])
        before, after = given.explanation(), other.explanation()
    except NotEnoughDataError:
        return False
    less = difference(other.windows, before.log_share, after.log_share)[0] <= np.log(0.5)
    return less and after.unexplained <= GOOD and clearly_better_rays(before, after)
