"""Frames and times by the names of images."""

import numpy as np
import pytest

from dqslam.io.image_names import ImageNameError, frames_of_images, have_times


@pytest.mark.parametrize(
    ("names", "frames"),
    [
        (["000042.png"], [42]),
        (["image_02/000042.png", "image_02/000007.png"], [42, 7]),
        (["left_7.txt", "left_7.txt", "left_10.txt"], [7, 7, 10]),
        (["frame-0010", "shot 3"], [10, 3]),
        # The number that varies counts, wherever it is.
        (["000000_10.txt", "000001_10.txt"], [0, 1]),
        (["cam0_run2_00012.png", "cam0_run2_00013.png"], [12, 13]),
        (["2024-05-01_0007.jpg", "2024-05-01_0099.jpg"], [7, 99]),
        # What exports append is no number of a frame.
        (["a_12_jpg.rf.0a9f88e31c.jpg", "a_13_jpg.rf.77aa02f1b0.jpg"], [12, 13]),
    ],
)
def test_frames_by_numbers(names, frames):
    found = frames_of_images(names)
    assert found.frame.tolist() == frames
    assert found.time is None


@pytest.mark.parametrize(
    ("names", "times"),
    [
        (
            ["rgb/1311868164.363181.png", "rgb/1311868164.399026.png"],
            [1311868164.363181, 1311868164.399026],
        ),
        (["0.2.txt", "0.0.txt"], [0.2, 0.0]),
        (
            ["1403636579763555584.png", "1403636579813555456.png"],
            [1403636579.763555584, 1403636579.813555456],
        ),
        (["1403636579763555.png"], [1403636579.763555]),
        (["1403636579763.jpg"], [1403636579.763]),
    ],
)
def test_names_that_are_times(names, times):
    frame, time = frames_of_images(names)
    np.testing.assert_allclose(time, times, rtol=0, atol=3e-7)
    assert frame.tolist() == np.argsort(np.argsort(times)).tolist()
    assert have_times(names)


@pytest.mark.parametrize(
    ("names", "row", "message"),
    [
        (["1.png", "shot.png"], 1, "no number of a frame"),
        (["left/4.png", "right/4.png"], 1, "two images are frame 4: left/4.png and right/4.png"),
        (["clip_4.txt", "clip_04.txt"], 1, "two images are frame 4"),
        (["a_1_2", "a_3_4"], 0, "which number in its name is the frame"),
        (["a_1_2"], 0, "which number .* 2 of them are there in 'a_1_2'"),
        (["a1_b2", "b2_a1"], 1, "which number"),
        # Only the seconds vary, but they are no frames.
        (["2024-05-01_12-31-45", "2024-05-01_12-31-46"], 0, "a date with a time"),
        (["20240501123145.jpg", "20240501123146.jpg"], 0, "a date with a time"),
        (["IMG_20240501_123145", "IMG_20240501_123146"], 0, "a date with a time"),
        (["1" * 17, "2" * 17], 0, "too long"),
        (["1.5.png", "1.50.png"], 1, "two images are at 1.5"),
    ],
)
def test_names_that_tell_no_frame(names, row, message):
    with pytest.raises(ImageNameError, match=message) as error:
        frames_of_images(names)
    assert error.value.row == row


def test_counting_on_past_sixty_is_no_time_of_day():
    names = [f"2024-05-01_{number:06d}.png" for number in range(100)]
    assert frames_of_images(names).frame.tolist() == list(range(100))
